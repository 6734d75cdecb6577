"""``keyhole report``: all of the paper's experiments, and one page about them."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from robot.configuration import Configuration
from scenes.experiments import experiment
from server.commands.stop_signals import StopSignals
from server.commands.study import add_worker_arguments, calibration_text, seeds
from server.configuration_file import load
from server.report.results import Results, tasks
from server.run.headless import HeadlessRun
from server.run.options import PLANTS, PRESETS, cut, options_for
from server.study.folder import StudyFolder
from server.study.local_workers import default_jobs
from server.study.program_mark import program_mark
from server.study.study import Study, StudyResult
from server.version import version

PAGE = "report.html"
_SEEDS = [1, 2, 3, 4, 5]
_QUICK_S = 2.0
_SPEED_S = 5.0


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``report`` to the command line."""
    parser = subparsers.add_parser("report", help="run the paper's experiments, write one page")
    parser.add_argument("--out", metavar="DIR", required=True, help=f"folder of runs and {PAGE}")
    parser.add_argument("--seeds", metavar="LIST", type=seeds, help="seeds (1-5)")
    parser.add_argument("--preset", choices=PRESETS, default="paper", help="simulated robot")
    parser.add_argument("--plant", choices=PLANTS, default="physics", help="the robot")
    parser.add_argument(
        "--quick", action="store_true", help="one seed, the first seconds of each path only"
    )
    parser.add_argument("--config", metavar="FILE", help="configuration (TOML)")
    add_worker_arguments(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Run what is not yet run, and write the page.

    Returns:
        0 when the page holds every run, 1 when it was stopped or a run could not be made.
    """
    configuration = load(arguments.config)
    chosen = arguments.seeds or (_SEEDS[:1] if arguments.quick else _SEEDS)
    seconds = _QUICK_S if arguments.quick else None
    folder = StudyFolder(Path(arguments.out))
    wanted = tasks(arguments.plant, arguments.preset, chosen, seconds)
    study = Study(
        wanted,
        configuration,
        calibration_text(arguments.calibration),
        folder,
        arguments.jobs or default_jobs(),
        arguments.scheduler,
    )
    with StopSignals() as stopped:
        result = study.run(stopped.received)
        if result.stopped:
            count = len(result.documents)
            print(f"stopped: {count} of {len(wanted)} runs are finished; no page is written")
            return 1
        factor = _speed(configuration, arguments)
    _write(arguments, configuration, result, folder, chosen, seconds, factor)
    print(folder.path / PAGE)
    for task, failure in result.failures.items():
        print(f"keyhole: {task.words()}: {failure}", file=sys.stderr)
    return 1 if result.failures else 0


def _speed(configuration: Configuration, arguments: argparse.Namespace) -> float:
    """Plant time over wall time of the circle's first seconds, with nothing else running."""
    found = experiment("circle", configuration)
    options = options_for(
        found,
        configuration,
        "0",
        plant=arguments.plant,
        preset=arguments.preset,
        compensation="off",
        path=cut(found.path, _QUICK_S if arguments.quick else _SPEED_S),
    )
    run = HeadlessRun(configuration, options)
    return run.execute(lambda _: None, lambda: False).realtime_factor


def _write(
    arguments: argparse.Namespace,
    configuration: Configuration,
    result: StudyResult,
    folder: StudyFolder,
    chosen: list[int],
    seconds: float | None,
    factor: float,
) -> None:
    # The drawing library takes a second to load; a refusal need not wait for it.
    from server.report.page import Conditions, page

    command = f"keyhole report --out DIR --preset {arguments.preset} --plant {arguments.plant}"
    command += f" --seeds {','.join(map(str, chosen))}" + " --quick" * arguments.quick
    conditions = Conditions(
        arguments.plant,
        arguments.preset,
        chosen,
        seconds,
        factor,
        version(),
        program_mark()[:16],
        command,
        [f"{task.words()}: {failure}" for task, failure in result.failures.items()],
    )
    text = page(Results(result, folder), configuration, conditions)
    folder.write(PAGE, text.encode())
