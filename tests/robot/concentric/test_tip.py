"""Where the tip is: the paper's starts, and what can be said without a solver."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot.concentric.kinematics import NOT_CONVERGED, OUTSIDE, SINGULAR, SOLVED, solve_cold
from tests.robot.concentric.arm_solution import (
    FOUR_TUBES,
    configuration,
    overlapping_configuration,
    random_configuration,
    solve,
    solve_stable,
    tubes_like,
)

THREE = FOUR_TUBES[:3]
STARTS = {
    "1 A": ([-100, -80, -50], [45, 45, 45], (46.12, -46.12, 323.83)),
    "1 B": ([-80, -60, -30], [45, 45, 45], (46.12, -46.12, 343.83)),
    "2 A": ([-150, -100, -50], [180, 90, 45], (32.95, -7.10, 281.63)),
    "2 B": ([-130, -120, -100], [90, -60, -270], (34.90, -9.78, 302.68)),
    "3 A": ([-250, -200, -120], [0, 0, 0], (0.0, -45.48, 176.83)),
}


@pytest.mark.parametrize("name", STARTS)
def test_tips_of_the_starts(name: str) -> None:
    translations, rotations, tip_mm = STARTS[name]
    # No guess at all is enough here.
    solution = solve(configuration(translations, rotations), THREE, np.zeros(3))
    assert solution.status == SOLVED
    np.testing.assert_allclose(solution.position * 1e3, tip_mm, rtol=0, atol=0.0051)


def arcs(*sections: tuple[float, float]) -> np.ndarray:
    """End (3,) of arcs of (length in m, curvature about x in 1/m) that follow each other."""
    place, direction = np.zeros(3), Rotation.identity()
    for length, kappa in sections:
        turn = kappa * length
        along = length * np.sinc(turn / math.pi)
        aside = -length * 0.5 * turn * np.sinc(0.5 * turn / math.pi) ** 2
        place = place + direction.apply([0.0, aside, along])
        direction = direction * Rotation.from_rotvec([turn, 0.0, 0.0])
    return place


def test_aligned_configuration_3_is_a_chain_of_arcs() -> None:
    solution = solve_stable(configuration([-250, -200, -120], [0, 0, 0]), THREE)
    ei = THREE["bending_stiffness"]
    two, three = ei[:2] / ei[:2].sum(), ei / ei.sum()
    # Tube 3 curves from 29 to 79 mm, tube 2 from 67 to 117 mm, tube 1 from 137 to 187 mm.
    expected = arcs(
        (0.029, 0.0),
        (0.038, 7.0 * three[2]),
        (0.012, 7.0 * three[2] + 5.0 * three[1]),
        (0.038, 5.0 * two[1]),
        (0.020, 0.0),
        (0.050, 10.0),
    )
    np.testing.assert_allclose(solution.position, expected, rtol=0, atol=4e-14)


def test_one_tube_is_an_arc(rng: np.random.Generator) -> None:
    tube = FOUR_TUBES[:1]
    for _ in range(20):
        q = random_configuration(tube, rng)
        solution = solve_stable(q, tube)
        straight = max(q[0] + 0.387, 0.0)
        expected = arcs((straight, 0.0), (min(0.05, q[0] + 0.437), 10.0))
        turn = Rotation.from_rotvec([0.0, 0.0, q[1]])
        np.testing.assert_allclose(solution.position, turn.apply(expected), rtol=0, atol=1e-15)
        assert solution.torsion[0] == 0.0
        assert solution.stability == 1.0


def test_two_aligned_tubes_bend_by_the_weighted_mean(rng: np.random.Generator) -> None:
    tubes = tubes_like(FOUR_TUBES[:2], length=[0.4, 0.3], straight_length=[0.35, 0.25])
    for _ in range(10):
        alpha = rng.uniform(-math.pi, math.pi)
        back = rng.uniform(-0.2, 0.0)
        solution = solve_stable(np.array([back - 0.1, back, alpha, alpha]), tubes)
        ei = tubes["bending_stiffness"]
        mean = float(ei @ tubes["curvature"] / ei.sum())
        expected = arcs((0.25 + back, 0.0), (0.05, mean))
        turn = Rotation.from_rotvec([0.0, 0.0, alpha])
        np.testing.assert_allclose(solution.position, turn.apply(expected), rtol=0, atol=1e-14)


def test_straight_tubes_are_straight(rng: np.random.Generator) -> None:
    tubes = tubes_like(THREE, curvature=0.0)
    for _ in range(10):
        q = random_configuration(tubes, rng)
        solution = solve_stable(q, tubes)
        np.testing.assert_allclose(solution.position, [0, 0, 0.437 + q[0]], rtol=0, atol=1e-15)
        turn = Rotation.from_rotvec([0.0, 0.0, q[3]]).as_matrix()
        np.testing.assert_allclose(solution.rotation, turn, rtol=0, atol=1e-15)


def test_turning_all_tubes_turns_the_tip(rng: np.random.Generator) -> None:
    for _ in range(20):
        q = overlapping_configuration(THREE, rng)
        angle = rng.uniform(-math.pi, math.pi)
        before = solve_stable(q, THREE)
        after = solve_stable(q + np.array([0, 0, 0, angle, angle, angle]), THREE)
        turn = Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix()
        np.testing.assert_allclose(after.position, turn @ before.position, rtol=0, atol=1e-12)
        np.testing.assert_allclose(after.rotation, turn @ before.rotation, rtol=0, atol=1e-11)
        assert after.stability == pytest.approx(before.stability, rel=1e-9)


def test_torsion_vanishes_in_tubes_that_cannot_twist(rng: np.random.Generator) -> None:
    q = overlapping_configuration(THREE, rng, 0.03)
    twist = [
        np.max(np.abs(solve_stable(q, tubes_like(THREE, torsional_stiffness=gj)).torsion))
        for gj in (1e-2, 1e2, 1e4)
    ]
    assert twist[0] > 0.01
    assert twist[1] == pytest.approx(100.0 * twist[2], rel=1e-2)
    assert twist[2] < 1e-5


def test_a_tube_drawn_in_to_the_exit_leaves_the_others_alone() -> None:
    two = solve_stable(configuration([-250, -199], [30, 100]), FOUR_TUBES[:2])
    three = solve_stable(configuration([-250, -199, -199], [30, 100, -20]), THREE)
    np.testing.assert_allclose(three.position, two.position, rtol=0, atol=1e-12)
    assert three.torsion[2] == 0.0


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_the_tip_s_frame_is_orthonormal(count: int, rng: np.random.Generator) -> None:
    tubes = FOUR_TUBES[:count]
    for _ in range(20):
        rotation = solve_stable(random_configuration(tubes, rng), tubes).rotation
        np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), rtol=0, atol=1e-14)
        assert np.linalg.det(rotation) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "q",
    [
        configuration([0.01, 0, 0], [0, 0, 0]),
        configuration([-438, -80, -50], [0, 0, 0]),
        configuration([-200, -70, -50], [0, 0, 0]),
        configuration([math.nan, -80, -50], [0, 0, 0]),
        configuration([-100, -80, -50], [0, math.inf, 0]),
    ],
)
def test_outside_is_a_status_and_leaves_no_numbers(q: np.ndarray) -> None:
    solution = solve(q, THREE, np.zeros(3))
    assert solution.status == OUTSIDE
    assert all(np.isnan(values).all() for values in solution[1:])
    assert solve_cold(q, THREE, np.empty(3)) == OUTSIDE


def test_a_guess_without_a_solution_near_is_a_status(rng: np.random.Generator) -> None:
    q = configuration([-387, -267, -149], [170, 0, 0])
    assert solve(q, THREE, np.full(3, math.nan)).status in {NOT_CONVERGED, SINGULAR}
    statuses = {solve(q, THREE, rng.uniform(-1e4, 1e4, 3)).status for _ in range(50)}
    assert NOT_CONVERGED in statuses


def test_the_guess_chooses_the_branch() -> None:
    """Fully overlapped and nearly opposite, the tubes rest on either side."""
    at = [-387, -267, -149]
    cold = solve_stable(configuration(at, [182, 0, 0]), THREE)
    followed = solve_stable(configuration(at, [120, 0, 0]), THREE)
    for degrees in range(121, 183):
        followed = solve(configuration(at, [degrees, 0, 0]), THREE, followed.torsion)
        assert followed.status == SOLVED
    assert followed.stability > 0.0
    assert followed.torsion[0] < -1.0
    assert cold.torsion[0] > 1.0
    # Its mirror image is where the tubes come from the other side.
    mirrored = solve_stable(configuration(at, [178, 0, 0]), THREE)
    np.testing.assert_allclose(cold.torsion, -mirrored.torsion, rtol=0, atol=1e-8)


def test_from_its_own_torsion_a_configuration_gives_the_same_bits(rng: np.random.Generator) -> None:
    for _ in range(10):
        q = overlapping_configuration(THREE, rng)
        once = solve_stable(q, THREE)
        again = solve(q, THREE, once.torsion)
        for before, after in zip(once, again, strict=True):
            np.testing.assert_array_equal(after, before)
