"""Limits: whatever rates they allow, no tick leaves the allowed configurations."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.arm import Arm
from robot.instrument_robot import InstrumentRobot
from robot.priority.limits import (
    BEND_BIT,
    JOINT_POSITION_BIT,
    JOINT_SPEED_BIT,
    LAMBDA_HIGH_BIT,
    LAMBDA_LOW_BIT,
    SERVO_RANGE_BIT,
    SERVO_SPEED_BIT,
    active_limits,
    describe,
    share_within,
    speed_violations,
    violations,
)
from robot.records import Case
from tests.robot.drive import DT, random_x
from tests.robot.level_problem import limits_at, plan_of, robot_problem


def allowed_rates(
    x: np.ndarray, parameters: np.ndarray, rng: np.random.Generator, extreme: bool, dt: float
) -> np.ndarray:
    """Rates that keep every limit at ``x``: anywhere inside, or in a corner."""
    lower, upper, bend_row, bound = limits_at(x, parameters, dt)
    assert np.all(lower <= upper)
    share = rng.integers(0, 2, 10) if extreme else rng.uniform(size=10)
    rates = lower + share * (upper - lower)
    outward = bend_row @ rates - bound
    if outward > 0.0:
        rates = rates - outward * bend_row
        rates[7:9] = np.clip(rates[7:9], lower[7:9], upper[7:9])
    return np.asarray(rates)


@pytest.mark.parametrize("extreme", [False, True])
@pytest.mark.parametrize("dt", [0.0005, DT, 0.02])
def test_random_walks_never_leave_the_limits(
    robot: InstrumentRobot, rng: np.random.Generator, extreme: bool, dt: float
) -> None:
    p = robot.parameters
    near_joint_end = 0.0
    for _ in range(10):
        x, wish = random_x(robot, rng), rng.integers(0, 2, 10)
        for index in range(600):
            if index % 100 == 0:
                wish = rng.integers(0, 2, 10)
            lower, upper, bend_row, bound = limits_at(x, p, dt)
            rates = allowed_rates(x, p, rng, extreme, dt)
            if extreme:
                # Push the same way for a while, or the ends are never reached.
                rates = np.where(wish == 1, upper, lower)
                rates = rates - max(0.0, bend_row @ rates - bound) * bend_row
                rates = np.clip(rates, lower, upper)
                if bend_row @ rates > bound + 1e-12:
                    continue
            x = x + dt * rates
            assert violations(x, p) == 0
            assert speed_violations(rates, p) == 0
            ends = np.minimum(x[:7] - p[0]["joint_lower"], p[0]["joint_upper"] - x[:7])
            near_joint_end = max(near_joint_end, float(np.exp(-1e3 * ends.min())))
    assert not extreme or dt < 0.02 or near_joint_end > 0.9


def test_the_bend_limit_holds_for_motion_along_it(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    """A step along the tangent of the limit's circle leads out of it: the margin takes that up."""
    p = robot.parameters
    x = random_x(robot, rng)
    for start in np.linspace(0.0, 2.0 * math.pi, 24):
        limit = p[0]["bend_max"] - 1e-4
        x[7:9] = limit * math.cos(start), limit * math.sin(start)
        for _ in range(400):
            lower, upper, bend_row, bound = limits_at(x, p)
            tangent = np.zeros(10)
            tangent[7:9] = -bend_row[8], bend_row[7]
            share = share_within(1e3 * tangent, lower, upper, bend_row, 1e9)
            rates = 1e3 * share * tangent + min(0.0, bound) * bend_row
            x = x + DT * np.clip(rates, lower, upper)
            assert violations(x, p) == 0


@pytest.mark.parametrize("index", range(10))
@pytest.mark.parametrize("side", [-1, 1])
def test_outside_a_limit_the_allowed_rates_lead_back(
    robot: InstrumentRobot, rng: np.random.Generator, index: int, side: int
) -> None:
    """As after enabling a robot that was moved there by hand."""
    p = robot.parameters
    x = robot.initial_state()["x"][0].copy()
    x[7:9] = 0.0
    where = {9: p[0]["lambda_max" if side > 0 else "lambda_min"]}
    for joint in range(7):
        where[joint] = p[0]["joint_upper" if side > 0 else "joint_lower"][joint]
    for segment in (7, 8):
        where[segment] = side * p[0]["bend_max"]
    for beyond in (0.005, 0.3):
        x[index] = where[index] + side * beyond
        for _ in range(600):
            rates = allowed_rates(x, p, rng, False, DT)
            x = x + DT * rates
            if violations(x, p) == 0:
                break
        assert violations(x, p) == 0


@pytest.mark.parametrize("case", list(Case))
def test_there_is_a_motion_from_every_configuration(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator, case: Case
) -> None:
    """However far outside the limits, the solver is never asked for the impossible."""
    for _ in range(100):
        x = random_x(robot, rng)
        x += rng.normal(size=10) * rng.choice([0.0, 0.1, 1.0], size=10)
        problem = robot_problem(arm, robot.parameters, x, rng)
        assert problem.excess(problem.solve(plan_of(case))) < 5e-7


def test_share_within_is_the_largest_share_inside_the_limits(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    p = robot.parameters
    cut = 0
    for _ in range(300):
        lower, upper, bend_row, bound = limits_at(random_x(robot, rng), p)
        rates = rng.normal(size=10) * 10.0 ** rng.uniform(-2, 1)
        share = share_within(rates, lower, upper, bend_row, bound)
        assert 0.0 <= share <= 1.0

        def excess(
            scaled: np.ndarray,
            limits: tuple[np.ndarray, ...] = (lower, upper, bend_row),
            most: float = bound,
        ) -> float:
            over = np.concatenate([limits[0] - scaled, scaled - limits[1]])
            return float(max(over.max(), limits[2] @ scaled - most))

        assert excess(share * rates) <= 1e-12
        if share < 1.0:
            cut += 1
            assert excess((share + 1e-6) * rates) > 0.0
    assert 50 < cut < 290


def test_violations_count_what_is_outside(robot: InstrumentRobot) -> None:
    p = robot.parameters
    inside = robot.initial_state()["x"][0]
    assert violations(inside, p) == 0
    for joint in range(7):
        for end, sign in (("joint_upper", 1.0), ("joint_lower", -1.0)):
            x = inside.copy()
            x[joint] = p[0][end][joint] + sign * 1e-9
            assert violations(x, p) == 1
    for value in (p[0]["lambda_min"] - 1e-9, p[0]["lambda_max"] + 1e-9):
        x = inside.copy()
        x[9] = value
        assert violations(x, p) == 1
    x = inside.copy()
    x[7:9] = p[0]["bend_max"] + 1e-9, 0.0
    assert violations(x, p) == 1
    reach = p[0]["servo_max"] * p[0]["pulley_radius"] / p[0]["pitch_radius"]
    x[8] = reach + 1e-9
    assert violations(x, p) == 2
    x[:] = np.nan
    assert violations(x, p) == 10


def test_speed_violations_count_what_is_too_fast(robot: InstrumentRobot) -> None:
    p = robot.parameters
    servo = p[0]["servo_speed"] * p[0]["pulley_radius"] / p[0]["pitch_radius"]
    fastest = np.concatenate([p[0]["joint_speed"], [servo, servo]])
    for index in range(9):
        for sign in (-1.0, 1.0):
            rates = np.zeros(10)
            rates[index] = sign * fastest[index]
            assert speed_violations(rates, p) == 0
            rates[index] *= 1.0 + 1e-6
            assert speed_violations(rates, p) == 1


def bits_at(x: np.ndarray, parameters: np.ndarray, index: int, side: int) -> int:
    """Bits when rate ``index`` stands at its bound and the others do nothing."""
    lower, upper, bend_row, bound = limits_at(x, parameters)
    rates = np.zeros(10)
    rates[index] = upper[index] if side > 0 else lower[index]
    return active_limits(x, rates, lower, upper, bend_row, bound, parameters)


def test_active_limits_tell_position_from_speed(robot: InstrumentRobot) -> None:
    p = robot.parameters
    middle = np.concatenate([0.5 * (p[0]["joint_lower"] + p[0]["joint_upper"]), [0.0, 0.0, 0.5]])
    for joint in range(7):
        for side in (-1, 1):
            assert bits_at(middle, p, joint, side) == 1 << (JOINT_SPEED_BIT + joint)
            x = middle.copy()
            x[joint] = p[0]["joint_upper" if side > 0 else "joint_lower"][joint] - side * 1e-4
            assert bits_at(x, p, joint, side) == 1 << (JOINT_POSITION_BIT + joint)
    assert bits_at(middle, p, 7, -1) == 1 << SERVO_SPEED_BIT
    reach = p[0]["servo_max"] * p[0]["pulley_radius"] / p[0]["pitch_radius"]
    x = middle.copy()
    x[8] = 1e-4 - reach
    assert bits_at(x, p, 8, -1) >> SERVO_RANGE_BIT & 1
    x[8], x[9] = 0.0, p[0]["lambda_min"] + 2e-4
    assert bits_at(x, p, 9, -1) == 1 << LAMBDA_LOW_BIT
    x[9] = p[0]["lambda_max"] - 2e-4
    assert bits_at(x, p, 9, 1) == 1 << LAMBDA_HIGH_BIT
    x[7], x[9] = p[0]["bend_max"] - 1e-4, 0.5
    lower, upper, bend_row, bound = limits_at(x, p)
    rates = bound * bend_row
    assert active_limits(x, rates, lower, upper, bend_row, bound, p) == 1 << BEND_BIT
    assert active_limits(x, 0.0 * rates, lower, upper, bend_row, bound, p) == 0


def test_every_limit_has_words_of_its_own(robot: InstrumentRobot) -> None:
    p = robot.parameters
    x = robot.initial_state()["x"][0]
    words = [describe(1 << bit, x, p) for bit in range(LAMBDA_HIGH_BIT + 1)]
    assert all(len(one) == 1 for one in words)
    assert len({one[0] for one in words}) == len(words)
    everything = (1 << (LAMBDA_HIGH_BIT + 1)) - 1
    assert sorted(describe(everything, x, p)) == sorted(one[0] for one in words)
    assert describe(0, x, p) == []


def test_a_joint_limit_is_named_with_its_end_and_angle(robot: InstrumentRobot) -> None:
    p = robot.parameters
    x = robot.initial_state()["x"][0].copy()
    for joint in range(7):
        for end in ("lower", "upper"):
            limit = p[0][f"joint_{end}"][joint]
            # Slowing down begins before the limit; the words name the limit all the same.
            x[joint] = limit - math.copysign(5e-3, limit)
            (words,) = describe(1 << (JOINT_POSITION_BIT + joint), x, p)
            expected = f"joint {joint + 1} at its {end} limit ({math.degrees(limit):.1f} deg)"
            assert words == expected
