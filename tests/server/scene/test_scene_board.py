"""The board in the scene: one at a time, lit where it is touched, green where it is passed."""

from __future__ import annotations

import numpy as np
import pytest
import viser

from robot.configuration import Configuration
from robot.rotations import matrix_from_quaternion
from scenes.boards.board import BOARD_NAMES, board
from scenes.boards.clearance import distances
from server.scene.board import LINGER
from server.scene.instrument_scene import BOARD_PERIOD
from server.scene.palette import BALL, PASSED, TOUCHED
from server.scene.view import PERIOD, SceneView
from tests.server.scene.stage import Recorder, handle, instrument_of, messages
from tests.server.scene.viser_browser import ViserBrowser


def names_below(server: viser.ViserServer) -> set[str]:
    known = server.scene._handle_from_node_name
    return {name.removeprefix("/board/") for name in known if name.startswith("/board/")}


def colour(server: viser.ViserServer, name: str) -> tuple[int, ...]:
    return tuple(int(value) for value in handle(server, f"/board/{name}").color)


def put(link: Recorder, view: SceneView, name: str, now: float) -> None:
    """Let the link tell of another board, and wait until it is looked at."""
    link.board = name
    view.step(now)
    assert instrument_of(view).board.name == name


def test_the_configured_board_is_there_from_the_start(
    server: viser.ViserServer, view: SceneView, configuration: Configuration
) -> None:
    assert instrument_of(view).board.name == configuration.simulation.board == "pegboard"
    assert {"plate", "green peg", "red peg", "blue peg", "yellow peg"} <= names_below(server)


def test_one_board_takes_the_place_of_the_other(
    server: viser.ViserServer, view: SceneView, link: Recorder
) -> None:
    now = 10.0
    for name in (*BOARD_NAMES[::-1], *BOARD_NAMES):
        now += 2.0 * BOARD_PERIOD
        put(link, view, name, now)
        below = names_below(server)
        assert ("ring 1" in below) == (name == "ring-board")
        assert ("ball" in below) == name.startswith("silicon")
        assert ("green peg" in below) == (name == "pegboard")
        assert bool(below) == (name != "none")


def test_a_board_that_is_not_known_changes_nothing(view: SceneView, link: Recorder) -> None:
    for name in ("", "chessboard"):
        link.board = name
        view.step(100.0 + len(name))
        assert instrument_of(view).board.name == "pegboard"


@pytest.mark.parametrize("name", [name for name in BOARD_NAMES if name != "none"])
def test_every_solid_is_drawn_where_it_is(
    server: viser.ViserServer,
    view: SceneView,
    link: Recorder,
    configuration: Configuration,
    name: str,
) -> None:
    put(link, view, name, 10.0)
    assert {part.solids for part in instrument_of(view).board._parts}
    drawn = [solid for part in instrument_of(view).board._parts for solid in part.solids]
    assert {solid.name for solid in drawn} == {
        solid.name for solid in board(name, configuration).solids
    }
    for part in instrument_of(view).board._parts:
        vertices = np.asarray(part.handle.vertices, dtype=np.float64)
        # Corners of the mesh lie on the surface of one of its solids.
        away = np.min([np.abs(distances(solid, vertices)) for solid in part.solids], axis=0)
        assert away.max() < 1e-5


def test_rings_turn_green_one_by_one_and_say_so(
    server: viser.ViserServer, view: SceneView, link: Recorder
) -> None:
    put(link, view, "ring-board", 10.0)
    plain = colour(server, "ring 1")
    assert plain not in (PASSED, TOUCHED)
    link.record["truth"]["rings_passed"] = 0b101
    link.record["truth"]["rings_touched"] = 0b010
    view.step(11.0)
    for number in range(1, 7):
        assert (colour(server, f"ring {number}") == PASSED) == (number in (1, 3))
    words = [handle(server, f"/board/ring {number} label").text for number in (1, 2, 3, 4)]
    assert words == ["1 passed", "2 · touched", "3 passed", "4"]


def test_what_is_touched_lights_up_and_goes_out(
    server: viser.ViserServer, view: SceneView, link: Recorder, browser: ViserBrowser
) -> None:
    put(link, view, "pegboard", 10.0)
    truth = link.record["truth"][0]
    peg = next(
        part
        for part in instrument_of(view).board._parts
        if part.ring < 0 and "red" in part.solids[0].name
    )
    # The tip beside the red peg: its foremost point a hair from the surface.
    solid = peg.solids[0]
    tip = np.empty((3, 3))
    matrix_from_quaternion(truth["wxyz"], tip)
    reached = solid.position - (solid.size[0] + 1e-4) * np.array([1.0, 0.0, 0.0])
    moved = reached - truth["position"]
    for field in ("position", "shaft_base", "shaft_end"):
        truth[field] += moved
    view.step(10.1)
    assert colour(server, "red peg") != TOUCHED
    truth["contact_count"] = 1
    view.step(10.2)
    assert colour(server, "red peg") == TOUCHED
    assert colour(server, "yellow peg") != TOUCHED
    truth["contact_count"] = 0
    view.step(10.2 + 0.5 * LINGER)
    assert colour(server, "red peg") == TOUCHED
    view.step(10.2 + 2.0 * LINGER)
    assert colour(server, "red peg") == tuple(solid.rgb)


def test_the_ball_goes_where_it_is_and_lights_up_when_it_is_pushed(
    server: viser.ViserServer,
    view: SceneView,
    link: Recorder,
    browser: ViserBrowser,
    configuration: Configuration,
) -> None:
    put(link, view, "silicon-sine", 10.0)
    one = board("silicon-sine", configuration)
    assert one.ball is not None
    ball = handle(server, "/board/ball")
    # A plant without contact has no ball: it stays where it rests.
    assert ball.position == pytest.approx(one.ball.position)
    truth = link.record["truth"][0]
    tip = np.empty((3, 3))
    matrix_from_quaternion(truth["wxyz"], tip)
    truth["ball_position"] = truth["position"] + one.ball.radius * tip[:, 2]
    view.step(10.1)
    assert ball.position == pytest.approx(truth["ball_position"])
    assert colour(server, "ball") == BALL
    truth["contact_count"] = 1
    view.step(10.2)
    assert colour(server, "ball") == TOUCHED


def test_a_board_at_rest_costs_no_messages(
    server: viser.ViserServer, view: SceneView, link: Recorder, browser: ViserBrowser
) -> None:
    put(link, view, "ring-board", 10.0)
    link.record["truth"]["rings_passed"] = 0b11
    now = 20.0
    for _ in range(10):
        now += PERIOD
        view.step(now)
    before = messages(server)
    for _ in range(30):
        now += PERIOD
        view.step(now)
    assert messages(server) - before < 10
