"""Configuration and calibration as the compiled estimator reads them."""

from __future__ import annotations

import math

import numpy as np

from robot.calibration import Calibration
from robot.configuration import Configuration, Instrument
from robot.sensing.joint_estimate import MODEL
from robot.sensing.sense import SENSING

SLIDING_SHARE = 0.3
"""Standard deviation of a tendon's sliding share: while it sticks, nobody knows where between."""


def chord_length(instrument: Instrument) -> float:
    """L / (8 n^2), m: see :mod:`robot.sensing.tendon_work`."""
    return instrument.segment_length_m / (8.0 * instrument.disk_count**2)


def estimator_parameters(
    configuration: Configuration, calibration: Calibration
) -> tuple[np.ndarray, np.ndarray]:
    """The estimator's model and what turns readings into samples, (1,) records.

    What ``calibration`` holds replaces what the configuration assumes.
    """
    section, tracker = configuration.sensing, configuration.tracker
    instrument, found = configuration.instrument, calibration.tendons
    model, sensing = np.zeros(1, MODEL), np.zeros(1, SENSING)
    stiffness = found.bending_stiffness_n_m2 if found else section.bending_stiffness_n_m2
    values: dict[str, object] = {
        "length": instrument.segment_length_m,
        "pitch_radius": instrument.tendon_pitch_radius_m,
        "chord": chord_length(instrument),
        "contact_offset": 0.5 * instrument.disk_diameter_m,
        "bending_stiffness": stiffness,
        "torsion_stiffness": section.torsion_ratio * stiffness,
        "friction": found.friction if found else section.tendon_friction,
        "coulomb": found.friction_n if found else section.tendon_friction_n,
        "stiffness_deviation": (
            found.stiffness_uncertainty if found else 0.01 * section.stiffness_uncertainty_percent
        ),
        "friction_deviation": (
            found.friction_uncertainty if found else 0.01 * section.friction_uncertainty_percent
        ),
        "position_deviation": max(tracker.position_noise_mm, 0.01) * 1e-3,
        "angle_deviation": math.radians(max(tracker.orientation_noise_deg, 0.01)),
        "length_deviation": section.tendon_length_noise_mm * 1e-3,
        "tension_deviation": section.tension_noise_n,
        "sliding_deviation": SLIDING_SHARE,
        "balance_deviation": section.balance_noise_n_mm * 1e-3,
    }
    for name, value in values.items():
        model[name] = value
    sensing["tendon_stiffness"] = (
        found.tendon_stiffness_n_m if found else section.tendon_stiffness_n_m
    )
    sensing["pretension"] = found.pretension_n if found else section.pretension_n
    sensing["full_scale"] = section.tension_full_scale_n
    sensing["cell_flat"] = configuration.tension_unit.cell_flat_s
    sensing["broken"] = section.broken_tendon_n
    sensing["force_deviation"] = section.force_expected_n
    for record in (model, sensing):
        record.flags.writeable = False
    return model, sensing
