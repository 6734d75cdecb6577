"""The check of a recording: the same inputs give the same bits, and nothing else passes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import server.recording.machine as machine_module
from robot.calibration import Calibration
from robot.records import OUTCOME, RECORD
from server.command_line import main
from server.configuration_file import load
from server.recording.reader import Recording
from server.recording.verify import Verification, report, verify
from server.recording.writer import RecordingWriter
from tests.server.recorded import CALIBRATION, Records, recorded_run, write


def checked(path: Path, records: Records) -> Verification:
    write(path, records)
    with Recording(path) as recording:
        return verify(recording)


def test_every_tick_of_a_run_comes_out_the_same(tmp_path: Path) -> None:
    shares: list[float] = []
    path = tmp_path / "run.mcap"
    write(path, recorded_run())
    with Recording(path) as recording:
        result = verify(recording, shares.append)
        said = report(recording, result)
    assert result == Verification(checked=len(recorded_run()) - 1)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert "599 ticks" in said
    assert "bit for bit" in said


def test_any_flipped_bit_of_an_outcome_is_found(tmp_path: Path, rng: np.random.Generator) -> None:
    place = RECORD.fields["outcome"][1]  # type: ignore[index]
    for attempt in range(4):
        records = recorded_run()[:120].copy()
        tick = int(rng.integers(60, 119))
        byte = place + int(rng.integers(OUTCOME.itemsize))
        raw = records.view(np.uint8).reshape(len(records), -1)
        # The number of the tick is what tells a restart; a wrong one is told as such.
        if place <= byte < place + 8:
            byte += 8
        raw[tick, byte] ^= 1 << int(rng.integers(8))
        result = checked(tmp_path / f"{attempt}.mcap", records)
        assert result.first is not None
        assert result.first.tick == records["header"]["tick"][tick]
        assert result.first.sequence == tick
        # The tick after starts from the recorded state, and may differ for it.
        assert result.differing in (1, 2)
        assert len(result.first.fields) == 1


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("hold", lambda records: np.add.at(records["input"]["hold"], 70, -1)),
        ("leader", lambda records: np.add.at(records["input"]["leader"]["position"], 70, 1e-3)),
        ("measured", lambda records: np.add.at(records["input"]["measured_valid"], 70, -1)),
    ],
)
def test_another_input_leads_elsewhere(
    tmp_path: Path, name: str, change: Callable[[Records], None]
) -> None:
    records = recorded_run()[:120].copy()
    records["input"]["settings"]["hold_to_move"] = 0
    if name == "hold":
        records["input"]["settings"]["hold_to_move"][70] = 1
    change(records)
    result = checked(tmp_path / f"{name}.mcap", records)
    assert result.first is not None
    assert result.first.sequence == 70


def test_the_recorded_calibration_and_configuration_are_used(tmp_path: Path) -> None:
    limits = load().limits.model_copy(update={"joint_speed_rad_s": 1e-4})
    slower = load().model_copy(update={"limits": limits})
    for name, configuration, calibration in (
        ("other configuration", slower, CALIBRATION),
        ("other calibration", load(), Calibration(gain=(0.5, 0.5))),
        ("no calibration", load(), None),
    ):
        path = tmp_path / f"{name}.mcap"
        with RecordingWriter(path, configuration, calibration) as writer:
            writer.append(recorded_run()[:200])
        with Recording(path) as recording:
            assert verify(recording).differing > 0, name


def test_after_a_gap_it_goes_on_from_the_recorded_state(tmp_path: Path) -> None:
    path, records = tmp_path / "gap.mcap", recorded_run()
    with RecordingWriter(path, load(), CALIBRATION) as writer:
        writer.append(records[:100], 0)
        writer.append(records[130:], 130)
    with Recording(path) as recording:
        result = verify(recording)
        said = report(recording, result)
    assert (result.checked, result.differing) == (99 + len(records) - 131, 0)
    assert len(result.restarts) == 1
    assert "30 records are missing" in said


def test_after_a_restart_of_the_controller_it_goes_on(tmp_path: Path) -> None:
    records = np.concatenate([recorded_run()[:80], recorded_run()[:90]])
    result = checked(tmp_path / "twice.mcap", records)
    assert (result.checked, result.differing) == (79 + 89, 0)
    (told,) = result.restarts
    assert "started anew" in told


def test_the_record_of_a_loop_that_failed_is_not_a_tick(tmp_path: Path) -> None:
    failed = recorded_run()[79:80].copy()
    failed["header"]["tick"] += 1
    failed["outcome"]["state"]["safety"] = 3
    result = checked(tmp_path / "failed.mcap", np.concatenate([recorded_run()[:80], failed]))
    assert (result.checked, result.differing) == (79, 0)
    assert "had failed" in result.restarts[0]


def test_other_versions_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, records = tmp_path / "run.mcap", recorded_run()[:100].copy()
    records["outcome"]["command"]["q"][60] += 1e-12
    write(path, records)
    here = machine_module.versions()
    monkeypatch.setattr(machine_module, "versions", lambda: {**here, "numpy": "9.9"})
    with Recording(path) as recording:
        result = verify(recording)
        said = report(recording, result)
        clean = report(recording, dataclasses.replace(result, first=None, differing=0))
    assert result.otherwise == [f"numpy: {here['numpy']} then, 9.9 now"]
    assert "made elsewhere" in said
    assert "outcome.command.q" not in said
    assert "command.q: recorded [" in said
    assert "not made here" in clean


def test_the_exit_status_tells_the_outcome(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    records = recorded_run()[:100].copy()
    write(tmp_path / "same.mcap", records)
    records["outcome"]["report"]["x_dot"][70, 3] += 1e-15
    write(tmp_path / "other.mcap", records)
    assert main(["replay", "--verify", str(tmp_path / "same.mcap")]) == 0
    assert "99 ticks computed anew" in capsys.readouterr().out
    assert main(["replay", "--verify", str(tmp_path / "other.mcap")]) == 1
    said = capsys.readouterr().out
    assert "1 ticks differ; the first is tick 71" in said
    assert "report.x_dot" in said
    assert "versions and machine are those of the recording" in said
    damaged = bytearray((tmp_path / "same.mcap").read_bytes())
    with Recording(tmp_path / "same.mcap") as recording:
        chunk = recording.chunks[0]
    damaged[chunk.offset + 1000] ^= 4
    (tmp_path / "damaged.mcap").write_bytes(damaged)
    assert main(["replay", "--verify", str(tmp_path / "damaged.mcap")]) == 2
    assert "is damaged" in capsys.readouterr().err
