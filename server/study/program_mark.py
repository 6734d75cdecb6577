"""A mark of the program: equal on two machines only where a run goes through the same code."""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]
_DECIDING = ("robot", "scenes", "hardware", "server/control")
_DECIDING_FILES = (
    *("server/run/headless.py", "server/run/figures.py"),
    *("server/run/tube_run.py", "server/run/tube_figures.py"),
    *(
        f"server/run/sensing_{name}.py"
        for name in (
            *("options", "rod", "calibration", "methods", "samples", "run", "coverage", "tension"),
            *("figures", "traces", "chirp"),
        )
    ),
    *("server/study/work.py", "server/study/task.py"),
)
_KINDS = (".py", ".toml", ".csv")


@functools.cache
def program_mark() -> str:
    """SHA-256 of all files that decide what a run's figures are."""
    files = [_ROOT / name for name in _DECIDING_FILES]
    for folder in _DECIDING:
        files += [path for path in (_ROOT / folder).rglob("*") if path.suffix in _KINDS]
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(f"{file.relative_to(_ROOT)}\n".encode())
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()
