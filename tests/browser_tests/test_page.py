"""The page itself: who is let in, what it says, how it is laid out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from tests.browser_tests.conftest import VIEWPORT, Complaints
from tests.browser_tests.console_page import SLOW_S, ConsolePage
from tests.server.console_process import ConsoleProcess, eventually

LAYOUT_FAULTS = (Path(__file__).parent / "layout_faults.js").read_text(encoding="utf-8")
SLIP_IN = """() => {
  const script = document.createElement("script");
  script.textContent = "window.slippedIn = 'a script'";
  document.body.append(script);
}"""
BREAKAGES = {
    "overlap": ("#reset span", "position: relative; left: 50px"),
    "too small": ("#freeze", "width: 6px; padding: 0; border: 0; overflow: hidden"),
    "cut": (".plots-bar", "transform: translateX(60px)"),
    "contrast": ("h1", "color: #e0e0e0"),
    "covered": ("#pause", "transform: translateX(-60px)"),
    "not whole on the screen": ("#help", "margin-right: -30px"),
    "wider than its button": ("#enable", "width: 30px"),
}


@pytest.mark.parametrize("query", ["", "?token=wrong"])
def test_without_the_token_a_page_tells_how_to_get_in(
    fresh_context: BrowserContext, console: ConsoleProcess, query: str
) -> None:
    page = fresh_context.new_page()
    answer = page.goto(f"{console.base}/{query}")
    assert answer is not None
    assert answer.status == 401
    expect(page.locator("h1")).to_have_text("This console needs its token")
    expect(page.locator("body")).to_contain_text("/?token=")
    assert not fresh_context.cookies()


def test_the_token_leaves_the_address_and_the_policy_is_in_force(
    fresh_context: BrowserContext, console: ConsoleProcess, complaints: Complaints
) -> None:
    page = fresh_context.new_page()
    answer = page.goto(f"{console.base}/?token={console.token}")
    assert answer is not None
    assert page.url == f"{console.base}/"
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "script-src 'self';" in policy
    cookie = fresh_context.cookies()[0]
    assert cookie["httpOnly"]
    assert cookie["sameSite"] == "Strict"
    page.evaluate(SLIP_IN)
    assert page.evaluate("() => window.slippedIn ?? 'nothing'") == "nothing"
    eventually(lambda: page.evaluate("1") and complaints.found, "the browser complains", SLOW_S)
    assert all("Content Security Policy" in one for one in complaints.found)
    complaints.found.clear()
    expect(page.get_by_text("Research software, not a medical device").first).to_be_visible()
    expect(page.locator("#safety-state")).not_to_have_text("CONNECTING")


def layout_faults(page: Page) -> list[str]:
    """What is wrong with the layout when it has come to rest."""
    ends = time.monotonic() + 5.0
    while True:
        found = page.evaluate(LAYOUT_FAULTS)
        assert isinstance(found, list)
        if not found or time.monotonic() > ends:
            return found
        page.wait_for_timeout(100)


@pytest.fixture
def sized(operator: ConsolePage) -> Iterator[Callable[[tuple[int, int], str], Page]]:
    """Gives the operator's page another size and theme for one test."""
    page = operator.page
    eventually(lambda: not page.locator(".toast").count(), "no message is shown", SLOW_S)

    def resize(size: tuple[int, int], theme: str) -> Page:
        page.set_viewport_size({"width": size[0], "height": size[1]})
        page.emulate_media(color_scheme="dark" if theme == "dark" else "light")
        return page

    yield resize
    resize((VIEWPORT["width"], VIEWPORT["height"]), "light")


@pytest.mark.parametrize(
    ("size", "theme"),
    [((1280, 800), "light"), ((1920, 1080), "dark")],
    ids=("1280x800-light", "1920x1080-dark"),
)
def test_nothing_overlaps_is_cut_or_pale(
    operator: ConsolePage,
    sized: Callable[[tuple[int, int], str], Page],
    size: tuple[int, int],
    theme: str,
) -> None:
    page = sized(size, theme)
    assert layout_faults(page) == []
    assert operator.call("POST", "/path", {"experiment": "circle"}) == 200
    eventually(lambda: operator.shown()["path"], "a path plays", SLOW_S)
    assert layout_faults(page) == []
    for pane in ("Devices", "Events"):
        operator.button(pane).click()
        expect(page.get_by_role("region", name=pane)).to_be_visible()
        assert layout_faults(page) == []
        operator.button(pane).click()
    operator.button("Help").click()
    expect(page.locator("#help-dialog")).to_be_visible()
    assert layout_faults(page) == []
    operator.button("Close").click()
    page.locator("#emergency-stop").click()
    operator.until("FAULT")
    assert layout_faults(page) == []
    operator.button("Release").click()
    expect(page.locator("#operator-role")).to_have_text("Watching")
    assert layout_faults(page) == []


def test_a_broken_layout_would_be_noticed(
    sized: Callable[[tuple[int, int], str], Page],
) -> None:
    page = sized((1280, 800), "light")
    set_style = "([where, style]) => { document.querySelector(where).style.cssText = style; }"
    assert layout_faults(page) == []
    for fault, (where, style) in BREAKAGES.items():
        page.evaluate(set_style, [where, style])
        found = page.evaluate(LAYOUT_FAULTS)
        page.evaluate(set_style, [where, ""])
        assert [words for words in found if words.startswith(fault)], (fault, found)


def test_the_documentation_of_the_api_needs_no_other_host(
    fresh_context: BrowserContext, console: ConsoleProcess
) -> None:
    page = fresh_context.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    fresh_context.request.get(f"{console.base}/?token={console.token}")
    page.goto(f"{console.base}/docs")
    expect(page.get_by_text("/api/v1/robots/instrument/emergency-stop")).to_be_visible()
    page.get_by_text("/api/v1/robots/instrument/lease", exact=True).first.click()
    expect(page.get_by_role("button", name="Execute")).to_be_visible()
    own = [url for url in asked if url.startswith(f"{console.base}/")]
    assert f"{console.base}/openapi.json" in own
    assert [url for url in asked if url not in own and not url.startswith("data:")] == []
