"""Configuration files for tests: the one that comes along, changed in places."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from pathlib import Path

LATE_TICKS = {"late_tick_ms = 100.0": "late_tick_ms = 1500.0"}
"""A machine that stands still for a moment pauses nothing; that late ticks do is tested apart."""

LATE_LEADERS = {
    "\ntimeout_ms = 25.0": "\ntimeout_ms = 1500.0",
    "api_timeout_ms = 25.0": "api_timeout_ms = 1500.0",
    "gizmo_timeout_ms = 120.0": "gizmo_timeout_ms = 1500.0",
}
"""A test that comes late with its next message pauses nothing."""


def configured(folder: Path, *changes: Mapping[str, str]) -> tuple[str, str]:
    """Write a changed configuration into ``folder``.

    Args:
        folder: where the file goes.
        changes: words of the file, each of which stands there once, and those in their place.

    Returns:
        The option and its value that choose the file.
    """
    text = (resources.files("robot") / "keyhole.toml").read_text("utf-8")
    for old, new in (pair for change in changes for pair in change.items()):
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in keyhole.toml"
        text = text.replace(old, new)
    path = folder / "changed.toml"
    path.write_text(text, "utf-8")
    return "--config", str(path)
