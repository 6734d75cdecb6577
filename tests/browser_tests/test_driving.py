"""The operator drives: what the mouse and the keys do on the page is seen through the API."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import FilePayload, expect

from robot.rotations import matrix_from_quaternion
from tests.browser_tests.console_page import JSON, SLOW_S, ConsolePage
from tests.server.console_process import ConsoleProcess, eventually

CASES = {"0": "Balanced", "1": "Linear first", "2": "Angular first", "pointing": "Pointing"}
BROKEN_CSV = b"""time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz
0,0,0,0,1,0,0,0
1,0,five,0,1,0,0,0
"""


def tip_of(state: JSON) -> NDArray[np.float64]:
    return np.array(state["true"]["position_mm"])


def axis_of(state: JSON, axis: int) -> NDArray[np.float64]:
    """Where an arrow of the gizmo points, base frame."""
    rotation = np.empty((3, 3))
    matrix_from_quaternion(np.array(state["commanded"]["orientation_wxyz"]), rotation)
    direction: NDArray[np.float64] = rotation[:, axis]
    return direction


def follow(
    operator: ConsolePage, axis: int, distance_mm: float, scale: float
) -> NDArray[np.float64]:
    """Pull an arrow; the tip must come after it by ``scale``. Returns how the tip moved, mm."""
    return operator.despite_stalls(lambda: follow_once(operator, axis, distance_mm, scale))


def follow_once(
    operator: ConsolePage, axis: int, distance_mm: float, scale: float
) -> NDArray[np.float64]:
    """:func:`follow` with a browser that does not stall."""
    console = operator.console
    before = console.state()
    start, drawn_before = tip_of(before), np.array(operator.gizmo_mm())
    assert drawn_before == pytest.approx(start, abs=0.2)
    with operator.pulling(axis, distance_mm):

        def there() -> JSON | None:
            state = operator.leading()
            pulled = np.array(operator.gizmo_mm()) - drawn_before
            assert state["errors"]["rcm_mm"] < 0.01
            near = np.linalg.norm(tip_of(state) - start - scale * pulled) < 0.05
            return state if near and np.linalg.norm(pulled) > 0.5 * abs(distance_mm) else None

        state = eventually(there, "the tip is where the gizmo was pulled", SLOW_S)
        assert state["engaged"]
        assert state["leader"] == "gizmo"
    eventually(lambda: not console.state()["engaged"], "the gizmo is let go", SLOW_S)
    after = console.state()
    moved = tip_of(after) - start
    along = float(moved @ axis_of(before, axis))
    assert along == pytest.approx(scale * distance_mm, abs=0.1 * abs(scale * distance_mm))
    assert np.linalg.norm(moved - along * axis_of(before, axis)) < 0.1
    assert after["errors"]["position_mm"] < 0.05
    assert after["errors"]["rcm_mm"] < 0.01
    eventually(operator.gizmo_is_at_the_tip, "the gizmo is back at the tip", SLOW_S)
    return moved


def test_the_tip_follows_the_arrow_that_the_mouse_pulls(operator: ConsolePage) -> None:
    there = follow(operator, axis=0, distance_mm=10.0, scale=1.0)
    back = follow(operator, axis=0, distance_mm=-10.0, scale=1.0)
    assert np.linalg.norm(there + back) < 2.0


def test_a_motion_scale_of_one_half_halves_the_motion(operator: ConsolePage) -> None:
    slider = operator.page.get_by_label("Motion scale")
    slider.fill("624")

    def scale() -> float:
        return float(operator.console.state()["teleoperation"]["motion_scale"])

    eventually(lambda: scale() == 0.5, "the scale is 0.5", SLOW_S)
    expect(operator.page.locator("#motion-scale-value")).to_have_text("0.50 ×")
    follow(operator, axis=0, distance_mm=10.0, scale=0.5)
    follow(operator, axis=0, distance_mm=-10.0, scale=0.5)


def test_the_case_is_chosen_by_click_and_by_key(
    operator: ConsolePage, console: ConsoleProcess
) -> None:
    def chosen(case: str) -> None:
        state = console.state
        eventually(lambda: state()["priority"]["case"] == case, f"case {case}", SLOW_S)
        expect(operator.page.get_by_role("radio", name=CASES[case])).to_be_checked()

    for case in ("2", "0", "pointing", "1"):
        operator.page.get_by_text(CASES[case], exact=True).click()
        chosen(case)
    for focus in (operator.focus_scene, operator.page.locator("h1").click):
        focus()
        for key, case in (("1", "0"), ("3", "2"), ("4", "pointing"), ("2", "1")):
            operator.page.keyboard.press(key)
            chosen(case)


def test_a_path_plays_and_its_progress_is_shown(
    operator: ConsolePage, console: ConsoleProcess
) -> None:
    start = tip_of(console.state())
    operator.page.get_by_label("Experiment").select_option("circle")
    operator.button("Play path").click()
    progress = operator.page.get_by_label("Progress of the path")

    def state_at(share: float) -> JSON:
        shown = lambda: progress.evaluate("bar => bar.value") > share  # noqa: E731
        eventually(shown, f"{share} of the path is shown", SLOW_S)
        return console.state()

    shown = [state_at(0.05), state_at(0.15)]
    assert all(state["path"]["name"] == "circle" for state in shown)
    assert all(state["leader"] == "path" for state in shown)
    assert shown[1]["path"]["progress"] > shown[0]["path"]["progress"] > 0.05
    assert np.linalg.norm(tip_of(shown[1]) - start) > 5.0
    assert all(state["errors"]["position_mm"] < 0.01 for state in shown)
    assert all(state["errors"]["rcm_mm"] < 0.001 for state in shown)
    expect(operator.page.locator("#path-text")).to_contain_text("%")

    operator.button("Stop path").click()
    eventually(lambda: console.state()["path"] is None, "the path has ended", SLOW_S)
    expect(operator.page.locator("#path-text")).to_have_text("No path")


def test_a_broken_csv_is_refused_with_line_and_column(
    operator: ConsolePage, console: ConsoleProcess
) -> None:
    start = tip_of(console.state())
    file = FilePayload(name="suture.csv", mimeType="text/csv", buffer=BROKEN_CSV)
    operator.page.get_by_label("Play a path from a CSV file").set_input_files(file)
    toast = operator.page.get_by_role("alert").filter(has_text="suture.csv")
    expect(toast).to_contain_text("line 3")
    expect(toast).to_contain_text("y_mm")
    expect(toast).to_contain_text("five")
    state = console.state()
    assert state["path"] is None
    assert state["safety"]["state"] == "ENABLED"
    assert tip_of(state) == pytest.approx(start, abs=0.01)
