"""Run every check of the project: ruff, mypy, and then pytest, whose summary comes last.

``./keyhole test [pytest arguments]`` sets up what this needs and calls it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from tests import browser  # noqa: E402 - the path above makes it importable

CHECKS = {
    "ruff check": ["ruff", "check", "."],
    "ruff format": ["ruff", "format", "--check", "."],
    "mypy": ["mypy", "--num-workers", "2"],
}


def main(arguments: Sequence[str]) -> int:
    """Run all checks, each whatever became of the others.

    Args:
        arguments: handed to pytest.

    Returns:
        0 when everything passed, else pytest's own status or 1.
    """
    failed = [title for title, command in CHECKS.items() if not _passes(title, command)]
    began = time.monotonic()
    chromium = browser.find() or browser.install()
    print(f"keyhole: browser: {chromium or browser.advice()} ({_since(began)})", flush=True)
    environment = {**os.environ, "KEYHOLE_FAILED_CHECKS": ", ".join(failed)}
    if chromium:
        environment["KEYHOLE_CHROMIUM"] = chromium
    slowest = ["--durations=15"] if os.environ.get("CI") == "true" else []
    # More than two at once would take the processors away from the consoles under test.
    parallel = [] if arguments else ["-n", "2", "--no-loadscope-reorder"]
    command = [sys.executable, "-m", "pytest", *parallel, *slowest, *arguments]
    status = subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode
    return status or bool(failed)


def _passes(title: str, command: list[str]) -> bool:
    began = time.monotonic()
    result = subprocess.run([sys.executable, "-m", *command], cwd=ROOT, check=False)
    word = "failed" if result.returncode else "passed"
    print(f"keyhole: {title} {word} ({_since(began)})", flush=True)
    return result.returncode == 0


def _since(began: float) -> str:
    return f"{time.monotonic() - began:.1f} s"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
