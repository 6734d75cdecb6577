"""One task, carried out wherever it is sent: everything it needs travels with it."""

from __future__ import annotations

import hashlib
import io
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from robot.calibration import Calibration
from robot.configuration import Configuration
from robot.errors import KeyholeError
from server.run.headless import RunResult
from server.study.program_mark import program_mark
from server.version import version

_TRACE_PERIOD_S = 0.02
_one_at_a_time = threading.Lock()


class StudyTask(Protocol):
    """One run of a study, of whichever robot; equal ones are the same run."""

    @property
    def experiment(self) -> str:
        """Name of the experiment."""
        ...

    def name(self, configuration: Configuration, calibration: str | None) -> str:
        """A name for files: the task, and a mark of all else that its result depends on."""
        ...

    def words(self) -> str:
        """For people."""
        ...

    def weight(self, configuration: Configuration) -> float:
        """How long it takes, beside other tasks of the study."""
        ...

    def outcome(
        self,
        configuration: Configuration,
        calibration: Calibration | None,
        interrupted: Callable[[], bool],
    ) -> Outcome:
        """Run it; raises :class:`robot.errors.KeyholeError` where it cannot be run."""
        ...


@dataclass(frozen=True)
class Work:
    """A task with what it is done under.

    Attributes:
        task: what to run.
        name: of its files.
        configuration: JSON of the study's configuration.
        calibration: JSON of the calibration that is given, or None to calibrate where it is needed.
        program: mark of the Keyhole that asks.
    """

    task: StudyTask
    name: str
    configuration: str
    calibration: str | None
    program: str


@dataclass(frozen=True)
class Outcome:
    """What came of it.

    Attributes:
        document: the run's figures; None if it was interrupted or failed.
        trace: a compressed ``.npz`` (see :func:`packed_trace`).
        failure: why there are no figures, or empty.
    """

    document: dict[str, Any] | None
    trace: bytes = b""
    failure: str = ""


def perform(work: Work, interrupted: Callable[[], bool] = lambda: False) -> Outcome:
    """Do it.

    Args:
        work: what to do.
        interrupted: asked every tick whether to stop.
    """
    if work.program != program_mark():
        return Outcome(None, failure="the worker's Keyhole is not the same as this one")
    # A cluster's worker may have threads; a run is not made to share a process with another.
    with _one_at_a_time:
        try:
            given = work.calibration
            return work.task.outcome(
                Configuration.model_validate_json(work.configuration),
                None if given is None else Calibration.model_validate_json(given),
                interrupted,
            )
        except KeyholeError as error:
            return Outcome(None, failure=" ".join(str(error).split()))


def finished(document: dict[str, Any], trace: bytes) -> Outcome:
    """The outcome of a run that was not interrupted.

    Args:
        document: its figures; what made them, and a mark of the trace, are added.
        trace: a compressed ``.npz``.
    """
    document["keyhole"] = version()
    document["trace_sha256"] = hashlib.sha256(trace).hexdigest()
    return Outcome(document, trace)


def packed_trace(result: RunResult, dt_s: float) -> bytes:
    """A ``.npz`` of a row every 20 ms, single precision.

    It holds ``trace``, ``detail`` and ``errors`` of a :class:`server.run.headless.RunResult`. Equal
    results give equal bytes.

    Args:
        result: what came of the run.
        dt_s: length of a tick.
    """
    every = max(1, math.floor(_TRACE_PERIOD_S / dt_s + 0.5))
    packed = io.BytesIO()
    np.savez_compressed(
        packed,
        trace=result.trace[::every].astype(np.float32),
        detail=result.detail[::every].astype(np.float32),
        errors=result.errors[::every].astype(np.float32),
    )
    return packed.getvalue()
