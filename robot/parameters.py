"""The configuration as the compiled control path reads it: one read-only numpy record, SI units."""

from __future__ import annotations

import math

import numpy as np

from robot.calibration import Calibration
from robot.configuration import Configuration, Instrument

PARAMETERS = np.dtype(
    [
        ("shaft_base", "f8", 3),
        ("rotation_flange_segment", "f8", (3, 3)),
        ("shaft_length", "f8"),
        ("segment_length", "f8"),
        ("pitch_radius", "f8"),
        ("pulley_radius", "f8"),
        ("joint_lower", "f8", 7),
        ("joint_upper", "f8", 7),
        ("joint_speed", "f8", 7),
        ("bend_max", "f8"),
        ("servo_max", "f8"),
        ("servo_speed", "f8"),
        ("lambda_min", "f8"),
        ("lambda_max", "f8"),
        ("approach_gain", "f8"),
        ("jump_position", "f8"),
        ("jump_angle", "f8"),
        ("target_distance", "f8"),
        ("tracking_error", "f8"),
        ("servo_tracking_error", "f8"),
        ("acceleration_max", "f8"),
        ("angular_acceleration_max", "f8"),
        ("workspace_min", "f8", 3),
        ("workspace_max", "f8", 3),
        ("wall_normal", "f8", 3),
        ("wall_radius", "f8"),
        ("wall_thickness", "f8"),
        ("link_radius", "f8", 7),
        ("module_radius", "f8"),
        ("clearance", "f8"),
        ("trocar_distance", "f8"),
        ("late_tick", "f8"),
        ("contact_force", "f8"),
        ("tracker_delay", "f8"),
        ("correction_gain", "f8"),
        ("gain", "f8", 2),
        ("offset", "f8", 2),
        ("friction", "f8", 2),
        ("stick", "f8", 2),
        ("chord", "f8"),
        ("tendon_stiffness", "f8"),
        ("pretension", "f8", 4),
        ("bending_stiffness", "f8"),
        ("capstan", "f8"),
        ("coulomb", "f8"),
        ("tension_full_scale", "f8"),
        ("cell_flat", "f8"),
        ("tension_limit", "f8"),
        ("tension_rate", "f8"),
        ("tendon_travel", "f8"),
        ("alignment_tolerance", "f8"),
        ("speed_max", "f8"),
        ("speed_min", "f8"),
        ("position_threshold", "f8"),
        ("position_ramp", "f8"),
        ("angular_speed_max", "f8"),
        ("angular_speed_min", "f8"),
        ("orientation_threshold", "f8"),
        ("orientation_ramp", "f8"),
        ("rcm_gain", "f8"),
        ("lambda_gain", "f8"),
        ("posture_gain", "f8"),
        ("characteristic_length", "f8"),
    ]
)
"""Fields as in ``robot.configuration`` and ``robot.calibration``, in m, rad, s, N.
``rotation_flange_segment``: the segment's base frame in the flange frame; its z axis is the shaft's
direction. ``tendon_stiffness`` to ``coulomb``: of tendons and backbone, as ``robot.sensing`` has
them; ``tension_*``, ``tendon_travel``: of the table [tendons]; ``cell_flat``: of [tension_unit]."""


def _module_rotation(configuration: Configuration) -> np.ndarray:
    z = np.array(configuration.module.shaft_direction)
    x = np.array(configuration.module.bend_direction)
    z, x = z / np.linalg.norm(z), x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _unit_vector(vector: tuple[float, float, float]) -> np.ndarray:
    direction = np.array(vector)
    return np.asarray(direction / np.linalg.norm(direction))


def _degrees(value: float) -> float:
    return math.radians(value)


def chord_ratio(instrument: Instrument) -> float:
    """L / (8 n^2 r): see :func:`robot.compensation.tendon_motion`."""
    squared = 8.0 * instrument.disk_count**2
    return instrument.segment_length_m / (squared * instrument.tendon_pitch_radius_m)


def _tendons(configuration: Configuration, calibration: Calibration) -> dict[str, object]:
    """What tensions are held by; what was calibrated replaces what is assumed."""
    section, assumed, found = configuration.tendons, configuration.sensing, calibration.tendons
    known = found or assumed
    return {
        "tendon_stiffness": known.tendon_stiffness_n_m,
        "pretension": known.pretension_n,
        "bending_stiffness": known.bending_stiffness_n_m2,
        "capstan": found.friction if found else assumed.tendon_friction,
        "coulomb": found.friction_n if found else assumed.tendon_friction_n,
        "tension_full_scale": assumed.tension_full_scale_n,
        "cell_flat": configuration.tension_unit.cell_flat_s,
        "tension_limit": section.tension_limit_n,
        "tension_rate": section.tension_rate_n_s,
        "tendon_travel": section.travel_mm * 1e-3,
    }


def parameters(configuration: Configuration, calibration: Calibration | None = None) -> np.ndarray:
    """The (1,) read-only record of ``configuration`` and ``calibration`` (by default: none needed).

    Joint limits already hold the margin that is kept from the mechanical stops.
    """
    record, tendons = np.zeros(1, PARAMETERS), calibration or Calibration()
    limits, commands = configuration.limits, configuration.commands
    margin, joints = _degrees(limits.joint_margin_deg), configuration.arm.joints
    instrument, module = configuration.instrument, configuration.module
    values: dict[str, object] = {
        "shaft_base": module.shaft_base_m,
        "rotation_flange_segment": _module_rotation(configuration),
        "shaft_length": instrument.shaft_length_m,
        "segment_length": instrument.segment_length_m,
        "pitch_radius": instrument.tendon_pitch_radius_m,
        "pulley_radius": module.pulley_radius_m,
        "joint_lower": [joint.lower_rad + margin for joint in joints],
        "joint_upper": [joint.upper_rad - margin for joint in joints],
        "joint_speed": [min(joint.speed_rad_s, limits.joint_speed_rad_s) for joint in joints],
        "bend_max": _degrees(limits.bend_deg),
        "servo_max": _degrees(module.servo_range_deg),
        "servo_speed": _degrees(module.servo_speed_deg_s),
        "lambda_min": limits.lambda_min,
        "lambda_max": limits.lambda_max,
        "approach_gain": limits.approach_gain,
        "jump_position": limits.tip_jump_mm * 1e-3,
        "jump_angle": _degrees(limits.tip_jump_deg),
        "target_distance": limits.target_distance_mm * 1e-3,
        "tracking_error": limits.tracking_error_rad,
        "servo_tracking_error": _degrees(limits.servo_tracking_error_deg),
        "acceleration_max": limits.tip_acceleration_mm_s2 * 1e-3,
        "angular_acceleration_max": _degrees(limits.tip_angular_acceleration_deg_s2),
        "workspace_min": limits.workspace_min_m,
        "workspace_max": limits.workspace_max_m,
        "wall_normal": _unit_vector(configuration.trocar.wall_normal),
        "wall_radius": configuration.trocar.wall_radius_m,
        "wall_thickness": configuration.trocar.wall_thickness_m,
        "link_radius": configuration.arm.link_radii_m,
        "module_radius": 0.5 * max(module.adapter_size_m),
        "clearance": limits.clearance_mm * 1e-3,
        "trocar_distance": limits.trocar_distance_mm * 1e-3,
        "late_tick": limits.late_tick_ms * 1e-3,
        "contact_force": limits.contact_force_n,
        "tracker_delay": configuration.tracker.delay_ms * 1e-3,
        "correction_gain": configuration.tracker.correction_gain,
        "gain": tendons.gain,
        "offset": tendons.offset_rad,
        "friction": tendons.friction_rad,
        "stick": tendons.stick_rad,
        "chord": chord_ratio(instrument),
        **_tendons(configuration, tendons),
        "alignment_tolerance": _degrees(configuration.teleoperation.alignment_tolerance_deg),
        "speed_max": commands.speed_max_mm_s * 1e-3,
        "speed_min": commands.speed_min_mm_s * 1e-3,
        "position_threshold": commands.position_threshold_mm * 1e-3,
        "position_ramp": commands.position_ramp,
        "angular_speed_max": _degrees(commands.angular_speed_max_deg_s),
        "angular_speed_min": _degrees(commands.angular_speed_min_deg_s),
        "orientation_threshold": _degrees(commands.orientation_threshold_deg),
        "orientation_ramp": commands.orientation_ramp,
        "rcm_gain": commands.rcm_gain_per_s,
        "lambda_gain": configuration.priority.lambda_gain_per_s,
        "posture_gain": configuration.priority.posture_gain_per_s,
        "characteristic_length": configuration.priority.characteristic_length_m,
    }
    for name, value in values.items():
        record[name] = value
    record.flags.writeable = False
    return record
