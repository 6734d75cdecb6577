"""``keyhole run`` as people and programs call it: JSON, trace, stops, and one-line refusals."""

from __future__ import annotations

import csv
import json
import math
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hardware.kinematic_plant import KinematicPlant
from hardware.plant import Measurement
from scenes.experiments import experiment, names
from scenes.experiments.sensing import TITLES as SENSING
from scenes.experiments.tubes import TITLES
from server.command_line import main
from server.configuration_file import load
from server.run import headless as headless_run
from server.run.headless import SETTLING_S, TRACE_COLUMNS
from server.supervision.child_process import module_command, module_environment
from tests import own_kinematics
from tests.configured import configured
from tests.server import headless

HEAD = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n"
SHORT = HEAD + "0,0,0,0,1,0,0,0\n0.5,2,1,0,0.9998,0.02,0,0\n1,0,0,0,1,0,0,0\n"
KEYS = {
    "experiment": str,
    "case": str,
    "solver": str,
    "coordinates": str,
    "plant": str,
    "steps": int,
    "dt_s": float,
    "duration_s": float,
    "ended": str,
    "preset": str,
    "seed": int,
    "board": str,
    "tracker": bool,
    "compensation": str,
    "realtime_factor": float,
}


@pytest.fixture
def short(tmp_path: Path) -> str:
    """A path of one second."""
    file = tmp_path / "short.csv"
    file.write_text(SHORT)
    return str(file)


def lines(file: Path) -> list[list[str]]:
    with open(file, newline="") as opened:
        return list(csv.reader(opened))


def test_the_json_holds_what_programs_rely_on(
    short: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "--plant", "kinematic", "--path", short, "--case", "2", "--json", "-"]) == 0
    output = capsys.readouterr()
    document: dict[str, Any] = json.loads(output.out)
    assert output.err == ""
    for key, kind in KEYS.items():
        assert isinstance(document[key], kind), key
    assert (document["case"], document["solver"], document["coordinates"]) == ("2", "hqp", "uv")
    assert (document["plant"], document["experiment"]) == ("kinematic", "short.csv")
    assert (document["steps"], document["dt_s"], document["duration_s"]) == (501, 0.002, 1.0)
    assert document["ended"] == "completed"
    for error in ("position_mm", "orientation_deg", "rcm_mm"):
        found = document["errors"][error]
        assert 0.0 <= found["rms"] <= found["max"]
        assert 0.0 <= found["final"] <= found["max"]
    assert document["lambda"]["reference"] == 0.4
    assert 0.0 <= document["lambda"]["max_abs_error"] < 0.1
    assert 59.0 < document["bend_deg"]["max"] <= 90.0
    assert document["limits"]["violations"] == 0
    assert 0.0 < document["tick_us"]["p50"] <= document["tick_us"]["p99"]


def test_anyone_can_recompute_the_errors_from_the_trace(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By DH, quaternions and vector algebra that the program does not use."""
    figures, trace = tmp_path / "figures.json", tmp_path / "trace.csv"
    command = ["run", "circle-infeasible", "--case", "0", "--plant", "kinematic"]
    assert main([*command, "--json", str(figures), "--trace", str(trace)]) == 0
    summary = capsys.readouterr().out
    document = json.loads(figures.read_text())
    head, *body = lines(trace)
    assert head == TRACE_COLUMNS
    values = np.array(body, dtype=float)
    assert len(values) == document["steps"] == 4001
    np.testing.assert_allclose(values[:, 0], 0.002 * np.arange(4001), rtol=0, atol=1e-12)
    found = headless.recompute(values, headless.configuration())
    for name, own, factor in (
        ("position_mm", found.position, 1e3),
        ("orientation_deg", found.orientation, 180.0 / math.pi),
        ("rcm_mm", found.rcm, 1e3),
    ):
        said = document["errors"][name]
        assert own.max() * factor == pytest.approx(said["max"], rel=1e-6, abs=2e-6)
        assert math.sqrt(np.mean(own**2)) * factor == pytest.approx(said["rms"], rel=1e-6, abs=2e-6)
        assert own[-1] * factor == pytest.approx(said["final"], rel=1e-6, abs=2e-6)
        assert f"{said['max']:.5f}" in summary
    bend = 90.0 - np.degrees(values[:, 8].min())
    assert bend == pytest.approx(document["bend_deg"]["max"], abs=1e-9)
    away = np.abs(values[:, 10] - 0.4).max()
    assert away == pytest.approx(document["lambda"]["max_abs_error"], abs=1e-12)


def test_the_trace_s_true_pose_trocar_and_lambda_are_those_of_its_joints(
    tmp_path: Path, short: str
) -> None:
    trace = tmp_path / "trace.csv"
    assert main(["run", "--plant", "kinematic", "--path", short, "--trace", str(trace)]) == 0
    for row in np.array(lines(trace)[1:], dtype=float)[::20]:
        where = own_kinematics.pose(headless.configuration(), row[1:8], row[8], row[9])
        np.testing.assert_allclose(row[11:14], where.tip, rtol=0, atol=1e-12)
        rotation = Rotation.from_quat(row[[15, 16, 17, 14]]).as_matrix()
        np.testing.assert_allclose(rotation, where.rotation, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(row[25:28], headless.configuration().trocar.position_m)
        shaft = where.shaft_end - where.shaft_base
        along = (row[25:28] - where.shaft_base) @ shaft / (shaft @ shaft)
        assert row[10] == pytest.approx(along, abs=1e-12)


def test_a_path_moves_along_the_base_s_axes_and_turns_in_the_base(
    tmp_path: Path, short: str
) -> None:
    trace = tmp_path / "trace.csv"
    assert main(["run", "--plant", "kinematic", "--path", short, "--trace", str(trace)]) == 0
    values = np.array(lines(trace)[1:], dtype=float)
    first, middle = values[0], values[250]
    np.testing.assert_allclose(middle[18:21] - first[18:21], [0.002, 0.001, 0.0], atol=1e-12)
    start, turned = (Rotation.from_quat(row[[22, 23, 24, 21]]) for row in (first, middle))
    expected = Rotation.from_quat([0.02, 0.0, 0.0, 0.9998])
    assert ((turned * start.inv()) * expected.inv()).magnitude() < 1e-9


def test_equal_runs_leave_equal_traces(tmp_path: Path, short: str) -> None:
    traces = [tmp_path / "one.csv", tmp_path / "two.csv"]
    for trace in traces:
        assert main(["run", "--plant", "kinematic", "--path", short, "--trace", str(trace)]) == 0
    assert traces[0].read_bytes() == traces[1].read_bytes()


def test_the_list_has_every_experiment(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--list"]) == 0
    listed = capsys.readouterr().out.splitlines()
    expected = ["instrument:", *names(), "sensing:", *SENSING, "concentric:", *TITLES]
    assert [line.split()[0] for line in listed] == expected


def test_all_runs_every_experiment_for_every_case_it_lists(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "all.json"
    command = ["run", "all", "--plant", "kinematic", "--seconds", "0.1", "--json", str(file)]
    assert main(command) == 0
    found = [(one["experiment"], one["case"]) for one in json.loads(file.read_text())]
    assert found == [(name, case) for name in names() for case in experiment(name, load()).cases]
    assert len(capsys.readouterr().out.splitlines()) == 1 + len(found)
    assert main([*command, "--case", "pointing"]) == 0
    cases = [one["case"] for one in json.loads(file.read_text())]
    assert cases == ["pointing"] * len(names())


def test_a_run_can_be_recorded_and_computed_anew(
    tmp_path: Path, short: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "deep" / "run.mcap"
    command = ["run", "--plant", "kinematic", "--path", short, "--record", str(file)]
    assert main(command) == 0
    assert main(["replay", str(file), "--verify"]) == 0
    capsys.readouterr()
    assert str(file) in refused(command, capsys)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_stopped_still_writes_its_json(
    tmp_path: Path, number: signal.Signals
) -> None:
    long = tmp_path / "long.csv"
    long.write_text(HEAD + "0,0,0,0,1,0,0,0\n900,10,0,0,1,0,0,0\n")
    figures, trace = tmp_path / "figures.json", tmp_path / "trace.csv"
    arguments = [
        "run",
        "--plant",
        "kinematic",
        "--path",
        str(long),
        "--json",
        str(figures),
        "--trace",
        str(trace),
    ]
    process = subprocess.Popen(
        module_command("server.command_line", arguments),
        env=module_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        until = time.monotonic() + 120.0
        while not trace.exists() and time.monotonic() < until:
            time.sleep(0.02)
        time.sleep(1.0)
        process.send_signal(number)
        output, complaint = process.communicate(timeout=120.0)
    finally:
        process.kill()
    assert process.returncode == 1
    assert complaint == ""
    assert "interrupted" in output
    document = json.loads(figures.read_text())
    assert document["ended"] == "interrupted"
    assert 0 < document["steps"] < 450_001
    assert len(lines(trace)) == 1 + document["steps"]
    assert document["errors"]["position_mm"]["max"] <= 0.01


def test_a_run_leaves_the_signals_as_they_were(short: str) -> None:
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    assert main(["run", "--plant", "kinematic", "--path", short]) == 0
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before


def test_a_fault_ends_the_run_with_its_reason(
    short: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    settling = round(500 * SETTLING_S)

    class Failing(KinematicPlant):
        reads = 0

        def read(self) -> Measurement:
            Failing.reads += 1
            return super().read()._replace(valid=Failing.reads < settling + 100)

    monkeypatch.setattr(headless_run, "simulated_plant", Failing)
    assert main(["run", "--plant", "kinematic", "--path", short, "--json", "-"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["ended"] == "measurements from the robot stopped"
    assert 50 < document["steps"] < 100


BAD_PATHS = {
    "not a number": (HEAD + "0,0,0,0,1,0,0,0\n1,0,zero,0,1,0,0,0\n", "line 3, column y_mm"),
    "NaN": (HEAD + "0,0,0,0,1,0,0,0\n1,0,0,0,1,nan,0,0\n", "line 3, column qx"),
    "zero quaternion": (HEAD + "0,0,0,0,0,0,0,0\n1,0,0,0,1,0,0,0\n", "line 2, column qw"),
    "other columns": ("t,x,y,z\n0,0,0,0\n", "line 1"),
    "empty": ("", "line 1"),
}


@pytest.mark.parametrize("what", BAD_PATHS)
def test_a_malformed_path_names_file_line_and_column(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str
) -> None:
    file = tmp_path / "bad.csv"
    text, place = BAD_PATHS[what]
    file.write_text(text)
    complaint = refused(["run", "--path", str(file)], capsys)
    assert complaint.startswith(f"keyhole: {file}, {place}")


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What is said in one line on stderr, with exit status 2 and nothing on stdout."""
    assert main(arguments) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.count("\n") == 1
    assert output.err.endswith("\n")
    assert "Traceback" not in output.err
    return output.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run"], "name of an experiment or --path"),
        (["run", "circle", "--path", "x.csv"], "name of an experiment or --path"),
        (["run", "spiral"], "choose one of: arc, arc-stylus, circle, circle-yz"),
        (["run", "circle", "--case", "3"], "invalid choice: '3'"),
        (["run", "circle", "--solver", "magic"], "invalid choice: 'magic'"),
        (["run", "circle", "--coordinates", "xy"], "invalid choice: 'xy'"),
        (["run", "circle", "--plant", "steam"], "invalid choice: 'steam'"),
        (["run", "circle", "--preset", "shiny"], "invalid choice: 'shiny'"),
        (["run", "circle", "--actuation", "steam"], "invalid choice: 'steam'"),
        (["run", "circle", "--compensation", "half"], "invalid choice: 'half'"),
        (["run", "circle", "--tracker", "maybe"], "invalid choice: 'maybe'"),
        (["run", "circle", "--board", "chess"], "invalid choice: 'chess'"),
        (["run", "circle", "--seed", "-1"], "a seed is a whole number from 0"),
        (["run", "circle", "--seed", "1.5"], "a seed is a whole number from 0"),
        (["run", "circle", "--seed", "9999999999"], "a seed is a whole number from 0"),
        (["run", "circle", "--seconds", "nan"], "must be a number above 0"),
        (["run", "all", "--trace", "x.csv"], "--trace is of one run"),
        (["run", "all", "--record", "x.mcap"], "--record is of one run"),
        (["run", "circle", "--calibration", "no/such.toml"], "no/such.toml"),
        (["run", "circle", "twice"], "unrecognized arguments"),
        (["run", "--path", "no/such/file.csv"], "no/such/file.csv: No such file"),
        (["run", "--path", "/"], "/: Is a directory"),
        (["run", "circle", "--config", "no/such.toml"], "no/such.toml"),
        (["run", "circle", "--json", "no/such/folder/x.json"], "cannot be written"),
        (["run", "circle", "--trace", "/"], "cannot be written"),
    ],
)
def test_what_cannot_be_run_is_refused_in_one_line(
    capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    assert words in refused(arguments, capsys)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("schema_version = = 1", "line 1"),
        ("schema_version = 2", "schema_version"),
        ("", "schema_version is refused: Field required"),
    ],
)
def test_a_broken_configuration_is_refused_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, words: str
) -> None:
    file = tmp_path / "lab.toml"
    file.write_text(text)
    complaint = refused(["run", "circle", "--config", str(file)], capsys)
    assert str(file) in complaint
    assert words in complaint


def test_what_is_not_text_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "path.csv"
    file.write_bytes(b"\xff\xfe\x00")
    assert "is not text" in refused(["run", "--path", str(file)], capsys)


def test_a_start_out_of_reach_is_refused_before_anything_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    far = configured(tmp_path, {"[0.400, 0.0, 0.120] ": "[1.9, 0.0, 0.1] "})
    assert "cannot be reached" in refused(["run", "circle", *far], capsys)


def test_the_program_itself_refuses_without_a_traceback(tmp_path: Path) -> None:
    file = tmp_path / "bad.csv"
    file.write_text(HEAD + "0,0,0,0,1,0,0,0\n1,0,0,inf,1,0,0,0\n")
    done = subprocess.run(
        module_command("server.command_line", ["run", "--path", str(file)]),
        env=module_environment(),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (done.returncode, done.stdout) == (2, "")
    expected = f"keyhole: {file}, line 3, column z_mm: inf is not a finite number\n"
    assert done.stderr == expected


def test_tendons_hold_tensions_where_the_unit_measures_them(
    short: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["run", "--path", short, "--tendons", "hybrid", "--co-contraction", "2.5"]
    assert main(asked) == 2
    assert "hybrid control needs a robot that measures" in capsys.readouterr().err
    file = tmp_path / "held.json"
    assert main([*asked, "--actuation", "tension-unit", "--json", str(file)]) == 0
    assert "tension unit, hybrid control, 2.5 N at least" in capsys.readouterr().out
    found = json.loads(file.read_text())
    assert found["actuation"] == "tension-unit"
    assert found["tendons"] == {"control": "hybrid", "co_contraction_n": 2.5}
    assert main([*asked[:-1], "9", "--actuation", "tension-unit"]) == 2
    assert "at most 8.44 N" in capsys.readouterr().err
