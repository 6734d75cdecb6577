"""Four modules: motor, gear with backlash, pulley, torque cell behind the gear, and their drives.

Equations of motion of one, theta_m at the motor, theta at the pulley, N the gear's ratio:

    J_m theta_m'' = K_t i - b theta_m' - f sign(theta_m') - T_g / (N eta)   (eta for what is driven)
    J_p theta''   = T_g + T r            T_g = k_g dead(theta_m / N - theta) + d_g (rates)

A tendon's tension T pulls the pulley toward positive angles; a negative angle takes the tendon up,
as the servos' angles do. The cell carries the motor and reads the gear's reaction, T_g; so
tension = -reading / r while the pulley stands.

The gear's losses are friction that grows with its load: between eta and 1 / eta of T_g / N. With f
they are Coulomb friction in the strict sense, which also holds a motor that stands; inner steps are
semi-implicit and solve for it exactly. The drive's cascaded loops run once a cycle, on what encoder
and cell say; the current follows them at once.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np

from robot.compiled import compiled
from robot.tension_unit_design import TensionUnit

MODULES = 4
CYCLE_S = 0.001
"""Of the drives' loops (paper 3, II-C: up to 1 kHz)."""
INNER_S = 25e-6
"""Longest inner step; gear and pulley swing at 200 Hz and more."""
POSITION, TORQUE, CURRENT = 0, 1, 2
"""What a drive holds: an angle of the pulley; the gear's torque on it, as the cell has it; or the
motor's current, asked for as the torque that it would give without losses."""
_GEAR_DAMPING = 0.4
"""Damping ratio of pulley and motor on the gear."""
_LONGEST_SWING = 0.5
"""Of gear, pulley and load: rad that an inner step may pass over."""
_SPEED_LOOP_RATIO = 4.0
_INTEGRAL_PER_S = 30.0
_TORQUE_SPEED = 40.0
"""Speed of the pulley, rad/s, that the torque loop asks for per N m that is missing."""


class UnitFault(IntEnum):
    """How a module can break."""

    NONE = 0
    CELL_MISSING = 1
    """The cell's cable: no number."""
    CELL_FLAT = 2
    """The amplifier: the last reading, for ever."""
    CELL_SATURATED = 3
    """The end of the range on the side of a pulled tendon."""
    TENDON_BROKEN = 4
    """Nothing loads the pulley any more."""


_CELL_MISSING, _CELL_FLAT = int(UnitFault.CELL_MISSING), int(UnitFault.CELL_FLAT)
_CELL_SATURATED, _TENDON_BROKEN = int(UnitFault.CELL_SATURATED), int(UnitFault.TENDON_BROKEN)

CONSTANTS = np.dtype(
    [
        ("radius", "f8"),
        ("ratio", "f8"),
        ("efficiency", "f8"),
        ("gear_stiffness", "f8"),
        ("gear_damping", "f8"),
        ("half_backlash", "f8"),
        ("rotor", "f8"),
        ("pulley", "f8"),
        ("torque_constant", "f8"),
        ("current_limit", "f8"),
        ("friction", "f8"),
        ("viscosity", "f8"),
        ("count", "f8"),
        ("current_noise", "f8"),
        ("full_scale", "f8"),
        ("cell_noise", "f8"),
        ("cell_resolution", "f8"),
        ("offset", "f8", MODULES),
        ("gain", "f8", MODULES),
        ("bandwidth", "f8"),
        ("tendon_stiffness", "f8", MODULES),
        ("tendon_length", "f8", MODULES),
        ("pretension", "f8", MODULES),
        ("spring", "f8"),
        ("inner", "f8"),
    ]
)
"""SI units. ``count``: rad of the motor between two of the encoder's; ``tendon_*``, ``pretension``:
the load, of the straight segment; ``spring``: one on every pulley instead, N m/rad, 0 for none;
``inner``: longest inner step, s."""

STATE = np.dtype(
    [
        ("motor", "f8", MODULES),
        ("motor_speed", "f8", MODULES),
        ("angle", "f8", MODULES),
        ("speed", "f8", MODULES),
        ("mode", "i8", MODULES),
        ("integral", "f8", MODULES),
        ("current", "f8", MODULES),
        ("seen", "f8", MODULES),
        ("seen_speed", "f8", MODULES),
        ("wanted", "f8", MODULES),
        ("load", "f8", MODULES),
        ("cell", "f8", MODULES),
        ("measured_current", "f8", MODULES),
        ("work", "f8", MODULES),
        ("lost", "f8", MODULES),
        ("fault", "i8", MODULES),
    ]
)
"""Angles rad and speeds rad/s of motor and pulley; mode, integral and current A of the drive;
``seen``, ``seen_speed``: the motor's angle and speed as the encoder has them; ``wanted``: the angle
that was last asked for; ``load``: torque of the load on the pulley, N m; ``cell``,
``measured_current``: as measured; ``work``: of the motor, ``lost``: in friction and gear, J;
``fault``: a :class:`UnitFault`."""


def unit_constants(
    design: TensionUnit,
    generator: np.random.Generator,
    tendon_stiffness: np.ndarray | float = 0.0,
    tendon_length: np.ndarray | float = 0.0,
    pretension: np.ndarray | float = 0.0,
    spring: float = 0.0,
) -> np.ndarray:
    """The (1,) constants of a unit.

    Args:
        design: the table ``[tension_unit]``.
        generator: draws offset and gain of the cells, and is advanced.
        tendon_stiffness: N/m.
        tendon_length: of the straight segment, m.
        pretension: N.
        spring: on every pulley, N m/rad, where there are no tendons.
    """
    constants = np.zeros(1, CONSTANTS)
    draws = generator.normal(size=(2, MODULES))
    values: dict[str, object] = {
        "radius": design.pulley_radius_mm * 1e-3,
        "ratio": design.gear_ratio,
        "efficiency": design.gear_efficiency,
        "gear_stiffness": design.gear_stiffness_nm_rad,
        "half_backlash": 0.5 * math.radians(design.backlash_deg),
        "rotor": design.rotor_inertia_g_cm2 * 1e-7,
        "pulley": design.pulley_inertia_g_cm2 * 1e-7,
        "torque_constant": design.torque_constant_mnm_a * 1e-3,
        "current_limit": design.current_limit_a,
        "friction": design.motor_friction_mnm * 1e-3,
        "viscosity": design.motor_viscosity_nnm_s * 1e-9,
        "count": 2.0 * math.pi / design.encoder_counts,
        "current_noise": design.current_noise_ma * 1e-3,
        "full_scale": design.cell_full_scale_nm,
        "cell_noise": design.cell_noise_mnm * 1e-3,
        "cell_resolution": design.cell_resolution_mnm * 1e-3,
        "offset": design.cell_offset_mnm * 1e-3 * draws[0],
        "gain": 1.0 + 0.01 * design.cell_gain_percent * draws[1],
        "bandwidth": 2.0 * math.pi * design.position_bandwidth_hz,
        "tendon_stiffness": tendon_stiffness,
        "tendon_length": tendon_length,
        "pretension": pretension,
        "spring": spring,
    }
    for name, value in values.items():
        constants[name] = value
    _fit_gear(constants)
    return constants


def _fit_gear(constants: np.ndarray) -> None:
    """The gear's damping, and the inner step in which the fastest swing is passed safely."""
    c = constants[0]
    gear, load = c["gear_stiffness"], max(c["spring"], *(c["tendon_stiffness"] * c["radius"] ** 2))
    seen_rotor = c["rotor"] * c["ratio"] ** 2
    mobility = 1.0 / c["pulley"] + 1.0 / (seen_rotor * c["efficiency"])
    constants["gear_damping"] = 2.0 * _GEAR_DAMPING * math.sqrt(gear / mobility)
    fastest = math.sqrt(gear * mobility + load / c["pulley"])
    constants["inner"] = min(INNER_S, _LONGEST_SWING / fastest)


@compiled
def load_on(constants: np.ndarray, i: int, angle: float, length: float) -> float:
    """Torque of the load of module ``i`` on its pulley, N m.

    Args:
        constants: (1,).
        i: 0 to 3.
        angle: of the pulley, rad.
        length: of the routed tendon, m.
    """
    c = constants[0]
    if c.spring > 0.0:
        return float(-c.spring * angle)
    slack = c.pretension[i] / max(c.tendon_stiffness[i], 1e-9)
    rest_length = c.tendon_length[i] + c.radius * angle - slack
    return float(c.radius * max(0.0, c.tendon_stiffness[i] * (length - rest_length)))


@compiled
def _drive(
    state: np.ndarray, constants: np.ndarray, i: int, mode: int, wanted: float, dt: float
) -> None:
    """The drive of module ``i``: position or torque around a loop of the speed, or a current."""
    s, c = state[0], constants[0]
    seen = c.count * np.rint(s.motor[i] / c.count)
    speed = (seen - s.seen[i]) / dt
    s.seen[i], s.seen_speed[i] = seen, speed
    # What the speed loop makes of 1 rad/s at the motor, A.
    gain = c.rotor * _SPEED_LOOP_RATIO * c.bandwidth / c.torque_constant
    per_torque = 1.0 / (c.ratio * c.torque_constant)
    if mode == POSITION:
        ahead = (wanted - s.wanted[i]) / dt
        off = c.ratio * (c.bandwidth * wanted + ahead) - c.bandwidth * seen - speed
        current = gain * off
        s.wanted[i] = wanted
    elif mode == TORQUE:
        # Around a loop of the speed, which meets friction: a tendon of any stiffness is then wound
        # up without swinging, a soft one slowly. Without a reading the motor is held.
        missing = wanted - s.cell[i] if np.isfinite(s.cell[i]) else 0.0
        off = c.ratio * _TORQUE_SPEED * missing - speed
        current = wanted * per_torque + gain * off
        s.wanted[i] = seen / c.ratio
    else:
        off, s.integral[i], s.mode[i] = 0.0, 0.0, mode
        current = wanted * per_torque
        s.wanted[i] = seen / c.ratio
    step = gain * _INTEGRAL_PER_S * off * dt
    if mode != s.mode[i]:
        # No jump of the current where the mode changes.
        s.integral[i] = s.current[i] - current
        s.mode[i] = mode
    current += s.integral[i]
    if abs(current) < c.current_limit or current * step < 0.0:
        s.integral[i] += step
    s.current[i] = min(max(current, -c.current_limit), c.current_limit)


@compiled
def _inner_step(state: np.ndarray, constants: np.ndarray, i: int, length: float, h: float) -> float:
    """One inner step of module ``i``; the gear's torque on the pulley, N m."""
    s, c = state[0], constants[0]
    twist = s.motor[i] / c.ratio - s.angle[i]
    gear = 0.0
    if abs(twist) > c.half_backlash:
        spring = c.gear_stiffness * (twist - math.copysign(c.half_backlash, twist))
        rate = s.motor_speed[i] / c.ratio - s.speed[i]
        gear = spring + c.gear_damping * rate
        # Teeth push; they do not pull.
        gear = max(0.0, gear) if twist > 0.0 else min(0.0, gear)
    load = 0.0 if s.fault[i] == _TENDON_BROKEN else load_on(constants, i, s.angle[i], length)
    # Half way between what drives and what is driven; friction reaches either.
    back = 0.5 * (1.0 / c.efficiency + c.efficiency) * gear / c.ratio
    friction = c.friction + 0.5 * (1.0 / c.efficiency - c.efficiency) * abs(gear) / c.ratio
    motor = c.torque_constant * s.current[i]
    slower = 1.0 + h / c.rotor * c.viscosity
    free = (s.motor_speed[i] + h / c.rotor * (motor - back)) / slower
    held = h / c.rotor * friction / slower
    motor_before, before = s.motor_speed[i], s.speed[i]
    s.motor_speed[i] = 0.0 if abs(free) <= held else free - math.copysign(held, free)
    s.speed[i] += h / c.pulley * (gear + load)
    s.motor[i] += h * s.motor_speed[i]
    s.angle[i] += h * s.speed[i]
    # Over a step forces work along the mean of the speeds before and after it.
    motor_mean, mean = 0.5 * (motor_before + s.motor_speed[i]), 0.5 * (before + s.speed[i])
    taken = motor - c.rotor * (s.motor_speed[i] - motor_before) / h
    s.work[i] += h * motor * motor_mean
    s.lost[i] += h * (taken * motor_mean - gear * mean)
    s.load[i] = load
    return float(gear)


@compiled
def _reading(
    state: np.ndarray, constants: np.ndarray, i: int, torque: float, noise: float
) -> float:
    """What the cell of module ``i`` says of the mean torque (N m) of a cycle."""
    s, c = state[0], constants[0]
    if s.fault[i] == _CELL_MISSING:
        return float(np.nan)
    if s.fault[i] == _CELL_FLAT:
        return float(s.cell[i])
    if s.fault[i] == _CELL_SATURATED:
        return float(-c.full_scale)
    reading = c.gain[i] * torque + c.offset[i] + c.cell_noise * noise
    if c.cell_resolution > 0.0:
        reading = c.cell_resolution * np.rint(reading / c.cell_resolution)
    return float(min(max(reading, -c.full_scale), c.full_scale))


@compiled
def drive_unit(
    state: np.ndarray,
    constants: np.ndarray,
    mode: np.ndarray,
    wanted: np.ndarray,
    length: np.ndarray,
    dt: float,
    noise: np.ndarray,
) -> None:
    """Let all four modules work for one cycle of their drives.

    Args:
        state: (1,) changed.
        constants: (1,).
        mode: (4,) ``POSITION``, ``TORQUE`` or ``CURRENT``.
        wanted: (4,) angles of the pulleys in rad, or torques of the gears on them in N m.
        length: (4,) of the routed tendons, m; nothing where the load is a spring.
        dt: of the cycle, s.
        noise: (2, 4) standard normal numbers, of cells and currents.
    """
    s, c = state[0], constants[0]
    steps = max(1, math.ceil(dt / c.inner - 1e-6))
    h = dt / steps
    for i in range(MODULES):
        _drive(state, constants, i, mode[i], wanted[i], dt)
        mean = 0.0
        for _ in range(steps):
            mean += _inner_step(state, constants, i, length[i], h) / steps
        s.cell[i] = _reading(state, constants, i, mean, noise[0, i])
        s.measured_current[i] = s.current[i] + c.current_noise * noise[1, i]


def rest(state: np.ndarray, constants: np.ndarray, angles: np.ndarray) -> None:
    """Let the (1,) modules stand at ``angles`` (4,), rad, teeth in contact, holding their load.

    Whatever was broken is whole again.
    """
    c = constants[0]
    state[:] = np.zeros(1, STATE)
    for i in range(MODULES):
        load = load_on(constants, i, float(angles[i]), float(c["tendon_length"][i]))
        twist = -load / c["gear_stiffness"] - math.copysign(c["half_backlash"], load)
        state["angle"][0, i] = angles[i]
        state["motor"][0, i] = state["seen"][0, i] = c["ratio"] * (angles[i] + twist)
        state["wanted"][0, i] = angles[i] + twist
        state["load"][0, i], state["cell"][0, i] = load, -load
        held = -load / (c["ratio"] * c["torque_constant"])
        state["integral"][0, i] = state["current"][0, i] = held
