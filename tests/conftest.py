"""What every test may use: fixed seeds and the browser."""

from __future__ import annotations

import functools
import os
import random
import zlib
from pathlib import Path

import numpy as np
import pytest
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling

from tests import browser

ROOT = Path(__file__).resolve().parent.parent


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


class ByConsole(LoadScopeScheduling):  # type: ignore[misc] # xdist has no types
    """Keeps together on one processor what shares a console or a file's fixtures."""

    def _split_scope(self, nodeid: str) -> str:
        file = nodeid.partition("::")[0]
        if "browser_tests" in file:
            return "browser"
        return "console" if _shares_the_console(file) else file


@functools.cache
def _shares_the_console(file: str) -> bool:
    return "tests.server.api_client" in (ROOT / file).read_text(encoding="utf-8")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> ByConsole:
    """Lay out what runs side by side, where two processes run the tests."""
    return ByConsole(config, log)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the checks that failed before pytest began, right above its closing line."""
    failed = os.environ.get("KEYHOLE_FAILED_CHECKS")
    if failed:
        terminalreporter.write_line(f"FAILED before pytest: {failed} (see the top)", red=True)
