"""A second browser sees everything and moves nothing."""

from __future__ import annotations

import re

import numpy as np
import pytest
from playwright.sync_api import BrowserContext, expect

from tests.browser_tests.console_page import SLOW_S, ConsolePage
from tests.browser_tests.test_driving import tip_of
from tests.server.console_process import ConsoleProcess, eventually


@pytest.fixture
def watcher(fresh_context: BrowserContext, console: ConsoleProcess) -> ConsolePage:
    """Another person's browser, with the token and a scene of its own."""
    page = ConsolePage(fresh_context, console)
    page.wait_for_scene()
    return page


def test_a_second_browser_watches_and_cannot_drive(
    operator: ConsolePage, watcher: ConsolePage, console: ConsoleProcess
) -> None:
    operator.settle()
    page = watcher.page
    watcher.until("ENABLED")
    expect(page.locator("#operator-role")).to_have_text("Watching")
    name = console.state()["operator"]["name"]
    expect(page.locator("#watcher-note")).to_contain_text(name)
    for button in ("Disable", "Play path", "Align with view"):
        expect(page.get_by_role("button", name=button)).to_have_attribute("aria-disabled", "true")
    for control in page.locator("input.drive, select.drive").all():
        expect(control).to_be_disabled()
    expect(page.locator("#emergency-stop")).to_be_enabled()
    watcher.button("Ask for control").click()
    asks = operator.page.locator("#hand-over-title")
    expect(asks).to_contain_text("asks for control")
    operator.page.get_by_role("button", name="Decline").click()
    expect(asks).to_be_hidden()
    expect(page.locator("#operator-role")).to_have_text("Watching")

    start, drawn = tip_of(console.state()), np.array(watcher.gizmo_mm())
    x, y = watcher.pixel(0, 0.053)
    with watcher.pulling(0, 8.0):
        nudges = iter(range(10_000))

        def drawn_elsewhere() -> bool:
            # Its own picture follows the mouse, until it is put back where the robot is.
            page.mouse.move(x + next(nudges) % 2, y)
            return bool(np.linalg.norm(np.array(watcher.gizmo_mm()) - drawn) > 4.0)

        eventually(drawn_elsewhere, "the watcher's own picture follows its mouse", SLOW_S)
        assert not console.state()["engaged"]
    eventually(
        lambda: np.allclose(watcher.gizmo_mm(), drawn, atol=0.2), "the gizmo is put back", SLOW_S
    )
    page.keyboard.press("x")
    state = console.state()
    assert tip_of(state) == pytest.approx(start, abs=1e-3)
    assert state["safety"]["state"] == "ENABLED", state["safety"]
    assert state["operator"]["name"] == name


def test_the_api_refuses_a_watcher_to_drive(
    operator: ConsolePage, fresh_context: BrowserContext, console: ConsoleProcess
) -> None:
    fresh_context.request.get(f"{console.base}/?token={console.token}")
    start = tip_of(console.state())
    for path, body in (
        ("/target", {"position_mm": [start[0] + 2.0, start[1], start[2]]}),
        ("/leader", {"position_mm": [0, 0, 0], "orientation_wxyz": [1, 0, 0, 0], "clutch": True}),
        ("/path", {"experiment": "circle"}),
        ("/disable", None),
    ):
        answer = fresh_context.request.post(f"{console.base}{console.robot_path}{path}", data=body)
        assert answer.status == 403
        assert answer.json()["code"] == "not_the_operator"
    priority = f"{console.base}{console.robot_path}/priority"
    answer = fresh_context.request.put(priority, data={"case": "2"})
    assert answer.status == 403
    state = console.state()
    assert tip_of(state) == pytest.approx(start, abs=1e-3)
    assert state["safety"]["state"] == "ENABLED", state["safety"]
    assert state["priority"]["case"] == "1"
    assert operator.shown()["operator"]["you"]


def test_control_goes_from_browser_to_browser_in_sight_of_both(
    operator: ConsolePage, watcher: ConsolePage, console: ConsoleProcess
) -> None:
    operator.settle()
    watcher.button("Ask for control").click()
    expect(watcher.page.locator("#hand-over-title")).to_contain_text("You asked")
    operator.page.locator("#hand-over-yes").click()
    expect(operator.page.locator("#hand-over-title")).to_contain_text("Control is offered to")
    operator.until("PAUSED")
    enable = operator.button("Enable")
    expect(enable).to_have_attribute("data-why", re.compile("withdraw the offer"))
    watcher.button("Take over").click()
    expect(watcher.page.locator("#operator-role")).to_have_text("You drive")
    expect(operator.page.locator("#operator-role")).to_have_text("Watching")
    assert console.state()["safety"]["state"] == "PAUSED"
    watcher.enable()
    watcher.button("Release").click()


def test_a_fault_can_be_tried_and_stands_among_the_events(
    operator: ConsolePage, console: ConsoleProcess
) -> None:
    page = operator.page
    operator.button("Devices").click()
    expect(operator.button("Home")).to_have_attribute("data-why", re.compile("simulated"))
    page.locator("#fault").select_option("bus-lost")
    page.locator("#fault-inject").click()
    operator.until("PAUSED")
    expect(page.locator("#readiness")).to_contain_text("A device is not connected.")
    expect(operator.button("Enable")).to_have_attribute("aria-disabled", "true")
    page.locator("#fault-mend").click()
    expect(page.locator("#readiness")).to_contain_text("Devices ready")
    page.keyboard.press("j")
    expect(page.locator("#events li").filter(has_text="the servo bus is gone")).to_have_count(1)
    page.keyboard.press("j")
    operator.enable()
    assert console.state()["safety"]["state"] == "ENABLED"


def test_a_part_of_the_page_that_fails_takes_no_other_with_it(
    operator: ConsolePage, console: ConsoleProcess
) -> None:
    page = operator.page
    # What one part writes into is gone.
    page.evaluate("() => document.getElementById('contact-text').remove()")
    expect(page.get_by_role("alert").filter(has_text="A part of this page failed")).to_be_visible()
    tick = operator.shown()["tick"]
    eventually(lambda: operator.shown()["tick"] > tick + 50, "the page goes on", SLOW_S)
    assert console.state()["safety"]["state"] == "ENABLED"
    page.locator("#emergency-stop").click()
    operator.until("FAULT")
    page.reload()
    eventually(lambda: operator.page.evaluate("() => window.keyhole?.state ?? null"), "it is back")
    operator.wait_for_scene()
