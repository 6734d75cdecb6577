"""``keyhole report``: the experiments of all three papers, and one page about them."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from robot.configuration import Configuration
from scenes.experiments import experiment
from server.commands.progress_bar import clock
from server.commands.run_refusals import refuse_options
from server.commands.stop_signals import StopSignals
from server.commands.study import add_worker_arguments, calibration_text, seeds
from server.configuration_file import load
from server.report.results import Results, tasks
from server.report.sensing_results import SensingResults
from server.report.sensing_tasks import sensing_csv, sensing_tasks
from server.report.tube_measures import measure_tubes
from server.report.tube_results import TubeResults
from server.report.tube_tasks import tube_csv, tube_tasks
from server.run.headless import HeadlessRun
from server.run.options import PLANTS, PRESETS, cut, options_for
from server.study.folder import StudyFolder
from server.study.local_workers import default_jobs
from server.study.program_mark import program_mark
from server.study.study import AnyTask, Study, StudyResult
from server.study.task import Task
from server.version import version

PAGE = "report.html"
PARTS = ("instrument", "concentric", "sensing")
_TUBES, _SENSING = "tubes", "sensing"
_PRESET = "paper"
_INSTRUMENT_OPTIONS = ("seeds", "preset", "plant", "calibration")
_SEEDS = [1, 2, 3, 4, 5]
_QUICK_S = 2.0
_SPEED_S = 5.0


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``report`` to the command line."""
    parser = subparsers.add_parser("report", help="run the papers' experiments, write one page")
    parser.add_argument("--out", metavar="DIR", required=True, help=f"folder of runs and {PAGE}")
    parser.add_argument("--robot", choices=PARTS, help="one part only: of a robot, or sensing")
    parser.add_argument("--seeds", metavar="LIST", type=seeds, help="of the instrument (1-5)")
    parser.add_argument("--preset", choices=PRESETS, help="how good the instrument is (paper)")
    parser.add_argument("--plant", choices=PLANTS, help="how the instrument is simulated (physics)")
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
    if arguments.robot == "concentric":
        refuse_options(
            arguments, _INSTRUMENT_OPTIONS, "the concentric-tube arms have no such thing"
        )
    if arguments.robot == "sensing":
        refuse_options(arguments, _INSTRUMENT_OPTIONS, "the sensing experiments have no such thing")
    configuration = load(arguments.config)
    folder = StudyFolder(Path(arguments.out))
    chosen = arguments.seeds or (_SEEDS[:1] if arguments.quick else _SEEDS)
    wanted = PARTS if arguments.robot is None else (arguments.robot,)
    instrument = tubes = sensing = None
    factor = None
    with StopSignals() as stopped:
        if "instrument" in wanted:
            instrument = _run_instrument(arguments, configuration, folder, chosen, stopped.received)
            if instrument.stopped:
                return _stopped(instrument)
            factor = _speed(configuration, arguments)
        if "concentric" in wanted:
            tubes = _run_tubes(arguments, configuration, folder, stopped.received)
            if tubes.study.stopped:
                return _stopped(tubes.study)
        if "sensing" in wanted:
            sensing = _run_sensing(arguments, configuration, folder, stopped.received)
            if sensing.study.stopped:
                return _stopped(sensing.study)
    failures = _failures(instrument)
    failures += _failures(None if tubes is None else tubes.study)
    failures += _failures(None if sensing is None else sensing.study)
    _write(arguments, configuration, folder, chosen, factor, failures, instrument, tubes, sensing)
    print(folder.path / PAGE)
    for failure in failures:
        print(f"keyhole: {failure}", file=sys.stderr)
    return 1 if failures else 0


def _stopped(result: StudyResult[AnyTask]) -> int:
    count = len(result.documents)
    print(f"stopped: {count} of {len(result.names)} runs are finished; no page is written")
    return 1


def _failures(result: StudyResult[AnyTask] | None) -> list[str]:
    failures: Mapping[AnyTask, str] = {} if result is None else result.failures
    return [f"{task.words()}: {failure}" for task, failure in failures.items()]


def _run_instrument(
    arguments: argparse.Namespace,
    configuration: Configuration,
    folder: StudyFolder,
    chosen: list[int],
    stopped: Callable[[], bool],
) -> StudyResult[Task]:
    seconds = _QUICK_S if arguments.quick else None
    study = Study(
        tasks(_plant(arguments), _preset(arguments), chosen, seconds),
        configuration,
        calibration_text(arguments.calibration),
        folder,
        arguments.jobs or default_jobs(),
        arguments.scheduler,
    )
    return study.run(stopped)


def _run_tubes(
    arguments: argparse.Namespace,
    configuration: Configuration,
    folder: StudyFolder,
    stopped: Callable[[], bool],
) -> TubeResults:
    began = time.monotonic()
    own = StudyFolder(folder.path / _TUBES)
    study = Study(
        tube_tasks(configuration, arguments.quick),
        configuration,
        None,
        own,
        arguments.jobs or default_jobs(),
        arguments.scheduler,
        tube_csv,
    )
    result = study.run(stopped)
    measures = None
    if not result.stopped:
        measures = measure_tubes(configuration.concentric, arguments.quick)
    took = time.monotonic() - began
    print(f"concentric tubes took {clock(took)}", file=sys.stderr)
    return TubeResults(result, own, measures, took)


def _run_sensing(
    arguments: argparse.Namespace,
    configuration: Configuration,
    folder: StudyFolder,
    stopped: Callable[[], bool],
) -> SensingResults:
    began = time.monotonic()
    own = StudyFolder(folder.path / _SENSING)
    study = Study(
        sensing_tasks(arguments.quick),
        configuration,
        None,
        own,
        arguments.jobs or default_jobs(),
        arguments.scheduler,
        sensing_csv,
    )
    result = study.run(stopped)
    took = time.monotonic() - began
    print(f"shape and force sensing took {clock(took)}", file=sys.stderr)
    return SensingResults(result, own, took)


def _plant(arguments: argparse.Namespace) -> str:
    return str(arguments.plant or PLANTS[0])


def _preset(arguments: argparse.Namespace) -> str:
    return str(arguments.preset or _PRESET)


def _speed(configuration: Configuration, arguments: argparse.Namespace) -> float:
    """Plant time over wall time of the circle's first seconds, with nothing else running."""
    found = experiment("circle", configuration)
    options = options_for(
        found,
        configuration,
        "0",
        plant=_plant(arguments),
        preset=_preset(arguments),
        compensation="off",
        path=cut(found.path, _QUICK_S if arguments.quick else _SPEED_S),
    )
    run = HeadlessRun(configuration, options)
    return run.execute(lambda _: None, lambda: False).realtime_factor


def _write(
    arguments: argparse.Namespace,
    configuration: Configuration,
    folder: StudyFolder,
    chosen: list[int],
    factor: float | None,
    failures: list[str],
    instrument: StudyResult[Task] | None,
    tubes: TubeResults | None,
    sensing: SensingResults | None,
) -> None:
    # The drawing library takes a second to load; a refusal need not wait for it.
    from server.report.page import Conditions, page

    plant, preset = _plant(arguments), _preset(arguments)
    command = "keyhole report --out DIR"
    if arguments.robot is not None:
        command += f" --robot {arguments.robot}"
    if instrument is not None:
        command += f" --preset {preset} --plant {plant} --seeds {','.join(map(str, chosen))}"
    command += " --quick" * arguments.quick
    conditions = Conditions(
        plant,
        preset,
        chosen,
        _QUICK_S if arguments.quick else None,
        factor,
        version(),
        program_mark()[:16],
        command,
        failures,
    )
    results = None if instrument is None else Results(instrument, folder)
    folder.write(PAGE, page(results, configuration, conditions, tubes, sensing).encode())
