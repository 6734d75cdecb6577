"""Sticks are rates: what comes of them, and when a gamepad leads at all."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from robot.configuration import Configuration
from robot.records import RECORD, DriveMode, LeaderKind, Safety
from robot.rotations import matrix_from_quaternion
from server.memory.link import WebLink
from server.web.gamepad_leader import (
    DEAD_ZONE,
    LONGEST_STEP_S,
    SPEED_M_S,
    TIMEOUT_S,
    TURN_RAD_S,
    Axes,
    GamepadLeader,
    rate,
)
from server.web.refusals import NotReady, UnreadableRequest
from server.web.state_source import StateSource
from server.web.stream import read_message
from tests.server.api_client import ApiClient
from tests.server.leaders.conftest import ControlSide

STILL: Axes = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
PERIOD_S = 0.016


class Pad:
    """A gamepad at a page that sends every 16 ms, and the state that the server would see."""

    def __init__(self, link: WebLink, configuration: Configuration, control: ControlSide) -> None:
        self.record = np.zeros(1, RECORD)
        self.now, self.control = 0.0, control
        self.leader = GamepadLeader(
            link, cast(StateSource, self), configuration, clock=lambda: self.now
        )
        self.say(Safety.ENABLED)

    def say(self, safety: Safety) -> None:
        self.record["outcome"]["state"]["safety"] = int(safety)

    def fresh_record(self) -> NDArray[Any]:
        return self.record

    def hold(self, axes: Axes, buttons: int = 1, samples: int = 1) -> None:
        for _ in range(samples):
            self.now += PERIOD_S
            self.leader.sample(axes, buttons)


@pytest.fixture
def pad(directory: Path, configuration: Configuration) -> Iterator[Pad]:
    link = WebLink(directory)
    yield Pad(link, configuration, ControlSide(directory, LeaderKind.GAMEPAD))
    link.close()


def test_a_press_alone_moves_nothing(pad: Pad) -> None:
    pad.hold(STILL, samples=20)
    sample = pad.control.sample()
    assert sample["clutch"] == 1
    assert sample["absolute"] == 0
    assert sample["timeout_s"] == TIMEOUT_S
    assert pad.control.position() == pytest.approx(np.zeros(3))


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_stick_at_its_end_is_full_speed(pad: Pad, axis: int, sign: float) -> None:
    axes = [0.0] * 6
    axes[axis] = sign
    pad.hold(STILL)
    pad.hold(cast(Axes, tuple(axes)), samples=50)
    position, rotation = np.zeros(3), np.empty((3, 3))
    matrix_from_quaternion(np.array(pad.control.sample()["wxyz"]), rotation)
    if axis < 3:
        position[axis] = sign * SPEED_M_S * 50 * PERIOD_S
        assert rotation == pytest.approx(np.eye(3), abs=1e-12)
    else:
        angle = sign * TURN_RAD_S * 50 * PERIOD_S
        skew = (rotation - rotation.T) / 2.0
        vector = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
        expected = np.zeros(3)
        expected[axis - 3] = np.sin(angle)
        assert vector == pytest.approx(expected, abs=1e-9)
    assert pad.control.position() == pytest.approx(position, abs=1e-12)


def test_the_dead_zone_is_still_and_rates_grow_from_it() -> None:
    assert {rate(value) for value in np.linspace(-DEAD_ZONE, DEAD_ZONE, 11)} == {0.0}
    rates = [rate(value) for value in np.linspace(DEAD_ZONE, 1.0, 50)]
    assert rates[0] == 0.0
    assert rates[-1] == 1.0
    assert (np.diff(rates) > 0.0).all()
    assert rate(-0.7) == -rate(0.7)


def test_a_page_that_stalls_makes_no_jump(pad: Pad) -> None:
    pad.hold(STILL)
    pad.now += 10.0
    pad.hold((1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert pad.control.position()[0] == pytest.approx(SPEED_M_S * LONGEST_STEP_S)
    pad.now -= 20.0
    pad.hold((1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert pad.control.position()[0] == pytest.approx(SPEED_M_S * LONGEST_STEP_S)


def test_shoulder_buttons_choose_what_moves_and_letting_go_opens(pad: Pad) -> None:
    for buttons, mode in ((1, DriveMode.BOTH), (2, DriveMode.SEGMENT), (3, DriveMode.ARM)):
        pad.hold(STILL, buttons)
        assert (pad.control.sample()["clutch"], pad.control.sample()["mode"]) == (1, mode)
    pad.hold((1.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0)
    assert pad.control.sample()["clutch"] == 0
    published = pad.control.published
    pad.hold((1.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0, samples=10)
    assert pad.control.published == published


def test_what_is_held_before_enabling_does_not_lead_after_it(pad: Pad) -> None:
    pad.say(Safety.PAUSED)
    with pytest.raises(NotReady):
        pad.hold(STILL)
    pad.hold(STILL, samples=10)
    pad.say(Safety.ENABLED)
    before = pad.control.published
    pad.hold(STILL, samples=10)
    assert pad.control.published == before
    pad.hold(STILL, 0)
    pad.hold(STILL, 1)
    assert pad.control.sample()["clutch"] == 1
    pad.say(Safety.FAULT)
    with pytest.raises(NotReady):
        pad.hold(STILL)
    assert pad.control.sample()["clutch"] == 0


@pytest.mark.parametrize(
    "wrong",
    [
        {"axes": [0, 0, 0, 0, 0]}, {"axes": [2, 0, 0, 0, 0, 0]}, {"axes": [None] * 6},
        {"axes": ["0"] * 6}, {"buttons": 4}, {"buttons": True}, {"scale": 3},
    ],
)  # fmt: skip
def test_bad_samples_are_refused(wrong: dict[str, Any]) -> None:
    message = {"type": "gamepad", "axes": [0.0] * 6, "buttons": 1, **wrong}
    with pytest.raises(UnreadableRequest):
        read_message(json.dumps(message))


def test_a_gamepad_at_the_page_moves_the_tip(driver: ApiClient) -> None:
    start = np.array(driver.state()["true"]["position_mm"])
    seen = set()
    with driver.stream() as stream:

        def send(axes: list[float], buttons: int) -> None:
            stream.send(json.dumps({"type": "gamepad", "axes": axes, "buttons": buttons}))
            stream.send(json.dumps({"type": "heartbeat"}))

        for step in range(60):
            send([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 1)
            time.sleep(0.015)
            if step % 10 == 9:
                seen.add(driver.state()["leader"])
        send([0.0] * 6, 0)
        driver.until(lambda s: not s["engaged"], "let go")
    assert "gamepad" in seen
    way = np.array(driver.state()["true"]["position_mm"]) - start
    assert way[1] > 1.0
    assert np.linalg.norm(way[[0, 2]]) < 0.5
