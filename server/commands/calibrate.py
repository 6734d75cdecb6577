"""``keyhole calibrate``: a free bending sweep, and the file that comes of it."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

from robot.calibration import Calibration
from server.calibration.file import default_path, save
from server.calibration.sweep import calibrate
from server.commands.progress_bar import ProgressBar
from server.commands.run import seed
from server.configuration_file import load
from server.run.options import ACTUATIONS, PLANTS, PRESETS


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``calibrate`` to the command line."""
    parser = subparsers.add_parser(
        "calibrate", help="measure stretch and friction of the tendons in a free bending sweep"
    )
    parser.add_argument("--plant", choices=PLANTS, help="the robot")
    parser.add_argument("--preset", choices=PRESETS, help="how good the simulated robot is")
    parser.add_argument("--seed", type=seed, metavar="N", help="which robot of the preset")
    parser.add_argument("--actuation", choices=ACTUATIONS, help="what drives the tendons")
    parser.add_argument("--config", metavar="FILE", help="configuration (TOML)")
    parser.add_argument(
        "--out",
        metavar="FILE",
        type=Path,
        help="where it is written; by default where the console looks",
    )
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")


def execute(arguments: argparse.Namespace) -> int:
    """Sweep, fit, write, and say what was found.

    Raises:
        KeyholeError: the sweep shows too little, or the file cannot be written.
    """
    configuration = load(arguments.config)
    chosen = {
        name: getattr(arguments, name)
        for name in ("plant", "preset", "seed", "actuation")
        if getattr(arguments, name) is not None
    }
    table = configuration.simulation.model_dump() | chosen
    simulation = type(configuration.simulation).model_validate(table)
    configuration = configuration.model_copy(update={"simulation": simulation})
    progress = ProgressBar("calibrating")
    found = calibrate(configuration, progress)
    progress.end()
    path = arguments.out or default_path(configuration)
    save(path, found)
    if arguments.json:
        print(json.dumps({**found.model_dump(), "file": str(path)}, indent=2))
    else:
        _print(found, path)
    return 0


def _print(found: Calibration, path: Path) -> None:
    print(f"{found.robot}: {found.samples} samples, {found.residual_deg:.2f} deg rms unexplained")
    for name, k in (("u", 0), ("v", 1)):
        print(
            f"  {name}: gain {found.gain[k]:.4f}   "
            f"offset {math.degrees(found.offset_rad[k]):+.2f} deg   "
            f"friction {math.degrees(found.friction_rad[k]):.2f} deg   "
            f"sticks over {math.degrees(found.stick_rad[k]):.2f} deg"
        )
    if found.tendons:
        t = found.tendons
        print(
            f"  backbone: E I {t.bending_stiffness_n_m2 * 1e6:.1f} N mm^2 "
            f"(+- {100 * t.stiffness_uncertainty:.1f} %)   tendons: friction {t.friction_n:.2f} N "
            f"and {t.friction:.3f} per rad (+- {100 * t.friction_uncertainty:.0f} %), "
            f"{t.tendon_stiffness_n_m * 1e-3:.2f} N/mm, {t.residual_mm * 1e3:.0f} um rms left"
        )
    print(f"written to {path}")
