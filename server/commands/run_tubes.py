"""``keyhole run`` for the two concentric-tube arms: experiments, methods, starts, point files."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from robot.concentric.design import METHODS, Concentric
from robot.errors import UnknownName
from scenes.experiments.tube_paths import parse_points
from scenes.experiments.tubes import POINTS, RANDOM, TITLES, TRADE_OFF, TubeMotion, motions, starts
from server.commands.progress_bar import ProgressBar
from server.commands.run_refusals import RunArgumentError, check_writable, refuse_options, text_of
from server.commands.stop_signals import StopSignals
from server.run.tube_figures import gathered, printed, tube_document
from server.run.tube_run import TubeResult, TubeRun, TubeTask, trace_columns

ALL = "all"
COUNT_DEFAULT, COUNT_MAX = 20, 1000
SEED_DEFAULT = 1
TUBE_OPTIONS = ("method", "configuration", "count")
_INSTRUMENT_OPTIONS = (
    *("case", "solver", "coordinates", "plant", "preset", "actuation", "tracker", "compensation"),
    *("tendons", "co_contraction", "board", "seconds", "calibration", "record", "realtime"),
)


class _Sweep(NamedTuple):
    """What is to be run: every motion by every method from every start."""

    experiment: str
    played: tuple[TubeMotion, ...]
    methods: tuple[str, ...]
    starts: dict[str, np.ndarray]
    stops_unreached: bool


def add_tube_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the concentric-tube experiments."""
    parser.add_argument(
        "--robot", choices=("instrument", "concentric"), help="whose path --path FILE is"
    )
    parser.add_argument(
        "--method", choices=(*METHODS, ALL), help="how tubes resolve the redundancy"
    )
    parser.add_argument(
        "--configuration", metavar="N", help=f"where the tubes start: 1, 2, 3 ... or {ALL}"
    )
    parser.add_argument("--count", type=_count, metavar="N", help="how many random starts")


def _count(text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= COUNT_MAX:
        raise argparse.ArgumentTypeError(
            f"a count is a whole number from 1 to {COUNT_MAX}, not {text!r}"
        )
    return int(text)


def is_for_tubes(arguments: argparse.Namespace) -> bool:
    """Whether the command line means the concentric-tube arms."""
    if arguments.robot is not None:
        return bool(arguments.robot == "concentric")
    return arguments.name in TITLES


def print_tube_list() -> None:
    """Print the experiments."""
    print("concentric:")
    for name, title in TITLES.items():
        print(f"{name:<20}            {title}")


def execute_tubes(arguments: argparse.Namespace, design: Concentric) -> int:
    """Run it.

    Returns:
        0 when every path was played to its end, 1 when one was stopped before: by the user, or at
        a point of a file that was not reached.
    """
    sweep = _sweep(arguments, design)
    check_writable(arguments.json)
    check_writable(arguments.trace)
    runs = [
        (motion, method, TubeTask(
            motion.name if sweep.experiment == TRADE_OFF else sweep.experiment,
            name, start, motion.offsets, motion.relative_offset, sweep.stops_unreached,
        ))
        for motion in sweep.played
        for method in sweep.methods
        for name, start in sweep.starts.items()
    ]  # fmt: skip
    documents = []
    with StopSignals() as stopped:
        for place, (_, method, task) in enumerate(runs, 1):
            title = f"{task.experiment}, {method}, start {task.configuration}"
            bar = ProgressBar(title + f" ({place}/{len(runs)})" * (len(runs) > 1))
            run = TubeRun(design, task, method, arguments.trace is not None)
            result = run.execute(bar, stopped.received)
            bar.end()
            documents.append(tube_document(task, method, result))
            if arguments.trace:
                _write_trace(arguments.trace, result)
            if stopped.received():
                break
    gathered_documents = _gathered(sweep, documents)
    _tell(sweep, gathered_documents, arguments)
    return 0 if all(document["ended"] == "completed" for document in documents) else 1


def _gathered(sweep: _Sweep, documents: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """A document for each path and method, gathered over the starts where there are several."""
    if len(sweep.starts) == 1:
        return list(documents)
    found = []
    for motion in sweep.played:
        for method in sweep.methods:
            name = motion.name if sweep.experiment == TRADE_OFF else sweep.experiment
            chosen = [d for d in documents if (d["experiment"], d["method"]) == (name, method)]
            if chosen:
                found.append(gathered(chosen))
    return found


def _tell(sweep: _Sweep, found: Sequence[dict[str, Any]], arguments: argparse.Namespace) -> None:
    document: dict[str, Any] = dict(found[0])
    if len(found) > 1 or len(sweep.methods) > 1:
        document = {
            "experiment": sweep.experiment,
            "robot": "concentric",
            "method": ALL if len(sweep.methods) > 1 else sweep.methods[0],
            "configuration": ALL if len(sweep.starts) > 1 else next(iter(sweep.starts)),
            "runs": list(found),
        }
    if sweep.experiment == RANDOM:
        document["seed"] = SEED_DEFAULT if arguments.seed is None else arguments.seed
        document["count"] = len(sweep.starts)
    text = json.dumps(document, indent=2)
    if arguments.json == "-":
        print(text)
        return
    if arguments.json:
        Path(arguments.json).write_text(text + "\n")
    print(printed(found))


def _write_trace(name: str, result: TubeResult) -> None:
    with open(name, "w", newline="") as file:
        file.write(",".join(trace_columns(result.tubes)) + "\n")
        file.writelines(",".join(map(repr, row.tolist())) + "\n" for row in result.trace)


def _sweep(arguments: argparse.Namespace, design: Concentric) -> _Sweep:
    """What the command line asks for; refuses what does not belong together."""
    name = arguments.name
    refuse_options(arguments, _INSTRUMENT_OPTIONS, "the concentric-tube arms have no such thing")
    if arguments.path is not None and name not in (None, POINTS):
        raise RunArgumentError("give either the name of an experiment or --path FILE")
    if name is None and arguments.path is not None:
        name = POINTS
    if name is None:
        raise RunArgumentError("give either the name of an experiment or --path FILE")
    if name not in TITLES:
        raise UnknownName("concentric-tube experiment", name, tuple(TITLES))
    if name == RANDOM:
        refuse_options(arguments, ("configuration",), "random starts are counted with --count")
    else:
        refuse_options(arguments, ("count", "seed"), f"it is of {RANDOM!r} only")
    if name == POINTS:
        if arguments.path is None:
            raise RunArgumentError("points need --path FILE with the columns x_mm,y_mm,z_mm")
        offsets = parse_points(text_of(arguments.path), arguments.path)
        played: tuple[TubeMotion, ...] = (TubeMotion(Path(arguments.path).name, offsets),)
    else:
        played = motions(name)
    methods = _methods(arguments.method, name, design)
    places = _starts(arguments, name, design)
    if arguments.trace and len(played) * len(methods) * len(places) > 1:
        raise RunArgumentError("--trace is of one run; name one path, --method and --configuration")
    experiment = played[0].name if name == POINTS else name
    return _Sweep(experiment, played, methods, places, name == POINTS)


def _methods(wanted: str | None, name: str, design: Concentric) -> tuple[str, ...]:
    if wanted == ALL or (wanted is None and name == TRADE_OFF):
        return METHODS
    return (wanted or design.method,)


def _starts(arguments: argparse.Namespace, name: str, design: Concentric) -> dict[str, np.ndarray]:
    count = COUNT_DEFAULT if arguments.count is None else arguments.count
    seed = SEED_DEFAULT if arguments.seed is None else arguments.seed
    found = starts(name, design, count, seed)
    if name == RANDOM or arguments.configuration in (None, ALL):
        if name == POINTS and arguments.configuration is None:
            return {str(design.start): found[str(design.start)]}
        return found
    if arguments.configuration not in found:
        raise UnknownName("configuration", arguments.configuration, (*found, ALL))
    return {arguments.configuration: found[arguments.configuration]}
