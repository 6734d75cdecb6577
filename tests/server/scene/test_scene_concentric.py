"""The concentric-tube arms on a real viser server: what is drawn, and what it costs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import viser
import viser.transforms as tf
from numpy.typing import NDArray

from robot.configuration import Configuration
from robot.records import LeaderKind
from server import configuration_file
from server.control.mapped_path import MappedPath
from server.memory.link_records import path_file
from server.scene.camera import FIELD_OF_VIEW
from server.scene.concentric_views import VIEWPOINTS
from server.scene.palette import TRUE, TUBES, WARNING
from server.scene.tubes import OVERLAP, PIECES, WIDTH
from server.scene.view import PERIOD, SceneView
from tests.server.scene.stage import TubeRecorder, handle, messages
from tests.server.scene.viser_browser import ViserBrowser


@pytest.fixture(scope="module")
def configuration() -> Configuration:
    return configuration_file.load().model_copy(update={"robot": "concentric"})


@pytest.fixture
def link(configuration: Configuration) -> TubeRecorder:
    return TubeRecorder(configuration)


def elsewhere(start: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """A configuration near the start that keeps the order of the tubes."""
    q = start.copy()
    for arm in range(2):
        q[6 * arm : 6 * arm + 3] += rng.uniform(-4.0e-3, 4.0e-3, 3)
        q[6 * arm + 3 : 6 * arm + 6] += rng.uniform(-0.4, 0.4, 3)
    return q


class DrawnTube:
    """One tube of one arm as the batched mesh has it."""

    def __init__(self, server: viser.ViserServer, arm: int, tube: int) -> None:
        mesh = handle(server, "/arms/tubes")
        count, arms = 3, 2
        of_arm = len(mesh.batched_positions) // arms
        assert of_arm == count * (PIECES + 2)
        first = of_arm * arm + PIECES * (count - 1 - tube)
        front = slice(first, first + PIECES)
        rear = of_arm * arm + PIECES * count + tube
        self.colours = np.asarray(mesh.batched_colors)[front]
        self.radii = np.asarray(mesh.batched_scales)[front, 0]
        self.lengths = np.asarray(mesh.batched_scales, dtype=float)[front, 2] / OVERLAP
        self.rear_length = float(mesh.batched_scales[rear, 2]) / OVERLAP
        self.rear_middle = np.asarray(mesh.batched_positions[rear], dtype=float)
        along = tf.SO3(np.asarray(mesh.batched_wxyzs[front.stop - 1], dtype=float)).as_matrix()
        middle = np.asarray(mesh.batched_positions[front.stop - 1], dtype=float)
        self.tip = middle + 0.5 * self.lengths[-1] * along[:, 2]


def test_few_nodes_carry_all_of_it(server: viser.ViserServer, view: SceneView) -> None:
    for name in (
        *("/arms/tubes", "/arms/commanded", "/endoscope/body", "/endoscope/channel B"),
        *("/relative/vector", "/relative/label", "/snapping/A", "/frames/tip A", "/frames/tip B"),
        *("/ghost", "/ghost b", "/gizmo", "/path", "/trail/true", "/ground/grid"),
    ):
        assert server.scene.get_handle_by_name(name) is not None, name
    assert server.scene.get_handle_by_name("/trocar") is None
    assert len(server.scene._handle_from_node_name) < 45


def test_every_tube_is_drawn_where_the_record_says(
    server: viser.ViserServer,
    view: SceneView,
    link: TubeRecorder,
    configuration: Configuration,
    rng: np.random.Generator,
) -> None:
    tubes = configuration.concentric.tubes
    for step in range(4):
        q = elsewhere(link.start, rng)
        link.move(q)
        view.step(10.0 * (step + 1))
        truth = link.record["truth"][0]
        for arm, tip in enumerate((truth["position"], truth["position_b"])):
            rear = 1e3 * q[6 * arm : 6 * arm + 3]
            reach = [beta + tube.length_mm for beta, tube in zip(rear, tubes, strict=True)] + [0.0]
            for index, tube in enumerate(tubes):
                drawn = DrawnTube(server, arm, index)
                assert (drawn.colours == TUBES[index]).all()
                assert drawn.radii == pytest.approx(WIDTH * 0.5e-3 * tube.outer_diameter_mm)
                front = reach[index] - reach[index + 1]
                assert 1e3 * drawn.lengths.sum() == pytest.approx(front, rel=2e-3)
                around = np.append(rear, 0.0)[index + 1]
                assert 1e3 * drawn.rear_length == pytest.approx(around - rear[index], abs=1e-3)
                middle = 0.5 * (rear[index] + around)
                assert 1e3 * drawn.rear_middle == pytest.approx([12 * arm - 6, 0, middle], abs=1e-3)
            assert DrawnTube(server, arm, 0).tip == pytest.approx(tip, abs=2e-6)


def test_a_frame_in_which_all_moves_is_few_messages(
    server: viser.ViserServer,
    view: SceneView,
    link: TubeRecorder,
    browser: ViserBrowser,
    rng: np.random.Generator,
) -> None:
    now = 10.0
    view.step(now)
    before = messages(server)
    for _ in range(60):
        now += PERIOD
        link.move(elsewhere(link.start, rng))
        view.step(now)
    assert (messages(server) - before) / 60 < 20


def test_arms_at_rest_cost_next_to_nothing(
    server: viser.ViserServer, view: SceneView, browser: ViserBrowser
) -> None:
    now = 10.0
    for _ in range(10):
        now += 0.2
        view.step(now)
    before = messages(server)
    for _ in range(300):
        now += PERIOD
        view.step(now)
    assert (messages(server) - before) / 10.0 <= 5


def test_the_vector_is_broken_and_says_so_where_b_is_not_in_its_place(
    server: viser.ViserServer, view: SceneView, link: TubeRecorder
) -> None:
    line, label = handle(server, "/relative/vector"), handle(server, "/relative/label")
    ghost = handle(server, "/ghost b")
    view.step(10.0)
    truth = link.record["truth"][0]
    assert line.points[0] == pytest.approx(np.array([truth["position"], truth["position_b"]]))
    assert (line.colors == TRUE).all()
    assert not label.visible
    assert not ghost.visible
    pieces = len(line.points)
    link.record["outcome"]["report"]["desired_b"] = truth["position_b"] + [0.0, 1.5e-3, 0.0]
    view.step(20.0)
    assert len(line.points) > pieces + 3
    assert (line.colors == WARNING).all()
    assert label.visible
    assert "1.5 mm" in label.text
    assert ghost.visible
    assert ghost.position == pytest.approx(truth["position_b"] + [0.0, 1.5e-3, 0.0])
    link.move(link.start)
    view.step(30.0)
    assert len(line.points) == pieces
    assert not label.visible


def test_an_arm_near_snapping_is_warned_of(
    server: viser.ViserServer, view: SceneView, link: TubeRecorder
) -> None:
    labels = [handle(server, f"/snapping/{arm}") for arm in "AB"]
    shown = []
    for step, stability in enumerate((0.8, 0.12, 0.16, 0.3)):
        link.record["outcome"]["report"]["stability"][0] = [1.0, stability]
        view.step(10.0 * (step + 1))
        shown.append([label.visible for label in labels])
    assert shown == [[False, False], [False, True], [False, True], [False, False]]
    assert "B is near snapping: stability 0.16" in labels[1].text


def test_the_commanded_shape_shows_only_where_it_is_another(
    server: viser.ViserServer, view: SceneView, link: TubeRecorder
) -> None:
    line = handle(server, "/arms/commanded")
    view.step(10.0)
    assert not line.visible
    commanded = link.start.copy()
    commanded[:3] += 2e-3
    link.record["outcome"]["report"]["q"][0] = commanded
    view.step(11.0)
    assert line.visible
    count = len(line.points) // 2
    tip = link.record["truth"][0]["position"]
    ahead = line.points[count - 1, 1] - tip
    assert np.linalg.norm(ahead) == pytest.approx(2e-3, rel=0.2)
    assert line.points[0, 0] == pytest.approx([-6e-3, 0.0, 0.0], abs=1e-6)
    link.move(link.start)
    view.step(12.0)
    assert not line.visible


def seen(view: Any, place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where a point is in the picture of ``view``: right and up, 1 at the upper border."""
    forward = view.look_at - view.position
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, view.up)
    right /= np.linalg.norm(right)
    ray = place - view.position
    flat = np.array([ray @ right, ray @ np.cross(right, forward)]) / (ray @ forward)
    return np.asarray(flat / np.tan(FIELD_OF_VIEW / 2))


@pytest.mark.parametrize("name", VIEWPOINTS.names)
def test_every_view_has_both_tips_in_it_and_a_on_the_left(link: TubeRecorder, name: str) -> None:
    truth = link.record["truth"][0]
    view = VIEWPOINTS.view(name, truth["position"], truth["position_b"])
    for tip in (truth["position"], truth["position_b"]):
        assert np.abs(seen(view, tip)).max() < 0.9
    if name != "Side":
        left, right = (seen(view, np.array([x, 0.0, 0.1])) for x in (-6e-3, 6e-3))
        assert left[0] < right[0]


def test_the_first_view_has_endoscope_and_gizmo_in_it(
    server: viser.ViserServer, view: SceneView, link: TubeRecorder
) -> None:
    view.step(10.0)
    truth = link.record["truth"][0]
    first = VIEWPOINTS.view(VIEWPOINTS.home, truth["position"], truth["position_b"])
    assert server.initial_camera.position == pytest.approx(first.position)
    assert server.initial_camera.look_at == pytest.approx(first.look_at)
    for place in ([0.0, 0.0, -0.07], truth["position"] + [0.0, 0.0, 0.06]):
        # The page's scene can be narrower than it is high.
        assert np.abs(seen(first, np.array(place))).max() < 0.95
        assert abs(seen(first, np.array(place))[0]) < 0.6


def test_the_gizmo_moves_and_does_not_turn(
    view: SceneView, link: TubeRecorder, configuration: Configuration
) -> None:
    view.step(10.0)
    control = view.gizmo.control
    assert control.disable_rotations
    commanded = link.record["outcome"]["report"]["commanded_position"][0]
    assert control.position == pytest.approx(commanded)
    assert np.abs(control.wxyz) == pytest.approx([1.0, 0.0, 0.0, 0.0])


def test_the_path_that_plays_is_shown_whole(
    server: viser.ViserServer, view: SceneView, link: TubeRecorder, tmp_path: Path
) -> None:
    line = handle(server, "/path")
    samples = np.zeros((3, 8))
    samples[:, 0], samples[:, 1], samples[:, 4] = [0.0, 1.0, 2.0], [0.0, 0.01, 0.03], 1.0
    (tmp_path / path_file(7)).write_bytes(MappedPath.file_bytes(samples))
    view._path._directory = tmp_path
    start = link.record["truth"][0]["position"].copy()
    link.record["header"]["path_id"] = 7
    link.record["header"]["path_progress"] = 0.5
    view.step(10.0)
    assert not line.visible
    link.record["input"]["leader"]["kind"] = LeaderKind.PATH
    link.record["input"]["leader"]["position"][0] = start + np.array([0.01, 0.0, 0.0])
    view.step(11.0)
    assert line.visible
    assert line.points[0, 0] == pytest.approx(start, abs=1e-6)
    assert line.points[-1, 1] == pytest.approx(start + np.array([0.03, 0.0, 0.0]), abs=1e-6)
    link.record["header"]["path_id"] = 0
    view.step(12.0)
    assert not line.visible
    link.record["header"]["path_id"] = 8
    view.step(13.0)
    assert not line.visible


@pytest.mark.parametrize("part", ["q", "torsion", "position", "wxyz", "position_b", "wxyz_b"])
def test_what_is_no_number_is_not_drawn(view: SceneView, link: TubeRecorder, part: str) -> None:
    view.step(10.0)
    link.record["truth"][part] = np.nan
    with pytest.raises(FloatingPointError, match=part):
        view.step(20.0)
