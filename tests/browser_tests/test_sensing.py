"""Sensing on the page of a robot with tension cells: shape, force, tensions, and the switch."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, expect

from robot.calibration import Calibration
from robot.configuration import Configuration
from server.calibration.file import default_path, save
from server.configuration_file import load
from tests.browser_tests.conftest import VIEWPORT, Complaints
from tests.browser_tests.console_page import SLOW_S, ConsolePage
from tests.browser_tests.test_page import layout_faults
from tests.configured import LATE_TICKS, configured
from tests.server.console_process import ConsoleProcess, eventually

BARS = "[1, 2, 3, 4].map((n) => document.getElementById(`tension-${n}`).previousSibling)"
FILLED = f"() => {BARS}.map((bar) => bar.hidden ? 0 : bar.firstChild.getBoundingClientRect().width)"
INKED = """() => {
  const canvas = document.getElementById("plot-force");
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const [r, g, b] = [0x8a, 0x10, 0x60];
  let count = 0;
  for (let i = 0; i < data.length; i += 4) {
    const off = Math.abs(data[i] - r) + Math.abs(data[i + 1] - g) + Math.abs(data[i + 2] - b);
    count += data[i + 3] > 200 && off < 60;
  }
  return count;
}"""


def with_tension_unit() -> Configuration:
    """What the console is started with."""
    configuration = load()
    unit = configuration.simulation.model_copy(update={"actuation": "tension-unit"})
    return configuration.model_copy(update={"simulation": unit})


@pytest.fixture
def watching(
    browser: Browser, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[ConsolePage, Complaints]]:
    """The page of a robot with tension cells that is taken as ideal, which spares its sweep."""
    folder = tmp_path_factory.mktemp("sensing")
    kept = folder / "state" / "keyhole" / "calibration" / default_path(with_tension_unit()).name
    save(kept, Calibration())
    patient = configured(folder, LATE_TICKS)
    with ConsoleProcess(folder, *patient, "--actuation", "tension-unit") as console:
        console.wait_until_running()
        context = browser.new_context(viewport=VIEWPORT, color_scheme="light")  # type: ignore[arg-type]
        context.set_default_timeout(SLOW_S * 1e3)
        complaints = Complaints(console.base)
        complaints.watch(context)
        yield ConsolePage(context, console), complaints
        context.close()


def held_at(operator: ConsolePage, level: float) -> Any:
    """What the tendons hold, once two of them have come to that tension; enables as often as need
    be: on a busy machine a late tick pauses the robot.
    """
    shown = operator.shown()
    if shown["safety"]["state"] != "ENABLED":
        operator.page.get_by_role("button", name="Enable").click()
        return None
    tendons = shown["tendons"]
    pairs = [
        (wanted, tension)
        for wanted, tension in zip(tendons["wanted_n"], shown["tension_n"], strict=True)
        if wanted is not None
    ]
    there = [wanted > level - 0.01 and abs(tension - wanted) < 0.6 for wanted, tension in pairs]
    return tendons if len(pairs) == 2 and all(there) else None


def test_shape_force_and_tensions_are_shown_and_switched_off(
    watching: tuple[ConsolePage, Complaints],
) -> None:
    operator, complaints = watching
    page = operator.page
    expect(page.locator("#sensing-state")).to_have_text("Valid", timeout=SLOW_S * 1e3)
    shown = eventually(lambda: operator.shown()["sensing"]["valid"] and operator.shown(), "valid")
    assert shown["actuation"] == "tension-unit"
    assert "tension unit" in page.locator("#sensing-group").inner_text()
    for tendon in range(1, 5):
        expect(page.locator(f"#tension-{tendon}")).not_to_have_text("–")
    assert min(page.evaluate(FILLED)) > 3.0
    expect(page.locator("#force")).not_to_have_text("–")
    expect(page.locator("#force-deviation")).to_contain_text("±")
    expect(page.locator("#plot-force")).to_be_visible()
    eventually(lambda: page.evaluate(INKED) > 20, "the force is plotted", SLOW_S)
    expect(page.locator("#tip-estimated-x")).not_to_have_text("–")
    assert layout_faults(page) == []

    operator.take_control()
    page.locator("h1").click()
    page.keyboard.press("y")
    expect(page.locator("#sensing-state")).to_have_text("Sensing is off.")
    expect(page.locator("#force")).to_have_text("–")
    expect(page.locator("#tip-estimated-x")).to_have_text("–")
    expect(page.locator("#tension-1")).not_to_have_text("–")
    page.get_by_role("switch", name="Sensing").click()
    expect(page.locator("#sensing-state")).to_have_text("Valid")

    page.locator("#instrument-group > summary").click()
    expect(page.locator("#co-contraction")).to_be_disabled()
    page.locator("#tendon-control").select_option("hybrid")
    expect(page.locator("#co-contraction")).to_be_enabled()
    page.locator("#co-contraction").fill("12")
    page.locator("#co-contraction").press("Enter")
    expect(page.locator("#toasts")).to_contain_text("at most 8.44 N")
    page.locator("#co-contraction").fill("3")
    page.locator("#co-contraction").press("Enter")
    held = eventually(lambda: held_at(operator, 3.0), "tensions are held at 3 N", SLOW_S)
    loose = held["holds"].index("tension")
    row = page.locator(f"#tension-{loose + 1}").locator("..")
    expect(row).to_have_attribute("data-tip", re.compile(r"holds its tension at [34]\.\d\d N"))
    expect(page.locator("#tendon-words")).to_contain_text("mN m/rad")
    assert layout_faults(page) == []
    assert complaints.found == []


def test_a_robot_without_tension_cells_says_so(
    fresh_context: BrowserContext, console: ConsoleProcess
) -> None:
    page = ConsolePage(fresh_context, console).page
    expect(page.locator("#sensing-state")).to_have_text("This robot measures no tendon tension.")
    expect(page.locator("#tension-1")).to_have_text("–")
    expect(page.locator("#plot-force")).to_be_hidden()
    expect(page.locator("#tip-estimated-x")).to_be_hidden()
