"""Where a stylus is that plays a path, and which of its buttons are pressed."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from robot.configuration import Configuration
from scenes.experiments import experiment, names
from scenes.path import Path
from scenes.path_file import parse_csv

_STILL = 0.2
_RESTS = 0.8
_CLOSED_M = 1e-3

Place = tuple[float, float, float, float, float, float, float]


class Sample(NamedTuple):
    """What a stylus says at one moment: position in m, quaternion, buttons (bit 0 the first)."""

    position: tuple[float, float, float]
    wxyz: tuple[float, float, float, float]
    buttons: int
    stamp_ns: int
    sequence: int


def places_of(path: Path, rate_hz: float) -> list[Place]:
    """The path as one place (m, quaternion) for each sample, from its start to its end."""
    row = np.empty(7)
    places: list[Place] = []
    for step in range(round(path.duration_s * rate_hz) + 1):
        path.at(step / rate_hz, row)
        x, y, z, a, b, c, d = row.tolist()
        places.append((x, y, z, a, b, c, d))
    return places


def named_path(name: str, configuration: Configuration) -> Path:
    """An experiment's path by its name, or that of a CSV file.

    Raises:
        KeyholeError: there is no such experiment, or the file is no path.
    """
    if name in names() or not FilePath(name).exists():
        return experiment(name, configuration).path
    return parse_csv(FilePath(name).read_text(encoding="utf-8"), FilePath(name).name)


class FakeStylus:
    """A stylus that plays a path while a button is pressed, and stands at its start otherwise.

    Args:
        places: of the path, one for each sample.
        rate_hz: samples a second.
        buttons: which are pressed: bit 0 the first, bit 1 the second.
        automatic: presses by itself, again and again; otherwise by :meth:`press`.
    """

    def __init__(
        self, places: list[Place], rate_hz: float, buttons: int, *, automatic: bool
    ) -> None:
        self._places, self._buttons, self._automatic = places, buttons, automatic
        self._still, self._rests = round(_STILL * rate_hz), round(_RESTS * rate_hz)
        first, last = places[0], places[-1]
        self._is_closed = all(
            abs(a - b) < _CLOSED_M for a, b in zip(first[:3], last[:3], strict=True)
        )
        self._step, self._sequence = -self._rests, 0
        self._bits = 0

    @property
    def bits(self) -> int:
        """The pressed buttons."""
        return self._bits

    def press(self, bits: int) -> None:
        """Press these buttons and play from the path's start, or, while playing, change them."""
        if self._bits == 0:
            self._step = -self._still
        self._automatic, self._bits = False, bits

    def release(self) -> None:
        """Let go of all buttons; the stylus stays where it is until the next press."""
        self._automatic, self._bits = False, 0

    def next(self, stamp_ns: int) -> Sample:
        """The sample that follows the last."""
        self._sequence += 1
        if self._automatic:
            self._play_by_itself()
        elif self._bits:
            self._step += 1
            if self._step >= len(self._places) and self._is_closed:
                self._step = 0
        x, y, z, a, b, c, d = self._places[min(max(self._step, 0), len(self._places) - 1)]
        return Sample((x, y, z), (a, b, c, d), self._bits, stamp_ns, self._sequence)

    def _play_by_itself(self) -> None:
        self._step += 1
        if self._bits == 0 and self._step >= 0:
            self._bits, self._step = self._buttons, -self._still
        elif self._bits and self._step >= len(self._places) + self._still:
            self._bits, self._step = 0, -self._rests
