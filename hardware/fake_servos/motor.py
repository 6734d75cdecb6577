"""One servo's motor: the profile that a goal becomes, the loop that follows it, and its physics.

Positions are in ticks of the output shaft, as the servo counts them. Torques are shares of the
stall torque at the nominal voltage.
"""

from __future__ import annotations

import math

from hardware.servos.control_table import TICKS_PER_TURN, OperatingMode

NOMINAL_VOLT = 12.0
STALL_TORQUE_NM = 1.5
"""At the nominal voltage; e-manual, XL430-W250."""

VELOCITY_UNIT = 0.229 * TICKS_PER_TURN / 60.0
"""Ticks per second in one count of a velocity register."""
ACCELERATION_UNIT = 214.577 * TICKS_PER_TURN / 3600.0
"""Ticks per second squared in one count of ``profile_acceleration``."""
LARGEST_PWM = 885

_NO_LOAD = 61.0 * TICKS_PER_TURN / 60.0
_TIME_CONSTANT_S = 0.010
"""Of the velocity: rotor and gears against the motor's own damping."""
_FRICTION = 0.02
"""Of the gears, while the motor is driven; it is part of the load that a servo reads."""
_FRICTION_WITHOUT_TORQUE = 0.0003
_LOOSENESS = 20.0
"""How much faster a load turns the motor when it is not driven. Both are assumed for the worst: a
bent segment without torque springs straight."""
_PWM, _VELOCITY = int(OperatingMode.PWM), int(OperatingMode.VELOCITY)
_GAIN_UNIT = 1.0 / (128.0 * LARGEST_PWM)
_STANDS = 1.0
_BREAKAWAY = 0.0004
"""How much more it takes to begin a motion than to keep it up, share of stall."""


def _clamp(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)


class Motor:
    """State of one motor.

    Attributes:
        position: ticks, true.
        velocity: ticks/s, true.
        goal: where the profile leads, ticks; in velocity mode the wanted ticks/s.
        trajectory: where the profile stands, ticks.
        trajectory_velocity: its velocity, ticks/s.
        largest_velocity: of the profile, ticks/s; 0 for no limit.
        acceleration: of the profile, ticks/s²; 0 for no limit.
        mode: one of ``OperatingMode``.
        torque: whether the motor is driven.
        gain: register ``position_p_gain``.
        pwm: largest output share, and in PWM mode the wanted one.
        volt: supply.
        drive: output share of this moment.
        load: torque that the motor gives, share of stall, as the servo infers it.
        stuck_at: position that the encoder reads, ticks, when it is stuck; else None.
    """

    def __init__(self, position: float) -> None:
        self.position = position
        self.velocity = 0.0
        self.goal = position
        self.trajectory = position
        self.trajectory_velocity = 0.0
        self.largest_velocity = 0.0
        self.acceleration = 0.0
        self.mode = int(OperatingMode.POSITION)
        self.torque = False
        self.gain = 640
        self.pwm = 1.0
        self.volt = NOMINAL_VOLT
        self.drive = 0.0
        self.load = 0.0
        self.stuck_at: float | None = None

    @property
    def encoder(self) -> float:
        """The position that the servo believes in, ticks."""
        return self.position if self.stuck_at is None else self.stuck_at

    @property
    def at_rest(self) -> bool:
        """Whether nothing changes any more while goal and outer load stay as they are."""
        if self.velocity != 0.0 or abs(self.drive) > 0.5:
            return False
        return not self.torque or (
            self.mode not in {_PWM, _VELOCITY} and self.trajectory == self.goal
        )

    def halt(self) -> None:
        """Give up what was commanded and hold where the servo stands, without a profile."""
        self.goal = self.trajectory = self.encoder
        self.trajectory_velocity = 0.0
        if self.mode == OperatingMode.VELOCITY:
            self.goal = 0.0
        elif self.mode == OperatingMode.PWM:
            self.pwm = 0.0

    def step(self, seconds: float, outer_load: float) -> None:
        """Go on in time.

        Args:
            seconds: small against the time constant of 10 ms.
            outer_load: torque from outside, share of stall, positive toward larger ticks.
        """
        if self.torque:
            self._step_profile(seconds)
            self.drive = self._output() * self.volt / NOMINAL_VOLT
            friction, speed = _FRICTION, _NO_LOAD
        else:
            self.drive = 0.0
            friction, speed = _FRICTION_WITHOUT_TORQUE, _NO_LOAD * _LOOSENESS
        self._step_motion(seconds, self.drive + outer_load, friction, speed)
        self.load = self.drive - self.velocity / _NO_LOAD if self.torque else 0.0

    def _step_motion(self, seconds: float, torque: float, friction: float, speed: float) -> None:
        before = self.velocity
        if abs(before) < _STANDS and abs(torque) <= friction + _BREAKAWAY:
            self.velocity = 0.0
            return
        against = math.copysign(friction, before if abs(before) >= _STANDS else torque)
        aim = speed * (torque - against)
        after = before + (aim - before) * min(seconds / _TIME_CONSTANT_S, 1.0)
        # Friction stops a motion; it does not turn it round.
        if before * after < 0.0 and abs(torque) <= friction:
            after = 0.0
        self.velocity = after
        self.position += 0.5 * (before + after) * seconds

    def _output(self) -> float:
        """What the servo's own loop puts on the motor, share of the supply."""
        if self.mode == _PWM:
            return self.pwm
        if self.mode == _VELOCITY:
            wanted = self.trajectory_velocity
            return _clamp((wanted + 4.0 * (wanted - self.velocity)) / _NO_LOAD, 1.0)
        return _clamp((self.trajectory - self.encoder) * self.gain * _GAIN_UNIT, abs(self.pwm))

    def _step_profile(self, seconds: float) -> None:
        if self.mode == _VELOCITY:
            change = self.goal - self.trajectory_velocity
            if self.acceleration:
                change = _clamp(change, self.acceleration * seconds)
            self.trajectory_velocity += change
            self.trajectory = self.encoder
            return
        if self.mode == _PWM or self.trajectory == self.goal:
            self.trajectory_velocity = 0.0
            return
        way = self.goal - self.trajectory
        if not self.largest_velocity:
            self.trajectory, self.trajectory_velocity = self.goal, 0.0
        elif not self.acceleration:
            move = _clamp(way, self.largest_velocity * seconds)
            self.trajectory_velocity = move / seconds
            self.trajectory = self.goal if move == way else self.trajectory + move
        else:
            self._step_trapezoid(seconds, way)

    def _step_trapezoid(self, seconds: float, way: float) -> None:
        """Accelerate, cruise, and brake so as to stand at the goal; turns round where it must."""
        change = self.acceleration * seconds
        # Half a step less than the braking parabola, or the discrete profile would run past.
        reachable = math.sqrt(2.0 * self.acceleration * abs(way) + 0.25 * change**2) - 0.5 * change
        wanted = math.copysign(min(self.largest_velocity, reachable), way)
        self.trajectory_velocity += _clamp(wanted - self.trajectory_velocity, change)
        move = self.trajectory_velocity * seconds
        if abs(way) <= abs(move) + 0.01 and abs(self.trajectory_velocity) <= 2.0 * change:
            self.trajectory, self.trajectory_velocity = self.goal, 0.0
        else:
            self.trajectory += move
