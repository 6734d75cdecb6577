"""What is added for stretch and friction of the tendons: both ways, bounded, and without jumps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.calibration import Calibration
from robot.compensation import (
    SHARE_RATE,
    commanded_bend,
    expected_bend,
    follow_setting,
    friction_after,
    held_back,
    tendon_motion,
)
from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.parameters import parameters
from robot.records import STATE, Compensation, Request, Safety
from robot.tendons import bend_from_servos
from tests.robot.drive import DT, Drive

FOUND = Calibration(
    gain=(0.93, 0.96), offset_rad=(0.02, -0.03), friction_rad=(0.04, 0.03), stick_rad=(0.02, 0.01)
)
OFF, GAIN, FULL = Compensation.OFF, Compensation.GAIN, Compensation.FULL


@pytest.fixture(scope="module")
def calibrated(configuration: Configuration) -> InstrumentRobot:
    return InstrumentRobot(configuration, FOUND)


@pytest.fixture(scope="module")
def found(configuration: Configuration) -> np.ndarray:
    return parameters(configuration, FOUND)


def state(rng: np.random.Generator, gain: float = 1.0, friction: float = 1.0) -> np.ndarray:
    """A (1,) state with any bend and any friction."""
    one = np.zeros(1, STATE)
    one["x"][0, 7:9] = rng.uniform(-1.1, 1.1, 2)
    one["friction"] = rng.uniform(-1.0, 1.0, 4)
    one["compensation"] = [gain, friction]
    return one


def told(one: np.ndarray, p: np.ndarray) -> np.ndarray:
    """(2,) the bend that the servos are told."""
    out = np.empty(2)
    commanded_bend(one[0], p, out)
    return out


@pytest.mark.parametrize("shares", [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.4, 0.7)])
def test_what_is_told_and_what_is_expected_are_inverse(
    shares: tuple[float, float], found: np.ndarray, rng: np.random.Generator
) -> None:
    for _ in range(50):
        one = state(rng, *shares)
        wanted, servo_bend = one["x"][0, 7:9].copy(), told(one, found)
        one["x"][0, 7:9] = 0.0
        expected_bend(one[0], float(servo_bend[0]), float(servo_bend[1]), found)
        np.testing.assert_allclose(one["x"][0, 7:9], wanted, rtol=0, atol=1e-14)


def test_without_compensation_the_bend_itself_is_told(
    found: np.ndarray, rng: np.random.Generator
) -> None:
    for _ in range(50):
        one = state(rng, 0.0, 0.0)
        np.testing.assert_array_equal(told(one, found), one["x"][0, 7:9])


def test_an_ideal_calibration_changes_nothing(
    configuration: Configuration, rng: np.random.Generator
) -> None:
    for _ in range(50):
        one = state(rng)
        np.testing.assert_array_equal(told(one, parameters(configuration)), one["x"][0, 7:9])


def test_it_is_the_calibrations_model_turned_around(
    found: np.ndarray, rng: np.random.Generator
) -> None:
    """Bend = offset + gain * told - friction * f, f half the difference of the pair's tendons."""
    for _ in range(50):
        one = state(rng)
        f = one["friction"][0]
        pair = 0.5 * np.array([f[2] - f[0], f[1] - f[3]])
        bend = np.array(FOUND.offset_rad) + np.array(FOUND.gain) * told(one, found)
        bend -= np.array(FOUND.friction_rad) * pair
        np.testing.assert_allclose(bend, one["x"][0, 7:9], rtol=0, atol=1e-14)


def test_friction_is_bounded_odd_and_stays_full_once_it_slides(rng: np.random.Generator) -> None:
    for _ in range(200):
        f, slid, stick = rng.uniform(-1, 1), rng.normal(), rng.uniform(0.005, 0.5)
        after = friction_after(f, slid, stick)
        assert -1.0 <= after <= 1.0
        assert friction_after(-f, -slid, stick) == -after
        assert friction_after(math.copysign(1.0, slid), slid, stick) == math.copysign(1.0, slid)
        assert friction_after(f, 0.0, stick) == f
        assert (after - f) * slid >= 0.0


def test_friction_depends_on_the_way_not_on_the_steps(rng: np.random.Generator) -> None:
    for _ in range(200):
        f, slid, stick = rng.uniform(-1, 1), rng.normal(), rng.uniform(0.005, 0.5)
        part = rng.uniform()
        halfway = friction_after(f, part * slid, stick)
        twice = friction_after(halfway, (1.0 - part) * slid, stick)
        assert twice == pytest.approx(friction_after(f, slid, stick), abs=1e-12)


def test_friction_turns_around_over_twice_its_stick() -> None:
    assert friction_after(1.0, -0.05, 0.05) == 0.0
    assert friction_after(1.0, -0.1, 0.05) == -1.0


def test_tendons_move_against_each_other_and_all_a_little_shorter(
    rng: np.random.Generator,
) -> None:
    chord, slid = 0.0145, np.empty(4)
    for _ in range(50):
        before, after = rng.uniform(-1.5, 1.5, 2), rng.uniform(-1.5, 1.5, 2)
        tendon_motion(before[0], before[1], after[0], after[1], chord, slid)
        step = after - before
        np.testing.assert_allclose([slid[2] - slid[0], slid[1] - slid[3]], 2.0 * step, atol=1e-14)
        shared = -chord * (after @ after - before @ before)
        np.testing.assert_allclose([slid[0] + slid[2], slid[1] + slid[3]], 2.0 * shared, atol=1e-14)


def test_what_all_tendons_share_holds_nothing_back(rng: np.random.Generator) -> None:
    out = np.empty(2)
    for _ in range(20):
        f = rng.uniform(-1, 1)
        held_back(np.full(4, f), out)
        np.testing.assert_array_equal(out, 0.0)


@pytest.mark.parametrize("goal", [OFF, GAIN, FULL])
def test_a_setting_comes_into_force_by_steps(goal: Compensation) -> None:
    for start in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)):
        one = np.zeros(1, STATE)
        one["compensation"] = start
        before = np.array(start)
        for _ in range(101):
            follow_setting(one[0], int(goal), 0.01)
            now = one["compensation"][0].copy()
            assert np.abs(now - before).max() <= 0.01 + 1e-15
            before = now
        np.testing.assert_array_equal(before, [float(goal >= GAIN), float(goal == FULL)])


def moving(robot: InstrumentRobot, tick: int, drive: Drive) -> None:
    """Lead the tip to and fro by some millimetres, so that the segment bends."""
    share = math.sin(2.0 * math.pi * tick * DT)
    drive.lead(np.array([0.004 * share, 0.003 * share, 0.002 * (1.0 - share * share)]))


@pytest.mark.parametrize(
    ("before", "after"), [(FULL, OFF), (OFF, FULL), (GAIN, FULL), (FULL, GAIN)]
)
def test_a_change_of_the_setting_while_moving_moves_no_servo_suddenly(
    calibrated: InstrumentRobot, before: Compensation, after: Compensation
) -> None:
    """Beside a robot that keeps its setting: the same motion, servos that part slowly."""
    changing, keeping = Drive(calibrated), Drive(calibrated)
    for drive in (changing, keeping):
        drive.input["settings"]["compensation"] = before
        drive.engage(np.zeros(3))
    last, largest = np.zeros(4), 0.0
    for tick in range(700):
        if tick == 100:
            changing.input["settings"]["compensation"] = after
        servos = []
        for drive in (changing, keeping):
            moving(calibrated, tick, drive)
            servos.append(drive.tick()["command"]["servo"].copy())
        np.testing.assert_array_equal(changing.x, keeping.x)
        apart = servos[0] - servos[1]
        largest = max(largest, float(np.abs(apart - last).max()))
        last = apart
    # All that compensation ever adds to a servo: 8 % of 90 degrees, offset and friction, times 1/3.
    assert largest <= SHARE_RATE * DT * (0.08 * 0.5 * math.pi + 0.03 + 0.05) / 3.0 + 2e-4
    assert (np.abs(last).max() > 0.002) == (before != after)


def test_a_change_of_the_setting_at_rest_moves_nothing(calibrated: InstrumentRobot) -> None:
    drive = Drive(calibrated)
    drive.input["settings"]["compensation"] = FULL
    drive.enable()
    servo = drive.tick()["command"]["servo"].copy()
    for setting in (OFF, GAIN, FULL):
        drive.input["settings"]["compensation"] = setting
        for _ in range(10):
            outcome = drive.tick()
            assert outcome["command"]["moving"] == 0
            np.testing.assert_array_equal(outcome["command"]["servo"], servo)


@pytest.mark.parametrize("setting", [OFF, GAIN, FULL])
def test_enabling_takes_over_the_servos_as_they_stand(
    calibrated: InstrumentRobot, setting: Compensation, rng: np.random.Generator
) -> None:
    for _ in range(10):
        drive = Drive(calibrated)
        drive.input["settings"]["compensation"] = setting
        drive.state["friction"] = rng.uniform(-1.0, 1.0, 4)
        u, v = rng.uniform(-0.8, 0.8, 2)
        measured = np.array([-u, v, u, -v]) / 3.0
        drive.obedient = False
        drive.measure(drive.x)
        drive.input["measured_servo"] = measured
        outcome = drive.tick(Request.ENABLE)
        assert drive.safety == Safety.ENABLED
        np.testing.assert_allclose(outcome["command"]["servo"], measured, rtol=0, atol=1e-14)
        assert outcome["command"]["moving"] == 0
        if setting == OFF:
            np.testing.assert_allclose(drive.x[7:9], (u, v), rtol=0, atol=1e-14)
        else:
            assert np.abs(drive.x[7:9] - (u, v)).max() > 1e-4


def test_a_resting_robot_keeps_the_friction_that_it_has(calibrated: InstrumentRobot) -> None:
    drive = Drive(calibrated)
    drive.input["settings"]["compensation"] = FULL
    drive.engage(np.zeros(3))
    for tick in range(60):
        moving(calibrated, tick, drive)
        drive.tick()
    drive.let_go()
    drive.tick()
    friction = drive.state["friction"].copy()
    assert np.abs(friction).max() > 0.5
    for _ in range(50):
        drive.tick()
    np.testing.assert_array_equal(drive.state["friction"], friction)


def test_what_is_told_leads_what_is_wanted_in_the_direction_of_motion(
    calibrated: InstrumentRobot,
) -> None:
    """To and fro at the same bend, the servos are told twice the friction apart."""
    drive = Drive(calibrated)
    drive.input["settings"]["compensation"] = FULL
    drive.input["settings"]["lock_arm"] = 1
    drive.engage(np.zeros(3))
    seen: list[tuple[float, float, float]] = []
    for tick in range(1500):
        share = math.sin(2.0 * math.pi * tick * DT / 1.5)
        drive.lead(np.array([0.004 * share, 0.0, 0.004 * share]))
        before = float(drive.x[7])
        servo = drive.tick()["command"]["servo"]
        told_u, _ = bend_from_servos(np.asarray(servo), 0.0018, 0.0054)
        rate = (float(drive.x[7]) - before) / DT
        extra = told_u - (float(drive.x[7]) - FOUND.offset_rad[0]) / FOUND.gain[0]
        seen.append((rate, extra, float(drive.x[7])))
    late = np.array(seen[300:])
    quick = np.abs(late[:, 0]) > 0.3
    assert quick.sum() > 100
    leads = np.sign(late[quick, 0]) * late[quick, 1]
    assert np.median(leads) == pytest.approx(FOUND.friction_rad[0] / FOUND.gain[0], rel=0.05)
