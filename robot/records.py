"""What one tick takes and gives, as numpy record types: what all robots share, the instrument's.

Positions in metres and base frame, orientations as unit quaternions (w, x, y, z) or rotation
matrices, angles in radians. Every field is eight bytes wide so that a record is a flat block of
memory that can be mapped, copied and compared byte by byte.

Words (one meaning each): *desired* comes from the operator, *commanded* is what the controller
integrates, *measured* comes from encoders, *true* is the simulator's own.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from robot.sensing.records import CURVATURE_MODES, SENSED, SENSED_COUNT
from robot.tension.records import TENDON_COMMAND, TENDON_SETTINGS, TENDON_STATE

SCHEMA_VERSION = 7

RecordFields: TypeAlias = Any
"""A record or part of one inside compiled code, where its fields are attributes."""

Fields: TypeAlias = list[Any]
"""Fields that the records of all robots begin with: compiled code that names only these serves
every robot."""

ARM_JOINTS = 7
SERVOS = 4
U, V, LAMBDA = 7, 8, 9
"""Places of the segment's (u, v) and of lambda in the augmented configuration ``x`` (10)."""


class Safety(IntEnum):
    """Safety states (names after the Collaborative Robotics Toolkit)."""

    DISABLED = 0
    ENABLED = 1
    PAUSED = 2
    FAULT = 3


class Request(IntEnum):
    """What an operator may ask of the safety state."""

    NONE = 0
    ENABLE = 1
    DISABLE = 2
    PAUSE = 3
    RESET = 4
    EMERGENCY_STOP = 5
    OPERATOR_LOST = 6


class Refusal(IntEnum):
    """Why a leader's wish is not followed although the robot is enabled (``target_refused``)."""

    NONE = 0
    TARGET_TOO_FAR = 1
    NOT_ALIGNED = 2
    HOLD_NOT_PRESSED = 3
    OUTSIDE_WORKSPACE = 4
    BEHIND_TROCAR = 5


class Readiness(IntEnum):
    """Why the robot could not be enabled now (``readiness``)."""

    READY = 0
    NOT_CONNECTED = 1
    NOT_HOMED = 2
    BUSY = 3
    TORQUE_OFF = 4
    DEVICE_FAULT = 5
    OUTSIDE_LIMITS = 6


class LeaderKind(IntEnum):
    """Who leads the tip."""

    NONE = 0
    GIZMO = 1
    API_POSE = 2
    API_TARGET = 3
    PATH = 4
    STYLUS = 5
    GAMEPAD = 6


class DriveMode(IntEnum):
    """What a leader drives: arm and segment together, or one of them alone (paper 1, 3.1)."""

    BOTH = 0
    ARM = 1
    SEGMENT = 2


class Case(IntEnum):
    """Priority presets, below the RCM: balanced, linear first, angular first, pointing."""

    BALANCED = 0
    LINEAR_FIRST = 1
    ANGULAR_FIRST = 2
    POINTING = 3


class Solver(IntEnum):
    """How the levels are solved."""

    HQP = 0
    CLOSED_FORM = 1
    AUGMENTED = 2


class Coordinates(IntEnum):
    """Segment coordinates of the closed forms."""

    UV = 0
    POLAR = 1


class Alignment(IntEnum):
    """What the leader's absolute orientation means when the clutch closes."""

    RELATIVE = 0
    MATCHED = 1


class Compensation(IntEnum):
    """How the stretch and friction of the tendons are met: not, by a gain, by both."""

    OFF = 0
    GAIN = 1
    FULL = 2


class ErrorSource(IntEnum):
    """What the reported errors are measured against."""

    TRUE = 0
    MEASURED = 1


SHARED_SETTINGS: Fields = [
    ("alignment", "i8"),
    ("hold_to_move", "i8"),
    ("lock_rotation", "i8"),
    ("lock_translation", "i8"),
    ("motion_scale", "f8"),
    ("rotation_base_leader", "f8", (3, 3)),
]
"""The operator's choices that every robot has. ``rotation_base_leader`` turns leader motion into
the base frame."""

SETTINGS = np.dtype(
    [
        *SHARED_SETTINGS,
        ("case", "i8"),
        ("solver", "i8"),
        ("coordinates", "i8"),
        ("feed_forward", "i8"),
        ("lock_arm", "i8"),
        ("compensation", "i8"),
        ("use_tracker", "i8"),
        ("sensing", "i8"),
        *TENDON_SETTINGS,
        ("lambda_reference", "f8"),
    ]
)
"""Those of the instrument. ``lock_arm``: the joints stand still and the segment alone follows;
``sensing``: whether shape and force are estimated."""

LEADER = np.dtype(
    [
        ("kind", "i8"),
        ("sequence", "i8"),
        ("clutch", "i8"),
        ("absolute", "i8"),
        ("mode", "i8"),
        ("age_s", "f8"),
        ("timeout_s", "f8"),
        ("smoothing_s", "f8"),
        ("position", "f8", 3),
        ("wxyz", "f8", 4),
    ]
)
"""The newest sample of the active leader. ``absolute``: the pose is a tip pose in the base frame
rather than a motion relative to the clutch's anchor. ``mode``: a :class:`DriveMode`.
``smoothing_s``: time constant over which coarse samples are interpolated; 0 takes them as they
are."""

TRACKER = np.dtype(
    [
        ("sequence", "i8"),
        ("age_s", "f8"),
        ("position", "f8", 3),
        ("wxyz", "f8", 4),
    ]
)
"""A tip pose from a tracker, base frame, as it was ``age_s`` ago; ``sequence`` grows with each new
one, and is 0 while there is none."""

SHARED_INPUT: Fields = [
    ("dt_s", "f8"),
    ("request", "i8"),
    ("hold", "i8"),
    ("measured_valid", "i8"),
    ("measured_age_s", "f8"),
    ("plant_event", "i8"),
    ("readiness", "i8"),
    ("late_s", "f8"),
    ("trocar_position", "f8", 3),
    ("leader", LEADER),
]
"""What a tick of every robot is told. ``plant_event``: the :class:`robot.safety.Event` that the
plant tells now, 0 for none; ``readiness``: a :class:`Readiness`; ``late_s``: how long after its
deadline the tick began; ``trocar_position``: where the robot enters the body."""

INPUT = np.dtype(
    [
        *SHARED_INPUT,
        ("measured_q", "f8", ARM_JOINTS),
        ("measured_servo", "f8", SERVOS),
        ("measured_tension", "f8", SERVOS),
        ("tension_cells", "i8"),
        ("measured_load", "f8", SERVOS),
        ("measured_contact", "f8"),
        ("tracker", TRACKER),
        ("trocar_velocity", "f8", 3),
        ("settings", SETTINGS),
    ]
)
"""That of the instrument. ``measured_tension`` in N, NaN of a cell without a reading;
``tension_cells``: whether the robot measures tensions; ``measured_load``: of each servo, share of
its largest, -1 to 1; ``measured_contact``: largest force in N on the instrument that a sensor of
the scene reads, 0 without one."""

SHARED_STATE: Fields = [
    ("tick", "i8"),
    ("safety", "i8"),
    ("reason", "i8"),
    ("engaged", "i8"),
    ("leader_kind", "i8"),
    ("leader_sequence", "i8"),
    ("leader_position", "f8", 3),
    ("leader_rotation", "f8", (3, 3)),
    ("tip_position", "f8", 3),
    ("tip_rotation", "f8", (3, 3)),
    ("desired_position", "f8", 3),
    ("desired_rotation", "f8", (3, 3)),
    ("desired_velocity", "f8", 3),
    ("desired_angular_velocity", "f8", 3),
    ("target_position", "f8", 3),
    ("target_rotation", "f8", (3, 3)),
    ("anchor_leader_position", "f8", 3),
    ("anchor_leader_rotation", "f8", (3, 3)),
    ("anchor_tip_position", "f8", 3),
    ("anchor_tip_rotation", "f8", (3, 3)),
    ("anchor_scale", "f8"),
    ("anchor_lock_rotation", "i8"),
    ("anchor_lock_translation", "i8"),
    ("anchor_rotation_base_leader", "f8", (3, 3)),
    ("correction_position", "f8", 3),
    ("correction_rotation", "f8", 3),
    ("mode", "i8"),
]
"""What every robot remembers: its safety, who leads, and the led tip. ``tip_*``: that tip as
commanded, base frame; ``target_*``: where the leader wants it; ``desired_*velocity``: how the
desired pose moved in the last tick (m/s, rad/s, base frame); ``correction_*``: what a tracker says
that the commanded tip is off (m, rotation vector in rad, base frame), zero without one; ``mode``:
the :class:`DriveMode` in force."""

STATE = np.dtype(
    [
        *SHARED_STATE,
        ("x", "f8", 10),
        ("arm_position", "f8", 3),
        ("arm_rotation", "f8", (3, 3)),
        ("arm_jacobian", "f8", (6, ARM_JOINTS)),
        ("friction", "f8", SERVOS),
        ("compensation", "f8", 2),
        ("tracker_sequence", "i8"),
        ("lagged_position", "f8", 3),
        ("lagged_rotation", "f8", (3, 3)),
        ("contact_allowance", "f8"),
        ("clearance", "f8"),
        ("clearance_part", "i8"),
        ("clearance_allowance", "f8"),
        ("trocar_distance", "f8"),
        *TENDON_STATE,
        ("sensed_time", "f8"),
        ("sensed_count", "i8"),
        ("sensed", SENSED, SENSED_COUNT),
    ]
)
"""That of the instrument. ``x`` is the commanded configuration; the ``arm_*`` and ``tip_*`` fields
are its forward kinematics, kept so that each tick computes them once (``arm_jacobian``: rows linear
then angular, of the point that coincides with the base origin, base frame).
``friction``: of each tendon in the disks, share of full, -1 to 1;
``compensation``: shares of gain and friction that are made up for;
``lagged_*``: the commanded tip as old as the tracker's samples; ``contact_allowance``: the contact
force in N above which motion pauses; ``clearance``: smallest distance in m between arm, shaft
and body wall where they were measured, of the pair ``clearance_part`` (see
``robot.clearance``); ``clearance_allowance``: the clearance below which motion pauses;
``trocar_distance``: of the measured shaft from the trocar, m; ``sensed``: the last measurements, in
a ring of which ``sensed_count`` were written, on the clock ``sensed_time`` (s)."""

COMMAND = np.dtype(
    [
        ("q", "f8", ARM_JOINTS),
        ("servo", "f8", SERVOS),
        *TENDON_COMMAND,
        ("moving", "i8"),
    ]
)
"""Joint and servo angles to go to; ``moving`` is 0 for a zero-motion command."""

SHARED_REPORT: Fields = [
    ("desired_position", "f8", 3),
    ("desired_wxyz", "f8", 4),
    ("commanded_position", "f8", 3),
    ("commanded_wxyz", "f8", 4),
    ("twist", "f8", 6),
    ("limits_active", "i8"),
    ("solver_status", "i8"),
    ("target_refused", "i8"),
]
"""What every controller reports of the led tip. ``twist``: as commanded, linear and angular, m/s
and rad/s; ``limits_active``: bits of the limits that held the
motion back; ``target_refused``: a :class:`Refusal`."""

REPORT = np.dtype(
    [
        *SHARED_REPORT,
        ("x", "f8", 10),
        ("x_dot", "f8", 10),
        ("theta", "f8"),
        ("delta", "f8"),
        ("residual_rcm", "f8"),
        ("residual_linear", "f8"),
        ("residual_angular", "f8"),
        ("estimate_fault", "i8"),
        ("estimate_force", "f8", 3),
        ("estimate_force_covariance", "f8", (3, 3)),
        ("estimate_modes", "f8", CURVATURE_MODES),
        ("estimate_position", "f8", 3),
        ("estimate_wxyz", "f8", 4),
        ("estimate_tension", "f8", SERVOS),
    ]
)
"""What the instrument's controller did, and what its sensing found. ``residual_*``: norms of
what each level could not do, m/s and rad/s. ``limits_active``: see ``priority.limits``.
``estimate_fault``: a ``robot.sensing.faults.SensingFault``; while it is not NONE, the estimate is
not valid and its numbers are zero. ``estimate_force``: of the environment on the tip, N, base
frame, with its covariance; ``estimate_modes``: curvature from the measured end of the shaft on, see
``robot.sensing.curvature_modes``; ``estimate_position``, ``estimate_wxyz``: of the tip, base frame;
``estimate_tension`` at the segment's base, N."""

OUTCOME = np.dtype([("state", STATE), ("command", COMMAND), ("report", REPORT)])
"""What ``tick`` returns: the next state, the command, the report."""

SHARED_TRUTH: Fields = [
    ("source", "i8"),
    ("position", "f8", 3),
    ("wxyz", "f8", 4),
    ("position_error", "f8"),
]
"""Where the led tip is: the simulator's truth, or the forward kinematics of what was measured
(``source``, an :class:`ErrorSource`), and the error against it: desired minus it."""

TRUTH = np.dtype(
    [
        *SHARED_TRUTH,
        ("shaft_base", "f8", 3),
        ("shaft_end", "f8", 3),
        ("q", "f8", ARM_JOINTS),
        ("uv", "f8", 2),
        ("lambda_along_shaft", "f8"),
        ("trocar_position", "f8", 3),
        ("tension", "f8", SERVOS),
        ("contact_count", "i8"),
        ("contact_force", "f8"),
        ("contact_wrench", "f8", 6),
        ("rings_passed", "i8"),
        ("rings_touched", "i8"),
        ("ball_position", "f8", 3),
        ("ball_progress", "f8"),
        ("orientation_error", "f8"),
        ("rcm_error", "f8"),
    ]
)
"""Where the instrument is. ``trocar_position``: where the trocar is, against which the RCM error
counts; ``tension`` in N; ``contact_force``: largest contact force on the instrument in N;
``contact_wrench``: of all contacts on the instrument together, force in N and moment about the tip
in N m, base frame; ``rings_*``: a bit for each ring of the board; ``ball_progress``: 0 at the
groove's start, 1 at its end."""

HEADER = np.dtype(
    [
        ("schema_version", "i8"),
        ("robot", "S16"),
        ("configuration_hash", "i8"),
        ("tick", "i8"),
        ("time_ns", "i8"),
        ("dt_ns", "i8"),
        ("stamp_ns", "i8"),
        ("lateness_ns", "i8"),
        ("tick_ns", "i8"),
        ("overruns", "i8"),
        ("request_sequence", "i8"),
        ("path_id", "i8"),
        ("path_progress", "f8"),
    ]
)
"""``time_ns`` is the plant's clock, ``stamp_ns`` the host's monotonic clock at publication,
``request_sequence`` the last request from outside that this tick had taken in."""


class RecordTypes(NamedTuple):
    """The numpy types of one robot.

    Attributes:
        robot: its name.
        settings: the operator's choices.
        outcome: what a tick fills.
        truth: where the robot is.
        record: one tick: header, input, outcome, truth.
    """

    robot: str
    settings: np.dtype[Any]
    outcome: np.dtype[Any]
    truth: np.dtype[Any]
    record: np.dtype[Any]


def record_types(robot: str, tick_input: Any, outcome: Any, truth: Any) -> RecordTypes:
    """The types of a robot whose ticks take ``tick_input`` (with ``settings`` in it)."""
    record = np.dtype(
        [("header", HEADER), ("input", tick_input), ("outcome", outcome), ("truth", truth)]
    )
    return RecordTypes(robot, tick_input["settings"], outcome, truth, record)


INSTRUMENT = record_types("instrument", INPUT, OUTCOME, TRUTH)
RECORD = INSTRUMENT.record
"""One tick of the first robot (``instrument``)."""
