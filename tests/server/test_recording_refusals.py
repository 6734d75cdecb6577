"""What is no recording, not a whole one, or one of another time is refused in plain words."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

import server.recording.writer as writer_module
from robot.records import RECORD, SCHEMA_VERSION
from server.command_line import main
from server.configuration_file import load
from server.recording.errors import (
    NotARecording,
    RecordingConfiguration,
    RecordingEmpty,
    RecordingError,
    RecordingUnreadable,
    RecordingVersion,
)
from server.recording.folder import RecordingNameRefused, check_new, named
from server.recording.reader import Recording
from server.recording.writer import RecordingWriter
from tests.server.recorded import recorded_run, write


def made(path: Path, change: Callable[[bytes], bytes]) -> Path:
    """A recording whose bytes were changed."""
    write(path, recorded_run()[:200])
    path.write_bytes(change(path.read_bytes()))
    return path


def read_all(path: Path) -> None:
    with Recording(path) as recording:
        recording.configuration()
        for _ in recording.batches():
            pass


def refused(path: Path, kind: type[RecordingError], *words: str) -> None:
    """Reading it all must be refused so, naming the file, in one line."""
    with pytest.raises(kind) as refusal:
        read_all(path)
    said = str(refusal.value)
    assert str(path) in said
    assert "\n" not in said
    for word in words:
        assert word in said


def test_no_file(tmp_path: Path) -> None:
    refused(tmp_path / "none.mcap", RecordingUnreadable, "No such file")
    refused(tmp_path, RecordingUnreadable, "directory")


@pytest.mark.parametrize("content", [b"", b"time_s,x_mm\n0,0\n", b"\x89MCAP1\r\n" + bytes(99)])
def test_another_kind_of_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other.mcap"
    path.write_bytes(content)
    refused(path, NotARecording, "not an MCAP file")


def test_somebody_elses_mcap(tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.register_channel("/chatter", "json", 0)
        writer.finish()  # type: ignore[no-untyped-call]
    refused(path, NotARecording, "not one that keyhole recorded")


def test_cut_off_before_the_first_ticks(tmp_path: Path) -> None:
    path = tmp_path / "early.mcap"
    writer = RecordingWriter(path, load())
    writer.append(recorded_run()[:3])
    writer.abandon()
    refused(path, RecordingEmpty, "no ticks")


def test_damage_in_the_middle_is_found_and_placed(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    write(path, recorded_run())
    with Recording(path) as recording:
        chunk = recording.chunks[1]
    content = bytearray(path.read_bytes())
    content[chunk.offset + chunk.length // 2] ^= 1
    path.write_bytes(content)
    refused(path, RecordingUnreadable, "damaged between 0.25 s and")


def test_records_of_another_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "old.mcap"
    monkeypatch.setattr(writer_module, "SCHEMA_VERSION", SCHEMA_VERSION - 1)
    write(path, recorded_run()[:10])
    refused(path, RecordingVersion, f"version {SCHEMA_VERSION - 1}", f"version {SCHEMA_VERSION}")


def test_records_of_the_same_version_and_another_form(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = np.dtype([*RECORD.descr, ("more", "<f8")])
    monkeypatch.setattr(writer_module, "describe", lambda _: json.dumps(other.descr).encode())
    write(tmp_path / "other.mcap", recorded_run()[:10])
    refused(tmp_path / "other.mcap", RecordingVersion, "another form")


def test_a_configuration_that_is_not_known(tmp_path: Path) -> None:
    def rename(content: bytes) -> bytes:
        assert content.count(b'"lambda_min"') == 1
        return content.replace(b'"lambda_min"', b'"lambda_low"')

    path = made(tmp_path / "run.mcap", rename)
    refused(path, RecordingConfiguration, "limits.lambda_min")


def test_a_calibration_that_is_not_known(tmp_path: Path) -> None:
    path = made(
        tmp_path / "run.mcap",
        lambda content: content.replace(b'"residual_deg"', b'"residual_rad"'),
    )
    with Recording(path) as recording, pytest.raises(RecordingConfiguration, match="calibration"):
        recording.calibration()


@pytest.mark.parametrize("options", [(), ("--verify",)])
def test_the_command_refuses_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...]
) -> None:
    path = tmp_path / "text.mcap"
    path.write_text("no recording")
    assert main(["replay", str(path), *options]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == f"keyhole: {path}: is not an MCAP file\n"


def test_a_console_that_cannot_record_does_not_start(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "there.mcap"
    path.write_text("mine")
    place = ["--run-directory", str(tmp_path / "run")]
    assert main(["console", "--no-browser", "--record", str(path), *place]) == 2
    assert "exists already" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_names_cannot_lead_out_of_the_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", "/somewhere")
    folder = Path("/somewhere/keyhole/recordings")
    assert named("first try") == folder / "first try.mcap"
    assert named("a.mcap") == folder / "a.mcap"
    assert named().parent == folder
    for name in ("", ".", "..", "../a", "/a", "a/b", ".a", "a\n", "a\0", "x" * 101, "é"):
        with pytest.raises(RecordingNameRefused):
            named(name)


def test_a_place_is_checked_before_anything_starts(tmp_path: Path) -> None:
    assert check_new(tmp_path / "new" / "run.mcap").parent.is_dir()
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file", tmp_path / "file" / "run.mcap"):
        with pytest.raises(RecordingError):
            check_new(path)
