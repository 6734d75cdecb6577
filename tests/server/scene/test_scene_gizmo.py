"""The gizmo: what it sends, and when it may be moved from here."""

from __future__ import annotations

import time

import numpy as np
import pytest
import viser

from robot.records import Safety
from server.scene.gizmo import FOLLOW_PERIOD
from server.scene.view import PERIOD, SceneView
from tests.server.scene.stage import Recorder, messages, until
from tests.server.scene.viser_browser import ViserBrowser


def test_the_gizmo_follows_the_commanded_tip_until_it_is_taken(
    server: viser.ViserServer, view: SceneView, link: Recorder, browser: ViserBrowser
) -> None:
    control = view.gizmo.control
    view.step(10.0)
    tip = link.record["outcome"]["report"]["commanded_position"][0]
    assert control.position == pytest.approx(tip)

    browser.take_gizmo()
    until(lambda: view.gizmo.dragging)
    target = (float(tip[0]) + 0.02, float(tip[1]), float(tip[2]))
    browser.move_gizmo(target)
    until(lambda: np.allclose(link.samples[-1].position, target))
    x = link.start.copy()
    x[0] += 0.1
    link.move(x)
    for index in range(30):
        view.step(11.0 + index * PERIOD)
    assert control.position == pytest.approx(target)

    browser.let_go()
    until(lambda: not view.gizmo.dragging)
    view.step(13.0)
    assert control.position == pytest.approx(
        link.record["outcome"]["report"]["commanded_position"][0]
    )


def test_a_held_gizmo_repeats_its_sample_and_opens_at_the_end(
    view: SceneView, link: Recorder, browser: ViserBrowser
) -> None:
    view.start()
    until(lambda: link.reads > 3)
    tip = view.gizmo.control.position.copy()
    browser.take_gizmo()
    until(lambda: len(link.samples) > 0)
    assert link.samples[0].clutch
    assert link.samples[0].position == pytest.approx(tip)
    browser.move_gizmo((0.5, 0.01, 0.02))
    time.sleep(1.0)
    browser.let_go()
    until(lambda: not link.samples[-1].clutch)
    closed = link.samples[:-1]
    assert all(sample.clutch for sample in closed)
    assert [sample.sequence for sample in link.samples] == list(range(1, len(link.samples) + 1))
    assert closed[-1].position == pytest.approx([0.5, 0.01, 0.02])
    gaps = np.diff([sample.time for sample in closed])
    assert len(closed) >= 20
    assert np.median(gaps) <= 0.05
    count = len(link.samples)
    time.sleep(0.3)
    assert len(link.samples) == count


def test_closing_the_page_in_a_drag_opens_the_clutch(
    server: viser.ViserServer, view: SceneView, link: Recorder
) -> None:
    page = ViserBrowser(server.get_port())
    until(lambda: len(server.get_clients()) == 1)
    view.start()
    page.take_gizmo()
    until(lambda: view.gizmo.dragging)
    page.close()
    until(lambda: not link.samples[-1].clutch, seconds=2.0)
    assert not view.gizmo.dragging


def test_a_second_browser_cannot_take_a_gizmo_that_is_held(
    server: viser.ViserServer, view: SceneView, link: Recorder, browser: ViserBrowser
) -> None:
    other = ViserBrowser(server.get_port())
    until(lambda: len(server.get_clients()) == 2)
    browser.take_gizmo()
    until(lambda: view.gizmo.dragging)
    other.take_gizmo()
    other.move_gizmo((0.9, 0.9, 0.9))
    other.let_go()
    other.close()
    until(lambda: len(server.get_clients()) == 1)
    assert view.gizmo.dragging
    assert all(sample.clutch and sample.position[0] < 0.9 for sample in link.samples)


def test_what_a_watcher_moved_in_its_own_picture_is_put_back(
    server: viser.ViserServer, view: SceneView, browser: ViserBrowser
) -> None:
    now = 10.0
    for _ in range(20):
        now += FOLLOW_PERIOD * 1.01
        view.step(now)
    before = messages(server)
    for _ in range(30):
        now += FOLLOW_PERIOD * 1.01
        view.step(now)
    # Two poses, each written twice, once a second; browsers see the last of each.
    assert 8 <= messages(server) - before <= 16
    assert view.gizmo.control.wxyz[0] >= 0.0


def test_the_gizmo_is_pale_while_motion_is_not_enabled(view: SceneView, link: Recorder) -> None:
    view.step(10.0)
    ready = view.gizmo.control.opacity
    link.record["outcome"]["state"]["safety"] = Safety.PAUSED
    view.step(20.0)
    assert view.gizmo.control.opacity < ready
