"""``keyhole bench``: measure, beside a peer in the same run."""

from __future__ import annotations

import argparse
import importlib
import json
from pathlib import Path
from typing import Any

from robot.errors import KeyholeError
from server.configuration_file import load

BENCHMARKS = {
    "tick": ("benchmarks.tick", "the controller tick beside a pink step"),
    "plant": ("benchmarks.plant", "the simulated robot beside its bare engine"),
    "hardware": ("benchmarks.hardware", "servo bus and stylus, from the hand to the servos"),
    "tubes": ("benchmarks.tubes", "concentric tubes beside a general solver, and a whole tick"),
    "sensing": ("benchmarks.sensing", "shape and force beside scipy and beside paper 3's way"),
    "loop": ("benchmarks.loop_lateness", "lateness of the control process beside an empty loop"),
}
"""Names, modules with ``measure(configuration, seconds)``, titles."""


class BenchmarkPackageMissing(KeyholeError):
    """A benchmark needs a package that only the test set-up installs.

    Attributes:
        package: the missing package.
    """

    code = "benchmark_package_missing"

    def __init__(self, package: str) -> None:
        super().__init__(f"the package {package} is missing; ./keyhole test installs it")
        self.package = package


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``bench`` to the command line."""
    parser = subparsers.add_parser("bench", help="measure speed and lateness")
    benchmarks = parser.add_subparsers(dest="benchmark", metavar="NAME", required=True)
    for name, (_, title) in BENCHMARKS.items():
        one = benchmarks.add_parser(name, help=title)
        one.add_argument("--json", metavar="FILE", help="write the figures as JSON (- for stdout)")
        one.add_argument("--config", metavar="FILE", help="configuration (TOML)")
        one.add_argument(
            "--seconds", type=float, default=10.0, help="about how long each part runs"
        )


def execute(arguments: argparse.Namespace) -> int:
    """Run it and print or write its figures."""
    try:
        module = importlib.import_module(BENCHMARKS[arguments.benchmark][0])
    except ModuleNotFoundError as error:
        raise BenchmarkPackageMissing(str(error.name)) from None
    document: dict[str, Any] = module.measure(load(arguments.config), arguments.seconds)
    text = json.dumps(document, indent=2)
    if arguments.json and arguments.json != "-":
        Path(arguments.json).write_text(text + "\n")
    else:
        print(text)
    return 0
