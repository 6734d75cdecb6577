"""The search for a browser, with programs that stand where the real ones would."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from tests import browser


@pytest.fixture
def programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that is all of PATH, on a machine where nothing is installed yet."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("KEYHOLE_CHROMIUM", raising=False)
    monkeypatch.setattr(browser, "_playwright_path", lambda: None)
    monkeypatch.setattr(sys, "executable", "/bin/false")
    return tmp_path


def _program(path: Path, script: str) -> str:
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return str(path)


def test_a_browser_that_does_not_start_is_passed_over(programs: Path) -> None:
    _program(programs / "chromium", "exit 127")
    assert browser.find() is None
    works = _program(programs / "google-chrome", "exit 0")
    assert browser.find() == works


def test_the_named_browser_is_the_only_one_tried(
    programs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    works = _program(programs / "chromium", "exit 0")
    monkeypatch.setenv("KEYHOLE_CHROMIUM", str(programs / "absent"))
    assert browser.find() is None
    monkeypatch.setenv("KEYHOLE_CHROMIUM", works)
    assert browser.find() == works


def test_root_installs_it_from_the_systems_packages(
    programs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    path = programs / "chromium"
    install = f'[ "$1" = update ] || {{ echo "#!/bin/sh" > "{path}"; /bin/chmod +x "{path}"; }}'
    _program(programs / "apt-get", install)
    assert browser.install() == str(path)


def test_others_are_told_the_command(programs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    _program(programs / "apt-get", "exit 1")
    assert browser.install() is None
    assert "sudo apt-get install chromium" in browser.advice()
