"""What every test may use: fixed seeds and the browser."""

from __future__ import annotations

import functools
import os
import random
import sys
import time
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling

from robot.configuration import Configuration
from tests import browser
from tests.stalls import StallWatch, in_words

ROOT = Path(__file__).resolve().parent.parent
WATCH, BEGAN = pytest.StashKey[StallWatch](), pytest.StashKey[float]()


@pytest.fixture(autouse=True)
def fixed_seeds() -> None:
    """Start every test from the same global seeds, whichever tests ran before it."""
    random.seed(0)
    np.random.seed(0)  # noqa: NPY002 - a library under test may draw from it


@pytest.fixture(autouse=True, scope="session")
def own_audit_log(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep what tests do out of the audit log of this user's robots."""
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))


@pytest.fixture(autouse=True, scope="session")
def starts_found_once() -> Iterator[None]:
    """Find the start of a configuration once: it takes each new robot 0.3 s.

    That it always is the same is tested in ``robot/test_start.py``, which does without this.
    """
    robots = sys.modules.get("robot.instrument_robot")
    if robots is None:
        yield
        return
    find, found = robots.start_configuration, dict[tuple[str, bytes], np.ndarray]()

    def find_once(configuration: Configuration, arm: Any, parameters: np.ndarray) -> np.ndarray:
        key = configuration.model_dump_json(), parameters.tobytes()
        if key not in found:
            found[key] = find(configuration, arm, parameters)
        return found[key].copy()

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(robots, "start_configuration", find_once)
        yield


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


def pytest_sessionstart(session: pytest.Session) -> None:
    """Watch for stalls of the machine from here on."""
    session.config.stash[WATCH] = StallWatch()


def pytest_unconfigure(config: pytest.Config) -> None:
    """Watch no more."""
    if WATCH in config.stash:
        config.stash[WATCH].close()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let a test that failed while the machine stood still run again, twice at most."""
    for item in items:
        stood_still = functools.partial(_stood_still, item)
        item.add_marker(pytest.mark.flaky(reruns=2, condition=stood_still))


def _stood_still(item: pytest.Item) -> bool:
    return bool(item.config.stash[WATCH].since(item.stash[BEGAN]))


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Remember when this try of the test began."""
    item.stash[BEGAN] = time.monotonic()


class ByConsole(LoadScopeScheduling):  # type: ignore[misc] # xdist has no types
    """Keeps together on one processor what shares a console, runs, or a file's fixtures."""

    def _split_scope(self, nodeid: str) -> str:
        file = nodeid.partition("::")[0]
        if "browser_tests" in file:
            return "browser"
        return next((what for what, word in _SHARED.items() if word in _text(file)), file)


_SHARED = {"console": "tests.server.api_client", "runs": "headless.named("}
"""What several files share, and by which words in them one sees it."""


@functools.cache
def _text(file: str) -> str:
    return (ROOT / file).read_text(encoding="utf-8")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> ByConsole:
    """Lay out what runs side by side, where two processes run the tests."""
    return ByConsole(config, log)


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Tell of stalls, and name the checks that failed before pytest began."""
    if WATCH in config.stash and (stalls := config.stash[WATCH].since(0.0)):
        terminalreporter.write_line(in_words(stalls))
    failed = os.environ.get("KEYHOLE_FAILED_CHECKS")
    if failed:
        terminalreporter.write_line(f"FAILED before pytest: {failed} (see the top)", red=True)
