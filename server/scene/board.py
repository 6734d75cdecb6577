"""The board before the instrument: what it touches lights up, a ring it has passed turns green.

Which part is touched is not in the record, only that something is; it is the one that the drawn
instrument is next to.
"""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numpy as np
import viser
from numpy.typing import NDArray

from robot.configuration import Instrument
from robot.rotations import matrix_from_quaternion
from scenes.boards.board import Board, Solid
from scenes.boards.clearance import distances, instrument_axis
from server.scene.palette import BALL, GROOVE, PASSED, PEDESTAL, TOUCHED, Colour
from server.scene.shapes import Mesh, ball, ball_arc, merge, revolve, round_bar

ROOT = "/board"
NEAR = 8e-4
"""A part this near to the instrument (m) is the one that is touched, when something is: it takes
in that the picture's segment is an arc and the simulated one a chain that yields."""
LINGER = 0.25
"""A touch is shown for this long (s) after it, or the shortest would not be seen."""
BALL_RESOLUTION = 2e-5
"""Changes smaller than this (m) are not sent."""

FLOOR = -0.16
"""Height of the floor (m): below everything the tip reaches through the default trocar."""

_ROUND = 14
_CAP = 5
_GROOVE_WIDTH = 0.0012
_PEDESTAL = 0.008


class Part(NamedTuple):
    """Solids that are drawn and light up together; the number of the ring they are, or -1."""

    handle: viser.MeshHandle
    rgb: Colour
    solids: tuple[Solid, ...]
    ring: int


class SceneBoard:
    """Nodes below ``/board``, which stands in the world."""

    def __init__(self, server: viser.ViserServer, instrument: Instrument) -> None:
        """Build no board yet.

        Args:
            server: draws.
            instrument: dimensions of what touches.
        """
        self._server, self._instrument = server, instrument
        self._lock = threading.Lock()
        self._board = Board("none", "")
        self._root = server.scene.add_frame(ROOT, show_axes=False)
        self._parts: list[Part] = []
        self._labels: list[viser.LabelHandle] = []
        self._ball: viser.MeshHandle | None = None
        self._touched: dict[int, float] = {}
        self._shown: dict[str, object] = {}

    @property
    def name(self) -> str:
        """Of the board that is shown."""
        return self._board.name

    def show(self, board: Board) -> None:
        """Draw another board in place of the present one; from any thread, at any time."""
        with self._lock, self._server.atomic():
            self._root.remove()
            self._root = self._server.scene.add_frame(ROOT, show_axes=False)
            self._board = board
            self._touched, self._shown = {}, {}
            self._parts = [self._draw(*group) for group in _groups(board)]
            self._labels = [
                self._server.scene.add_label(
                    f"{ROOT}/ring {number} label",
                    str(number),
                    position=ring.centre + np.array([0.0, 0.0, ring.clear_radius + 0.004]),
                    font_screen_scale=0.9,
                    anchor="bottom-center",
                )
                for number, ring in enumerate(board.rings, 1)
            ]
            self._draw_pedestal()
            self._draw_groove()

    def update(self, now: float, truth: Any, shaft_rotation: NDArray[np.float64]) -> None:
        """Take in what a record says of the board.

        Args:
            now: monotonic time, s.
            truth: the record's :data:`robot.records.TRUTH`.
            shaft_rotation: (3, 3) frame of the segment's base in the world.
        """
        with self._lock:
            if self._board.name == "none":
                return
            self._feel(now, truth, shaft_rotation)
            passed, touched = int(truth["rings_passed"]), int(truth["rings_touched"])
            for index, part in enumerate(self._parts):
                lit = now < self._touched.get(index, -np.inf)
                green = part.ring >= 0 and passed >> part.ring & 1
                colour = TOUCHED if lit else PASSED if green else part.rgb
                self._set(part.handle, "color", colour)
            for index, label in enumerate(self._labels):
                words = " passed" if passed >> index & 1 else ""
                words += " · touched" if touched >> index & 1 else ""
                self._set(label, "text", f"{index + 1}{words}")
            self._roll(now, truth)

    def _feel(self, now: float, truth: Any, shaft_rotation: NDArray[np.float64]) -> None:
        """Remember which parts are touched."""
        if truth["contact_count"] <= 0:
            return
        axis = instrument_axis(
            self._instrument,
            truth["shaft_base"],
            truth["shaft_end"],
            shaft_rotation,
            truth["uv"],
        )
        reach = self._instrument.disk_diameter_m / 2 + NEAR
        for index, part in enumerate(self._parts):
            if any(distances(solid, axis).min() < reach for solid in part.solids):
                self._touched[index] = now + LINGER
        if self._board.ball is not None:
            away = np.linalg.norm(axis - truth["ball_position"], axis=1).min()
            if away < reach + self._board.ball.radius:
                self._touched[-1] = now + LINGER

    def _roll(self, now: float, truth: Any) -> None:
        """Put the ball where it is; a plant without contact knows of none."""
        if self._ball is None:
            return
        position = np.array(truth["ball_position"])
        if position.any() and np.abs(position - self._ball.position).max() > BALL_RESOLUTION:
            self._ball.position = position
        lit = now < self._touched.get(-1, -np.inf)
        self._set(self._ball, "color", TOUCHED if lit else BALL)

    def _set(self, handle: Any, attribute: str, value: object) -> None:
        """Send only what is new."""
        key = f"{handle.name} {attribute}"
        if self._shown.get(key) != value:
            self._shown[key] = value
            setattr(handle, attribute, value)

    def _add(self, name: str, mesh: Mesh, colour: Colour) -> viser.MeshHandle:
        return self._server.scene.add_mesh_simple(
            f"{ROOT}/{name}", mesh.vertices, mesh.faces, color=colour
        )

    def _draw(self, name: str, solids: tuple[Solid, ...], ring: int) -> Part:
        mesh = merge(*(_placed(solid) for solid in solids))
        colour = solids[0].rgb
        handle = self._add(name, mesh, colour)
        self._shown[f"{handle.name} color"] = colour
        return Part(handle, colour, solids, ring)

    def _draw_pedestal(self) -> None:
        boxes = [solid for solid in self._board.solids if solid.kind == "box"]
        for index, box in enumerate(boxes):
            top = box.position[2] - box.size[2]
            if top > FLOOR + 0.01:
                column = revolve([(_PEDESTAL, FLOOR), (_PEDESTAL, top)], 32)
                foot = round_bar(FLOOR + 0.0005, FLOOR + 0.004, 5.0 * _PEDESTAL, 0.001, 48)
                vertices = merge(column, foot)
                handle = self._add(f"pedestal {index}", vertices, PEDESTAL)
                handle.position = (float(box.position[0]), float(box.position[1]), 0.0)

    def _draw_groove(self) -> None:
        """The ball, a line where it shall go, and a mark where it shall arrive."""
        self._ball = None
        board = self._board
        if board.ball is None or board.groove is None:
            return
        radius = board.ball.radius
        line = board.groove.centre_line - np.array([0.0, 0.0, radius - 1e-4])
        ends = np.stack([line[:-1], line[1:]], axis=1).astype(np.float32)
        self._server.scene.add_line_segments(
            f"{ROOT}/way", ends, GROOVE, thickness=1.5, thickness_units="screen"
        )
        mark = revolve(
            [
                (radius, 0.0),
                (radius, 2e-4),
                (radius - _GROOVE_WIDTH, 2e-4),
                (radius - _GROOVE_WIDTH, 0.0),
            ],
            48,
        )
        self._add("end", mark, GROOVE).position = line[-1]
        self._ball = self._add("ball", ball(radius), BALL)
        self._ball.position = board.ball.position
        self._shown[f"{self._ball.name} color"] = BALL


def _groups(board: Board) -> list[tuple[str, tuple[Solid, ...], int]]:
    """Name, solids and number of the ring (or -1) of what is drawn together."""
    groups: dict[str, list[Solid]] = {}
    numbers: dict[str, int] = {}
    rings = {place: index for index, ring in enumerate(board.rings) for place in ring.solids}
    for place, solid in enumerate(board.solids):
        # A rail is many pieces called "left rail 7"; a ring knows its own.
        ring = rings.get(place, -1)
        name = f"ring {ring + 1}" if ring >= 0 else solid.name
        stem, _, last = solid.name.rpartition(" ")
        if ring < 0 and stem.endswith("rail") and last.isdigit():
            name = stem
        groups.setdefault(name, []).append(solid)
        numbers[name] = ring
    return [(name, tuple(solids), numbers[name]) for name, solids in groups.items()]


def _placed(solid: Solid) -> Mesh:
    """The solid's surface in the world."""
    mesh = _surface(solid)
    rotation = np.empty((3, 3))
    matrix_from_quaternion(solid.wxyz, rotation)
    vertices = mesh.vertices @ rotation.T + solid.position
    return Mesh(vertices.astype(np.float32), mesh.faces)


def _surface(solid: Solid) -> Mesh:
    radius, half = float(solid.size[0]), float(solid.size[1])
    if solid.kind == "box":
        return _box(solid.size)
    if solid.kind == "cylinder":
        return round_bar(-half, half, radius, 0.1 * radius, 2 * _ROUND)
    half = half if solid.kind == "capsule" else 0.0
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 2 * _CAP)
    lower, upper = angles[:_CAP], angles[_CAP:]
    return revolve(
        ball_arc(radius, -half, lower) + ball_arc(radius, half, upper), _ROUND, smooth=True
    )


def _box(size: NDArray[np.float64]) -> Mesh:
    """A box of half edges ``size`` (3,), each face with corners of its own."""
    vertices: list[NDArray[np.float64]] = []
    faces: list[tuple[int, int, int]] = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            normal, side = np.eye(3)[axis] * sign, np.eye(3)[(axis + 1) % 3]
            other = np.cross(normal, side)
            first = len(vertices)
            vertices += [
                (normal + a * side + b * other) * size
                for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
            ]
            faces += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return Mesh(np.array(vertices, dtype=np.float32), np.array(faces, dtype=np.uint32))
