"""The limits of the concentric-tube arms as compiled code reads them, in m, rad and s."""

from __future__ import annotations

import math

import numpy as np

from robot.configuration import Configuration

PARAMETERS = np.dtype(
    [
        ("speed_max", "f8"),
        ("acceleration_max", "f8"),
        ("angular_speed_max", "f8"),
        ("angular_acceleration_max", "f8"),
        ("target_distance", "f8"),
        ("alignment_tolerance", "f8"),
        ("jump_position", "f8"),
        ("jump_angle", "f8"),
        ("workspace_min", "f8", 3),
        ("workspace_max", "f8", 3),
        ("wall_normal", "f8", 3),
        ("late_tick", "f8"),
        ("tracking_error", "f8"),
        ("tracking_angle", "f8"),
        ("relative_error", "f8"),
    ]
)
"""The first twelve are what ``robot.teleoperation`` and ``robot.safety`` ask of every robot.
``wall_normal`` points into the endoscope: a target must stay in front of its face."""


def parameters(configuration: Configuration) -> np.ndarray:
    """The (1,) read-only record of ``configuration``."""
    record = np.zeros(1, PARAMETERS)
    limits, shared = configuration.concentric.limits, configuration.limits
    values: dict[str, object] = {
        "speed_max": limits.tip_speed_mm_s * 1e-3,
        "acceleration_max": limits.tip_acceleration_mm_s2 * 1e-3,
        "angular_speed_max": math.radians(configuration.commands.angular_speed_max_deg_s),
        "angular_acceleration_max": math.radians(shared.tip_angular_acceleration_deg_s2),
        "target_distance": limits.target_distance_mm * 1e-3,
        "alignment_tolerance": math.pi,
        "jump_position": limits.tip_jump_mm * 1e-3,
        "jump_angle": math.radians(shared.tip_jump_deg),
        "workspace_min": limits.workspace_min_m,
        "workspace_max": limits.workspace_max_m,
        "wall_normal": (0.0, 0.0, -1.0),
        "late_tick": shared.late_tick_ms * 1e-3,
        "tracking_error": limits.tracking_error_mm * 1e-3,
        "tracking_angle": math.radians(limits.tracking_error_deg),
        "relative_error": limits.relative_error_mm * 1e-3,
    }
    for name, value in values.items():
        record[name] = value
    record.flags.writeable = False
    return record
