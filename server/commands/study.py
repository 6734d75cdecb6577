"""``keyhole study``: experiments by cases, presets and seeds, on all cores or a cluster."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from robot.configuration import Configuration
from robot.errors import KeyholeError
from robot.priority.levels import CASE_NAMES
from scenes.experiments import names
from server.commands.run import given_calibration, positive, seed
from server.commands.stop_signals import StopSignals
from server.configuration_file import load
from server.run.figure_table import printed
from server.run.options import COMPENSATIONS, PLANTS, PRESETS
from server.study.folder import StudyFolder
from server.study.local_workers import default_jobs
from server.study.study import TABLE, Study, StudyResult
from server.study.task import Sweep, Task

_SEEDS_MAX = 10_000


class StudyArgumentError(KeyholeError):
    """What was asked of ``keyhole study`` cannot be done."""

    code = "study_argument"


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``study`` to the command line."""
    parser = subparsers.add_parser("study", help="run many experiments on all cores")
    parser.add_argument("--out", metavar="DIR", required=True, help="folder of the results")
    lists = (
        ("--experiments", "circle,square or all", "experiments", ("all", *names())),
        ("--cases", "0,1,2", "priority cases (those that each experiment lists)", CASE_NAMES),
        ("--plants", "physics", "plants", PLANTS),
        ("--presets", "paper,harsh", "how good the simulated robots are", PRESETS),
        ("--tracker", "on,off", "whether the tip is tracked", ("on", "off")),
        ("--compensation", "off,gain,full", "of stretch and friction", COMPENSATIONS),
    )
    for option, example, words, known in lists:
        parser.add_argument(
            option, metavar="LIST", type=_list_of(tuple(known)), help=f"{words}, as in {example}"
        )
    parser.add_argument("--seeds", metavar="LIST", type=seeds, help="seeds, as in 1-5 or 1,4,9")
    parser.add_argument(
        "--seconds", type=positive, metavar="S", help="only the first S seconds of each path"
    )
    parser.add_argument("--config", metavar="FILE", help="configuration (TOML)")
    add_worker_arguments(parser)


def add_worker_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that say who does the work."""
    parser.add_argument("--jobs", type=jobs, metavar="N", help="processes (one a core)")
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="of a Dask cluster, tcp://host:port, instead"
    )
    parser.add_argument(
        "--calibration", metavar="FILE", help="of all robots, instead of calibrating each"
    )


def _list_of(known: tuple[str, ...]) -> Callable[[str], list[str]]:
    def parse(text: str) -> list[str]:
        found = list(dict.fromkeys(part.strip() for part in text.split(",")))
        for one in found:
            if one not in known:
                raise argparse.ArgumentTypeError(
                    f"invalid choice: {one!r} (choose from {', '.join(known)})"
                )
        return found

    return parse


def seeds(text: str) -> list[int]:
    """Seeds from the command line: ``1-5``, ``1,4,9``, or both."""
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        low = seed(first)
        high = seed(last) if dash else low
        if high < low or high - low >= _SEEDS_MAX:
            raise argparse.ArgumentTypeError(
                f"{part!r} is no range of at most {_SEEDS_MAX} seeds, from low to high"
            )
        found += range(low, high + 1)
    return list(dict.fromkeys(found))


def jobs(text: str) -> int:
    """A number of processes from the command line."""
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= 1024:
        raise argparse.ArgumentTypeError(f"must be a number from 1 to 1024, not {text!r}")
    return int(text)


def execute(arguments: argparse.Namespace) -> int:
    """Run the study.

    Returns:
        0 when every path was played to its end, 1 when the study was stopped or a run was.
    """
    if arguments.jobs is not None and arguments.scheduler is not None:
        raise StudyArgumentError("give either --jobs or --scheduler: a cluster has its own workers")
    configuration = load(arguments.config)
    study = Study(
        _sweep(arguments, configuration).tasks(configuration),
        configuration,
        calibration_text(arguments.calibration),
        StudyFolder(Path(arguments.out)),
        arguments.jobs or default_jobs(),
        arguments.scheduler,
    )
    with StopSignals() as stopped:
        result = study.run(stopped.received)
    tell(result, study.folder)
    ended = {document["ended"] for document in result.documents.values()}
    return 0 if not result.stopped and not result.failures and ended <= {"completed"} else 1


def calibration_text(file: str | None) -> str | None:
    """JSON of the calibration in ``file``, for workers; None without a file."""
    given = given_calibration(file)
    return None if given is None else given.model_dump_json()


def _sweep(arguments: argparse.Namespace, configuration: Configuration) -> Sweep:
    simulation = configuration.simulation
    experiments: Sequence[str] = arguments.experiments or ["all"]
    if "all" in experiments:
        experiments = names()
    tracked = ["on" if configuration.tracker.enabled else "off"]
    return Sweep(
        experiments,
        arguments.cases,
        arguments.plants or [simulation.plant],
        arguments.presets or [simulation.preset],
        arguments.seeds or [simulation.seed],
        [one == "on" for one in arguments.tracker or tracked],
        arguments.compensation or [configuration.compensation.mode],
        arguments.seconds,
    )


def tell(result: StudyResult[Task], folder: StudyFolder) -> None:
    """Print the table, what failed, and where everything is."""
    documents = result.in_order()
    if documents:
        print(printed(documents))
    for task, failure in result.failures.items():
        print(f"keyhole: {task.words()}: {failure}", file=sys.stderr)
    count = len(result.names)
    if len(documents) < count:
        print(
            f"{len(documents)} of {count} runs are finished; the same command goes on with the rest"
        )
    print(f"{folder.path / TABLE}")
