"""The programs of docs/labs.md run as they stand there."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.server.api_client import ApiClient
from tests.server.console_process import ConsoleProcess
from tests.server.recorded import recorded_run, write

ROOT = Path(__file__).resolve().parent.parent.parent
BLOCKS = re.findall(
    r"^```python\n(.*?)^```",
    (ROOT / "docs" / "labs.md").read_text(encoding="utf-8"),
    re.MULTILINE | re.DOTALL,
)
PROGRAMS = [block for block in BLOCKS if "KEYHOLE_TOKEN" in block]
READERS = [block for block in BLOCKS if "KEYHOLE_RECORDING" in block]
PIECES = [block for block in BLOCKS if block not in (*PROGRAMS, *READERS)]


def run(program: str, **environment: str) -> str:
    command = [sys.executable, "-W", "error", "-c", program]
    result = subprocess.run(
        command,
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert result.returncode == 0, result.stderr
    assert "refused" not in result.stdout
    return result.stdout


@pytest.mark.parametrize("program", PROGRAMS)
def test_programs_drive_a_console(
    program: str, console: ConsoleProcess, watcher: ApiClient
) -> None:
    watcher.until(lambda state: state["operator"]["name"] is None, "nobody drives", 10.0)
    before = watcher.state()
    assert run(program, KEYHOLE_ADDRESS=console.base, KEYHOLE_TOKEN=console.token)
    after = watcher.state()
    assert after["safety"]["state"] == "DISABLED"
    assert after["time_s"] > before["time_s"]
    assert after["operator"]["name"] is None


@pytest.mark.parametrize("cut", [False, True])
@pytest.mark.parametrize("reader", READERS)
def test_readers_read_recordings(reader: str, cut: bool, tmp_path: Path) -> None:
    path, records = tmp_path / "run.mcap", recorded_run()
    write(path, records)
    if cut:
        os.truncate(path, path.stat().st_size // 2)
    said = run(reader, KEYHOLE_RECORDING=str(path))
    assert ("cut off" in said) == cut
    assert cut or f"{len(records)} ticks" in said


@pytest.mark.parametrize("piece", PIECES)
def test_pieces_run(piece: str) -> None:
    run(piece)
