"""Offset and gain of a torque cell from known weights on its pulley (paper 3, section IV-B)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot.errors import KeyholeError

FEWEST_WEIGHTS = 3
STANDARD_GRAVITY = 9.80665
_LEAST_SPREAD_NM = 0.01


class WeightsUnusable(KeyholeError):
    """Readings with weights that do not calibrate a cell.

    Attributes:
        weights_kg: the weights.
    """

    code = "weights_unusable"

    def __init__(self, weights_kg: np.ndarray, what: str) -> None:
        listed = ", ".join(f"{weight * 1e3:.0f}" for weight in weights_kg) or "none"
        super().__init__(
            f"the torque cell cannot be calibrated: {what} (weights of {listed} g); hang at least "
            f"{FEWEST_WEIGHTS} different ones, none among them, inside the cell's range"
        )
        self.weights_kg = weights_kg


class CellCalibration(NamedTuple):
    """true torque = (reading - offset) / gain.

    Attributes:
        offset_nm: reading without a load.
        gain: reading over torque.
        offset_deviation_nm: standard deviation.
        gain_deviation: likewise.
        residual_nm: rms of what is left over.
    """

    offset_nm: float
    gain: float
    offset_deviation_nm: float
    gain_deviation: float
    residual_nm: float

    def torque(self, reading_nm: np.ndarray) -> np.ndarray:
        """True torque in N m of readings of any shape, of this cell."""
        return np.asarray((reading_nm - self.offset_nm) / self.gain)


def fit_cell(
    readings_nm: np.ndarray, weights_kg: np.ndarray, pulley_radius: float, full_scale_nm: float
) -> CellCalibration:
    """Least-squares line through the readings.

    Args:
        readings_nm: (n,) one of the cell for each weight; several of one weight are fine.
        weights_kg: (n,) what hung on the tendon.
        pulley_radius: m.
        full_scale_nm: end of the cell's range.

    Raises:
        WeightsUnusable: too few or too light weights, readings that are no numbers or at the end of
            the range, or a cell that does not follow the weights.
    """
    readings, weights = np.asarray(readings_nm, float), np.asarray(weights_kg, float)
    if len(set(weights.tolist())) < FEWEST_WEIGHTS:
        raise WeightsUnusable(weights, "too few weights")
    if not np.isfinite(readings).all():
        raise WeightsUnusable(weights, "a reading is not a number")
    if (np.abs(readings) >= full_scale_nm).any():
        raise WeightsUnusable(weights, f"a reading is at the end of {full_scale_nm:g} N m")
    # A tendon pulls the pulley toward positive angles; the cell reads what holds it.
    torque = -weights * STANDARD_GRAVITY * pulley_radius
    if np.ptp(torque) < _LEAST_SPREAD_NM:
        raise WeightsUnusable(weights, "the weights are too light")
    columns = np.column_stack([np.ones_like(torque), torque])
    found = np.linalg.lstsq(columns, readings, rcond=None)[0]
    left = readings - columns @ found
    free = max(1, len(readings) - 2)
    spread = np.linalg.inv(columns.T @ columns) * float(left @ left) / free
    offset, gain = found.tolist()
    if not 0.5 < gain < 2.0:
        raise WeightsUnusable(weights, f"its readings are {gain:.2f} times the weights' torque")
    deviations = np.sqrt(np.diag(spread)).tolist()
    return CellCalibration(
        offset, gain, deviations[0], deviations[1], float(np.sqrt(np.mean(left**2)))
    )
