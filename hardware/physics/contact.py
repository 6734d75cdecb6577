"""What the instrument touches, which rings it has gone through, and how far the ball is."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from hardware.physics.model import PhysicsModel
from robot.compiled import compiled
from scenes.boards.board import Board


@compiled
def _progress(place: np.ndarray, line: np.ndarray, lengths: np.ndarray) -> float:
    """Share of a line's length at its point nearest to ``place`` (3,)."""
    best, share = np.inf, 0.0
    for i in range(line.shape[0] - 1):
        square, along, off = 0.0, 0.0, 0.0
        for k in range(3):
            step = line[i + 1, k] - line[i, k]
            square += step * step
            along += step * (place[k] - line[i, k])
        t = min(max(along / square, 0.0), 1.0)
        for k in range(3):
            off += (line[i, k] + t * (line[i + 1, k] - line[i, k]) - place[k]) ** 2
        if off < best:
            best = off
            share = lengths[i] + t * (lengths[i + 1] - lengths[i])
    return float(share / lengths[-1])


@compiled
def _rings_passed(
    tip: np.ndarray, centres: np.ndarray, axes: np.ndarray, radii: np.ndarray, before: np.ndarray
) -> int:
    """Bits of the rings that the tip has just crossed half-way, from the front, inside the ring.

    Args:
        tip: (3,) m.
        centres: (n, 3) m.
        axes: (n, 3) unit vectors, in the direction in which the tip goes through.
        radii: (n,) clear radii, m.
        before: (n,) 1 where the tip was before the ring's plane within its mouth; changed.
    """
    bits = 0
    for i in range(centres.shape[0]):
        along, square = 0.0, 0.0
        for k in range(3):
            off = tip[k] - centres[i, k]
            along += off * axes[i, k]
            square += off * off
        aside = square - along * along
        inside = aside < radii[i] * radii[i]
        if along >= 0.0 and inside and before[i] == 1:
            bits |= 1 << i
        before[i] = 1 if inside and along < 0.0 else 0
    return bits


class ContactWatch:
    """Reads the engine's contacts once a tick.

    Attributes:
        count: contacts of the instrument in the last tick.
        force_n: largest of their forces, N.
        wrench: (6,) of all of them together on the instrument: force in N, moment about the tip in
            N m, base frame.
        touched: bits of the rings that the instrument has touched.
        passed: bits of the rings that the tip has gone half-way through.
        ball_progress: share of the groove that the ball has covered.
        ball_position: (3,) m, base frame; zero without a ball.
    """

    def __init__(self, physics: PhysicsModel, board: Board) -> None:
        self.count, self.force_n = 0, 0.0
        self.touched, self.passed = 0, 0
        self.ball_progress, self.ball_position = 0.0, np.zeros(3)
        self._physics = physics
        self._force, self.wrench = np.zeros(6), np.zeros(6)
        self._first, self._last = physics.instrument_geoms
        self._ring_of = {
            int(physics.board_geoms[solid]): index
            for index, ring in enumerate(board.rings)
            for solid in ring.solids
        }
        self._centres = np.array([ring.centre for ring in board.rings], float).reshape(-1, 3)
        self._axes = np.array([ring.axis for ring in board.rings], float).reshape(-1, 3)
        self._radii = np.array([ring.clear_radius for ring in board.rings], float)
        self._before = np.zeros(len(board.rings), dtype=np.int64)
        self._line = None if board.groove is None else np.array(board.groove.centre_line, float)
        if self._line is not None:
            steps = np.linalg.norm(np.diff(self._line, axis=0), axis=1)
            self._lengths = np.concatenate([[0.0], np.cumsum(steps)])

    def look(self, data: Any, tip: np.ndarray) -> None:
        """Read the contacts, the rings and the ball as they are after a step.

        Args:
            data: the engine's data.
            tip: (3,) m, base frame.
        """
        self.count, self.force_n = 0, 0.0
        self.wrench[:] = 0.0
        for index in range(data.ncon):
            self._contact(data, index, tip)
        if self._centres.size:
            self.passed |= _rings_passed(tip, self._centres, self._axes, self._radii, self._before)
        place = self._physics.ball_position
        if place >= 0 and self._line is not None:
            self.ball_position[:] = data.qpos[place : place + 3]
            self.ball_progress = _progress(self.ball_position, self._line, self._lengths)

    def _contact(self, data: Any, index: int, tip: np.ndarray) -> None:
        one, other = data.contact.geom[index]
        instrument = self._first <= one <= self._last
        if not instrument and not self._first <= other <= self._last:
            return
        mujoco.mj_contactForce(self._physics.model, data, index, self._force)
        force = float(np.linalg.norm(self._force[:3]))
        if force <= 0.0:
            return
        self.count += 1
        self.force_n = max(self.force_n, force)
        # The engine tells the force on the second of the two, in the contact's own frame.
        on_second = data.contact.frame[index].reshape(3, 3).T @ self._force[:3]
        on_instrument = -on_second if instrument else on_second
        self.wrench[:3] += on_instrument
        self.wrench[3:] += np.cross(data.contact.pos[index] - tip, on_instrument)
        ring = self._ring_of.get(int(other if instrument else one))
        if ring is not None:
            self.touched |= 1 << ring
