"""Everything that must stop the robot does, wherever the keyboard's focus is."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import expect

from tests.browser_tests.conftest import Seat
from tests.browser_tests.console_page import JSON, SLOW_S, ConsolePage
from tests.browser_tests.test_driving import follow, tip_of
from tests.server.console_process import ConsoleProcess, eventually

PAUSED_WITHIN_S = 2.0
PULLS = 5


def stands(console: ConsoleProcess) -> JSON:
    """Wait until the tip stands; it must then go on standing."""
    tips = [tip_of(console.state())]

    def stood() -> bool:
        time.sleep(0.2)
        tips.append(tip_of(console.state()))
        return bool(np.linalg.norm(tips[-1] - tips[-2]) < 1e-3)

    eventually(stood, "the tip stands", SLOW_S)
    for _ in range(3):
        stood()
        assert tips[-1] == pytest.approx(tips[-2], abs=1e-3)
    return console.state()


def press_key_in_scene(operator: ConsolePage) -> None:
    operator.focus_scene()
    operator.page.keyboard.press("Escape")


def press_key_on_page(operator: ConsolePage) -> None:
    operator.page.locator("h1").click()
    operator.page.keyboard.press("Escape")


def press_button(operator: ConsolePage) -> None:
    operator.page.locator("#emergency-stop").click()


@pytest.mark.parametrize("press", [press_button, press_key_in_scene, press_key_on_page])
def test_the_emergency_stop_ends_all_motion(
    operator: ConsolePage, console: ConsoleProcess, press: Callable[[ConsolePage], None]
) -> None:
    assert operator.call("POST", "/path", {"experiment": "circle"}) == 200
    eventually(lambda: console.state()["path"]["progress"] > 0.03, "the path plays", SLOW_S)
    press(operator)
    state = eventually(
        lambda: (state := console.state())["safety"]["state"] == "FAULT" and state, "FAULT", SLOW_S
    )
    assert state["safety"]["reason_code"] == "emergency_stop"
    stopped = stands(console)
    assert stopped["path"] is None
    expect(operator.page.locator("#banner")).to_be_visible()
    assert operator.button("Enable").get_attribute("aria-disabled") == "true"

    operator.button("Reset").click()
    operator.until("DISABLED")
    assert tip_of(console.state()) == pytest.approx(tip_of(stopped), abs=0.01)
    expect(operator.page.locator("#banner")).to_be_hidden()


def moved_mm(console: ConsoleProcess, start: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(np.subtract(tip_of(console.state()), start)))


def comes_true(condition: Callable[[], bool], within_s: float) -> bool:
    ends = time.monotonic() + within_s
    while time.monotonic() < ends:
        if condition():
            return True
        time.sleep(0.02)
    return False


def test_hold_to_move_follows_the_key_while_the_scene_has_the_focus(
    operator: ConsolePage, console: ConsoleProcess
) -> None:
    operator.page.get_by_role("switch", name="Hold-to-move").check()

    def hold() -> bool:
        return bool(console.state()["hold"])

    eventually(
        lambda: operator.shown()["teleoperation"]["hold_to_move"], "hold-to-move is on", SLOW_S
    )
    start = tip_of(console.state())
    operator.focus_scene()
    with operator.pulling(0, 6.0):
        stands(console)
        assert tip_of(console.state()) == pytest.approx(start, abs=0.01)
    eventually(lambda: not console.state()["engaged"], "the gizmo is let go", SLOW_S)
    eventually(operator.gizmo_is_at_the_tip, "the gizmo is put back", SLOW_S)

    operator.page.keyboard.down("Space")
    # A browser that draws in software may stall for longer than a held key counts. The clutch then
    # closes anew where the mouse is, as it must, and one pulls once more.
    seen: list[JSON] = []
    for _ in range(PULLS):
        eventually(hold, "the key is held", SLOW_S)
        with operator.pulling(0, 6.0):
            if not comes_true(lambda: moved_mm(console, start) > 3.0, SLOW_S / PULLS):
                seen.append(console.state())
                continue
            operator.page.keyboard.up("Space")
            eventually(lambda: not hold(), "the key is up", SLOW_S)
            held = tip_of(stands(console))
            operator.page.mouse.move(*operator.pixel(0, 0.05))
            assert tip_of(stands(console)) == pytest.approx(held, abs=0.01)
            break
    else:
        words = [(one["safety"]["reason"], one["hold"], one["engaged"]) for one in seen]
        pytest.fail(f"the tip did not move with the key held: {words}")
    assert console.state()["safety"]["state"] == "ENABLED"


def test_the_mouse_button_ends_a_drag_whose_end_the_scene_forgets(
    operator: ConsolePage, console: ConsoleProcess
) -> None:
    def take() -> None:
        operator.take_and_forget()
        eventually(lambda: operator.leading()["engaged"], "the gizmo leads", SLOW_S)

    operator.despite_stalls(take)
    operator.focus_scene()
    eventually(lambda: not console.state()["engaged"], "the gizmo is let go", SLOW_S)
    follow(operator, axis=0, distance_mm=6.0, scale=1.0)


def test_a_page_closed_in_a_drag_pauses_the_robot_and_one_can_come_back(
    operator: ConsolePage, console: ConsoleProcess, seat: Seat
) -> None:

    def pull_and_close() -> None:
        start = tip_of(console.state())
        with operator.pulling(0, 8.0):
            eventually(
                lambda: np.linalg.norm(tip_of(operator.leading()) - start) > 2.0,
                "the tip moves",
                SLOW_S,
            )
            operator.page.close()

    operator.despite_stalls(pull_and_close)
    closed = time.monotonic()
    state = eventually(
        lambda: (state := console.state())["safety"]["state"] == "PAUSED" and state,
        "PAUSED after the page was closed",
        PAUSED_WITHIN_S,
    )
    assert time.monotonic() - closed < PAUSED_WITHIN_S
    assert not state["engaged"]
    stands(console)

    again = seat.page()
    assert again.page is not operator.page
    again.take_control()
    again.until("PAUSED")
    again.enable()
    follow(again, axis=0, distance_mm=-6.0, scale=1.0)
