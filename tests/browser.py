"""Find the Chromium that the browser tests drive, or install one."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

# Chromium refuses its sandbox to root, and nothing here may look up hosts on the network.
ARGUMENTS = (
    *(("--no-sandbox",) if os.geteuid() == 0 else ()),
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-quic",
    "--disable-sync",
    "--no-first-run",
)


def find() -> str | None:
    """Path of a Chromium that starts: ``KEYHOLE_CHROMIUM``, the system's, or Playwright's own."""
    named = os.environ.get("KEYHOLE_CHROMIUM")
    if named:
        return named if _starts(named) else None
    for name in NAMES:
        path = shutil.which(name)
        if path and _starts(path):
            return path
    path = _playwright_path()
    return path if path and _starts(path) else None


def install() -> str | None:
    """Install a Chromium by Playwright, else as root by apt; tell which path it has, if any."""
    attempts = [[sys.executable, "-m", "playwright", "install", "chromium"]]
    if os.geteuid() == 0 and shutil.which("apt-get"):
        attempts += [["apt-get", "update"], ["apt-get", "install", "-y", "chromium"]]
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    for command in attempts:
        print(f"keyhole: {' '.join(command)}", flush=True)
        try:
            subprocess.run(
                command,
                env=environment,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                check=False,
                timeout=900,
            )
        except subprocess.TimeoutExpired:
            continue
        path = find()
        if path:
            return path
    return None


def advice() -> str:
    """One line that tells a person how to get a browser."""
    command = ".venv/bin/playwright install chromium"
    if shutil.which("apt-get"):
        command = f"{'' if os.geteuid() == 0 else 'sudo '}apt-get install chromium"
    return (
        f"no Chromium that starts was found; install one with: {command}"
        " (or name one with KEYHOLE_CHROMIUM=/path/to/chromium)"
    )


def _starts(path: str) -> bool:
    command = [path, *ARGUMENTS, "--version"]
    try:
        return subprocess.run(command, capture_output=True, check=False, timeout=60).returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False


def _playwright_path() -> str | None:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        path = playwright.chromium.executable_path
    return path if os.path.exists(path) else None
