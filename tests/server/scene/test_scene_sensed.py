"""Estimated shape and force in the scene: where they are drawn, when not, and what it costs."""

from __future__ import annotations

import numpy as np
import pytest
import viser
from numpy.typing import NDArray

from robot.configuration import Configuration
from robot.rotations import matrix_from_quaternion
from robot.segment import shape_frames
from robot.sensing.curvature_modes import U_MODE, V_MODE
from robot.sensing.faults import SensingFault
from server.scene.palette import ESTIMATED, FAINT
from server.scene.sensed import HOOPS, LONGEST, METRES_PER_NEWTON, PERIOD, REACH, ROOT
from server.scene.view import SceneView
from tests.server.scene.stage import Recorder, handle, messages, pose, somewhere
from tests.server.scene.viser_browser import ViserBrowser

KNOWN = np.diag([0.005**2, 0.005**2, 0.01**2])
UPWARD_UNKNOWN = np.diag([0.005**2, 0.01**2, 0.4**2])


@pytest.fixture
def sensed(link: Recorder) -> Recorder:
    """A link that tells a perfect estimate of the shape."""
    estimate(link, link.start)
    return link


def estimate(link: Recorder, x: NDArray[np.float64]) -> None:
    """Put robot and estimate where the configuration ``x`` has them; a force is not there."""
    link.move(x)
    report, truth = link.record["outcome"]["report"], link.record["truth"]
    report["estimate_fault"] = SensingFault.NONE
    report["estimate_position"], report["estimate_wxyz"] = truth["position"], truth["wxyz"]
    report["estimate_modes"] = 0.0
    report["estimate_modes"][0, V_MODE], report["estimate_modes"][0, U_MODE] = x[8], x[7]
    push(link, (0.0, 0.0, 0.0))


def push(
    link: Recorder, force: tuple[float, float, float], covariance: NDArray[np.float64] = KNOWN
) -> None:
    report = link.record["outcome"]["report"]
    report["estimate_force"], report["estimate_force_covariance"] = force, covariance


def ends(server: viser.ViserServer) -> NDArray[np.float64]:
    """Tail and head of the arrow in the world, (2, 3)."""
    arrow = handle(server, f"{ROOT}/force")
    return np.asarray(arrow.position + arrow.scale * np.asarray(arrow.points, float)[0])


def test_nothing_is_drawn_without_an_estimate(
    server: viser.ViserServer, view: SceneView, sensed: Recorder
) -> None:
    now = 10.0
    for fault in SensingFault:
        sensed.record["outcome"]["report"]["estimate_fault"] = fault
        now += 2.0
        view.step(now)
        assert handle(server, ROOT).visible == (fault == SensingFault.NONE), fault
    sensed.record["outcome"]["report"]["estimate_fault"] = SensingFault.NONE
    sensed.record["outcome"]["report"]["estimate_force"][0, 0] = np.nan
    view.step(now + 2.0)
    assert not handle(server, ROOT).visible


def test_the_hoops_stand_around_the_estimated_shape(
    server: viser.ViserServer,
    view: SceneView,
    sensed: Recorder,
    configuration: Configuration,
    rng: np.random.Generator,
) -> None:
    length = configuration.instrument.segment_length_m
    for index in range(4):
        x = somewhere(sensed.start, rng)
        estimate(sensed, x)
        view.step(10.0 * (index + 1))
        places, _ = shape_frames(x[7], x[8], length, np.arange(1, HOOPS + 1) / HOOPS)
        hoops, base = handle(server, f"{ROOT}/shape"), pose(server, "/instrument")
        drawn = np.asarray(hoops.batched_positions, float)
        assert drawn == pytest.approx(np.array([base.apply(place) for place in places]), abs=3e-5)
        tip = np.empty((3, 3))
        matrix_from_quaternion(sensed.record["truth"]["wxyz"][0], tip)
        last = np.empty((3, 3))
        matrix_from_quaternion(np.asarray(hoops.batched_wxyzs[-1], float), last)
        assert last == pytest.approx(tip, abs=1e-4)


def test_the_arrow_is_the_force_at_the_estimated_tip(
    server: viser.ViserServer, view: SceneView, sensed: Recorder
) -> None:
    tip = sensed.record["truth"]["position"][0]
    for now, force in ((10.0, (0.0, 0.3, -0.4)), (20.0, (0.02, 0.0, 0.0))):
        push(sensed, force)
        view.step(now)
        tail, head = ends(server)
        assert tail == pytest.approx(tip, abs=1e-6)
        assert head == pytest.approx(tip + METRES_PER_NEWTON * np.array(force), abs=1e-6)
        assert handle(server, f"{ROOT}/end/label").text == f"{np.linalg.norm(force):.2f} N"
        ellipsoid = handle(server, f"{ROOT}/end/uncertainty")
        assert handle(server, f"{ROOT}/end").position == pytest.approx(head, abs=1e-6)
        assert sorted(ellipsoid.scale) == pytest.approx([5e-4, 5e-4, 1e-3])
    push(sensed, (0.0, 30.0, 40.0))
    view.step(30.0)
    tail, head = ends(server)
    assert np.linalg.norm(head - tail) == pytest.approx(LONGEST, abs=1e-6)
    assert handle(server, f"{ROOT}/end/label").text == "50.00 N"


def test_a_direction_that_is_not_observable_is_a_broken_line(
    server: viser.ViserServer, view: SceneView, sensed: Recorder
) -> None:
    push(sensed, (0.2, 0.0, 0.3), UPWARD_UNKNOWN)
    view.step(10.0)
    tip = sensed.record["truth"]["position"][0]
    head = ends(server)[1]
    assert head == pytest.approx(tip + METRES_PER_NEWTON * np.array([0.2, 0.0, 0.0]), abs=1e-6)
    line = np.asarray(handle(server, f"{ROOT}/end/unknown").points, float).reshape(-1, 3)
    assert np.abs(line[:, :2]).max() < 1e-6
    assert (line[:, 2].min(), line[:, 2].max()) == pytest.approx((-REACH, REACH), abs=1e-6)
    assert max(handle(server, f"{ROOT}/end/uncertainty").scale) == pytest.approx(1e-3)
    # What is observable for a moment only goes on counting as not observable.
    push(sensed, (0.2, 0.0, 0.3))
    view.step(10.0 + 2.0 * PERIOD)
    assert ends(server)[1] == pytest.approx(head, abs=1e-6)
    push(sensed, (0.2, 0.0, 0.31))
    view.step(20.0)
    assert ends(server)[1][2] > head[2] + 0.01
    assert (
        np.ptp(np.asarray(handle(server, f"{ROOT}/end/unknown").points), axis=(0, 1)).max() == 0.0
    )
    push(sensed, (0.2, 0.0, 0.3), np.eye(3))
    view.step(30.0)
    assert not handle(server, f"{ROOT}/end/uncertainty").visible


def test_a_force_within_its_uncertainty_is_faint_and_does_not_flicker(
    server: viser.ViserServer, view: SceneView, sensed: Recorder
) -> None:
    colours = []
    now = 10.0
    for share in (1.0, 2.5, 3.5, 2.5, 1.5, 2.5):
        push(sensed, (share * 0.005, 0.0, 0.0))
        now += 2.0
        view.step(now)
        arrow = handle(server, f"{ROOT}/force")
        colours.append(tuple(int(part) for part in np.asarray(arrow.colors).reshape(-1, 3)[0]))
        assert handle(server, f"{ROOT}/end/label").visible == (colours[-1] == ESTIMATED)
    assert colours == [FAINT, FAINT, ESTIMATED, ESTIMATED, FAINT, FAINT]


def test_an_estimate_that_is_never_still_costs_a_bounded_share(
    server: viser.ViserServer,
    view: SceneView,
    sensed: Recorder,
    browser: ViserBrowser,
    rng: np.random.Generator,
) -> None:
    view.step(10.0)
    truth = sensed.record["truth"]["position"][0].copy()
    before, seconds = messages(server), 4.0
    for step in range(round(30 * seconds)):
        report = sensed.record["outcome"]["report"]
        report["estimate_position"] = truth + rng.normal(0.0, 2e-4, 3)
        push(sensed, tuple(rng.normal(0.0, 0.1, 3)))
        view.step(10.0 + (step + 1) / 30.0)
    assert (messages(server) - before) / seconds < 80
    before = messages(server)
    for step in range(300):
        view.step(20.0 + step / 30.0)
    assert (messages(server) - before) / 10.0 <= 5


def test_a_segment_that_is_pressed_on_ends_at_the_true_tip(
    server: viser.ViserServer, view: SceneView, link: Recorder, rng: np.random.Generator
) -> None:
    for index in range(3):
        link.move(somewhere(link.start, rng))
        aside = rng.normal(0.0, 5e-3, 3)
        link.record["truth"]["position"] += aside
        view.step(10.0 * (index + 1))
        root, disks = pose(server, "/instrument"), handle(server, "/instrument/disks")
        tip = root.apply(np.asarray(disks.batched_positions[-1], float))
        assert tip == pytest.approx(link.record["truth"]["position"][0], abs=3e-5)
        assert root.translation() == pytest.approx(link.record["truth"]["shaft_end"][0], abs=1e-5)
