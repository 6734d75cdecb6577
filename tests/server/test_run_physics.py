"""``keyhole run`` on the physics plant: one short seed of each experiment, and what it repeats."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

from hardware import choose
from hardware.physics.plant import PhysicsPlant
from hardware.plant import Measurement
from robot.safety import REASONS, Event
from scenes.experiments import experiment
from server.run.figures import result_document
from server.run.headless import HeadlessRun, RunResult
from server.run.options import cut, options_for
from tests.server import headless

SHORT_S = 1.5


def play(name: str, case: str, **more: Any) -> tuple[RunResult, dict[str, Any]]:
    configuration = headless.configuration()
    found = experiment(name, configuration)
    fields = {"plant": "physics", "preset": "paper", "seed": 1, "path": cut(found.path, SHORT_S)}
    options = options_for(found, configuration, case, **(fields | more))
    run = HeadlessRun(configuration, options)
    result = run.execute(lambda _: None, lambda: False)
    return result, result_document(run.configuration, options, result)


@functools.cache
def played(name: str, case: str, tracker: bool, compensation: str = "full") -> dict[str, Any]:
    return play(name, case, tracker=tracker, compensation=compensation)[1]


@pytest.mark.parametrize(
    ("name", "case", "tracker", "position_mm", "orientation_deg"),
    [
        ("circle", "0", False, 1.0, 1.7),
        ("circle", "0", True, 0.35, 0.8),
        ("circle-yz", "0", True, 0.35, 0.8),
        ("square", "0", False, 1.0, 1.7),
        ("silicon-sine", "1", True, 1.0, 2.0),
        ("silicon-arc", "2", True, 1.0, 2.0),
        ("ring-board", "1", True, 1.0, 1.5),
    ],
)
def test_the_first_seconds_are_within_what_the_whole_may_err(
    name: str, case: str, tracker: bool, position_mm: float, orientation_deg: float
) -> None:
    document = played(name, case, tracker)
    assert document["ended"] == "completed"
    assert document["duration_s"] == SHORT_S
    assert 0.001 < document["errors"]["position_mm"]["max"] <= position_mm
    assert document["errors"]["orientation_deg"]["max"] <= orientation_deg
    assert document["errors"]["rcm_mm"]["max"] <= 0.5
    assert document["board"] == experiment(name, headless.configuration()).board
    assert document["tracker"] is tracker
    assert document["rings"]["count"] == (6 if name == "ring-board" else 0)


def test_compensation_takes_back_what_the_tendons_lose() -> None:
    errors = [
        played("arc", "0", False, mode)["bend"]["theta_deg"]["max"]
        for mode in ("off", "gain", "full")
    ]
    assert errors[2] < 0.6 * min(errors[:2])


def test_equal_runs_are_equal_bit_for_bit_and_other_seeds_are_others() -> None:
    short = {"path": cut(experiment("circle", headless.configuration()).path, 0.3)}
    one, other, third = (
        play("circle", "1", compensation="off", seed=seed, **short)[0] for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(one.trace, other.trace)
    np.testing.assert_array_equal(one.detail, other.detail)
    assert np.abs(one.trace[:, 11:14] - third.trace[:, 11:14]).max() > 1e-6


def test_a_simulation_that_breaks_down_ends_the_run_and_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Breaking(PhysicsPlant):
        ticks = 0

        def read(self) -> Measurement:
            self.ticks += 1
            event = int(Event.SIMULATION_FAILED) if self.ticks > 2500 else 0
            return super().read()._replace(event=event)

    monkeypatch.setattr(choose, "PhysicsPlant", Breaking)
    document = play("circle", "1", compensation="off")[1]
    assert document["ended"] == REASONS[Event.SIMULATION_FAILED][0]
    assert document["steps"] < round(SHORT_S / document["dt_s"])
