"""The chirp on one module of the tension unit: its figures, and its curves for plotting."""

from __future__ import annotations

from typing import Any

import numpy as np

from hardware.tension_unit.chirp import BANDS_HZ, Chirp, run_chirp
from robot.tension_unit_design import TensionUnit
from scenes.experiments.chirp import (
    AMPLITUDE_RAD,
    DURATION_S,
    HIGHEST_HZ,
    LOWEST_HZ,
    SPRING_NM_RAD,
)
from scenes.experiments.sensing import CHIRP

WINDOWS = ((0.0, 12.0, 10), (19.0, 21.0, 2), (29.3, 30.0, 1))
"""Which parts are shown, from and to in s, and every how many cycles."""
CURVES = ("commanded_rad", "encoder_rad", "angle_rad", "load_nm", "cell_nm", "current_nm")


def chirp_run(design: TensionUnit, seed: int) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Run it.

    Args:
        design: of the module.
        seed: draws its noise.

    Returns:
        The figures as a JSON document, angles in rad and torques in mN m; and for window ``i`` of
        ``WINDOWS`` the arrays ``window{i}.time_s`` and ``window{i}.`` with every one of ``CURVES``.
    """
    found = run_chirp(design, seed)
    arrays: dict[str, np.ndarray] = {}
    for place, (begin, end, every) in enumerate(WINDOWS):
        shown = np.flatnonzero((found.time_s >= begin) & (found.time_s < end))[::every]
        arrays[f"window{place}.time_s"] = found.time_s[shown]
        for name in CURVES:
            arrays[f"window{place}.{name}"] = getattr(found, name)[shown].astype(np.float32)
    return _document(found, seed), arrays


def _document(found: Chirp, seed: int) -> dict[str, Any]:
    cell, current = (
        _spread(values - found.load_nm) for values in (found.cell_nm, found.current_nm)
    )
    return {
        "experiment": CHIRP,
        "robot": "tension-unit",
        "seed": seed,
        "ended": "completed",
        "amplitude_rad": AMPLITUDE_RAD,
        "frequency_hz": {"from": LOWEST_HZ, "to": HIGHEST_HZ},
        "spring_nm_rad": SPRING_NM_RAD,
        "duration_s": DURATION_S,
        "cycles": len(found.time_s),
        "position_error_rad": {
            "rms": found.position_rms_rad,
            "max": float(np.abs(found.commanded_rad - found.encoder_rad).max()),
        },
        "pulley_error_rad": {
            "rms": found.pulley_rms_rad,
            "max": float(np.abs(found.commanded_rad - found.angle_rad).max()),
        },
        "lag_deg": {f"{low:g}-{high:g} Hz": lag_deg(found, low, high) for low, high in BANDS_HZ},
        "torque_error_mnm": {"cell": cell, "current": current},
        "current_over_cell": current["rms"] / cell["rms"],
    }


def lag_deg(found: Chirp, low: float, high: float) -> float:
    """Phase by which the encoder's angle lags behind the command between two frequencies.

    A band is no whole number of swings, so command and derivative are fitted together.
    """
    inside = (found.frequency_hz >= low) & (found.frequency_hz < high)
    turned = np.gradient(found.commanded_rad, found.time_s) / (2.0 * np.pi * found.frequency_hz)
    columns = np.column_stack([found.commanded_rad, turned])[inside]
    along, ahead = np.linalg.lstsq(columns, found.encoder_rad[inside], rcond=None)[0]
    return float(np.degrees(-np.arctan2(ahead, along)))


def _spread(errors_nm: np.ndarray) -> dict[str, float]:
    return {
        "rms": float(np.sqrt(np.mean(errors_nm**2))) * 1e3,
        "max": float(np.abs(errors_nm).max()) * 1e3,
    }


def printed_chirp(document: dict[str, Any]) -> str:
    """The run for the terminal."""
    position, pulley = document["position_error_rad"], document["pulley_error_rad"]
    lag = ", ".join(f"{value:+.1f} deg at {band}" for band, value in document["lag_deg"].items())
    lines = [
        f"{document['experiment']}, seed {document['seed']}: {document['ended']}",
        f"  motor        off by {1e3 * position['rms']:.2f} mrad rms; lags by {lag}",
        f"  pulley       off by {1e3 * pulley['rms']:.2f} mrad rms, behind the backlash",
    ]
    for name, error in document["torque_error_mnm"].items():
        lines.append(
            f"  torque, {name:<9} off by {error['rms']:6.2f} mN m rms, {error['max']:6.2f} at most"
        )
    return "\n".join(lines)
