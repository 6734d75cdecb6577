"""Calibrating a simulated robot, the file that comes of it, and the command that does both."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from robot.calibration import Calibration, CalibrationRefused
from robot.configuration import Configuration
from robot.sensing.tendon_fit import SweepTooPoor
from server.calibration.file import (
    CalibrationFileError,
    belonging,
    default_path,
    load,
    load_if_there,
    save,
)
from server.calibration.sweep import calibrate, calibration_for, robot_name
from server.command_line import main
from tests.server import headless

FOUND = Calibration(
    gain=(0.953, 0.961),
    offset_rad=(0.012, -0.004),
    friction_rad=(0.035, 0.036),
    stick_rad=(0.011, 0.012),
    residual_deg=0.22,
    samples=1756,
    robot='physics, preset "paper", seed 1 \\ odd',
    made="2026-01-02 03:04:05 UTC",
)


def robot(**changed: object) -> Configuration:
    chosen: dict[str, object] = {"plant": "physics", "preset": "paper", "seed": 1}
    return headless.changed("simulation", **(chosen | changed))


@pytest.fixture(scope="module")
def found() -> Calibration:
    """Of the paper preset, as every run of this process knows it."""
    return calibration_for(robot())


def test_the_paper_preset_is_understood(found: Calibration) -> None:
    assert found.residual_deg < 0.5
    assert found.samples > 1000
    for axis in range(2):
        assert 0.9 < found.gain[axis] < 1.0
        assert abs(found.offset_rad[axis]) < math.radians(1.5)
        assert math.radians(1.0) < found.friction_rad[axis] < math.radians(3.5)
        assert 0.005 < found.stick_rad[axis] < 0.1
    assert found.robot == robot_name(robot()) == "physics, preset paper, seed 1"
    assert found.configuration_hash
    assert found.made.endswith("UTC")


def test_it_is_made_once_a_process_whatever_stands_before_the_robot(found: Calibration) -> None:
    assert calibration_for(robot(board="ring-board")) is found
    other = headless.changed("priority", case="2").model_copy(
        update={"simulation": robot().simulation}
    )
    assert calibration_for(other) is found


@pytest.mark.parametrize("preset", ["paper", "harsh"])
def test_without_compensation_none_is_made(preset: str) -> None:
    off = robot(preset=preset, seed=77)
    mode = off.compensation.model_copy(update={"mode": "off"})
    assert calibration_for(off.model_copy(update={"compensation": mode})) == Calibration()
    assert calibration_for(robot(plant="kinematic")) == Calibration()


def test_progress_grows_from_nothing_to_nearly_all() -> None:
    """Stopped after a while by whoever watches, which ends the sweep."""

    class Seen(Exception):
        pass

    shares: list[float] = []

    def watch(share: float) -> None:
        shares.append(share)
        if len(shares) == 4:
            raise Seen

    with pytest.raises(Seen):
        calibrate(robot(), watch)
    assert shares[0] == 0.0
    assert shares == sorted(shares)
    assert 0.0 < shares[-1] < 1.0


def test_a_robot_without_a_tracker_cannot_be_calibrated() -> None:
    with pytest.raises(SweepTooPoor, match="no tracker saw the tip; a calibration needs one"):
        calibrate(robot(plant="kinematic"))


def test_a_file_holds_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "a" / "new" / "folder" / "one.toml"
    save(path, FOUND)
    assert load(path) == FOUND
    assert load_if_there(path) == FOUND
    assert [one.name for one in path.parent.iterdir()] == ["one.toml"]
    save(path, Calibration())
    assert load(path) == Calibration()


def test_a_file_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CalibrationFileError, match=r"calibration .*file/one\.toml: "):
        save(tmp_path / "file" / "one.toml", FOUND)


BROKEN = [
    ("gain = [0.95, ", "keyhole calibrate"),
    ("\xff\xfe", "keyhole calibrate"),
]


@pytest.mark.parametrize(("text", "advice"), BROKEN)
def test_a_file_that_is_no_toml_is_refused(text: str, advice: str, tmp_path: Path) -> None:
    path = tmp_path / "broken.toml"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(CalibrationFileError, match=advice) as refused:
        load(path)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)
    assert load_if_there(path) is None


def test_a_file_that_is_not_there_is_said(tmp_path: Path) -> None:
    path = tmp_path / "none.toml"
    with pytest.raises(CalibrationFileError, match="No such file"):
        load(path)
    assert load_if_there(path) is None


@pytest.mark.parametrize(
    ("line", "key"),
    [
        ("schema_version = 2", "schema_version"),
        ("gain = [2.0, 0.9]", "gain.0"),
        ("gain = [0.9]", "gain.1"),
        ("gain = [nan, 0.9]", "gain.0"),
        ("offset_rad = [0.0, 0.7]", "offset_rad.1"),
        ("friction_rad = [-0.01, 0.0]", "friction_rad.0"),
        ("stick_rad = [0.0, 0.1]", "stick_rad.0"),
        ("samples = -1", "samples"),
        ("frictoin_rad = [0.0, 0.0]", "frictoin_rad"),
    ],
)
def test_a_wrong_value_is_refused_by_name(line: str, key: str, tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(line + "\n")
    with pytest.raises(CalibrationRefused) as refused:
        load(path)
    said = str(refused.value)
    assert f"{path}: {key} = " in said
    assert said.endswith("make it anew with 'keyhole calibrate'")
    assert load_if_there(path) is None


def test_every_robot_has_a_file_of_its_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    one = default_path(robot())
    assert one.parent == tmp_path / "keyhole" / "calibration"
    assert one.name == f"physics-preset-paper-seed-1-{belonging(robot())}.toml"
    others = [
        robot(seed=2),
        robot(preset="harsh"),
        robot(plant="kinematic"),
        headless.changed("tracker", delay_ms=30.0).model_copy(
            update={"simulation": robot().simulation}
        ),
    ]
    assert len({default_path(other) for other in (robot(), *others)}) == 5
    assert default_path(robot(board="ring-board")) == one


def test_the_command_calibrates_writes_and_tells(
    found: Calibration, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What it finds is what this process found before: calibrating is repeatable."""
    path = tmp_path / "out" / "paper.toml"
    arguments = ["calibrate", "--plant", "physics", "--preset", "paper", "--seed", "1"]
    assert main([*arguments, "--out", str(path), "--json"]) == 0
    told: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert told.pop("file") == str(path)
    assert told == load(path).model_dump(mode="json")
    same = {"made": found.made, "configuration_hash": found.configuration_hash}
    assert load(path).model_copy(update=same) == found


@pytest.mark.parametrize("seed", ["-1", "1.5", "one", str(2**31)])
def test_a_seed_that_is_none_is_refused(seed: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", f"--seed={seed}"]) == 2
    said = capsys.readouterr().err
    assert "a seed is a whole number from 0 to 2147483647" in said
    assert "Traceback" not in said


def test_a_robot_that_cannot_be_calibrated_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "none.toml"
    assert main(["calibrate", "--plant", "kinematic", "--out", str(path)]) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert said.endswith("keyhole: no tracker saw the tip; a calibration needs one")
    assert not path.exists()
