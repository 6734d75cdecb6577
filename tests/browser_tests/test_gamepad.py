"""A gamepad at the operator's browser, as scripts see one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import expect

from tests.browser_tests.console_page import SLOW_S, ConsolePage
from tests.server.console_process import ConsoleProcess, eventually

_PLUG = """() => {
  const buttons = Array.from({ length: 16 }, () => ({ pressed: false, value: 0 }));
  window.pad = { connected: true, axes: [0, 0, 0, 0], buttons };
  navigator.getGamepads = () => [null, window.pad];
}"""
_SEEN_MS = 500.0
_UNPLUG = "() => { navigator.getGamepads = () => [null]; }"
_HOLD = """([axes, held]) => {
  window.pad.axes = axes;
  window.pad.buttons[4] = { pressed: held, value: Number(held) };
}"""


@pytest.fixture
def gamepad(operator: ConsolePage) -> Iterator[ConsolePage]:
    """The page that drives, with a gamepad plugged in."""
    operator.page.evaluate(_PLUG)
    yield operator
    operator.page.evaluate(_UNPLUG)


def hold(page: ConsolePage, *, held: bool, right: float = 0.0, down: float = 0.0) -> None:
    """Bring the left stick there and the left shoulder button down or up."""
    page.page.evaluate(_HOLD, [[right, down, 0.0, 0.0], held])


def press(page: ConsolePage, *, down: float = 0.0) -> None:
    """Let the shoulder button go, so that the page sees it, and press it anew."""
    # A press counts if the page has seen it begin: it looks once in every drawn picture.
    hold(page, held=False)
    page.page.wait_for_timeout(_SEEN_MS)
    if page.state()["safety"]["state"] == "PAUSED":
        # A browser that draws in software stalls; a silent leader rightly pauses the robot.
        page.enable()
    hold(page, held=True, down=down)
    page.page.wait_for_timeout(_SEEN_MS)


def test_a_gamepad_moves_the_tip_while_a_button_is_held(
    gamepad: ConsolePage, console: ConsoleProcess
) -> None:
    expect(gamepad.page.locator("#gamepad")).to_contain_text("hold a shoulder button")
    start = np.array(console.state()["true"]["position_mm"])

    def moved() -> float:
        if not console.state()["engaged"]:
            press(gamepad, down=-0.6)
        return float((np.array(console.state()["true"]["position_mm"]) - start)[1])

    eventually(lambda: moved() > 3.0, "the stick pushed up leads the tip along y", SLOW_S)
    hold(gamepad, held=False, down=-0.6)
    eventually(lambda: not console.state()["engaged"], "the clutch opens", SLOW_S)
    way = np.array(console.state()["true"]["position_mm"]) - start
    assert np.linalg.norm(way[[0, 2]]) < 0.5


def test_a_gamepad_that_is_unplugged_while_it_leads_pauses(
    gamepad: ConsolePage, console: ConsoleProcess
) -> None:
    def leads_or_stalled() -> bool:
        press(gamepad)
        state = console.state()
        return bool(state["leader"] == "gamepad" or state["safety"]["state"] == "PAUSED")

    eventually(leads_or_stalled, "it leads", SLOW_S)
    gamepad.page.evaluate(_UNPLUG)
    gamepad.until("PAUSED")
    assert console.state()["safety"]["reason_code"] == "leader_stale"
    expect(gamepad.page.locator("#gamepad")).to_have_text("")
