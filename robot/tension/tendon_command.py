"""What the drives of the four tendons are told where tensions are held: the tick's last command.

One balance of forces says what every tendon should carry at the commanded bend (u, v): by virtual
work, in constant curvature, with the tendons' lengths q_i(u, v) and their friction (shares f_i),

    sum_i A_i m_i (tau_i - f_i c) = (E I / L) (u, v),    A_i = -dq_i/d(u, v),
    m_i = (1 - exp(-f_i mu theta)) / (f_i mu theta),     q_i = r (-u, v, u, -v)_i - chord theta^2

of whose solutions the least tensions above the co-contraction are taken. From there a tendon holds
either its tension, or the length that goes with it: q_i less the stretch (tau_i - pretension) / k.
In hybrid control the pulled tendon of each opposed pair holds its length and the loose one its
tension, which settles both the bend and the co-contraction; in tension control all hold tensions,
and the backbone alone holds the bend.

Nothing jumps, and a resting robot rests: a tendon begins to hold a tension at the one that is
measured, and a length where it stands. What that differs from the model in (``tendon_bias``, and
``force_bias`` of the balance) dies away while the robot moves. Paper 3, II-A and II-C, names the
three ways; the laws are ours.
"""

from __future__ import annotations

import math

import numpy as np

from robot.compiled import compiled
from robot.records import RecordFields, Safety
from robot.tendons import tendon_lengths
from robot.tension.cells import cells_read
from robot.tension.records import TendonControl, TendonMode

FROM_MEASURED = -1
"""``tendon_map`` where the next command has to begin from where the tendons are held."""
_BY_LENGTH, _BY_TENSION = 0, 1
_ENABLED, _PAUSED = int(Safety.ENABLED), int(Safety.PAUSED)
_POSITION_CONTROL, _HYBRID = int(TendonControl.POSITION), int(TendonControl.HYBRID)
_POSITION, _TENSION = int(TendonMode.POSITION), int(TendonMode.TENSION)
_BIAS_S = 0.5
"""Time constant in which what differs from the model dies away while the robot moves."""
_GONE = 1e-9
_TURN_RAD = 0.05
"""Bend to the other side from which on the other tendon of a pair holds the length."""


@compiled
def holds_tensions(tick_input: RecordFields) -> bool:
    """Whether tendons are to hold tensions on a robot that measures them."""
    by_tension = tick_input.settings.tendon_control != _POSITION_CONTROL
    return bool(by_tension and tick_input.tension_cells != 0)


@compiled
def balance(s: RecordFields, parameters: np.ndarray, rows: np.ndarray, right: np.ndarray) -> None:
    """The balance of forces ``rows @ tensions = right`` at the commanded bend, without its bias.

    Args:
        s: state; its bend, friction and compensation are read.
        parameters: (1,).
        rows: (2, 4) filled, m.
        right: (2,) filled, N m.
    """
    p = parameters[0]
    bend = (s.x[7], s.x[8])
    theta = math.hypot(bend[0], bend[1])
    chord = p.chord * p.pitch_radius
    side = (1.0, 0.0, -1.0, 0.0), (0.0, -1.0, 0.0, 1.0)
    for k in range(2):
        right[k] = p.bending_stiffness / p.segment_length * bend[k]
        for i in range(4):
            # The state's friction is positive where a tendon is let out.
            f = -s.friction[i] * s.compensation[1]
            decay = f * p.capstan * theta
            left = 1.0 if abs(decay) < 1e-6 else (1.0 - math.exp(-decay)) / decay
            rows[k, i] = left * (p.pitch_radius * side[k][i] + 2.0 * chord * bend[k])
            right[k] += rows[k, i] * f * p.coulomb


@compiled
def _hold_still(outcome: np.ndarray, i_: RecordFields, may_hold_tension: bool) -> None:
    """Command what was told last; tendons that may not hold their tension stay where they are."""
    s, c = outcome[0].state, outcome[0].command
    for i in range(4):
        if s.tendon_mode[i] == _TENSION and not may_hold_tension:
            s.tendon_mode[i] = _POSITION
            s.tendon_servo[i] = i_.measured_servo[i]
            s.tendon_tension[i] = 0.0
            # Whoever goes on begins anew: tensions may have changed meanwhile.
            s.tendon_map = FROM_MEASURED
        c.servo[i], c.tendon_mode[i] = s.tendon_servo[i], s.tendon_mode[i]
        c.tension[i] = s.tendon_tension[i]


@compiled
def _go_by_length(outcome: np.ndarray, i_: RecordFields, decay: float) -> None:
    """All tendons hold lengths, as the bend's command has them."""
    s, c = outcome[0].state, outcome[0].command
    for i in range(4):
        if s.tendon_map != _BY_LENGTH:
            start = s.tendon_servo[i]
            if s.tendon_mode[i] == _TENSION:
                start = i_.measured_servo[i]
            s.tendon_bias[i] = start - c.servo[i]
        elif c.moving != 0:
            s.tendon_bias[i] *= decay
        if i_.tension_cells == 0 or abs(s.tendon_bias[i]) < _GONE:
            s.tendon_bias[i] = 0.0
        c.servo[i] += s.tendon_bias[i]
        s.tendon_servo[i] = c.servo[i]
        s.tendon_mode[i], s.tendon_tension[i] = _POSITION, 0.0
    s.tendon_map = _BY_LENGTH


@compiled
def prepare_tendons(
    outcome: np.ndarray,
    tick_input: np.ndarray,
    parameters: np.ndarray,
    rows: np.ndarray,
    right: np.ndarray,
    low: np.ndarray,
) -> bool:
    """Do what needs no distribution of tensions; else fill its problem.

    Args:
        outcome: (1,) its command holds the servo angles that the bend asks for.
        tick_input: (1,).
        parameters: (1,).
        rows: (2, 4) filled, m.
        right: (2,) filled, N m.
        low: (4,) filled: least tensions, N.

    Returns:
        Whether :func:`finish_tendons` has to follow.
    """
    s, i_, p = outcome[0].state, tick_input[0], parameters[0]
    by_tension = holds_tensions(i_)
    decay = math.exp(-i_.dt_s / _BIAS_S)
    if s.safety != _ENABLED and s.tendon_map != _BY_LENGTH:
        reads = cells_read(s, i_, p)
        _hold_still(outcome, i_, by_tension and reads and s.safety == _PAUSED)
        return False
    if s.safety != _ENABLED or not by_tension:
        _go_by_length(outcome, i_, decay)
        return False
    balance(s, parameters, rows, right)
    for k in range(2):
        if s.tendon_map != _BY_TENSION:
            s.force_bias[k] = -right[k]
            for i in range(4):
                s.force_bias[k] += rows[k, i] * i_.measured_tension[i]
        elif outcome[0].command.moving != 0:
            s.force_bias[k] *= decay
        right[k] += s.force_bias[k]
    for i in range(4):
        low[i] = min(i_.settings.co_contraction, p.tension_limit)
    return True


@compiled
def _choose_holders(s: RecordFields, control: int, modes: np.ndarray) -> None:
    """What each tendon (4,) is to hold."""
    for k in range(2):
        # Tendon 1 pulls toward positive u, tendon 4 toward positive v.
        pulls = (0, 2) if k == 0 else (3, 1)
        bend = s.x[7 + k]
        if s.tendon_map != _BY_TENSION or bend * (1 - 2 * s.tendon_holder[k]) < -_TURN_RAD:
            s.tendon_holder[k] = 0 if bend >= 0.0 else 1
        for side in range(2):
            holds = control == _HYBRID and s.tendon_holder[k] == side
            modes[pulls[side]] = _POSITION if holds else _TENSION


@compiled
def _tensions_told(
    s: RecordFields,
    i_: RecordFields,
    p: RecordFields,
    wanted: np.ndarray,
    modes: np.ndarray,
    rows: np.ndarray,
    right: np.ndarray,
) -> None:
    """Lead tensions toward the wanted ones; those of tendons that hold a length follow from the
    balance with the others.
    """
    step = p.tension_rate * i_.dt_s
    for i in range(4):
        if modes[i] == _TENSION:
            told = s.tendon_tension[i]
            if s.tendon_map != _BY_TENSION or s.tendon_mode[i] != _TENSION:
                told = i_.measured_tension[i]
            s.tendon_tension[i] = told + min(max(wanted[i] - told, -step), step)
    if modes[0] == modes[2]:
        return
    a, b = (0 if modes[0] == _POSITION else 2), (1 if modes[1] == _POSITION else 3)
    left = np.empty(2)
    for k in range(2):
        left[k] = right[k]
        for i in range(4):
            if modes[i] == _TENSION:
                left[k] -= rows[k, i] * s.tendon_tension[i]
    determinant = rows[0, a] * rows[1, b] - rows[0, b] * rows[1, a]
    s.tendon_tension[a] = max(0.0, (left[0] * rows[1, b] - left[1] * rows[0, b]) / determinant)
    s.tendon_tension[b] = max(0.0, (left[1] * rows[0, a] - left[0] * rows[1, a]) / determinant)


@compiled
def finish_tendons(
    outcome: np.ndarray,
    tick_input: np.ndarray,
    parameters: np.ndarray,
    wanted: np.ndarray,
    rows: np.ndarray,
    right: np.ndarray,
) -> None:
    """Command each tendon its tension, or the length that goes with it.

    Args:
        outcome: (1,) state and command are changed.
        tick_input: (1,).
        parameters: (1,).
        wanted: (4,) tensions that solve ``rows @ wanted = right``, N.
        rows: (2, 4) of :func:`prepare_tendons`.
        right: (2,) likewise.
    """
    s, c = outcome[0].state, outcome[0].command
    i_, p = tick_input[0], parameters[0]
    modes, lengths = np.empty(4, dtype=np.int64), np.empty(4)
    _choose_holders(s, i_.settings.tendon_control, modes)
    _tensions_told(s, i_, p, wanted, modes, rows, right)
    u, v = s.x[7], s.x[8]
    tendon_lengths(u, v, p.pitch_radius, lengths)
    decay = math.exp(-i_.dt_s / _BIAS_S)
    for i in range(4):
        stretch = s.compensation[0] * (s.tendon_tension[i] - p.pretension[i]) / p.tendon_stiffness
        shortened = p.chord * p.pitch_radius * (u * u + v * v)
        angle = (lengths[i] - shortened - stretch) / p.pulley_radius
        if modes[i] == _TENSION:
            s.tendon_bias[i] = 0.0
        elif s.tendon_map != _BY_TENSION or s.tendon_mode[i] == _TENSION:
            held = s.tendon_mode[i] == _TENSION
            s.tendon_bias[i] = (i_.measured_servo[i] if held else s.tendon_servo[i]) - angle
        elif c.moving != 0:
            s.tendon_bias[i] *= decay
        c.servo[i] = angle + s.tendon_bias[i]
        c.tendon_mode[i], c.tension[i] = modes[i], s.tendon_tension[i]
        s.tendon_servo[i], s.tendon_mode[i] = c.servo[i], modes[i]
    s.tendon_map = _BY_TENSION
