"""The paper's closed forms (47), (52)-(69), written out once more."""

from __future__ import annotations

import numpy as np
import pytest

from robot.arm import Arm
from robot.instrument_robot import InstrumentRobot
from robot.priority.closed_form import augmented, polar_columns, prioritized
from robot.priority.levels import Level, plan
from robot.records import Case
from robot.segment import jacobian, jacobian_polar
from tests.robot.drive import random_x
from tests.robot.level_problem import LevelProblem, plan_of, robot_problem

FULL = (Case.BALANCED, Case.LINEAR_FIRST, Case.ANGULAR_FIRST)
IDENTITY = np.eye(10)


def ordinary(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator, count: int = 30
) -> list[tuple[np.ndarray, LevelProblem]]:
    """Configurations away from singular ones, with commands for every level."""
    found: list[tuple[np.ndarray, LevelProblem]] = []
    while len(found) < count:
        x = random_x(robot, rng)
        problem = robot_problem(arm, robot.parameters, x, rng)
        problem.targets[:3] = rng.uniform(-0.01, 0.01, 3)
        if np.linalg.svd(problem.rows[:9], compute_uv=False)[-1] > 3e-3:
            found.append((x, problem))
    return found


def case_1(j_rcm: np.ndarray, j_l: np.ndarray, j_a: np.ndarray, p: LevelProblem) -> np.ndarray:
    """Eqs. (53)-(59), (54) with the projector I - J_rcm^+ J_rcm - B^+ B."""
    xi, v, omega, eta = p.targets[:3], p.targets[3:6], p.targets[6:9], p.preferred
    r = np.linalg.pinv(j_rcm)
    b = j_l @ (IDENTITY - r @ j_rcm)
    b_inverse = np.linalg.pinv(b)
    d = IDENTITY - r @ j_rcm - b_inverse @ b
    c = j_a @ d
    c_inverse = np.linalg.pinv(c)
    b_1 = j_a @ r @ xi
    b_2 = j_a @ b_inverse @ (v - j_l @ r @ xi)
    n_3 = d - d @ c_inverse @ c
    first = r @ xi + b_inverse @ (v - j_l @ r @ xi)
    return np.asarray(first + d @ c_inverse @ (omega - b_1 - b_2) + n_3 @ eta)


def case_2(j_rcm: np.ndarray, j_l: np.ndarray, j_a: np.ndarray, p: LevelProblem) -> np.ndarray:
    """Eqs. (64)-(69), (63) with the projector I - J_rcm^+ J_rcm - C'^+ C'."""
    xi, v, omega, eta = p.targets[:3], p.targets[3:6], p.targets[6:9], p.preferred
    r = np.linalg.pinv(j_rcm)
    c = j_a @ (IDENTITY - r @ j_rcm)
    c_inverse = np.linalg.pinv(c)
    d = IDENTITY - r @ j_rcm - c_inverse @ c
    b = j_l @ d
    b_inverse = np.linalg.pinv(b)
    b_1 = j_l @ r @ xi
    b_2 = j_l @ c_inverse @ (omega - j_a @ r @ xi)
    n_3 = d - d @ b_inverse @ b
    first = r @ xi + c_inverse @ (omega - j_a @ r @ xi)
    return np.asarray(first + d @ b_inverse @ (v - b_1 - b_2) + n_3 @ eta)


def test_cases_1_and_2_are_the_paper_s_equations(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator
) -> None:
    for _, problem in ordinary(robot, arm, rng):
        blocks = problem.rows[:3], problem.rows[3:6], problem.rows[6:9]
        for case, formula in ((Case.LINEAR_FIRST, case_1), (Case.ANGULAR_FIRST, case_2)):
            found = prioritized(plan_of(case), problem.rows, problem.targets, problem.preferred)
            np.testing.assert_allclose(found, formula(*blocks, problem), rtol=0, atol=1e-10)


@pytest.mark.parametrize("case", list(Case))
def test_a_level_that_cannot_be_met_gives_way_to_those_above(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator, case: Case
) -> None:
    """An angular row that repeats a linear one: both cannot have their way."""
    plan = plan_of(case)
    for _, problem in ordinary(robot, arm, rng, 10):
        problem.rows[7] = problem.rows[3]
        problem.lower[:], problem.upper[:], problem.bend_bound = -1e9, 1e9, 1e9
        rates = prioritized(plan, problem.rows, problem.targets, problem.preferred)
        *above, last = problem.residuals(plan, rates)
        assert max(above) < 1e-10
        assert last > 1e-4
        assert max(problem.optimality(plan, rates)) < 1e-9


def test_the_cases_agree_where_all_levels_can_be_met(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator
) -> None:
    for _, problem in ordinary(robot, arm, rng):
        first, *others = (
            prioritized(plan_of(case), problem.rows, problem.targets, problem.preferred)
            for case in FULL
        )
        unprioritized = augmented(problem.rows, problem.targets, problem.preferred)
        for rates in (*others, unprioritized):
            np.testing.assert_allclose(rates, first, rtol=0, atol=1e-9)
        assert max(problem.residuals(plan_of(FULL[1]), first)) < 1e-12


def test_the_cases_agree_to_rounding_at_the_start(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator
) -> None:
    for _ in range(30):
        x = robot.initial_state()["x"][0] + rng.uniform(-0.05, 0.05, 10)
        problem = robot_problem(arm, robot.parameters, x, rng)
        first, *others = (
            prioritized(plan_of(case), problem.rows, problem.targets, problem.preferred)
            for case in FULL
        )
        for rates in others:
            np.testing.assert_allclose(rates, first, rtol=0, atol=1e-12)


def test_the_augmented_form_is_equation_47(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator
) -> None:
    for _, problem in ordinary(robot, arm, rng, 10):
        j_aug = problem.rows[[3, 4, 5, 6, 7, 8, 0, 1, 2]]
        twist = problem.targets[[3, 4, 5, 6, 7, 8, 0, 1, 2]]
        inverse = np.linalg.pinv(j_aug)
        expected = inverse @ twist + (IDENTITY - inverse @ j_aug) @ problem.preferred
        found = augmented(problem.rows, problem.targets, problem.preferred)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)


def test_the_freedom_that_is_left_cannot_steer_lambda(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator
) -> None:
    """With the whole tip pose commanded, only the elbow is free: u, v and lambda are not."""
    for _, problem in ordinary(robot, arm, rng):
        null = np.linalg.svd(problem.rows[:9])[2][9]
        np.testing.assert_allclose(null[7:], 0.0, rtol=0, atol=1e-10)
        still = LevelProblem(**{**vars(problem), "targets": np.zeros(10)})
        rates = prioritized(plan_of(Case.LINEAR_FIRST), still.rows, still.targets, IDENTITY[9])
        np.testing.assert_allclose(rates, 0.0, rtol=0, atol=1e-10)


def test_releasing_the_roll_does_not_free_lambda(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator
) -> None:
    """Trocar, tip and the tip's axis fix shaft angle, insertion and bend in the bending plane."""
    rows = plan_of(Case.POINTING).rows
    for _, problem in ordinary(robot, arm, rng):
        null = np.linalg.svd(problem.rows[rows])[2][len(rows) :]
        np.testing.assert_allclose(null[:, 9], 0.0, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "levels", [(("x", "y"), ("angular",)), (("linear",), ("roll",)), (("linear",),)]
)
def test_lambda_can_be_steered_where_position_or_pointing_gives_a_direction_up(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator, levels: tuple[Level, ...]
) -> None:
    steering = plan((("rcm",), *levels, ("lambda",)), 0.1)
    for _, problem in ordinary(robot, arm, rng, 10):
        rates = prioritized(steering, problem.rows, problem.targets, problem.preferred)
        assert max(problem.residuals(steering, rates)) < 1e-9
        assert rates[9] == pytest.approx(problem.targets[9], abs=1e-9)


@pytest.mark.parametrize("bend", [0.02, 0.3, 1.0])
def test_polar_columns_are_the_polar_jacobian(bend: float, rng: np.random.Generator) -> None:
    for delta in rng.uniform(-np.pi, np.pi, 20):
        u, v = bend * np.cos(delta), bend * np.sin(delta)
        rectangular, polar = np.empty((6, 2)), np.empty((6, 2))
        jacobian(u, v, 0.03, rectangular)
        jacobian_polar(0.5 * np.pi - bend, delta, 0.03, polar)
        change = polar_columns(u, v)
        np.testing.assert_allclose(rectangular @ change[7:9, 7:9], polar, rtol=0, atol=1e-14)
        others = np.delete(np.delete(change, [7, 8], axis=0), [7, 8], axis=1)
        np.testing.assert_array_equal(others, np.eye(8))


@pytest.mark.parametrize("case", FULL)
def test_polar_and_rectangular_agree_away_from_straight(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator, case: Case
) -> None:
    compared = 0
    for x, problem in ordinary(robot, arm, rng):
        if np.hypot(x[7], x[8]) < 0.2:
            continue
        compared += 1
        change = polar_columns(x[7], x[8])
        plan = plan_of(case)
        polar = prioritized(plan, problem.rows @ change, problem.targets, problem.preferred)
        rectangular = prioritized(plan, problem.rows, problem.targets, problem.preferred)
        np.testing.assert_allclose(change @ polar, rectangular, rtol=0, atol=1e-9)
    assert compared > 15


def test_polar_coordinates_lose_a_direction_at_the_straight_segment(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator
) -> None:
    """Why (u, v) are the state."""
    x = robot.initial_state()["x"][0].copy()
    x[7:9] = 0.0
    rows = robot_problem(arm, robot.parameters, x, rng).rows[:9]
    assert np.linalg.matrix_rank(rows, tol=1e-6) == 9
    assert np.linalg.matrix_rank(rows @ polar_columns(0.0, 0.0), tol=1e-6) == 8
