"""A small report of the robot that a file of tests is about, made by its ``COMMAND``."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.command_line import main
from tests.server.report.page import Page


@pytest.fixture(scope="module")
def folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the report is."""
    path = tmp_path_factory.mktemp("report")
    assert main([*request.module.COMMAND, "--out", str(path), "--jobs", "2"]) == 0
    return path


@pytest.fixture(scope="module")
def text(folder: Path) -> str:
    """Its page as it was written."""
    return (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(text: str) -> Page:
    """Its page as it was read."""
    return Page(text)
