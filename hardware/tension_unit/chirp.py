"""A chirp on one module of the unit against springs, and what its sensors say meanwhile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hardware.tension_unit.module import (
    CYCLE_S,
    MODULES,
    POSITION,
    STATE,
    drive_unit,
    unit_constants,
)
from robot.tension_unit_design import TensionUnit
from scenes.experiments.chirp import DURATION_S, SPRING_NM_RAD, chirp, frequency

BANDS_HZ = ((0.1, 1.0), (1.0, 3.0), (3.0, 10.0))
"""In which the phase lag is told."""


@dataclass(frozen=True)
class Chirp:
    """Every cycle of a chirp; all (n,).

    Attributes:
        time_s: from the start.
        frequency_hz: of the command.
        commanded_rad: angle of the pulley that was asked for.
        angle_rad: of the pulley.
        encoder_rad: of the pulley, as the motor's encoder has it.
        load_nm: torque of the module on the springs, the true one.
        cell_nm: as the torque cell reads it.
        current_nm: as the motor's current says: times torque constant and ratio.
    """

    time_s: np.ndarray
    frequency_hz: np.ndarray
    commanded_rad: np.ndarray
    angle_rad: np.ndarray
    encoder_rad: np.ndarray
    load_nm: np.ndarray
    cell_nm: np.ndarray
    current_nm: np.ndarray

    @property
    def position_rms_rad(self) -> float:
        """Of commanded minus the encoder's angle, which the drive closes its loop over."""
        return _rms(self.commanded_rad - self.encoder_rad)

    @property
    def pulley_rms_rad(self) -> float:
        """Of commanded minus the pulley's angle, behind the backlash."""
        return _rms(self.commanded_rad - self.angle_rad)

    @property
    def cell_rms_nm(self) -> float:
        """Error of the torque cell."""
        return _rms(self.cell_nm - self.load_nm)

    @property
    def current_rms_nm(self) -> float:
        """Error of the torque that the current says."""
        return _rms(self.current_nm - self.load_nm)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def run_chirp(design: TensionUnit, seed: int, spring_nm_rad: float = SPRING_NM_RAD) -> Chirp:
    """Run the chirp on the first module; the same seed gives the same numbers.

    Args:
        design: the table ``[tension_unit]``.
        seed: draws noise, offset and gain.
        spring_nm_rad: rate of the springs at the pulley.
    """
    generator = np.random.default_rng(seed)
    constants = unit_constants(design, generator, spring=spring_nm_rad)
    state, still = np.zeros(1, STATE), np.zeros(MODULES)
    modes = np.full(MODULES, POSITION)
    times = np.arange(0.0, DURATION_S, CYCLE_S)
    commanded = chirp(times)
    rows = np.empty((len(times), 5))
    per_current = float(constants["torque_constant"][0] * constants["ratio"][0])
    for row, wanted in zip(rows, commanded, strict=True):
        noise = generator.normal(size=(2, MODULES))
        drive_unit(state, constants, modes, np.full(MODULES, wanted), still, CYCLE_S, noise)
        s = state[0]
        row[:] = (
            s["angle"][0], s["seen"][0] / constants["ratio"][0], -s["load"][0], s["cell"][0],
            per_current * s["measured_current"][0],
        )  # fmt: skip
    return Chirp(times, frequency(times), commanded, *rows.T.copy())
