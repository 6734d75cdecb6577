"""Curvature in both planes: against integration, finite differences, and the constant arc."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from robot.segment import tip_position, tip_rotation
from robot.sensing.curvature_modes import (
    MODES,
    NODES,
    TWIST,
    U_MODE,
    V_MODE,
    curvature,
    force_stiffness,
    frames_at_nodes,
    shape_of_modes,
    tip_jacobian_of_modes,
    turned_axes,
)

LENGTH = 0.03
SPREAD = np.array([0.8, 0.3, 0.1, 0.05, 0.8, 0.3, 0.1, 0.05, 0.2, 0.1, 0.05])
STEP = 1e-5


class Frames:
    """Everything of one state."""

    def __init__(self, z: np.ndarray, offset: float = 0.0) -> None:
        self.rotations, self.positions = np.empty((NODES, 3, 3)), np.empty((NODES, 3))
        self.tip_rotation, self.tip = np.empty((3, 3)), np.empty(3)
        frames_at_nodes(z, LENGTH, self.rotations, self.positions, self.tip_rotation, self.tip)
        self.axes, self.jacobian = np.empty((NODES, MODES, 3)), np.empty((6, MODES))
        turned_axes(self.rotations, self.axes)
        self.offset = -offset * self.tip_rotation[:, 2]
        point = self.tip + self.offset
        tip_jacobian_of_modes(self.axes, self.positions, point, self.jacobian)
        self.point = point

    def stiffness(self, force: np.ndarray) -> np.ndarray:
        """How the generalised force of ``force`` changes."""
        out = np.empty((MODES, MODES))
        force_stiffness(
            self.rotations, self.axes, self.positions, self.tip, self.offset, LENGTH, force, out
        )
        return out


def test_a_constant_curvature_is_the_arc_of_the_segment(rng: np.random.Generator) -> None:
    for u, v in rng.uniform(-1.4, 1.4, size=(20, 2)):
        z = np.zeros(MODES)
        z[U_MODE], z[V_MODE] = u, v
        frames, position, rotation = Frames(z), np.empty(3), np.empty((3, 3))
        tip_position(u, v, LENGTH, position)
        tip_rotation(u, v, rotation)
        assert frames.tip == pytest.approx(position, abs=1e-13)
        assert frames.tip_rotation == pytest.approx(rotation, abs=1e-12)


def test_bends_and_twists_as_an_integrator_has_it(rng: np.random.Generator) -> None:
    def slope(s: float, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        k, rotation = np.empty(3), y[:9].reshape(3, 3)
        curvature(z, s, k)
        cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
        return np.concatenate([(rotation @ cross).ravel(), LENGTH * rotation[:, 2]])

    begin = np.concatenate([np.eye(3).ravel(), np.zeros(3)])
    for _ in range(5):
        z = SPREAD * rng.normal(size=MODES)
        solved = solve_ivp(
            slope, (0.0, 1.0), begin, args=(z,), rtol=1e-11, atol=1e-13, t_eval=[0.37, 1.0]
        ).y
        frames = Frames(z)
        assert frames.tip == pytest.approx(solved[9:, -1], abs=1e-8 * LENGTH)
        assert frames.tip_rotation.ravel() == pytest.approx(solved[:9, -1], abs=1e-8)
        places, turns = shape_of_modes(z, LENGTH, np.array([0.0, 0.37, 1.0]))
        assert places[0] == pytest.approx(np.zeros(3), abs=1e-15)
        assert places[1] == pytest.approx(solved[9:, 0], abs=1e-8 * LENGTH)
        assert turns[2] == pytest.approx(frames.tip_rotation, abs=1e-9)


def test_the_jacobian_is_the_finite_difference(rng: np.random.Generator) -> None:
    for offset in (0.0, 0.0023):
        for _ in range(20):
            z = SPREAD * rng.normal(size=MODES)
            here = Frames(z, offset)
            for a in range(MODES):
                step = STEP * np.eye(MODES)[a]
                more, less = Frames(z + step, offset), Frames(z - step, offset)
                moved = (more.tip - less.tip) / (2.0 * STEP)
                turn = Rotation.from_matrix(more.tip_rotation @ less.tip_rotation.T).as_rotvec()
                turn /= 2.0 * STEP
                # The rows are those of the point that moves with the tip.
                moved += np.cross(turn, here.offset)
                assert here.jacobian[:3, a] == pytest.approx(moved, abs=1e-7 * LENGTH)
                assert here.jacobian[3:, a] == pytest.approx(turn, abs=1e-7)


def test_the_stiffness_of_a_tip_force_is_the_finite_difference(rng: np.random.Generator) -> None:
    for offset in (0.0, 0.0023):
        for _ in range(10):
            z, force = SPREAD * rng.normal(size=MODES), rng.normal(size=3)
            here = Frames(z, offset)
            stiffness = here.stiffness(force)
            assert stiffness == pytest.approx(stiffness.T, abs=1e-7 * LENGTH)
            for b in range(MODES):
                step = STEP * np.eye(MODES)[b]
                more = Frames(z + step, offset).jacobian[:3].T @ force
                less = Frames(z - step, offset).jacobian[:3].T @ force
                assert stiffness[:, b] == pytest.approx(
                    (more - less) / (2.0 * STEP), abs=1e-7 * LENGTH
                )


def test_twist_alone_turns_the_tip_about_its_axis() -> None:
    z = np.zeros(MODES)
    z[TWIST] = 0.3
    frames = Frames(z)
    assert frames.tip == pytest.approx([0.0, 0.0, LENGTH], abs=1e-15)
    assert Rotation.from_matrix(frames.tip_rotation).as_rotvec() == pytest.approx([0.0, 0.0, 0.3])
