"""What the watch makes of cycles: misses, limits, alerts, an encoder that is stuck."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from hardware.module.watching import ServoWatch
from hardware.servos.cyclic import ALL
from hardware.servos.protocol import ALERT
from robot.safety import Event
from server.configuration_file import load

SETTINGS = load().servos
TICKS_PER_RAD = 652.0
GOALS = [2048] * 4


def _cycle(**changes: list[int]) -> Any:
    values = {
        "error": [0] * 4,
        "load": [-100] * 4,
        "position": [2048] * 4,
        "voltage": [120] * 4,
        "temperature": [30] * 4,
    }
    return SimpleNamespace(**values | changes)


@pytest.fixture
def watch() -> ServoWatch:
    made = ServoWatch(SETTINGS, TICKS_PER_RAD)
    made.forget(_cycle(), GOALS)
    return made


def test_one_miss_is_tolerated_and_two_in_a_row_are_an_event(watch: ServoWatch) -> None:
    for _ in range(5):
        watch.look(0b1011, _cycle(), GOALS)
        assert watch.event == 0
        watch.look(ALL, _cycle(), GOALS)
    watch.look(0b1011, _cycle(), GOALS)
    watch.look(0b0011, _cycle(), GOALS)
    assert watch.event == Event.SERVO_SILENT
    assert watch.message.startswith("servo 103 ")
    watch.look(ALL, _cycle(), GOALS)
    assert watch.event == 0


def test_of_two_silent_servos_the_first_is_named(watch: ServoWatch) -> None:
    for _ in range(2):
        watch.look(0b0001, _cycle(), GOALS)
    assert watch.message.startswith("servo 102 ")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"temperature": [30, 66, 30, 30]}, "servo 102: 66 °C"),
        ({"voltage": [120, 120, 120, 140]}, "servo 104: 14.0 V"),
        ({"voltage": [80, 120, 120, 120]}, "servo 101: 8.0 V"),
        ({"load": [-100, -100, 610, -100]}, "servo 103: load 61 %"),
    ],
)
def test_what_lasts_outside_a_limit_is_a_fault(
    watch: ServoWatch, changes: dict[str, list[int]], words: str
) -> None:
    watch.look(ALL, _cycle(**changes), GOALS)
    assert watch.event == 0, "one reading may be a spike"
    for _ in range(10):
        watch.look(ALL, _cycle(**changes), GOALS)
    assert watch.event == Event.SERVO_FAULT
    assert watch.message.startswith(words)


def test_an_alert_is_a_fault_at_once(watch: ServoWatch) -> None:
    watch.look(ALL, _cycle(error=[0, 0, ALERT, 0]), GOALS)
    assert watch.event == Event.SERVO_FAULT
    assert watch.alerts == 0b0100


def test_a_position_that_does_not_change_while_the_goal_leaves_is_a_fault(
    watch: ServoWatch,
) -> None:
    for step in range(60):
        watch.look(ALL, _cycle(), [2048 + 3 * step, 2048, 2048, 2048])
    assert watch.event == Event.SERVO_FAULT
    assert "101: stands still" in watch.message


def test_a_servo_that_lags_or_trembles_is_none(watch: ServoWatch) -> None:
    for step in range(200):
        goal = 2048 + 3 * step
        cycle = _cycle(position=[max(2048, goal - 40), 2048 + step % 2, 2048, 2048])
        watch.look(ALL, cycle, [goal, 2048 + 5 * (step % 3), 2048, 2048])
        assert watch.event == 0
