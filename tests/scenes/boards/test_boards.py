"""The boards have the dimensions of the paper and stand where they are wanted."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from robot.configuration import Configuration
from robot.errors import UnknownName
from robot.rotations import matrix_from_quaternion
from robot.start import start_bend, start_shaft_rotation
from scenes.boards.board import BOARD_NAMES, Board, Solid, board
from scenes.boards.clearance import distances, instrument_axis
from scenes.boards.place import place
from server.configuration_file import load

PAPER_RING_DIAMETER = 0.0081


@pytest.fixture(scope="module")
def configuration() -> Configuration:
    return load()


def built(name: str) -> Board:
    return board(name, load())


def turned(configuration: Configuration, shaft: tuple[float, float, float]) -> Configuration:
    """The configuration whose shaft starts in another direction."""
    start = configuration.start.model_copy(
        update={"shaft_direction": shaft, "bend_direction_up": (0.0, 0.0, 1.0)}
    )
    return configuration.model_copy(update={"start": start})


def ends(solid: Solid) -> tuple[np.ndarray, np.ndarray]:
    """Both ends of a capsule's axis."""
    rotation = np.empty((3, 3))
    matrix_from_quaternion(solid.wxyz, rotation)
    along = solid.size[1] * rotation[:, 2]
    return solid.position - along, solid.position + along


def test_an_unknown_one_is_refused_with_the_known_ones(configuration: Configuration) -> None:
    with pytest.raises(UnknownName) as caught:
        board("chessboard", configuration)
    assert caught.value.known == BOARD_NAMES


def test_the_configuration_knows_the_same_boards(configuration: Configuration) -> None:
    simulation = type(configuration.simulation)
    for name in BOARD_NAMES:
        given = {**configuration.simulation.model_dump(), "board": name}
        assert simulation.model_validate(given).board == name
    assert board("none", configuration).solids == ()


@pytest.mark.parametrize("name", BOARD_NAMES)
def test_solids_are_whole(name: str) -> None:
    one = built(name)
    assert one.name == name
    assert one.title
    names = [solid.name for solid in one.solids]
    assert len(set(names)) == len(names)
    for solid in one.solids:
        assert np.linalg.norm(solid.wxyz) == pytest.approx(1.0)
        used = {"box": 3, "sphere": 1}.get(solid.kind, 2)
        assert (solid.size[:used] > 0.0).all()
        assert (solid.size[used:] == 0.0).all()
        assert all(0 <= value <= 255 for value in solid.rgb)
        for array in (solid.position, solid.wxyz, solid.size):
            assert not array.flags.writeable


def test_four_pegs_of_four_colours_stand_23_mm_apart_in_the_order_of_the_square() -> None:
    pegs = [solid for solid in built("pegboard").solids if solid.name.endswith("peg")]
    assert [peg.name.split()[0] for peg in pegs] == ["green", "red", "blue", "yellow"]
    assert len({peg.rgb for peg in pegs}) == 4
    for one, following in itertools.pairwise([*pegs, pegs[0]]):
        assert np.linalg.norm(following.position - one.position) == pytest.approx(0.023)
    diagonal = np.linalg.norm(pegs[2].position - pegs[0].position)
    assert diagonal == pytest.approx(0.023 * math.sqrt(2.0))


def test_the_tip_starts_over_the_first_peg(configuration: Configuration) -> None:
    peg = built("pegboard").solids[1]
    tip = place(configuration).tip
    np.testing.assert_allclose(peg.position[:2], tip[:2], atol=1e-12)
    top = peg.position[2] + peg.size[0] + peg.size[1]
    assert 0.003 < tip[2] - configuration.instrument.disk_diameter_m / 2 - top < 0.006


def test_there_are_six_rings_of_8_1_mm_at_different_angles() -> None:
    one = built("ring-board")
    assert len(one.rings) >= 6
    for ring in one.rings:
        parts = [one.solids[index] for index in ring.solids]
        assert 2.0 * ring.clear_radius == pytest.approx(PAPER_RING_DIAMETER)
        assert np.linalg.norm(ring.axis) == pytest.approx(1.0)
        # A rod of the clear radius on the axis touches every part and enters none.
        for part in parts:
            start, end = ends(part)
            points = np.linspace(start, end, 41) - ring.centre
            away = np.linalg.norm(np.cross(points, ring.axis), axis=1) - part.size[0]
            assert away.min() == pytest.approx(ring.clear_radius, abs=1e-9)
            assert np.abs(points @ ring.axis).max() < 1e-12
        # The parts are a closed loop.
        for part, following in itertools.pairwise([*parts, parts[0]]):
            np.testing.assert_allclose(ends(part)[1], ends(following)[0], atol=1e-12)
    for ring, other in itertools.combinations(one.rings, 2):
        assert math.degrees(math.acos(ring.axis @ other.axis)) > 4.0
    axes = np.array([ring.axis for ring in one.rings])
    assert np.degrees(np.arccos(np.clip(axes @ axes.T, -1, 1))).max() > 45.0


def test_every_solid_of_the_ring_board_is_of_one_ring_or_of_none() -> None:
    one = built("ring-board")
    owned = [index for ring in one.rings for index in ring.solids]
    assert len(set(owned)) == len(owned)
    others = {solid.name.split()[0] for i, solid in enumerate(one.solids) if i not in owned}
    assert others == {"plate", "post"}


def test_the_sine_is_5_cm_long_with_3_mm_amplitude(configuration: Configuration) -> None:
    groove = built("silicon-sine").groove
    assert groove is not None
    level = (groove.centre_line - groove.centre_line[0]) @ place(configuration).heading
    assert level[-1] == pytest.approx([0.050, 0.0, 0.0], abs=1e-12)
    assert level[:, 1].max() == pytest.approx(0.003, rel=1e-3)
    assert level[:, 1].min() == pytest.approx(-0.003, rel=1e-3)
    sine = 0.003 * np.sin(2 * np.pi * level[:, 0] / 0.05)
    np.testing.assert_allclose(level[:, 1], sine, rtol=0, atol=1e-9)


def test_the_arc_has_2_cm_radius_and_turns_by_90_degrees() -> None:
    groove = built("silicon-arc").groove
    assert groove is not None
    line = groove.centre_line[:, :2]
    # The centre, from three points.
    one, two, three = line[0], line[100], line[200]
    matrix = 2.0 * np.array([two - one, three - one])
    centre = np.linalg.solve(matrix, [two @ two - one @ one, three @ three - one @ one])
    np.testing.assert_allclose(np.linalg.norm(line - centre, axis=1), 0.020, atol=1e-9)
    steps = np.diff(line, axis=0)
    headings = np.degrees(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    assert headings[0] == pytest.approx(-45.0, abs=0.5)
    assert headings[-1] == pytest.approx(45.0, abs=0.5)


@pytest.mark.parametrize("name", ["silicon-sine", "silicon-arc"])
def test_the_ball_rests_on_the_floor_between_the_rails_all_along(name: str) -> None:
    one = built(name)
    assert one.ball is not None
    assert one.groove is not None
    assert one.ball.radius == 0.005
    line = one.groove.centre_line
    np.testing.assert_allclose(one.ball.position, line[0], atol=1e-12)
    floor = next(solid for solid in one.solids if solid.name == "floor")
    np.testing.assert_allclose(distances(floor, line), one.ball.radius, atol=1e-9)
    for side in ("left", "right"):
        rails = [solid for solid in one.solids if solid.name.startswith(side)]
        away = np.min([distances(rail, line) for rail in rails], axis=0) - one.ball.radius
        assert away.min() > 0.0
        assert away.max() < 4e-4
    stop = next(solid for solid in one.solids if solid.name == "end stop")
    assert distances(stop, line[-1:])[0] > one.ball.radius + 0.003


@pytest.mark.parametrize("name", BOARD_NAMES)
def test_the_segment_can_straighten_at_the_start(name: str, configuration: Configuration) -> None:
    """As it does before it is withdrawn."""
    one = board(name, configuration)
    instrument, start = configuration.instrument, configuration.start
    rotation = start_shaft_rotation(configuration)
    base = np.array(configuration.trocar.position_m)
    base = base - start.lambda_along_shaft * instrument.shaft_length_m * rotation[:, 2]
    end = base + instrument.shaft_length_m * rotation[:, 2]
    for share in np.linspace(0.0, 1.0, 25):
        uv = share * np.array(start_bend(configuration))
        axis = instrument_axis(instrument, base, end, rotation, uv)
        for solid in one.solids:
            assert distances(solid, axis).min() > 0.5 * instrument.disk_diameter_m + 0.001


@pytest.mark.parametrize("name", ["silicon-sine", "silicon-arc", "ring-board"])
def test_boards_turn_with_the_start(name: str, configuration: Configuration) -> None:
    there = turned(configuration, (0.0, 0.6, -0.8))
    one, other = board(name, configuration), board(name, there)
    here, place_there = place(configuration), place(there)
    for solid, moved in zip(one.solids, other.solids, strict=True):
        before = (solid.position - here.tip) @ here.heading
        after = (moved.position - place_there.tip) @ place_there.heading
        np.testing.assert_allclose(after, before, atol=1e-9)


@pytest.mark.parametrize("bend", [0.0, 36.87])
def test_an_upright_tip_or_shaft_still_has_a_heading(
    bend: float, configuration: Configuration
) -> None:
    for shaft, up in (((0.0, 0.0, -1.0), (1.0, 0.0, 0.0)), ((0.6, 0.0, -0.8), (-0.8, 0.0, -0.6))):
        start = configuration.start.model_copy(
            update={"shaft_direction": shaft, "bend_direction_up": up, "bend_deg": bend}
        )
        here = place(configuration.model_copy(update={"start": start}))
        np.testing.assert_allclose(here.heading @ here.heading.T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(here.heading[:, 2], [0.0, 0.0, 1.0])
