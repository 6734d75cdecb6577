"""The control loop and its trocar: registered, breathing, led to, and left by withdrawal."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hardware.kinematic_plant import KinematicPlant
from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.records import Case, Request, Safety
from scenes.experiments import experiment
from scenes.path import Path
from scenes.trocar_motion import Breathing
from server.configuration_file import load
from server.control.instrument_loop import InstrumentLoop
from server.control.trocar import FARTHEST_M
from server.memory.link_records import TrocarSource
from server.web.api_trocar import withdrawal_of

BREATH = Breathing(0.005, 4.0)


@pytest.fixture(scope="module")
def robot() -> InstrumentRobot:
    return InstrumentRobot(load())


def standing(robot: InstrumentRobot) -> InstrumentLoop:
    """A disabled loop on the kinematic plant."""
    plant = KinematicPlant(robot.configuration, robot.initial_state()["x"][0])
    loop = InstrumentLoop(robot, plant, robot.configuration)
    loop.step()
    return loop


def ask(loop: InstrumentLoop, request: Request) -> Safety:
    loop.request = request
    loop.step()
    return loop.safety


def enabled(robot: InstrumentRobot, case: Case = Case.LINEAR_FIRST) -> InstrumentLoop:
    loop = standing(robot)
    loop.settings["case"] = case
    assert ask(loop, Request.ENABLE) == Safety.ENABLED
    return loop


def run(loop: InstrumentLoop, seconds: float) -> np.ndarray:
    """(n, 3) RCM error, distance of the tip from where it was, and lambda, in every tick."""
    tip = loop.record["truth"]["position"][0].copy()
    rows = []
    for _ in range(round(seconds * loop.robot.configuration.control.rate_hz)):
        loop.step()
        truth = loop.record["truth"][0]
        moved = float(np.linalg.norm(truth["position"] - tip))
        rows.append((truth["rcm_error"], moved, truth["lambda_along_shaft"]))
    assert loop.safety == Safety.ENABLED
    return np.array(rows)


@pytest.mark.parametrize("case", Case)
def test_the_shaft_breathes_with_the_trocar_while_the_tip_stands(
    robot: InstrumentRobot, case: Case
) -> None:
    loop = enabled(robot, case)
    loop.trocar.breathe(BREATH, loop.time_s)
    rcm, moved, _ = run(loop, 5.0).T
    assert rcm.max() < 1e-6
    assert moved.max() < 1e-5
    assert loop.trocar.motion.displacement(loop.time_s) > 0.001


@pytest.mark.parametrize("case", Case)
def test_a_path_is_kept_while_the_trocar_breathes(robot: InstrumentRobot, case: Case) -> None:
    loop = enabled(robot, case)
    loop.trocar.breathe(BREATH, loop.time_s)
    loop.start_path(experiment("circle", robot.configuration).path)
    rcm, _, _ = run(loop, 5.0).T
    assert rcm.max() < 1e-6
    assert loop.record["truth"]["position_error"][0] < 1e-5


def test_a_trocar_that_stops_breathing_leaves_the_robot_at_rest(robot: InstrumentRobot) -> None:
    loop = enabled(robot)
    loop.trocar.breathe(Breathing(0.004, 1.0), loop.time_s)
    run(loop, 0.6)
    loop.trocar.breathe(Breathing(0.0, 1.0), loop.time_s)
    run(loop, 0.6)
    assert loop.record["outcome"]["command"]["moving"][0] == 0
    loop.step()
    np.testing.assert_allclose(
        loop.record["truth"]["trocar_position"][0], robot.configuration.trocar.position_m
    )


def test_the_shaft_is_led_gently_to_a_trocar_beside_it(robot: InstrumentRobot) -> None:
    loop = standing(robot)
    place = np.add(loop.trocar.registered, (0.0, 0.004, 0.0))
    loop.register_trocar(TrocarSource.ENTER, place)
    loop.step()
    assert loop.record["truth"]["rcm_error"][0] == pytest.approx(0.004, abs=1e-4)
    assert ask(loop, Request.ENABLE) == Safety.ENABLED
    rcm, moved, _ = run(loop, 1.2).T
    assert np.abs(np.diff(rcm)).max() < 0.01 * 0.002, "no faster than 10 mm/s"
    assert rcm[-1] < 1e-6
    assert moved.max() < 1e-4


@pytest.mark.parametrize("pausing", [Request.NONE, Request.PAUSE])
def test_nothing_is_enabled_with_the_shaft_outside_of_the_trocar(
    robot: InstrumentRobot, pausing: Request
) -> None:
    loop = enabled(robot)
    stays = ask(loop, pausing or Request.DISABLE)
    beside = np.add(loop.trocar.registered, (0.0, FARTHEST_M + 0.001, 0.0))
    loop.register_trocar(TrocarSource.ENTER, beside)
    before = loop.record["outcome"]["state"]["x"][0].copy()
    assert ask(loop, Request.ENABLE) == stays
    loop.register_trocar(TrocarSource.TOUCH, loop.record["truth"]["position"][0].copy())
    assert ask(loop, Request.ENABLE) == stays
    np.testing.assert_array_equal(loop.record["outcome"]["state"]["x"][0][:9], before[:9])
    place = np.array(robot.configuration.trocar.position_m)
    loop.register_trocar(TrocarSource.CONFIGURATION, place)
    assert ask(loop, Request.ENABLE) == Safety.ENABLED


def test_a_touch_in_mid_breath_is_where_the_trocar_is_now(robot: InstrumentRobot) -> None:
    loop = standing(robot)
    loop.trocar.breathe(BREATH, loop.time_s)
    for _ in range(600):
        loop.step()
    out = loop.trocar.motion.displacement(loop.time_s)
    assert out > 0.001
    tip = loop.record["truth"]["position"][0].copy()
    loop.register_trocar(TrocarSource.TOUCH, tip)
    np.testing.assert_allclose(loop.trocar.at(loop.time_s), tip, atol=1e-12)
    np.testing.assert_allclose(tip - loop.trocar.registered, (0.0, 0.0, out), atol=1e-12)


def postures(configuration: Configuration) -> list[Configuration]:
    """Robots that wake up all over the place."""
    rng = np.random.default_rng(7)
    found = []
    for _ in range(8):
        direction = np.array([0.6, 0.0, -0.8]) + rng.normal(scale=0.2, size=3)
        start = configuration.start.model_copy(
            update={
                "shaft_direction": tuple(direction),
                "bend_deg": rng.uniform(0.0, 89.0),
                "direction_deg": rng.uniform(-180.0, 180.0),
                "lambda_along_shaft": rng.uniform(0.3, 0.94),
            }
        )
        found.append(configuration.model_copy(update={"start": start}))
    return found


@pytest.mark.parametrize("index", range(8))
def test_withdrawal_from_any_posture(index: int) -> None:
    configuration = postures(load())[index]
    loop = enabled(InstrumentRobot(configuration), Case(index % 4))
    withdrawal = withdrawal_of(loop.record, configuration)
    start_end = loop.record["truth"]["shaft_end"][0].copy()
    loop.start_path(Path(withdrawal.samples(), "withdrawal"))
    along, rcm, still = [], [], 0.0
    while loop.path is not None:
        loop.step()
        truth = loop.record["truth"][0]
        along.append(truth["lambda_along_shaft"])
        rcm.append(truth["rcm_error"])
        if len(along) * 0.002 < withdrawal.straightening_s:
            still = max(still, float(np.linalg.norm(truth["shaft_end"] - start_end)))
    assert loop.safety == Safety.ENABLED
    assert max(rcm) < 1e-5
    assert still < 1e-5, "the shaft stands still while the segment becomes straight"
    assert np.diff(along).min() > -1e-6, "the shaft only ever comes out"
    assert along[-1] == pytest.approx(max(0.949, along[0]), abs=1e-4)
    assert math.degrees(math.hypot(*truth["uv"])) < 0.01
    axis = truth["shaft_end"] - truth["shaft_base"]
    axis /= np.linalg.norm(axis)
    ahead = truth["position"] - truth["shaft_end"]
    assert np.linalg.norm(np.cross(ahead, axis)) < 1e-6, "the tip lies on the shaft's axis"
