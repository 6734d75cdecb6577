"""What the estimators know: a calibration from the rod's own free pull-release sweep.

The sweep's readings are noisy, and nothing of the rod's true stiffness, friction or sliding gets
past them. How the tendons slide is followed from their measured lengths, as friction has to be
undone and built up again over a travel that is a property of the design, the same for all rods.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hardware.rod.pose_noise import SensorNoise
from hardware.rod.properties import RodProperties
from hardware.rod.rod import RodShape
from robot.sensing.joint_estimate import MODEL
from robot.sensing.sweep_calibration import SweepFit, fit_sweep
from scenes.experiments.sensing import PAIRS, PullStop
from server.run.sensing_options import READINGS

STICK_M = RodProperties().stick_m
"""Travel of a tendon that takes its friction from none to full, as designed."""
SLIDING_DEVIATION = 0.03
BALANCE_DEVIATION_N_M = 2e-6
"""What eleven modes leave out of a continuous rod's balance."""
_SLIDES = 0.95
_LEAST_MM, _LEAST_DEG, _LEAST_N = 0.01, 0.02, 1e-3
_TORSION_RATIO = RodProperties().torsion_stiffness_n_m2 / RodProperties().bending_stiffness_n_m2


class StopReadings(NamedTuple):
    """Mean readings at the stops of a programme.

    Attributes:
        tensions: (n, 4) N.
        lengths: (n, 4) m.
        sliding: (n, 4) shares as followed from the lengths.
    """

    tensions: np.ndarray
    lengths: np.ndarray
    sliding: np.ndarray


class Calibrated(NamedTuple):
    """A calibration and what it was made from.

    Attributes:
        fit: stiffness and friction with their uncertainty.
        model: (1,) ``MODEL`` for the joint estimate.
        readings: of the sweep.
        used: (n,) which stops the fit saw: those at which the moving pair slides.
    """

    fit: SweepFit
    model: np.ndarray
    readings: StopReadings
    used: np.ndarray


def followed(lengths: np.ndarray) -> np.ndarray:
    """Sliding shares (n, 4) from lengths (n, 4) in m, one stop after the other from straight."""
    shares, last, found = np.zeros(4), np.zeros(4), np.empty_like(lengths)
    for row, now in enumerate(lengths):
        shares = np.clip(shares - (now - last) / STICK_M, -1.0, 1.0)
        last, found[row] = now, shares
    return found


def read_stops(
    tensions: Sequence[np.ndarray],
    shapes: Sequence[RodShape],
    noise: SensorNoise,
    rng: np.random.Generator,
) -> StopReadings:
    """Read tensions and lengths at each stop, ``READINGS`` times, and take the means."""
    fewer = 1.0 / math.sqrt(READINGS)
    pulled, moved = np.array(tensions), np.array([shape.lengths for shape in shapes])
    pulled = pulled + fewer * noise.tension_n * rng.normal(size=pulled.shape)
    moved = moved + fewer * noise.length_mm * 1e-3 * rng.normal(size=moved.shape)
    return StopReadings(pulled, moved, followed(moved))


def calibrate(
    sweep: Sequence[tuple[PullStop, RodShape]], noise: SensorNoise, rng: np.random.Generator
) -> Calibrated:
    """Fit stiffness and friction to a sweep.

    Raises:
        SweepUnusable: the sweep does not show them.
    """
    stops = [stop for stop, _ in sweep]
    readings = read_stops([stop.tensions for stop in stops], [one for _, one in sweep], noise, rng)
    moving = np.array([[PAIRS[stop.pair].pulled, PAIRS[stop.pair].released] for stop in stops])
    slides = np.abs(np.take_along_axis(readings.sliding, moving, axis=1))
    used = np.all(slides > _SLIDES, axis=1)
    nominal = RodProperties()
    routing = (nominal.pitch_radius_m, nominal.length_m, 0.0)
    fit = fit_sweep(
        readings.tensions[used],
        readings.lengths[used],
        readings.sliding[used],
        routing,
        nominal.bending_stiffness_n_m2,
    )
    return Calibrated(fit, model_of(fit, noise), readings, used)


def model_of(fit: SweepFit, noise: SensorNoise) -> np.ndarray:
    """(1,) ``MODEL`` of a calibration and of sensors whose noise is known."""
    nominal = RodProperties()
    values = {
        "length": nominal.length_m,
        "pitch_radius": nominal.pitch_radius_m,
        "bending_stiffness": fit.stiffness,
        "torsion_stiffness": _TORSION_RATIO * fit.stiffness,
        "friction": fit.friction,
        "coulomb": fit.coulomb,
        "stiffness_deviation": fit.stiffness_deviation,
        "friction_deviation": fit.friction_deviation,
        "position_deviation": 1e-3 * max(noise.position_mm, _LEAST_MM),
        "angle_deviation": math.radians(max(noise.angle_deg, _LEAST_DEG)),
        "length_deviation": 1e-3 * noise.length_mm,
        "tension_deviation": max(noise.tension_n, _LEAST_N),
        "sliding_deviation": SLIDING_DEVIATION,
        "balance_deviation": BALANCE_DEVIATION_N_M,
    }
    model = np.zeros(1, MODEL)
    for name, value in values.items():
        model[name] = value
    return model
