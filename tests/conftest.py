"""What every test may use: fixed seeds and the browser."""

from __future__ import annotations

import os
import random
import zlib

import numpy as np
import pytest

from tests import browser


@pytest.fixture(autouse=True)
def fixed_seeds() -> None:
    """Start every test from the same global seeds, whichever tests ran before it."""
    random.seed(0)
    np.random.seed(0)  # noqa: NPY002 - a library under test may draw from it


@pytest.fixture(autouse=True, scope="session")
def own_audit_log(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep what tests do out of the audit log of this user's robots."""
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """Random numbers that differ from test to test but never from run to run."""
    return np.random.default_rng(zlib.crc32(request.node.nodeid.encode()))


@pytest.fixture(scope="session")
def chromium() -> str:
    """Path of the Chromium that browser tests start with ``tests.browser.ARGUMENTS``."""
    path = browser.find()
    if path is None:
        pytest.fail(browser.advice())
    return path


@pytest.hookimpl(tryfirst=True)  # xdist reads the marks in the same hook
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep together on one processor what shares a console or a file's fixtures."""
    for item in items:
        fixtures = getattr(item, "fixturenames", ())
        place = item.nodeid.partition("::")[0]
        shared = "console" in fixtures
        if "browser_tests" in place:
            place = "browser"
        elif shared and place.startswith("tests/server/"):
            place = "console"
        item.add_marker(pytest.mark.xdist_group(place))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the checks that failed before pytest began, right above its closing line."""
    failed = os.environ.get("KEYHOLE_FAILED_CHECKS")
    if failed:
        terminalreporter.write_line(f"FAILED before pytest: {failed} (see the top)", red=True)
