"""Trocar, boards, compensation and withdrawal, as a person uses them on the page."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import expect

from tests.browser_tests.console_page import SLOW_S, ConsolePage
from tests.browser_tests.test_page import layout_faults
from tests.server.console_process import eventually

OPEN = "(open) => document.querySelectorAll('details').forEach((one) => { one.open = open; })"


@pytest.fixture
def disabled(operator: ConsolePage) -> Iterator[ConsolePage]:
    """The operator's page with every folded part open and the robot disabled."""
    assert operator.call("POST", "/disable") == 200
    operator.until("DISABLED")
    operator.page.evaluate(OPEN, True)
    yield operator
    operator.page.evaluate(OPEN, False)
    assert operator.call("POST", "/disable") in (200, 409)
    assert operator.call("POST", "/trocar", {"method": "configuration"}) == 200
    assert operator.call("PUT", "/board", {"name": "pegboard"}) == 200


def test_the_folded_parts_are_laid_out_well(disabled: ConsolePage) -> None:
    page = disabled.page
    page.locator("#tracker-words").scroll_into_view_if_needed()
    assert layout_faults(page) == []
    page.emulate_media(color_scheme="dark")
    assert layout_faults(page) == []
    page.emulate_media(color_scheme="light")


def test_the_trocar_is_entered_and_taken_back(disabled: ConsolePage) -> None:
    page = disabled.page
    page.locator("#trocar-y").fill("1,5")
    disabled.button("Register this place").click()
    eventually(lambda: disabled.shown()["trocar"]["method"] == "enter", "registered", SLOW_S)
    assert disabled.shown()["trocar_mm"] == [400.0, 1.5, 120.0]
    # The shaft leans as the tests before have left it.
    words = re.compile(r"Entered, 1\.\d\d mm from the shaft")
    expect(page.locator("#trocar-words")).to_contain_text(words)
    page.locator("#trocar-y").fill("much")
    disabled.button("Register this place").click()
    expect(page.locator(".toast").last).to_contain_text("Enter x, y and z as numbers")
    disabled.button("Configured").click()
    eventually(lambda: disabled.shown()["trocar_mm"] == [400.0, 0.0, 120.0], "as before", SLOW_S)
    expect(page.locator("#trocar-y")).to_have_value("0.00")


def test_a_touched_trocar_says_what_is_missing(disabled: ConsolePage) -> None:
    disabled.button("Tip touches it").click()
    expect(disabled.page.locator(".toast").last).to_contain_text("Insert it before you enable")
    disabled.button("Enable").click()
    expect(disabled.page.locator(".toast").last).to_contain_text("does not go through the trocar")
    assert disabled.shown()["safety"]["state"] == "DISABLED"


def test_an_experiment_offers_its_board(disabled: ConsolePage) -> None:
    page = disabled.page
    page.locator("#experiment").select_option("ring-board")
    expect(page.locator("#board-needed")).to_contain_text("Ring board")
    disabled.button("Put it there").click()
    eventually(lambda: disabled.shown()["board"] == "ring-board", "the board is there", SLOW_S)
    expect(page.locator("#board-offer")).to_be_hidden()
    expect(page.locator("#rings")).to_have_text("Rings 0 of 6")
    expect(page.locator("#contact-text")).to_have_text("No contact")
    disabled.enable()
    expect(page.locator("#board")).to_be_disabled()
    page.locator("#experiment").select_option("circle")


def test_compensation_and_tracker_are_chosen(disabled: ConsolePage) -> None:
    page = disabled.page
    page.locator("#compensation").select_option("gain")
    eventually(lambda: disabled.shown()["compensation"] == "gain", "chosen", SLOW_S)
    page.get_by_role("switch", name="Use the tip tracker").click()
    eventually(lambda: disabled.shown()["tracker"]["on"], "switched on", SLOW_S)
    assert disabled.call("PUT", "/compensation", {"mode": "full", "tracker": False}) == 200


def test_withdrawal_by_its_key_and_its_end_by_pause(operator: ConsolePage) -> None:
    operator.page.locator("h1").click()
    operator.page.keyboard.press("b")
    state = eventually(
        lambda: operator.shown()["path"] and operator.shown(), "the path plays", SLOW_S
    )
    assert state["path"]["name"] == "withdrawal"
    expect(operator.page.locator("#path-text")).to_contain_text("withdrawal")
    operator.button("Pause").click()
    operator.until("PAUSED")
    eventually(lambda: operator.shown()["path"] is None, "it has ended", SLOW_S)
