"""``keyhole run`` of shape and force sensing: what it must show, keys, repeatability, refusals."""

from __future__ import annotations

import dataclasses
import functools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hardware.tension_unit.chirp import BANDS_HZ, run_chirp
from scenes.experiments.sensing import TITLES
from server.command_line import main
from server.configuration_file import load
from server.run.sensing_chirp import chirp_run, lag_deg
from server.run.sensing_coverage import run_coverage
from server.run.sensing_figures import coverage_document, sensing_document
from server.run.sensing_options import SensingOptions
from server.run.sensing_run import SensingResult, run_sensing

CONFIGURATION = str(Path(__file__).parents[2] / "robot" / "keyhole.toml")
QUIET, NOISY = (0.1, 0.25), (0.25, 0.5)
SEEDS = (1, 2)


@functools.cache
def result(name: str, noise: tuple[float, float], seed: int, friction: float) -> SensingResult:
    options = SensingOptions(name, *noise, friction=friction, seed=seed, samples=40)
    return run_sensing(options, lambda _: None, lambda: False)


def figures(
    name: str, noise: tuple[float, float] = QUIET, seed: int = 1, friction: float = 0.15
) -> dict[str, Any]:
    options = SensingOptions(name, *noise, friction=friction, seed=seed, samples=40)
    return sensing_document(options, result(name, noise, seed, friction))


@functools.cache
def covered(noise: tuple[float, float]) -> dict[str, Any]:
    options = SensingOptions("coverage", *noise, trials=40)
    return coverage_document(options, run_coverage(options, lambda _: None, lambda: False))


@pytest.mark.parametrize("seed", SEEDS)
def test_in_contact_the_shape_is_found_and_an_arc_is_none(seed: int) -> None:
    document = figures("force-levels", QUIET, seed)
    ours, arc = document["shape_error_mm"], document["constant_curvature"]["shape_error_mm"]
    assert ours["rms"] <= 0.10
    assert 5.0 * ours["rms"] <= arc["rms"]
    assert 5.0 * ours["mean"] <= arc["mean"]
    assert figures("force-levels", NOISY, seed)["shape_error_mm"]["rms"] <= 0.20


@pytest.mark.parametrize("seed", SEEDS)
def test_the_contact_force_is_found_from_one_sample_and_better_from_twenty(seed: int) -> None:
    document = figures("force-levels", NOISY, seed)
    assert document["force_error_percent"]["rms"] <= 12.0
    assert document["mean_of_20"]["force_error_percent"]["rms"] <= 4.0
    assert document["force_error_n"]["rms"] <= 0.01
    true = [row["true_n"] for row in document["levels"]]
    assert true == sorted(true)
    assert 0.02 < true[0] < 0.04
    assert 0.30 < true[-1] < 0.36
    polynomial = document["polynomial_curvature"]["force"]
    assert polynomial["equation_43"]["force_error_percent"]["rms"] > 20.0
    assert set(polynomial) == {"axis_known", "without_moment", "equation_43"}
    arc = document["constant_curvature"]["force"]
    assert arc["equation_43"]["force_error_percent"]["rms"] == pytest.approx(100.0, abs=1.0)
    # Without the axis the force in the bending plane is hardly seen, and the covariance says so.
    assert document["force"]["axis_free"]["vector_error_n"]["rms"] > 0.05
    assert all(row["inside_percent"]["axis_free"] > 80.0 for row in document["levels"])


@pytest.mark.parametrize("noise", [QUIET, NOISY])
def test_in_free_bending_without_friction_the_arc_wins_and_with_friction_it_loses(
    noise: tuple[float, float],
) -> None:
    smooth = figures("shape-free", noise, friction=0.0)
    arc = smooth["constant_curvature"]["shape_error_mm"]["rms"]
    assert arc < smooth["shape_error_mm"]["rms"]
    assert arc < smooth["polynomial_curvature"]["shape_error_mm"]["rms"]
    rough = figures("shape-free", noise)
    assert rough["constant_curvature"]["shape_error_mm"]["rms"] > rough["shape_error_mm"]["rms"]
    # Told that nothing touches, tensions make up for what the pose does not show.
    assert rough["no_contact"]["shape_error_mm"]["rms"] < 0.06
    assert smooth["no_contact"]["shape_error_mm"]["rms"] <= 1.1 * arc


@pytest.mark.parametrize("noise", [QUIET, NOISY])
def test_regions_hold_the_truth_as_often_as_they_say(noise: tuple[float, float]) -> None:
    document = covered(noise)
    assert document["trials"] == 40
    for block in (document["axis_known"], document["axis_free"]):
        assert 85.0 <= block["inside_percent"] <= 100.0
    assert 0.6 < document["axis_known"]["width_ratio"] < 2.0
    assert 0.6 < document["axis_free"]["width_ratio_max"] < 2.0


@pytest.mark.parametrize("seed", SEEDS)
def test_the_calibration_finds_a_rod_of_its_own(seed: int) -> None:
    document = figures("force-levels", QUIET, seed)
    found, true = document["calibrated"], document["true"]
    assert found["stiffness"] == pytest.approx(true["stiffness"], rel=0.01)
    assert found["friction"] == pytest.approx(true["friction"], rel=0.06)
    assert abs(found["stiffness_error_percent"]) < 4.0 * found["stiffness_deviation_percent"]
    assert true["stiffness"] != pytest.approx(1.841e-4, rel=1e-4)
    assert len({figures("force-levels", QUIET, one)["true"]["stiffness"] for one in SEEDS}) == len(
        SEEDS
    )


def test_pulling_takes_more_tension_than_releasing() -> None:
    rough, smooth = figures("pull-release"), figures("pull-release", friction=0.0)
    assert [pair["name"] for pair in rough["pairs"]] == [
        *("pull 1, release 3", "pull 2, release 4", "pull 3, release 1", "pull 4, release 2")
    ]
    for pair in rough["pairs"]:
        assert pair["ratio"]["pulling"] == pytest.approx(1.087, abs=0.04)
        assert pair["ratio"]["releasing"] == pytest.approx(0.911, abs=0.03)
        assert max(pair["off_line_n"].values()) < 0.04
        assert 45.0 < pair["bend_max_deg"] < 65.0
    for pair in smooth["pairs"]:
        assert list(pair["ratio"].values()) == pytest.approx([1.0, 1.0], abs=0.01)


def test_noisier_tensions_cost_force(capsys: pytest.CaptureFixture[str]) -> None:
    errors = []
    for tension in ("0", "0.02", "0.15"):
        options = ["--noise", "0.25,0.5", "--tension-noise", tension, "--samples", "20"]
        assert main(["run", "force-levels", *options, "--json", "-"]) == 0
        document = json.loads(capsys.readouterr().out)
        assert document["noise"]["tension_n"] == float(tension)
        errors.append(document["force_error_percent"]["rms"])
    assert errors[0] < 4.0 < errors[1] < 12.0 < errors[2]


def test_without_noise_in_the_pose_the_shape_is_nearly_exact() -> None:
    document = figures("force-levels", (0.0, 0.0))
    assert document["shape_error_mm"]["rms"] < 0.01
    assert document["axis_known"]["shape_error_mm"]["rms"] < 0.01


def test_the_torque_cell_is_smoother_than_the_current(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "chirp", "--seed", "2", "--json", "-"]) == 0
    document = json.loads(capsys.readouterr().out)
    torque = document["torque_error_mnm"]
    assert torque["cell"]["rms"] < 3.0
    assert torque["current"]["rms"] > 5.0 * torque["cell"]["rms"]
    assert document["position_error_rad"]["rms"] < 0.02 * document["amplitude_rad"]
    assert all(abs(lag) < 3.0 for lag in document["lag_deg"].values())
    assert chirp_run(load().tension_unit, 2)[0] == document
    assert main(["run", "chirp"]) == 0
    told = capsys.readouterr().out
    for words in ("chirp, seed 1: completed", "torque, cell", "torque, current", "mrad rms"):
        assert words in told


def test_the_lag_of_a_motor_that_follows_exactly_is_none() -> None:
    found = run_chirp(load().tension_unit, 1)
    exact = dataclasses.replace(found, encoder_rad=found.commanded_rad)
    late = dataclasses.replace(found, encoder_rad=np.roll(found.commanded_rad, 2))
    for low, high in BANDS_HZ:
        assert lag_deg(exact, low, high) == pytest.approx(0.0, abs=1e-9)
        assert 360.0 * low * 0.002 < lag_deg(late, low, high) < 360.0 * high * 0.002


@pytest.mark.parametrize("name", ["shape-free", "force-levels", "pull-release", "coverage"])
def test_equal_seeds_repeat_bit_for_bit_and_others_do_not(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    found = []
    for seed in ("4", "4", "5"):
        options = ["--trials", "3"] if name == "coverage" else []
        options += ["--samples", "3"] if name in ("shape-free", "force-levels") else []
        assert main(["run", name, "--seed", seed, *options, "--json", "-"]) == 0
        output = capsys.readouterr()
        assert output.err == ""
        document = json.loads(output.out)
        times = document.pop("estimate_us")
        assert 0.0 < times["p50"] <= times["p99"]
        found.append(document)
    assert found[0] == found[1]
    assert found[0]["force_error_n"] != found[2]["force_error_n"]


@pytest.mark.parametrize("name", ["shape-free", "force-levels", "pull-release"])
def test_the_json_holds_what_programs_rely_on(name: str) -> None:
    document = figures(name)
    assert (document["experiment"], document["seed"], document["ended"]) == (name, 1, "completed")
    assert document["noise"] == {
        "position_mm": 0.1,
        "angle_deg": 0.25,
        "tension_n": 0.02,
        "length_mm": 0.01,
    }
    for block in (document, document["constant_curvature"], document["polynomial_curvature"]):
        error = block["shape_error_mm"]
        assert 0.0 < error["mean"] <= error["rms"] <= error["max"]
    assert {"stiffness", "friction"} <= set(document["calibrated"])
    assert document["force_error_n"]["rms"] > 0.0
    assert (document["force_error_percent"]["rms"] is None) == (name != "force-levels")
    assert json.loads(json.dumps(document)) == document


def test_percent_and_means_are_of_the_errors_beside_them() -> None:
    found = result("force-levels", QUIET, 1, 0.15)
    document = figures("force-levels")
    errors = np.array([one.samples.force_along("ours_axis_known") for one in found.cases])
    true = np.array([[np.linalg.norm(one.samples.true_force)] for one in found.cases])
    rms = float(np.sqrt(np.mean((100.0 * errors / true) ** 2)))
    assert document["force_error_percent"]["rms"] == pytest.approx(rms)
    means = errors.reshape(5, 2, 20).mean(axis=2)
    rms = float(np.sqrt(np.mean((100.0 * means / true) ** 2)))
    assert document["mean_of_20"]["force_error_percent"]["rms"] == pytest.approx(rms)


def test_no_estimator_sees_the_truth() -> None:
    """With other true properties behind the same readings, every estimate stays the same."""
    found = result("shape-free", QUIET, 1, 0.15)
    options = SensingOptions("shape-free", *QUIET, samples=40)
    hidden = dataclasses.replace(found, properties=type(found.properties)())
    one, other = sensing_document(options, found), sensing_document(options, hidden)
    assert one["calibrated"]["stiffness"] == other["calibrated"]["stiffness"]
    assert one["shape_error_mm"] == other["shape_error_mm"]


def test_a_run_is_told_to_people_and_written_to_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "figures.json"
    assert main(["run", "force-levels", "--samples", "20", "--json", str(file)]) == 0
    told = capsys.readouterr().out
    assert "pose 0.1 mm, 0.25 deg; tension 0.02 N; tendon length 0.01 mm" in told
    for words in ("ours, axis known", "polynomial, equation 43", "constant curvature", "level"):
        assert words in told
    assert json.loads(file.read_text())["experiment"] == "force-levels"
    for name in ("shape-free", "pull-release"):
        assert main(["run", name]) == 0
    assert main(["run", "coverage", "--trials", "2"]) == 0
    told = capsys.readouterr().out
    for words in ("force where there is none", "pull 4, release 2", "of 2 inside the 95 %"):
        assert words in told


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["force-levels", "--noise", "0.1"], "noise is MM,DEG from 0 to 1"),
        (["force-levels", "--noise", "0.1,0.2,0.3"], "noise is MM,DEG"),
        (["force-levels", "--noise", "-0.1,0.2"], "expected one argument"),
        (["force-levels", "--noise=-0.1,0.2"], "noise is MM,DEG"),
        (["force-levels", "--noise", "nan,0.2"], "noise is MM,DEG"),
        (["force-levels", "--noise", "0.1,2.5"], "noise is MM,DEG"),
        (["force-levels", "--tension-noise", "-1"], "tension noise is a number from 0 to 0.5"),
        (["circle", "--tension-noise", "0"], "--tension-noise does not belong here"),
        (["force-levels", "--friction", "0.9"], "friction is a number from 0 to 0.4, not '0.9'"),
        (["force-levels", "--friction", "much"], "friction is a number"),
        (["force-levels", "--samples", "0"], "a whole number from 1 to 10000, not '0'"),
        (["coverage", "--trials", "x"], "a whole number from 1 to 100000, not 'x'"),
        (["coverage", "--samples", "5"], "--samples does not belong here"),
        (["pull-release", "--samples", "5"], "--samples does not belong here"),
        (["shape-free", "--trials", "5"], "--trials does not belong here: it is of 'coverage'"),
        (["chirp", "--noise", "0,0"], "--noise does not belong here"),
        (["chirp", "--friction", "0"], "--friction does not belong here"),
        (["shape-free", "--config", CONFIGURATION], "--config does not belong here"),
        (["shape-free", "--case", "1"], "--case does not belong here"),
        (["shape-free", "--trace", "t.csv"], "--trace does not belong here"),
        (["shape-free", "--method", "hqp"], "--method does not belong here"),
        (["circle", "--noise", "0.1,0.2"], "--noise does not belong here"),
        (["circle", "--friction", "0"], "--friction does not belong here"),
        (["rectangle", "--trials", "5"], "--trials does not belong here"),
        (["shape-free", "--json", "/nowhere/f.json"], "/nowhere/f.json cannot be written"),
    ],
)
def test_what_does_not_belong_together_is_refused_in_one_line(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", *arguments]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert len(output.err.splitlines()) == 1
    assert words in output.err


def test_the_list_names_every_experiment(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--list"]) == 0
    listed = capsys.readouterr().out.split("sensing:\n")[1].split("concentric:\n")[0]
    assert [line.split()[0] for line in listed.splitlines()] == list(TITLES)


def test_a_run_that_is_stopped_says_so() -> None:
    asked = iter([False, False, True])
    options = SensingOptions("force-levels", samples=2)
    found = run_sensing(options, lambda _: None, lambda: next(asked, True))
    document = sensing_document(options, found)
    assert document["ended"] == "interrupted"
    assert len(document["levels"]) < 5
    covered = run_coverage(SensingOptions("coverage", trials=3), lambda _: None, lambda: True)
    assert (covered.ended, covered.true) == ("interrupted", [])
