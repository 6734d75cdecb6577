"""``keyhole run``: experiments or a path file, headless; figures as JSON, a trace as CSV."""

from __future__ import annotations

import argparse
import dataclasses
import json
from pathlib import Path
from typing import Any

from robot.calibration import Calibration
from robot.configuration import Configuration
from robot.priority.levels import CASE_NAMES
from robot.tension.feasibility import CONTROL_NAMES
from scenes.boards.board import BOARD_NAMES
from scenes.experiments import experiment, names
from scenes.path_file import parse_csv
from server.calibration import file as calibration_file
from server.commands.progress_bar import ProgressBar
from server.commands.run_refusals import RunArgumentError, check_writable, refuse_options, text_of
from server.commands.run_sensing import (
    SENSING_OPTIONS,
    add_sensing_arguments,
    execute_sensing,
    is_for_sensing,
    print_sensing_list,
)
from server.commands.run_tubes import (
    TUBE_OPTIONS,
    add_tube_arguments,
    execute_tubes,
    is_for_tubes,
    print_tube_list,
)
from server.commands.stop_signals import StopSignals
from server.configuration_file import load
from server.control.instrument_loop import COORDINATE_NAMES, SOLVER_NAMES
from server.recording.writer import RecordingWriter
from server.run.figure_table import printed
from server.run.figures import result_document
from server.run.headless import TRACE_COLUMNS, HeadlessRun, RunResult
from server.run.options import (
    ACTUATIONS,
    COMPENSATIONS,
    PLANTS,
    PRESETS,
    SEED_MAX,
    RunOptions,
    cut,
    options_for,
)

ALL = "all"


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``run`` to the command line."""
    parser = subparsers.add_parser("run", help="run an experiment or a path without a browser")
    parser.add_argument("name", nargs="?", help=f"an experiment (see --list), or {ALL}")
    parser.add_argument("--path", metavar="FILE", help="play a CSV path instead of an experiment")
    parser.add_argument("--list", action="store_true", help="list the experiments and stop")
    add_tube_arguments(parser)
    add_sensing_arguments(parser)
    parser.add_argument("--case", choices=tuple(CASE_NAMES), help="priority case")
    parser.add_argument("--solver", choices=tuple(SOLVER_NAMES), help="how the levels are solved")
    parser.add_argument(
        "--coordinates", choices=tuple(COORDINATE_NAMES), help="segment coordinates (closed forms)"
    )
    add_robot_arguments(parser)
    parser.add_argument("--tendons", choices=tuple(CONTROL_NAMES), help="what their drives hold")
    parser.add_argument(
        "--co-contraction", type=positive, metavar="N", help="tension that no tendon falls below"
    )
    parser.add_argument("--board", choices=BOARD_NAMES, help="another board than the experiment's")
    parser.add_argument(
        "--seconds", type=positive, metavar="S", help="play only the first S seconds of the path"
    )
    parser.add_argument(
        "--calibration", metavar="FILE", help="of the robot, instead of calibrating it first"
    )
    parser.add_argument("--record", metavar="FILE", help="record every tick to a new MCAP file")
    parser.add_argument("--realtime", action="store_true", help="paced by the wall clock")
    parser.add_argument("--config", metavar="FILE", help="configuration (TOML)")
    parser.add_argument("--json", metavar="FILE", help="write the figures as JSON (- for stdout)")
    parser.add_argument("--trace", metavar="FILE", help="write a CSV with a row a tick")


def add_robot_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how good the robot is, and what it knows of itself."""
    parser.add_argument("--plant", choices=PLANTS, help="the robot: physics or exact kinematics")
    parser.add_argument("--preset", choices=PRESETS, help="how good the simulated robot is")
    parser.add_argument("--seed", type=seed, metavar="N", help="which robot of that preset")
    parser.add_argument("--actuation", choices=ACTUATIONS, help="what drives the tendons")
    parser.add_argument("--tracker", choices=("on", "off"), help="whether the tip is tracked")
    parser.add_argument(
        "--compensation", choices=COMPENSATIONS, help="of the tendons' stretch and friction"
    )


def seed(text: str) -> int:
    """A seed from the command line; raises ``argparse.ArgumentTypeError`` for what is none."""
    if not text.isascii() or not text.isdigit() or int(text) > SEED_MAX:
        raise argparse.ArgumentTypeError(
            f"a seed is a whole number from 0 to {SEED_MAX}, not {text!r}"
        )
    return int(text)


def positive(text: str) -> float:
    """A number above zero from the command line."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"must be a number above 0, not {text!r}")
    return value


def execute(arguments: argparse.Namespace) -> int:
    """Run it.

    Returns:
        0 when every path was played to its end, 1 when one was stopped before.
    """
    configuration = load(arguments.config)
    if arguments.list:
        _print_list(configuration)
        print_sensing_list()
        print_tube_list()
        return 0
    if is_for_sensing(arguments):
        return execute_sensing(arguments, configuration)
    refuse_options(arguments, SENSING_OPTIONS, "it is of the sensing experiments")
    if is_for_tubes(arguments):
        return execute_tubes(arguments, configuration.concentric)
    refuse_options(arguments, TUBE_OPTIONS, "it is of the concentric-tube experiments")
    many = arguments.name == ALL and arguments.path is None
    runs = _all(arguments, configuration) if many else [_one(arguments, configuration)]
    check_writable(arguments.json)
    check_writable(arguments.trace)
    calibration = given_calibration(arguments.calibration)
    documents: list[dict[str, Any]] = []
    with StopSignals() as stopped:
        for place, options in enumerate(runs, 1):
            title = options.experiment + (f", case {options.case} ({place}/{len(runs)})" * many)
            sweeping = ProgressBar("calibrating")
            run = HeadlessRun(configuration, options, calibration, sweeping)
            sweeping.end()
            result = _play(run, title, stopped, arguments.record)
            documents.append(result_document(run.configuration, options, result))
            if arguments.trace:
                _write_trace(arguments.trace, result)
            if stopped.received():
                break
    _tell(documents if many else documents[0], arguments.json)
    return 0 if all(document["ended"] == "completed" for document in documents) else 1


def given_calibration(file: str | None) -> Calibration | None:
    """The calibration in ``file``; None without a file."""
    return None if file is None else calibration_file.load(Path(file))


def _play(run: HeadlessRun, title: str, stopped: StopSignals, record: str | None) -> RunResult:
    """Play it, with a bar, and record it if ``record`` names a file."""
    bar = ProgressBar(title)
    if record is None:
        result = run.execute(bar, stopped.received)
    else:
        with RecordingWriter(record, run.configuration, run.calibration) as writer:
            result = run.execute(bar, stopped.received, writer.append)
    bar.end()
    return result


def _tell(found: dict[str, Any] | list[dict[str, Any]], file: str | None) -> None:
    text = json.dumps(found, indent=2)
    if file == "-":
        print(text)
        return
    if file:
        Path(file).write_text(text + "\n")
    if isinstance(found, list):
        print(printed(found))
    else:
        _print_summary(found)


def _choices(arguments: argparse.Namespace) -> dict[str, Any]:
    """The fields of ``RunOptions`` that the command line sets."""
    chosen = {
        "plant": arguments.plant,
        "preset": arguments.preset,
        "seed": arguments.seed,
        "actuation": arguments.actuation,
        "tracker": None if arguments.tracker is None else arguments.tracker == "on",
        "compensation": arguments.compensation,
        "tendons": arguments.tendons,
        "co_contraction": arguments.co_contraction,
        "realtime": arguments.realtime,
    }
    for name in ("solver", "coordinates", "board"):
        if getattr(arguments, name) is not None:
            chosen[name] = getattr(arguments, name)
    return chosen


def _one(arguments: argparse.Namespace, configuration: Configuration) -> RunOptions:
    """The one run that is asked for."""
    if (arguments.name is None) == (arguments.path is None):
        raise RunArgumentError("give either the name of an experiment or --path FILE")
    priority = configuration.priority
    case, choices = arguments.case or priority.case, _choices(arguments)
    if arguments.path is None:
        options = options_for(
            experiment(arguments.name, configuration), configuration, case, **choices
        )
    else:
        fields = {"solver": priority.solver, "coordinates": priority.coordinates} | choices
        name = Path(arguments.path).name
        options = RunOptions(
            name, parse_csv(text_of(arguments.path), arguments.path), case, **fields
        )
    return dataclasses.replace(options, path=cut(options.path, arguments.seconds))


def _all(arguments: argparse.Namespace, configuration: Configuration) -> list[RunOptions]:
    """Every experiment for every case it lists, or for the one that is asked for."""
    for option in ("trace", "record"):
        if getattr(arguments, option):
            raise RunArgumentError(
                f"--{option} is of one run; name an experiment instead of {ALL!r}"
            )
    runs = []
    for name in names():
        found = experiment(name, configuration)
        cases = (arguments.case,) if arguments.case else found.cases
        path = cut(found.path, arguments.seconds)
        runs += [
            options_for(found, configuration, case, **(_choices(arguments) | {"path": path}))
            for case in cases
        ]
    return runs


def _write_trace(name: str, result: RunResult) -> None:
    with open(name, "w", newline="") as file:
        file.write(",".join(TRACE_COLUMNS) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in result.trace.tolist())


def _print_list(configuration: Configuration) -> None:
    print("instrument:")
    for name in names():
        one = experiment(name, configuration)
        print(f"{name:<20} {one.duration_s:6.1f} s   {one.title}")


def _print_summary(document: dict[str, Any]) -> None:
    print(
        f"{document['experiment']}: case {document['case']}, {document['solver']}, "
        f"{document['plant']} plant, {document['steps']} ticks: {document['ended']}"
    )
    if document["plant"] != "kinematic":
        print(
            f"  preset {document['preset']}, seed {document['seed']}, "
            f"tracker {'on' if document['tracker'] else 'off'}, "
            f"compensation {document['compensation']}"
        )
    if document["actuation"] == "tension-unit":
        held = document["tendons"]
        least = (
            "" if held["control"] == "position" else f", {held['co_contraction_n']:g} N at least"
        )
        print(f"  tension unit, {held['control']} control{least}")
    for key, unit in (("position_mm", "mm"), ("orientation_deg", "deg"), ("rcm_mm", "mm")):
        _print_extremes(key.split("_")[0], unit, document["errors"][key])
    for key in ("theta_deg", "direction_deg"):
        if "bend" in document:
            _print_extremes(key.split("_")[0], "deg", document["bend"][key])
    if document["contact"]["count"]:
        contact = document["contact"]
        print(f"  contacts     {contact['count']}, at most {contact['max_force_n']:.3f} N")
    if document["rings"]["count"]:
        rings = document["rings"]
        print(
            f"  rings        {rings['passed']} of {rings['count']} passed, "
            f"{rings['touched']} touched"
        )
    for level in (document["sensing"] or {}).get("levels", ()):
        print(
            f"  felt         {level['estimated_n']:.3f} N of {level['true_n']:.3f} N, "
            f"{level['error_percent']:.1f} % off"
        )
    if document["board"].startswith("silicon"):
        print(f"  ball         {100 * document['ball']['progress']:.1f} % of the groove")
    for words, share in document["limits"]["held_back"].items():
        print(f"  held back {100 * share:.1f} % of the time: {words}")
    print(f"  {document['realtime_factor']:.1f} times real time")


def _print_extremes(name: str, unit: str, values: dict[str, float | None]) -> None:
    if values["max"] is None:
        return
    final = values.get("final")
    line = f"  {name:<12} max {values['max']:10.5f} {unit}   rms {values['rms']:10.5f} {unit}"
    print(line + (f"   final {final:10.5f} {unit}" if final is not None else ""))
