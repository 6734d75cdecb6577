"""The scene on a real viser server: what is drawn, and what it costs."""

from __future__ import annotations

import numpy as np
import pytest
import viser
import viser.transforms as tf

from robot.configuration import Configuration
from robot.records import RECORD
from robot.rotations import matrix_from_quaternion
from robot.segment import shape_frames
from server.scene.camera import FIELD_OF_VIEW
from server.scene.instrument_views import INSTRUMENT, named_view
from server.scene.trails import MOST_POINTS, SAMPLE_PERIOD, SECONDS
from server.scene.view import PERIOD, SceneView
from tests.server.scene.stage import (
    Recorder,
    handle,
    instrument_of,
    messages,
    pose,
    somewhere,
    until,
)
from tests.server.scene.viser_browser import ViserBrowser


def test_the_stable_names_exist(server: viser.ViserServer, view: SceneView) -> None:
    for name in (
        "/robot",
        "/instrument/disks",
        "/instrument/tendons",
        "/trocar/wall",
        "/trocar/port",
        "/trocar/rcm",
        "/gizmo",
        "/ghost",
        "/trail/desired",
        "/trail/true",
        "/ground/grid",
    ):
        assert server.scene.get_handle_by_name(name) is not None, name


def test_the_drawn_arm_agrees_with_the_kinematics(
    server: viser.ViserServer, view: SceneView, link: Recorder, rng: np.random.Generator
) -> None:
    for index in range(5):
        link.move(somewhere(link.start, rng))
        view.step(10.0 * (index + 1))
        drawn = pose(server, instrument_of(view).arm.paths["segment_base"])
        truth = link.record["truth"][0]
        assert drawn.translation() == pytest.approx(truth["shaft_end"], abs=3e-5)
        instrument = pose(server, "/instrument")
        assert instrument.translation() == pytest.approx(truth["shaft_end"], abs=1e-5)
        turn = (drawn.rotation().inverse() @ instrument.rotation()).log()
        assert np.linalg.norm(turn) < 1e-4


@pytest.mark.parametrize("bend", ["any", "straight"])
def test_the_drawn_segment_ends_at_the_true_tip(
    server: viser.ViserServer,
    view: SceneView,
    link: Recorder,
    rng: np.random.Generator,
    bend: str,
) -> None:
    x = somewhere(link.start, rng)
    if bend == "straight":
        x[7:9] = 0.0
    link.move(x)
    view.step(10.0)
    disks, truth = handle(server, "/instrument/disks"), link.record["truth"][0]
    root = pose(server, "/instrument")
    assert len(disks.batched_positions) == 12
    tip = root.apply(np.asarray(disks.batched_positions[-1], dtype=np.float64))
    assert tip == pytest.approx(truth["position"], abs=2e-5)
    drawn = (root.rotation() @ tf.SO3(disks.batched_wxyzs[-1].astype(np.float64))).as_matrix()
    true = np.empty((3, 3))
    matrix_from_quaternion(truth["wxyz"], true)
    assert drawn == pytest.approx(true, abs=1e-3)


def test_the_tendons_pass_through_the_holes(
    server: viser.ViserServer, view: SceneView, link: Recorder, configuration: Configuration
) -> None:
    x = link.start.copy()
    x[7:9] = 0.9, -0.6
    link.move(x)
    view.step(10.0)
    instrument = configuration.instrument
    count = instrument.disk_count
    fractions = np.arange(count + 1) / count
    positions, rotations = shape_frames(0.9, -0.6, instrument.segment_length_m, fractions)
    middles = np.asarray(handle(server, "/instrument/tendons").batched_positions)
    assert len(middles) == 5 * count
    for tendon in range(4):
        turn = tendon * np.pi / 2
        hole = instrument.tendon_pitch_radius_m * np.array([np.cos(turn), np.sin(turn), 0.0])
        knots = positions + rotations @ hole
        drawn = middles[(tendon + 1) * count : (tendon + 2) * count]
        assert drawn == pytest.approx(0.5 * (knots[1:] + knots[:-1]), abs=1e-7)


def test_a_frame_in_which_all_moves_is_few_messages(
    server: viser.ViserServer,
    view: SceneView,
    link: Recorder,
    browser: ViserBrowser,
    rng: np.random.Generator,
) -> None:
    frames = 60
    now = 10.0
    view.step(now)
    before = messages(server)
    for _ in range(frames):
        now += PERIOD
        link.move(somewhere(link.start, rng))
        view.step(now)
    assert (messages(server) - before) / frames < 20


def test_a_robot_at_rest_costs_next_to_nothing(
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


def test_nothing_is_sent_at_full_rate_while_nobody_looks(
    server: viser.ViserServer, view: SceneView, link: Recorder, rng: np.random.Generator
) -> None:
    now = 10.0
    view.step(now)
    before = messages(server)
    for _ in range(90):
        now += PERIOD
        link.move(somewhere(link.start, rng))
        view.step(now)
    assert messages(server) - before < 4 * 25


def test_trails_are_bounded_and_expire(
    server: viser.ViserServer, view: SceneView, link: Recorder, browser: ViserBrowser
) -> None:
    now = 10.0
    for index in range(3 * MOST_POINTS):
        now += SAMPLE_PERIOD * 1.01
        link.record["truth"]["position"] = [0.4 + 1e-3 * (index % 7), 0.0, 1e-3 * (index % 5)]
        view.step(now)
    desired, true = handle(server, "/trail/desired"), handle(server, "/trail/true")
    assert 0.8 * MOST_POINTS < len(true.points) < MOST_POINTS
    for _ in range(20):
        now += SECONDS / 10
        view.step(now)
    assert len(true.points) == len(desired.points) == 1


def test_trails_that_coincide_share_the_line_as_dashes(
    server: viser.ViserServer, view: SceneView, link: Recorder, browser: ViserBrowser
) -> None:
    for offset, share in ((0.0, 1), (2e-3, 2)):
        now = 100.0 * (1 + share)
        for index in range(60):
            now += SAMPLE_PERIOD * 1.01
            place = np.array([0.4 + 1e-3 * index, 0.0, 0.0])
            link.record["truth"]["position"] = place
            aside = place + np.array([0.0, 0.0, offset])
            link.record["outcome"]["report"]["desired_position"] = aside
            view.step(now)
        lines = [handle(server, f"/trail/{name}").points for name in ("desired", "true")]
        assert len(lines[0]) + len(lines[1]) == pytest.approx(share * 59, abs=2)
        assert min(len(line) for line in lines) > 20


def test_a_jump_leaves_a_gap_in_the_trail(
    server: viser.ViserServer, view: SceneView, link: Recorder, browser: ViserBrowser
) -> None:
    now = 10.0
    for x in (0.40, 0.401, 0.45, 0.451):
        now += 2 * SAMPLE_PERIOD
        link.record["truth"]["position"] = [x, 0.0, 0.0]
        view.step(now)
    steps = np.diff(handle(server, "/trail/true").points[:, :, 0], axis=1)
    assert steps.max() < 0.01


def test_the_ghost_shows_only_a_target_that_is_not_reached(
    server: viser.ViserServer, view: SceneView, link: Recorder, browser: ViserBrowser
) -> None:
    ghost = handle(server, "/ghost")
    view.step(10.0)
    assert not ghost.visible
    target = link.record["truth"]["position"][0] + [0.0, 0.004, 0.0]
    link.record["outcome"]["report"]["desired_position"] = target
    view.step(11.0)
    assert ghost.visible
    assert ghost.position == pytest.approx(target)
    link.move(link.start)
    view.step(12.0)
    assert not ghost.visible


def test_the_trocar_may_move(server: viser.ViserServer, view: SceneView, link: Recorder) -> None:
    link.record["input"]["trocar_position"] = [0.41, 0.02, 0.13]
    view.step(10.0)
    assert handle(server, "/trocar").position == pytest.approx([0.41, 0.02, 0.13])
    truth = link.record["truth"][0]
    outward = truth["shaft_base"] - truth["shaft_end"]
    axis = tf.SO3(handle(server, "/trocar/port").wxyz).as_matrix()[:, 2]
    assert axis == pytest.approx(outward / np.linalg.norm(outward), abs=1e-6)


def test_the_first_view_shows_tip_and_trocar(
    server: viser.ViserServer, view: SceneView, link: Recorder
) -> None:
    view.step(10.0)
    truth = link.record["truth"][0]
    camera = server.initial_camera
    forward = camera.look_at - camera.position
    distance = np.linalg.norm(forward)
    assert 0.3 < distance < 0.7
    half = FIELD_OF_VIEW / 2
    for place in (truth["position"], link.record["input"]["trocar_position"][0]):
        ray = place - camera.position
        angle = np.arccos(ray @ forward / np.linalg.norm(ray) / distance)
        assert angle < 0.85 * half


def test_a_vertical_shaft_has_a_view_too() -> None:
    trocar, tip = np.array([0.4, 0.0, 0.1]), np.array([0.4, 0.0, 0.0])
    view = named_view(INSTRUMENT, trocar, tip, np.array([0.0, 0.0, -1.0]))
    assert np.isfinite(view.position).all()


def test_a_torn_read_costs_one_picture_only(view: SceneView, link: Recorder) -> None:
    link.failures = 3
    view.start()
    until(lambda: link.reads > 6)


def test_a_picture_that_fails_is_logged_once_and_not_the_last(
    view: SceneView, link: Recorder, caplog: pytest.LogCaptureFixture
) -> None:
    whole = link.record
    link.record = np.zeros(1, [("header", [("tick", "i8")])])
    link.record["header"]["tick"] = 1
    view.start()
    until(lambda: link.reads > 4)
    link.record = whole
    tip = whole["outcome"]["report"]["commanded_position"][0]
    until(lambda: np.allclose(view.gizmo.control.position, tip))
    assert len([entry for entry in caplog.records if entry.levelname == "ERROR"]) == 1


def test_before_the_first_tick_the_scene_stands_as_configured(
    server: viser.ViserServer, view: SceneView, link: Recorder
) -> None:
    link.record = np.zeros(1, RECORD)
    before = messages(server)
    view.step(10.0)
    assert messages(server) == before


def test_a_picture_that_fails_is_told_once_and_the_next_is_drawn(
    view: SceneView, link: Recorder, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    view.on_failure = told.append
    drawn = view._draw
    tries: list[int] = []

    def failing(now: float, record: object) -> None:
        tries.append(1)
        if len(tries) % 2:
            raise ZeroDivisionError("a plot without a range")
        raise ValueError("a pose that is none")

    monkeypatch.setattr(view, "_draw", failing)
    monkeypatch.setattr("server.scene.view.UNWATCHED_PERIOD", 0.0)
    link.move(link.start)
    view.start()
    until(lambda: len(tries) > 6)
    monkeypatch.setattr(view, "_draw", drawn)
    before = view._drawn
    until(lambda: view._drawn > before + 0.2)
    view.stop()
    assert told == [
        "ZeroDivisionError: a plot without a range",
        "ValueError: a pose that is none",
    ]


@pytest.mark.parametrize("part", ["q", "uv", "position", "wxyz", "shaft_base", "shaft_end"])
def test_what_is_no_number_is_not_drawn(view: SceneView, link: Recorder, part: str) -> None:
    link.move(link.start)
    view.step(10.0)
    link.record["truth"][part] = np.nan
    with pytest.raises(FloatingPointError, match=part):
        view.step(20.0)
