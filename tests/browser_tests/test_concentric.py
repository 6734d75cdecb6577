"""The second robot in a real browser: chosen on the page, driven, and left again."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Browser, TimeoutError, expect

from tests.browser_tests.conftest import VIEWPORT, Complaints
from tests.browser_tests.console_page import SCENE_S, SLOW_S, ConsolePage
from tests.browser_tests.test_driving import tip_of
from tests.browser_tests.test_page import layout_faults
from tests.configured import LATE_TICKS, configured
from tests.server.console_process import ConsoleProcess, eventually

METHODS = {
    "1": "NSPWLN, as printed",
    "2": "NSPWLN, repaired",
    "3": "NSPQP",
    "4": "SNSQP",
    "5": "HQP",
}
PULL_MM = 6.0
CHOICE_MS = 2000.0
COMPILED_S = 300.0
"""The first start of a new version compiles the controller."""


def choose_robot(page: ConsolePage, robot: str) -> None:
    """Choose it on the page and wait until the page is that robot's."""
    chooser = page.page.get_by_role("combobox", name="Robot", exact=True)
    cover = page.page.locator("#lost-title")

    def starting() -> bool:
        # A page that loads its scene without a graphics card stalls, and may lose its lease.
        page.take_control()
        if chooser.is_enabled():
            with contextlib.suppress(TimeoutError):
                chooser.select_option(robot, timeout=CHOICE_MS)
        page.page.wait_for_timeout(200)
        return "Starting: " in cover.inner_text() or driven() == robot

    def driven() -> object:
        return page.page.locator("body").get_attribute("data-driven")

    eventually(starting, f"{robot} is being started", 4.0 * SLOW_S)
    eventually(lambda: driven() == robot, f"the page is that of {robot}", SCENE_S)
    page.robot = robot
    eventually(lambda: page.state().get("control") == "running", "it runs", COMPILED_S)
    page.until("DISABLED")


@pytest.fixture(scope="module")
def seated(
    browser: Browser, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[ConsolePage, Complaints]]:
    """A page on which the second robot was chosen in place of the first."""
    folder = tmp_path_factory.mktemp("concentric")
    patient = configured(folder, LATE_TICKS)
    with ConsoleProcess(folder, *patient, "--plant", "kinematic") as console:
        console.wait_until_running()
        context = browser.new_context(viewport=VIEWPORT, color_scheme="light")  # type: ignore[arg-type]
        context.set_default_timeout(SLOW_S * 1e3)
        complaints = Complaints(console.base)
        complaints.watch(context)
        page = ConsolePage(context, console)
        expect(page.page.get_by_role("combobox", name="Robot", exact=True)).to_be_disabled()
        choose_robot(page, "concentric")
        page.wait_for_scene()
        # While the console starts anew, requests of the old page fail.
        complaints.found.clear()
        yield page, complaints
        context.close()


@pytest.fixture
def arms(seated: tuple[ConsolePage, Complaints]) -> Iterator[ConsolePage]:
    """The page that drives enabled arms; nothing on it may fail."""
    page, complaints = seated
    page.take_control()
    page.enable()
    yield page
    found, complaints.found = complaints.found, []
    assert not found


def test_the_page_has_what_this_robot_has(arms: ConsolePage) -> None:
    page = arms.page
    expect(page.get_by_role("radiogroup", name="Method")).to_be_visible()
    expect(page.get_by_role("radio", name="HQP")).to_be_checked()
    for gone in ("#priority", "#trocar-group", "#withdraw", "#lock-rotation", "#plot-rcm"):
        assert page.locator(gone).count() == 0
    for plot in ("relative", "position", "tubes-A", "tubes-B", "stability"):
        expect(page.locator(f"#plot-{plot}")).to_be_visible()
    expect(page.locator("#now-tube-A-1")).to_have_text("−100.0")
    expect(page.locator("#now-tube-A-4")).to_be_hidden()
    expect(page.locator("#translation-B-3")).to_have_text("−30.0")
    expect(page.get_by_role("combobox", name="Robot", exact=True)).to_be_disabled()
    why = "Disable the robot first."
    expect(page.locator(".robot-choice")).to_have_attribute("data-why", why)
    page.keyboard.press("u")
    expect(page.locator(".toast").last).to_contain_text(why)


def test_both_arms_follow_the_arrow_that_the_mouse_pulls(arms: ConsolePage) -> None:
    start = arms.state()
    peak = arms.page.locator("#max-position")

    def lead() -> None:
        begun = tip_of(arms.state())
        with arms.pulling(0, PULL_MM):
            eventually(
                lambda: tip_of(arms.leading())[0] - begun[0] > 0.8 * PULL_MM,
                "A's tip follows",
                SLOW_S,
            )
            assert arms.leading()["leader"] == "gizmo"
            # The tip lags behind a target that moves; the plot has seen it.
            eventually(lambda: float(peak.inner_text().split()[-1]) > 0.01, "a peak", SLOW_S)

    arms.despite_stalls(lead)
    eventually(lambda: not arms.state()["engaged"], "the gizmo is let go", SLOW_S)
    after = arms.state()
    beside = [np.subtract(one["true_b"]["position_mm"], tip_of(one)) for one in (start, after)]
    assert beside[1] == pytest.approx(beside[0], abs=0.1)
    expect(arms.page.locator("#in-place-text")).to_have_text("B in its place")


def test_the_method_is_chosen_by_click_and_by_key(arms: ConsolePage) -> None:
    page = arms.page
    page.get_by_text("SNSQP", exact=True).click()
    eventually(lambda: arms.state()["method"] == "snsqp", "snsqp", SLOW_S)
    for key in "12345":
        page.keyboard.press(key)
        expect(page.get_by_role("radio", name=METHODS[key], exact=False).first).to_be_checked()
    eventually(lambda: arms.state()["method"] == "hqp", "hqp", SLOW_S)


def test_a_path_plays_in_a_layout_without_faults(arms: ConsolePage) -> None:
    page = arms.page
    listed = page.get_by_label("Experiment").locator("option")
    assert listed.evaluate_all("all => all.map((one) => one.value)")[:2] == [
        "rectangle",
        "lissajous",
    ]
    page.get_by_label("Experiment").select_option("rectangle")
    arms.button("Play path").click()
    arms.button("Start recording").click()
    eventually(lambda: arms.shown()["recording"], "it records", SLOW_S)
    for size, theme in (((1000, 700), "light"), ((1920, 1080), "dark")):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        page.emulate_media(color_scheme="dark" if theme == "dark" else "light")
        assert layout_faults(page) == []
    page.set_viewport_size({"width": VIEWPORT["width"], "height": VIEWPORT["height"]})
    page.emulate_media(color_scheme="light")
    eventually(lambda: arms.shown()["path"]["progress"] > 0.05, "it goes on", SLOW_S)
    state = arms.state()
    assert state["leader"] == "path"
    assert state["errors"]["relative_mm"] < 0.05
    page.keyboard.press("l")
    eventually(lambda: not arms.shown()["recording"], "it has ended", SLOW_S)


def test_the_emergency_stop_ends_the_motion(arms: ConsolePage) -> None:
    if arms.state()["path"] is None:
        assert arms.call("POST", "/path", {"experiment": "rectangle"}) == 200
    arms.focus_scene()
    arms.page.keyboard.press("Escape")
    arms.until("FAULT")
    stood = tip_of(arms.state())
    time.sleep(0.3)
    assert tip_of(arms.state()) == pytest.approx(stood, abs=1e-3)
    arms.page.keyboard.press("r")
    arms.until("DISABLED")


def test_the_first_robot_comes_back(seated: tuple[ConsolePage, Complaints]) -> None:
    page, complaints = seated
    page.page.keyboard.press("x")
    page.until("DISABLED")
    choose_robot(page, "instrument")
    expect(page.page.get_by_role("radiogroup", name="Priority")).to_be_visible()
    assert page.page.locator("#method").count() == 0
    assert page.shown()["robot"] == "instrument"
    complaints.found.clear()
