"""The version of this installation."""

from __future__ import annotations

from importlib import metadata


def version() -> str:
    """Version of the installed package; "0" where Keyhole runs without being installed."""
    try:
        return metadata.version("keyhole")
    except metadata.PackageNotFoundError:
        return "0"
