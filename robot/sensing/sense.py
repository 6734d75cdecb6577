"""The sensing stage of the instrument's tick: checks its sensors, aligns them, estimates, reports.

An estimate is valid or it is not, with one reason; nothing is held over from an earlier tick. What
is reported while it is not valid is zero.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.records import RecordFields
from robot.rotations import matrix_from_quaternion, quaternion_from_matrix
from robot.sensing.alignment import REACH_S, carry_on, mean_tension, recall, remember
from robot.sensing.curvature_modes import MODES
from robot.sensing.faults import SensingFault
from robot.sensing.joint_estimate import FORCE, TENSION, estimate
from robot.tension.cells import is_flat

_OFF = int(SensingFault.OFF)
_NO_CELLS = int(SensingFault.NO_TENSION_CELLS)
_MISSING = int(SensingFault.CELL_MISSING)
_SATURATED = int(SensingFault.CELL_SATURATED)
_FLAT = int(SensingFault.CELL_FLAT)
_BROKEN = int(SensingFault.TENDON_BROKEN)
_TRACKER_LOST = int(SensingFault.TRACKER_LOST)
_IMPOSSIBLE = int(SensingFault.POSE_IMPOSSIBLE)
_NOT_CONVERGED = int(SensingFault.NOT_CONVERGED)

_IMPOSSIBLE_MISFIT = 200.0
"""Sum of the squares of ten residuals of pose and tendon lengths, in standard deviations, above
which a model cannot have made the pose; ten is expected."""
_PULLED_M = 2e-4
"""A tendon that is pulled by more than this beyond the mean of all carries tension, unless it is
broken."""

SENSING = np.dtype(
    [
        ("tendon_stiffness", "f8"),
        ("pretension", "f8", 4),
        ("full_scale", "f8"),
        ("cell_flat", "f8"),
        ("broken", "f8"),
        ("force_deviation", "f8"),
    ]
)
"""What turns readings into a sample: stiffness of a tendon N/m and its tension while straight N;
tension at the end of a cell's range N; after which time s without a change a cell is flat;
tension below which a tendon is broken N; standard
deviation of the forces to expect N."""


@compiled
def segment_lengths(
    servo: np.ndarray,
    tension: np.ndarray,
    pulley_radius: float,
    sensing: np.ndarray,
    out: np.ndarray,
) -> None:
    """Length changes (4,) of the tendons inside the segment, m: what the pulleys took up, less the
    stretch.
    """
    c = sensing[0]
    for i in range(4):
        stretch = (tension[i] - c.pretension[i]) / c.tendon_stiffness
        out[i] = pulley_radius * servo[i] + stretch


@compiled
def _tension_fault(
    s: RecordFields, i_: RecordFields, lengths: np.ndarray, sensing: np.ndarray
) -> int:
    c = sensing[0]
    if i_.tension_cells == 0:
        return _NO_CELLS
    for i in range(4):
        if not math.isfinite(i_.measured_tension[i]):
            return _MISSING
    mean = 0.0
    for i in range(4):
        mean += 0.25 * lengths[i]
        if i_.measured_tension[i] >= c.full_scale:
            return _SATURATED
    for i in range(4):
        if is_flat(s, i, c.cell_flat):
            return _FLAT
    for i in range(4):
        # At once; and as long as it lasts, although a single reading may be off by its noise.
        least = min(i_.measured_tension[i], mean_tension(s, i))
        if least < c.broken and lengths[i] - mean < -_PULLED_M:
            return _BROKEN
    return 0


@compiled
def _fill_sample(
    s: RecordFields,
    i_: RecordFields,
    lengths: np.ndarray,
    sensing: np.ndarray,
    parameters: np.ndarray,
    sample: np.ndarray,
) -> bool:
    """The aligned sample of now; False without a recent pose of the tip."""
    tracker, d, p = i_.tracker, sample[0], parameters[0]
    norm, total = 0.0, 0.0
    for k in range(4):
        norm += tracker.wxyz[k] * tracker.wxyz[k]
    for k in range(3):
        total += tracker.position[k]
    if not (abs(norm - 1.0) < 1e-3 and math.isfinite(total) and tracker.age_s <= REACH_S):
        return False
    if tracker.sequence == 0:
        return False
    shaft, turn, servo = np.empty(3), np.empty((3, 3)), np.empty(4)
    if not recall(s, tracker.age_s, shaft, turn, servo):
        return False
    seen = np.empty((3, 3))
    matrix_from_quaternion(tracker.wxyz, seen)
    for i in range(3):
        d.position[i] = 0.0
        for k in range(3):
            d.position[i] += turn[k, i] * (tracker.position[k] - shaft[k])
        for j in range(3):
            d.rotation[i, j] = 0.0
            for k in range(3):
                d.rotation[i, j] += turn[k, i] * seen[k, j]
    carry_on(
        servo, i_.measured_servo, p.pitch_radius, p.pulley_radius, p.segment_length,
        d.position, d.rotation,
    )  # fmt: skip
    d.force_weight[:] = 0.0
    for i in range(3):
        d.force[i] = 0.0
        d.force_weight[i, i] = 1.0 / sensing[0].force_deviation
    for i in range(4):
        d.lengths[i] = lengths[i]
        d.tensions[i] = i_.measured_tension[i]
        # The state's friction is positive where a tendon is let out.
        d.sliding[i] = -s.friction[i]
    return True


@compiled
def sense(
    outcome: np.ndarray,
    tick_input: np.ndarray,
    shaft_position: np.ndarray,
    shaft_rotation: np.ndarray,
    parameters: np.ndarray,
    model: np.ndarray,
    sensing: np.ndarray,
    sample: np.ndarray,
    found: np.ndarray,
) -> None:
    """Estimate shape and force from what this tick was told, into its report.

    Args:
        outcome: (1,) whose state remembers measurements and whose report is filled.
        tick_input: (1,).
        shaft_position: (3,) measured end of the shaft, base frame, m.
        shaft_rotation: (3, 3) the segment's base frame there.
        parameters: (1,) of the robot.
        model: (1,) ``MODEL``.
        sensing: (1,) ``SENSING``.
        sample: (1,) ``SAMPLE``, memory to work in.
        found: (1,) ``ESTIMATE``, likewise.
    """
    s, i_, report = outcome[0].state, tick_input[0], outcome[0].report
    wxyz, lengths = np.empty(4), np.empty(4)
    if not math.isfinite(shaft_position[0] + shaft_position[1] + shaft_position[2]):
        report.estimate_fault = _NOT_CONVERGED
        return
    quaternion_from_matrix(shaft_rotation, wxyz)
    remember(s, i_.dt_s, shaft_position, wxyz, i_.measured_servo, i_.measured_tension)
    segment_lengths(
        i_.measured_servo, i_.measured_tension, parameters[0].pulley_radius, sensing, lengths
    )
    report.estimate_fault = _tension_fault(s, i_, lengths, sensing)
    if report.estimate_fault != 0:
        return
    if not _fill_sample(s, i_, lengths, sensing, parameters, sample):
        report.estimate_fault = _TRACKER_LOST
        return
    estimate(sample, model, found)
    if found[0].settled == 0:
        report.estimate_fault = _NOT_CONVERGED
        return
    if found[0].pose_misfit + found[0].length_misfit > _IMPOSSIBLE_MISFIT:
        report.estimate_fault = _IMPOSSIBLE
        return
    _report(report, shaft_position, shaft_rotation, found)


@compiled
def _report(
    report: RecordFields, shaft_position: np.ndarray, turn: np.ndarray, found: np.ndarray
) -> None:
    """Put an estimate into the report, forces and the tip turned into the base frame."""
    e = found[0]
    rotation = np.empty((3, 3))
    half = np.empty((3, 3))
    for i in range(3):
        report.estimate_position[i] = shaft_position[i]
        for k in range(3):
            report.estimate_position[i] += turn[i, k] * e.position[k]
            report.estimate_force[i] += turn[i, k] * e.unknowns[FORCE + k]
        for j in range(3):
            rotation[i, j] = 0.0
            half[i, j] = 0.0
            for k in range(3):
                rotation[i, j] += turn[i, k] * e.rotation[k, j]
                half[i, j] += turn[i, k] * e.covariance[FORCE + k, FORCE + j]
    for i in range(3):
        for j in range(3):
            for k in range(3):
                report.estimate_force_covariance[i, j] += half[i, k] * turn[j, k]
    quaternion_from_matrix(rotation, report.estimate_wxyz)
    for a in range(MODES):
        report.estimate_modes[a] = e.unknowns[a]
    for i in range(4):
        report.estimate_tension[i] = e.unknowns[TENSION + i]


@compiled
def sensing_is_on(tick_input: np.ndarray) -> bool:
    """Whether this tick is to estimate."""
    return bool(tick_input[0].settings.sensing != 0)


@compiled
def say_off(outcome: np.ndarray) -> None:
    """Report that nothing is estimated because sensing is off, and forget what was kept for it."""
    outcome[0].report.estimate_fault = _OFF
    outcome[0].state.sensed_count = 0
