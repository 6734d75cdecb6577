"""Where calibrations are kept: one small versioned TOML file a robot."""

from __future__ import annotations

import hashlib
import os
import tomllib
from pathlib import Path
from typing import Any

import hardware.physics
from robot.calibration import Calibration, CalibrationRefused, parse_calibration
from robot.configuration import Configuration
from robot.errors import KeyholeError
from server.calibration.sweep import robot_name

_BELONGING = ("arm", "instrument", "module", "tracker", "control")
"""Sections of the configuration that a calibration depends on, beside which robot it is."""


class CalibrationFileError(KeyholeError):
    """A calibration cannot be read or written.

    Attributes:
        path: the file.
    """

    code = "calibration_file"

    def __init__(self, path: Path, detail: str) -> None:
        super().__init__(f"calibration {path}: {detail}")
        self.path = path


def belonging(configuration: Configuration) -> str:
    """A mark of all that a calibration made with ``configuration`` depends on, hexadecimal."""
    parts = [getattr(configuration, name).model_dump_json() for name in _BELONGING]
    digest = hashlib.sha256("\n".join([robot_name(configuration), *parts]).encode())
    if configuration.simulation.plant == "physics" and not configuration.hardware.connected:
        # A simulated robot is what its code makes it.
        for source in sorted(Path(hardware.physics.__file__).parent.glob("*.py")):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:12]


def default_path(configuration: Configuration) -> Path:
    """Where the calibration of the robot that ``configuration`` describes is kept."""
    home = os.environ.get("XDG_STATE_HOME") or os.path.expanduser("~/.local/state")
    words = robot_name(configuration).replace(",", "").replace(" ", "-")
    return Path(home) / "keyhole" / "calibration" / f"{words}-{belonging(configuration)}.toml"


def load(path: Path) -> Calibration:
    """Read a calibration.

    Raises:
        CalibrationFileError: the file cannot be read, or is no TOML.
        CalibrationRefused: a value in it is wrong, or it is of another version.
    """
    try:
        table = tomllib.loads(path.read_text())
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise CalibrationFileError(path, f"{reason}; make one with 'keyhole calibrate'") from None
    return parse_calibration(table, str(path))


def load_if_there(path: Path) -> Calibration | None:
    """The calibration in ``path``; None where there is none that can be used."""
    try:
        return load(path) if path.exists() else None
    except (CalibrationFileError, CalibrationRefused):
        return None


def _table(values: dict[str, Any]) -> list[str]:
    lines = []
    for name, value in values.items():
        if isinstance(value, str):
            shown = '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
        elif isinstance(value, tuple):
            shown = "[" + ", ".join(repr(float(one)) for one in value) + "]"
        else:
            shown = repr(value)
        lines.append(f"{name} = {shown}")
    return lines


def save(path: Path, calibration: Calibration) -> None:
    """Write a calibration, in one piece.

    Raises:
        CalibrationFileError: it cannot be written.
    """
    lines = ["# What a bending sweep found about the tendons. Written by 'keyhole calibrate'."]
    lines += _table(calibration.model_dump(exclude={"tendons"}))
    if calibration.tendons:
        lines += ["", "[tendons]", *_table(calibration.tendons.model_dump())]
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished.write_text("\n".join(lines) + "\n")
        os.replace(unfinished, path)
    except OSError as error:
        raise CalibrationFileError(path, error.strerror or "cannot be written") from None
