"""Workers of a Dask cluster: the same tasks, sent to where its scheduler says."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from robot.errors import KeyholeError
from server.study.work import Outcome, Work, perform

_PATIENCE_S = 10.0
_POLL_S = 0.5


class ClusterError(KeyholeError):
    """A cluster cannot be used."""

    code = "cluster"


def _distributed() -> Any:
    try:
        return importlib.import_module("distributed")
    except ImportError:
        raise ClusterError(
            "--scheduler needs the package distributed (the extra keyhole[cluster]); install it "
            f"with: {sys.executable} -m pip install -c constraints.txt distributed"
        ) from None


def cluster_outcomes(
    works: Sequence[Work], address: str, stopped: Callable[[], bool]
) -> Iterator[tuple[Work, Outcome]]:
    """Outcomes as they come, in any order.

    Args:
        works: what to do.
        address: of the scheduler, ``tcp://host:port``.
        stopped: asked now and then; once it says yes, runs are given up and no more come.

    Raises:
        ClusterError: the package is missing, no scheduler answers, it has no workers, or a task
            cannot be run there.
    """
    distributed = _distributed()
    try:
        client = distributed.Client(address, timeout=_PATIENCE_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise ClusterError(f"no scheduler answers at {address}: {error}") from None
    with client:
        if not client.scheduler_info()["workers"]:
            raise ClusterError(
                f"the scheduler at {address} has no workers: start some with dask worker {address}"
            )
        pending = {client.submit(perform, work, pure=False): work for work in works}
        try:
            while pending and not stopped():
                for future in _finished(distributed, pending):
                    if future.status != "finished":
                        raise ClusterError(f"a worker cannot run a task: {future.exception()}")
                    yield pending.pop(future), future.result()
        finally:
            client.cancel(list(pending))


def _finished(distributed: Any, pending: dict[Any, Work]) -> list[Any]:
    try:
        done = distributed.wait(list(pending), timeout=_POLL_S, return_when="FIRST_COMPLETED").done
    except (distributed.TimeoutError, TimeoutError):
        return []
    return list(done)
