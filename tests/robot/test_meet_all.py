"""The short cut for commands that can all be met at once, and when it must not be taken."""

from __future__ import annotations

import numpy as np
import pytest

from robot.arm import Arm
from robot.instrument_robot import InstrumentRobot
from robot.priority.closed_form import prioritized
from robot.records import Case
from tests.robot.drive import random_x
from tests.robot.level_problem import CASES, LevelProblem, plan_of, robot_problem


def met(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator, case: Case, count: int = 20
) -> list[tuple[LevelProblem, np.ndarray]]:
    """Problems at ordinary configurations that it answers, with its answers."""
    found: list[tuple[LevelProblem, np.ndarray]] = []
    start = robot.initial_state()["x"][0]
    while len(found) < count:
        x = start + np.concatenate([rng.uniform(-0.3, 0.3, 9), [0.0]])
        problem = robot_problem(arm, robot.parameters, x, rng, 0.3)
        rates = problem.meet_all(plan_of(case))
        if rates is not None:
            found.append((problem, rates))
    return found


@pytest.mark.parametrize("case", CASES)
def test_it_meets_every_level_inside_the_limits(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator, case: Case
) -> None:
    for problem, rates in met(robot, arm, rng, case):
        assert max(problem.residuals(plan_of(case), rates)) < 1e-12
        assert problem.excess(rates) < 0.0


@pytest.mark.parametrize("case", CASES)
def test_it_equals_the_qp_and_the_closed_form(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator, case: Case
) -> None:
    plan = plan_of(case)
    for problem, rates in met(robot, arm, rng, case):
        closed = prioritized(plan, problem.rows, problem.targets, problem.preferred)
        np.testing.assert_allclose(rates, closed, rtol=0, atol=1e-9)
        np.testing.assert_allclose(rates, problem.solve(plan), rtol=0, atol=1e-5)


@pytest.mark.parametrize("case", CASES)
def test_it_declines_when_any_limit_is_touched(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator, case: Case
) -> None:
    plan = plan_of(case)
    for problem, rates in met(robot, arm, rng, case, 5):
        for index in range(10):
            for bounds, outward in ((problem.upper, 1.0), (problem.lower, -1.0)):
                before = bounds[index]
                bounds[index] = rates[index]
                assert problem.meet_all(plan) is None
                bounds[index] = rates[index] + outward * 1e-12
                assert problem.meet_all(plan) is not None
                bounds[index] = before
        problem.bend_bound = float(problem.bend_row @ rates) - 1e-12
        assert problem.meet_all(plan) is None
        problem.bend_bound = float(problem.bend_row @ rates) + 1e-12
        assert problem.meet_all(plan) is not None


@pytest.mark.parametrize("case", CASES)
def test_it_declines_when_rows_depend_on_each_other(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator, case: Case
) -> None:
    plan = plan_of(case)
    for problem, _ in met(robot, arm, rng, case, 5):
        rows = problem.rows.copy()
        for last in range(1, len(plan.rows)):
            problem.rows = rows.copy()
            above = plan.rows[:last]
            mixed = rng.normal(size=last) @ rows[above]
            problem.rows[plan.rows[last]] = mixed
            assert problem.meet_all(plan) is None


@pytest.mark.parametrize("case", CASES)
def test_it_declines_what_is_no_number(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator, case: Case
) -> None:
    plan = plan_of(case)
    for problem, _ in met(robot, arm, rng, case, 3):
        problem.targets[plan.rows[4]] = np.nan
        assert problem.meet_all(plan) is None


def test_most_configurations_need_no_qp(
    robot: InstrumentRobot, arm: Arm, rng: np.random.Generator
) -> None:
    """Otherwise the tests above would look at rare exceptions."""
    answered = 0
    for _ in range(200):
        problem = robot_problem(arm, robot.parameters, random_x(robot, rng, 0.9), rng, 0.1)
        answered += problem.meet_all(plan_of(Case.LINEAR_FIRST)) is not None
    assert answered > 80
