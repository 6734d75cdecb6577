"""One console and one Chromium for all browser tests, and the browser's own complaints."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, BrowserContext, ConsoleMessage, sync_playwright

from tests import browser as chromium_browser
from tests.browser_tests.console_page import SLOW_S, ConsolePage
from tests.configured import LATE_TICKS, configured
from tests.server.console_process import ConsoleProcess

FOLDER = Path(__file__).parent
VIEWPORT = {"width": 1000, "height": 700}
# The first lets the scene's shared memory grow, the second spares the plots a slow path.
FLAGS = ("--disable-dev-shm-usage", "--disable-accelerated-2d-canvas")

# Chromium calls an answer of 4xx an error of the page, although pages ask for what is refused.
_REFUSED = re.compile(r"Failed to load resource: the server responded with a status of 4\d\d ")

NewContext = Callable[[], BrowserContext]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what needs no operator's page: its scene, drawn in software, slows every other.

    The items are those of all folders; the others stay where they are.
    """
    ours = [place for place, item in enumerate(items) if item.path.parent == FOLDER]
    ordered = sorted((items[place] for place in ours), key=_sits)
    for place, item in zip(ours, ordered, strict=True):
        items[place] = item


def _sits(item: pytest.Item) -> bool:
    return "seat" in getattr(item, "fixturenames", ())


class Complaints:
    """What no page may do: script errors, violated policies, requests to other hosts.

    Args:
        base: address of the console.
    """

    def __init__(self, base: str) -> None:
        self._host = urlsplit(base).netloc
        self.found: list[str] = []

    def watch(self, context: BrowserContext) -> None:
        """Listen to every page of the context."""
        context.on("console", self._said)
        context.on("weberror", lambda error: self.found.append(str(error.error)))
        context.on("request", lambda request: self._asked(request.url))

    def _said(self, message: ConsoleMessage) -> None:
        if message.type == "error" and not _REFUSED.match(message.text):
            self.found.append(f"{message.text} ({message.location['url']})")

    def _asked(self, url: str) -> None:
        parts = urlsplit(url)
        if parts.scheme not in ("data", "blob") and parts.netloc != self._host:
            self.found.append(f"a request to {url}")


@pytest.fixture(scope="package")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ConsoleProcess]:
    """Supervisor, control and web, running."""
    folder = tmp_path_factory.mktemp("browser")
    patient = configured(folder, LATE_TICKS)
    with ConsoleProcess(folder, *patient, "--plant", "kinematic") as running:
        running.wait_until_running()
        yield running


@pytest.fixture(scope="package")
def browser(chromium: str) -> Iterator[Browser]:
    """A Chromium without a window."""
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(
            executable_path=chromium, args=[*chromium_browser.ARGUMENTS, *FLAGS]
        )
        yield running
        running.close()


@pytest.fixture(scope="package")
def complaints(console: ConsoleProcess) -> Complaints:
    """Of all pages since the start."""
    return Complaints(console.base)


@pytest.fixture(autouse=True)
def nothing_to_complain_about(complaints: Complaints) -> Iterator[None]:
    """Every test fails whose pages gave reason to."""
    yield
    found, complaints.found = complaints.found, []
    assert not found


@pytest.fixture(scope="package")
def make_context(browser: Browser, complaints: Complaints) -> NewContext:
    """Makes a browser session of its own: no cookies, no storage."""

    def make() -> BrowserContext:
        context = browser.new_context(viewport=VIEWPORT, color_scheme="light")  # type: ignore[arg-type]
        context.set_default_timeout(SLOW_S * 1e3)
        complaints.watch(context)
        return context

    return make


@pytest.fixture
def fresh_context(make_context: NewContext) -> Iterator[BrowserContext]:
    """A browser session for one test."""
    context = make_context()
    yield context
    context.close()


class Seat:
    """The operator's browser. Its page is loaded once, since the scene takes its time.

    Args:
        context: the operator's session.
        console: serves the page.
    """

    def __init__(self, context: BrowserContext, console: ConsoleProcess) -> None:
        self._context, self._console = context, console
        self._page: ConsolePage | None = None

    def page(self) -> ConsolePage:
        """The operator's page with a scene that can be used; opened again if it was closed."""
        if self._page is None or self._page.page.is_closed():
            self._page = ConsolePage(self._context, self._console)
            self._page.wait_for_scene()
        return self._page


@pytest.fixture(scope="package")
def seat(make_context: NewContext, console: ConsoleProcess) -> Iterator[Seat]:
    """Where the operator sits."""
    context = make_context()
    yield Seat(context, console)
    context.close()


@pytest.fixture
def operator(seat: Seat) -> ConsolePage:
    """The page that drives an enabled robot that stands, with the settings as configured."""
    page = seat.page()
    page.settle()
    return page
