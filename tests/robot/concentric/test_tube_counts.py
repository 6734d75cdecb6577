"""Control with one, two and four tubes an arm: nothing is made for three."""

from __future__ import annotations

import numpy as np
import pytest

from robot.concentric.control import ControlReport, ControlStatus, PairControl
from robot.concentric.design import METHODS, Concentric
from robot.concentric.kinematics import SOLVED
from robot.concentric.pair import PairKinematics
from robot.concentric.proximal import Proximal
from tests.robot.concentric.arm_solution import DESIGNS
from tests.robot.concentric.pair_problem import design

TRANSLATIONS = (-0.300, -0.200, -0.120, -0.060)


def with_tubes(count: int) -> Concentric:
    return design().model_copy(update={"tubes": DESIGNS[:count]})


def standing(control: PairControl, count: int, rng: np.random.Generator) -> PairKinematics:
    found = PairKinematics(count)
    for arm in range(2):
        own = found.q[2 * count * arm : 2 * count * (arm + 1)]
        own[:count] = TRANSLATIONS[:count]
        own[count:] = rng.uniform(-0.5, 0.5, count)
    assert control.pair.evaluate_cold(found) == SOLVED
    return found


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("count", [2, 4])
def test_a_follows_and_b_keeps_its_place(count: int, method: str, rng: np.random.Generator) -> None:
    control = PairControl(with_tubes(count), 0.1, method)
    now, after, report = standing(control, count, rng), PairKinematics(count), ControlReport(count)
    relative, desired = now.relative.copy(), now.position[0] + 0.001
    for _ in range(25):
        status = control.step(now, desired, relative, np.zeros(3), after, report)
        assert status == ControlStatus.SOLVED
        now, after = after, now
    assert np.linalg.norm(report.tracking_after) < 1e-4
    assert np.linalg.norm(report.relative_after) < 2e-4


def test_with_one_tube_the_relative_position_is_kept_first(rng: np.random.Generator) -> None:
    control = PairControl(with_tubes(1), 0.1, "hqp")
    now, after, report = standing(control, 1, rng), PairKinematics(1), ControlReport(1)
    relative = now.relative.copy()
    for _ in range(10):
        desired = now.position[0] + rng.uniform(-0.01, 0.01, 3)
        control.step(now, desired, relative, np.zeros(3), after, report)
        assert np.linalg.norm(report.relative_after) < 2.1e-5
        assert 1e3 * Proximal(with_tubes(1)).excess(after.q[:1]) < 1e-9
        now, after = after, now
