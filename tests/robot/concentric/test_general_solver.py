"""The model beside a general solver of the rods' differential equations."""

from __future__ import annotations

import numpy as np
import pytest

from tests.robot.concentric.arm_solution import (
    FOUR_TUBES,
    overlapping_configuration,
    solve_stable,
    tubes_like,
)
from tests.robot.concentric.rod_equations import solve_rods

STATES = {2: 20, 3: 60, 4: 20}


@pytest.mark.parametrize("count", STATES)
def test_tip_is_that_of_a_general_solver(count: int, rng: np.random.Generator) -> None:
    tubes = FOUR_TUBES[:count]
    for _ in range(STATES[count]):
        q = overlapping_configuration(tubes, rng)
        ours = solve_stable(q, tubes)
        rods = solve_rods(q, tubes, ours.torsion + rng.uniform(-0.1, 0.1, count))
        assert np.max(np.abs(rods.left)) < 1e-9
        np.testing.assert_allclose(ours.torsion, rods.torsion, rtol=0, atol=1e-7)
        np.testing.assert_allclose(ours.position, rods.position, rtol=0, atol=1e-9)
        np.testing.assert_allclose(ours.rotation, rods.rotation, rtol=0, atol=1e-8)


def test_tubes_that_twist_each_other_far_more(rng: np.random.Generator) -> None:
    """Curved as much as knotted wire and soft in torsion: still exact."""
    tubes = tubes_like(
        FOUR_TUBES[:3],
        curvature=[40.0, 25.0, 30.0],
        torsional_stiffness=0.2 * FOUR_TUBES["bending_stiffness"][:3],
    )
    for _ in range(5):
        q = overlapping_configuration(tubes, rng, 0.03)
        q[3:] = rng.uniform(-0.5, 0.5, 3)
        ours = solve_stable(q, tubes)
        rods = solve_rods(q, tubes, ours.torsion)
        assert np.max(np.abs(rods.left)) < 1e-8
        np.testing.assert_allclose(ours.position, rods.position, rtol=0, atol=1e-9)
