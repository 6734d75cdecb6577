"""``keyhole run`` for shape and force sensing: noise, friction, samples, trials."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

from robot.configuration import Configuration
from scenes.experiments.sensing import CHIRP, COVERAGE, PULL_RELEASE, TITLES
from server.commands.progress_bar import ProgressBar
from server.commands.run_refusals import check_writable, refuse_options
from server.commands.stop_signals import StopSignals
from server.run.sensing_chirp import chirp_run, printed_chirp
from server.run.sensing_coverage import run_coverage
from server.run.sensing_figures import coverage_document, sensing_document
from server.run.sensing_options import (
    FRICTION_MAX,
    NOISE_MAX_DEG,
    NOISE_MAX_MM,
    SAMPLES_MAX,
    TENSION_MAX_N,
    TENSION_NOISE_N,
    TRIALS_MAX,
    SensingOptions,
)
from server.run.sensing_run import Interrupted, Progress, run_sensing
from server.run.sensing_tables import printed_sensing

SENSING_OPTIONS = ("noise", "tension_noise", "friction", "samples", "trials")
_OTHER_OPTIONS = (
    *("path", "case", "solver", "coordinates", "plant", "preset", "actuation", "tracker"),
    *(
        "compensation",
        "tendons",
        "co_contraction",
        "board",
        "seconds",
        "calibration",
        "record",
        "realtime",
        "trace",
    ),
    *("method", "configuration", "count"),
)


def add_sensing_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the sensing experiments."""
    parser.add_argument(
        "--noise", type=noise, metavar="MM,DEG", help="standard deviations of a sensed tip pose"
    )
    parser.add_argument(
        "--tension-noise",
        type=tension_noise,
        metavar="N",
        help=f"standard deviation of a sensed tension, N ({TENSION_NOISE_N:g})",
    )
    parser.add_argument(
        "--friction", type=friction, metavar="MU", help="of the tendons in the sensed segment"
    )
    parser.add_argument(
        "--samples", type=_samples, metavar="N", help="measurements of each bend or level"
    )
    parser.add_argument("--trials", type=_trials, metavar="N", help=f"of {COVERAGE}")


def noise(text: str) -> tuple[float, float]:
    """Position (mm) and angle (deg) noise from the command line."""
    try:
        position, angle = (float(one) for one in text.split(","))
    except ValueError:
        position, angle = math.nan, math.nan
    if not (0.0 <= position <= NOISE_MAX_MM and 0.0 <= angle <= NOISE_MAX_DEG):
        raise argparse.ArgumentTypeError(
            f"noise is MM,DEG from 0 to {NOISE_MAX_MM:g} and 0 to {NOISE_MAX_DEG:g}, not {text!r}"
        )
    return position, angle


def friction(text: str) -> float:
    """A coefficient of friction from the command line."""
    return _number("friction", text, FRICTION_MAX)


def tension_noise(text: str) -> float:
    """Noise of a tension in N from the command line."""
    return _number("tension noise", text, TENSION_MAX_N)


def _number(what: str, text: str, most: float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= most:
        raise argparse.ArgumentTypeError(f"{what} is a number from 0 to {most:g}, not {text!r}")
    return value


def _samples(text: str) -> int:
    return _whole(text, SAMPLES_MAX)


def _trials(text: str) -> int:
    return _whole(text, TRIALS_MAX)


def _whole(text: str, most: int) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= most:
        raise argparse.ArgumentTypeError(f"a whole number from 1 to {most}, not {text!r}")
    return int(text)


def is_for_sensing(arguments: argparse.Namespace) -> bool:
    """Whether the command line names a sensing experiment."""
    return arguments.name in TITLES and arguments.robot is None


def print_sensing_list() -> None:
    """Print the experiments."""
    print("sensing:")
    for name, title in TITLES.items():
        print(f"{name:<20}            {title}")


def execute_sensing(arguments: argparse.Namespace, configuration: Configuration) -> int:
    """Run it.

    Args:
        arguments: the command line.
        configuration: of the tension unit's modules; rods are drawn, not configured.

    Returns:
        0 when it was run to its end, 1 when it was stopped before; then nothing is written where
        no figure is there yet.
    """
    options = _options(arguments)
    check_writable(arguments.json)
    with StopSignals() as stopped:
        bar = ProgressBar(options.experiment)
        document = _figures(options, configuration, bar, stopped.received)
        bar.end()
    if document is None:
        print("stopped before there was any figure")
        return 1
    text = json.dumps(document, indent=2)
    if arguments.json == "-":
        print(text)
    else:
        if arguments.json:
            Path(arguments.json).write_text(text + "\n")
        chirp = options.experiment == CHIRP
        print(printed_chirp(document) if chirp else printed_sensing(document))
    return 0 if document["ended"] == "completed" else 1


def _figures(
    options: SensingOptions,
    configuration: Configuration,
    progress: Progress,
    interrupted: Interrupted,
) -> dict[str, Any] | None:
    """The document of any experiment; None where it was stopped before the first figure."""
    if options.experiment == CHIRP:
        return chirp_run(configuration.tension_unit, options.seed)[0]
    if options.experiment == COVERAGE:
        covered = run_coverage(options, progress, interrupted)
        return coverage_document(options, covered) if covered.true else None
    return sensing_document(options, run_sensing(options, progress, interrupted))


def _options(arguments: argparse.Namespace) -> SensingOptions:
    """What the command line asks for; refuses what does not belong together."""
    refuse_options(arguments, _OTHER_OPTIONS, "the sensing experiments have no such thing")
    name = arguments.name
    if name == CHIRP:
        refuse_options(arguments, SENSING_OPTIONS, "a module alone has neither tip nor tendons")
    else:
        refuse_options(arguments, ("config",), "rods are drawn from the seed, not configured")
    if name in (COVERAGE, PULL_RELEASE):
        refuse_options(arguments, ("samples",), "it measures once at each stop or trial")
    if name != COVERAGE:
        refuse_options(arguments, ("trials",), f"it is of {COVERAGE!r} only")
    given = {
        "friction": arguments.friction,
        "seed": arguments.seed,
        "samples": arguments.samples,
        "trials": arguments.trials,
        "tension_n": arguments.tension_noise,
    }
    if arguments.noise is not None:
        given["position_mm"], given["angle_deg"] = arguments.noise
    return SensingOptions(name, **{key: one for key, one in given.items() if one is not None})
