"""The physics plant: a robot that knows nothing of the controller."""

from __future__ import annotations

import contextlib
import math
import sys
from typing import Any

import mujoco
import numpy as np

from hardware.physics.actuation import ACTUATION, DRIVES, drive_joints, hold_tendons
from hardware.physics.contact import ContactWatch
from hardware.physics.model import SPEED_DAMPING_S, STEP_S, build
from hardware.physics.preset import PRESETS, draw
from hardware.physics.tendon_drive import ServoDrive, TendonDrive, UnitDrive
from hardware.physics.tracker import TipTracker
from hardware.plant import Actuator, Measurement, PlantSpec
from hardware.tension_unit.module import UnitFault
from hardware.wireless import Wireless
from robot.configuration import Configuration
from robot.records import ARM_JOINTS, SERVOS
from robot.rotations import quaternion_from_matrix
from robot.safety import Event
from robot.tendons import servo_angles
from robot.tension.records import TendonMode
from scenes.boards.board import Board

SERVO_STALL_NM = 1.4
"""Largest torque of an XL430-W250 at 11.1 V, after its maker's data sheet."""

_POSITIONS, _NO_TENSIONS = np.full(SERVOS, TendonMode.POSITION), np.zeros(SERVOS)
NO_BOARD = Board("none", "No board")
_EXERCISE_RAD = 0.2
_EXERCISE_SHRINKS = 0.75
_EXERCISES = 16
_EXERCISE_S = 0.12
_SETTLE_S = 0.4
_HAND_N = 20.0
"""What whoever ties a tendon pulls it with, at most."""


def _warn(text: str) -> None:
    """Say what the engine warns of; by itself it would write a file where the process stands."""
    # An error that left this function would end the process.
    with contextlib.suppress(Exception):
        print(f"simulation: {text}", file=sys.stderr)


mujoco.set_mju_user_warning(_warn)


class PhysicsPlant(Wireless):
    """Arm, tendon-driven instrument and board in MuJoCo, bitwise repeatable from the seed.

    What it measures is what a real robot would: joint encoders, servo positions, tension at the
    servos, a force sensor under the board, a tracker of the tip. The trocar is a place that the
    shaft went through when it was put in; it exerts no force.

    Raises:
        KeyError: the preset does not exist.
    """

    def __init__(self, configuration: Configuration, x: np.ndarray, board: Board) -> None:
        """Build the robot, bring it to ``x`` (10,) as a real one would get there, and let it rest.

        Args:
            configuration: dimensions; ``simulation`` chooses preset and seed.
            x: (10,) the controller's configuration at the start.
            board: what stands in front of it.
        """
        simulation = configuration.simulation
        self._configuration = configuration
        self._preset = PRESETS[simulation.preset]
        robot, noise, cells = np.random.default_rng(simulation.seed).spawn(3)
        self._drawn = draw(self._preset, robot)
        joints = tuple(Actuator(joint.name, "rad") for joint in configuration.arm.joints)
        servos = tuple(Actuator(f"servo{index}", "rad") for index in range(1, SERVOS + 1))
        tick_ns = round(1e9 / configuration.control.rate_hz)
        self.spec = PlantSpec("physics", joints + servos, tick_ns, True)
        self._steps = max(1, round(tick_ns * 1e-9 / STEP_S))
        self._time_ns = 0
        self._released = False
        self._failed = False
        self._drives = np.zeros(1, DRIVES)
        self._q_rest, self._rest = np.empty(ARM_JOINTS), np.empty(SERVOS)
        self._trocar_offset = np.zeros(3)
        self._servo, self._tension = np.zeros(SERVOS), np.zeros(SERVOS)
        self._load, self._true_tension = np.zeros(SERVOS), np.zeros(SERVOS)
        self._load_per_tension = configuration.module.pulley_radius_m / SERVO_STALL_NM
        self._q = np.zeros(ARM_JOINTS)
        self._assemble(NO_BOARD)
        self._constants = self._actuation()
        self._unit: UnitDrive | None = None
        self._untied = np.zeros(SERVOS, dtype=bool)
        self._tendon_drive: TendonDrive = ServoDrive(self._constants)
        if simulation.actuation == "tension-unit":
            self._unit = self._tendon_drive = UnitDrive(configuration, self._constants, cells)
        self._wake(x)
        self._tracker = TipTracker(configuration.tracker, noise)
        # Only now, so that nothing stands in the way of a segment that comes from straight.
        self.change_board(board)
        self.register_trocar(np.array(configuration.trocar.position_m))

    def _assemble(self, board: Board) -> None:
        """Compile the model and take the views into it: making one costs as much as a step."""
        self._physics = build(self._configuration, self._preset, self._drawn, board)
        model = self._model = self._physics.model
        # One step takes as long as the tick allows, so that a tick is a whole number of steps.
        model.opt.timestep = self.spec.tick_ns * 1e-9 / self._steps
        data = self._data = mujoco.MjData(model)
        base, end = self._physics.shaft_sites
        self._tip = data.site_xpos[self._physics.tip_site]
        self._tip_rotation = data.site_xmat[self._physics.tip_site].reshape(3, 3)
        self._shaft_base, self._shaft_end = data.site_xpos[base], data.site_xpos[end]
        self._arm = slice(int(self._physics.arm_positions[0]), ARM_JOINTS)
        self._rest_angles = model.qpos_spring[self._arm]
        self._stiffness, self._springs = model.tendon_stiffness, model.tendon_lengthspring[:, 1]
        self._length, self._lengthening = data.ten_length, data.ten_velocity
        mujoco.mj_forward(model, data)
        self._standing = data.qpos.copy()
        self._watch = ContactWatch(self._physics, board)

    def _actuation(self) -> np.ndarray:
        preset, drawn, module = self._preset, self._drawn, self._configuration.module
        tick = 2.0 * math.pi / module.servo_ticks_per_turn
        values: dict[str, object] = {
            "step_s": self._model.opt.timestep,
            "joint_lag_s": preset.joint_lag_s,
            "joint_lead_s": SPEED_DAMPING_S,
            "servo_lag_s": preset.servo_lag_s,
            "servo_speed": preset.servo_speed_rad_s,
            "servo_tick": tick if preset.servo_ticks else 0.0,
            "pulley_radius": module.pulley_radius_m,
            "tendon_length": self._length,
            "tendon_stiffness": drawn.stiffness_n_m,
            "pretension": drawn.pretension_n,
            "friction": drawn.friction_n,
            # Without friction the spring has no force; its stiffness only must not be zero.
            "stick": np.maximum(drawn.friction_n, 1e-3) / preset.tendon_stick_m,
        }
        constants = np.zeros(1, ACTUATION)
        for name, value in values.items():
            constants[name] = value
        return constants

    def _wake(self, x: np.ndarray) -> None:
        """Go to ``x`` and move to and fro around it, less and less, as a homing would.

        What friction still holds then is near the middle of what it can.
        """
        q, drives = x[:ARM_JOINTS], self._drives
        self._data.qpos[self._arm] = q
        drives["q_wanted"], drives["q_reference"] = q, q
        mujoco.mj_forward(self._model, self._data)
        drives["anchor"] = self._length
        swing = _EXERCISE_RAD
        for _ in range(_EXERCISES):
            self._bend_to(x[7] + swing, x[8] + swing, _EXERCISE_S)
            swing *= -_EXERCISE_SHRINKS
        self._bend_to(x[7], x[8], _EXERCISE_S)
        self._bend_to(x[7], x[8], _SETTLE_S)

    def _bend_to(self, u: float, v: float, duration_s: float) -> None:
        instrument, module = self._configuration.instrument, self._configuration.module
        goal = np.empty(SERVOS)
        servo_angles(u, v, instrument.tendon_pitch_radius_m, module.pulley_radius_m, goal)
        start = self._drives["servo_wanted"][0].copy()
        count = max(1, round(duration_s / self._model.opt.timestep))
        for step in range(count):
            self._drives["servo_wanted"] = start + (goal - start) * min(1.0, 1.5 * step / count)
            self._step()

    def _step(self) -> None:
        drives = self._drives
        drive_joints(drives, self._constants, self._q_rest)
        self._rest_angles[:] = self._q_rest
        self._tendon_drive.turn(drives, self._length)
        hold_tendons(drives, self._constants, self._length, self._stiffness, self._rest)
        self._springs[:] = self._rest
        if self._released:
            self._springs[:] = 1.0
        mujoco.mj_step(self._model, self._data)

    def _sense(self) -> None:
        mujoco.mj_kinematics(self._model, self._data)
        self._standing[:] = self._data.qpos
        self._q[:] = self._data.qpos[self._arm]
        # The engine's springs act implicitly, on lengths within the step; what it tells is those
        # at the step's beginning.
        drives, constants = self._drives, self._constants
        midway = self._length + 0.5 * self._model.opt.timestep * self._lengthening
        stretch = midway - drives["rest"][0]
        np.maximum(constants["tendon_stiffness"][0] * stretch, 0.0, out=self._tension)
        np.copyto(self._tension, 0.0, where=drives["torn"][0] != 0)
        np.multiply(self._tension, self._load_per_tension, out=self._load)
        self._true_tension[:] = self._tension
        self._tendon_drive.measure(drives, self._servo, self._tension)
        self._tracker.look(self._time_ns, self._tip, self._tip_rotation)
        self._watch.look(self._data, self._tip)
        self._measurement = Measurement(
            self._q,
            self._servo,
            self._tension,
            self._tracker.newest,
            self._load,
            tension_cells=self._tendon_drive.measures_tension,
            contact_n=self._watch.force_n,
            event=int(Event.SIMULATION_FAILED) if self._failed else 0,
        )

    def read(self) -> Measurement:
        """What the sensors said at the end of the last tick."""
        return self._measurement

    def write(self, command: np.ndarray) -> None:
        """Take the command; servos and joints follow it with their lags."""
        self._drives["q_wanted"] = command["q"]
        self._drives["servo_wanted"] = command["servo"]
        self._tendon_drive.take(command["tendon_mode"][0], command["tension"][0])

    def advance(self) -> int:
        """Let one tick pass. A simulation that breaks down stands still from then on."""
        if not self._failed:
            self._tie()
            before = self._data.time
            for _ in range(self._steps):
                self._step()
            # After a blow-up the engine silently starts from its initial state.
            passed = self._data.time - before
            expected = self._steps * self._model.opt.timestep
            whole = abs(passed - expected) < 0.5 * self._model.opt.timestep
            self._failed = not (whole and bool(np.isfinite(self._data.qpos).all()))
        self._time_ns += self.spec.tick_ns
        if not self._failed:
            self._sense()
        elif not self._measurement.event:
            self._measurement = self._measurement._replace(event=int(Event.SIMULATION_FAILED))
            self._data.qpos[:] = self._standing
            mujoco.mj_kinematics(self._model, self._data)
        return self.spec.tick_ns

    def hold(self) -> None:
        """Stay where it is, under torque."""
        self._drives["q_wanted"] = self._drives["q_reference"]
        self._drives["servo_wanted"] = self._drives["servo_reference"]
        self._tendon_drive.take(_POSITIONS, _NO_TENSIONS)
        self._released = False

    def release(self) -> None:
        """The servos let go of the tendons and the segment springs straight; the arm's brakes hold.

        :meth:`hold` takes hold again.
        """
        self._released = True

    def break_module(self, module: int, fault: UnitFault) -> None:
        """Break ``module`` (0 to 3) of the tension-feedback unit from the next tick on.

        ``UnitFault.NONE`` mends it; without such a unit there is nothing to break. A torn tendon
        is tied again as soon as a hand can: once its pulley has come back so far.
        """
        if self._unit is None:
            return
        torn = bool(self._drives["torn"][0, module])
        self._untied[module] = torn and fault == UnitFault.NONE
        if not self._untied[module]:
            self._drives["torn"][0, module] = fault == UnitFault.TENDON_BROKEN
            self._unit.break_module(module, fault)

    def _tie(self) -> None:
        """Tie again what is mended, where the tendon then carries no more than a hand can pull."""
        if self._unit is None or not self._untied.any():
            return
        constants, drives = self._constants[0], self._drives[0]
        pull = constants["tendon_stiffness"] * (self._length - drives["rest"])
        for module in np.flatnonzero(self._untied & (pull <= _HAND_N)):
            drives["torn"][module], self._untied[module] = False, False
            self._unit.break_module(int(module), UnitFault.NONE)

    def close(self) -> None:
        """There are no devices to give back."""

    def change_board(self, board: Board) -> None:
        """Put another board in front of the robot, which stays as it stands. Takes some 10 ms."""
        positions = self._data.qpos[: self._bending].copy()
        speeds = self._data.qvel[: self._bending].copy()
        time = self._data.time
        self._assemble(board)
        # A blow-up is told by the clock jumping back to 0: it must not be there.
        self._data.time = time
        self._data.qpos[: self._bending] = positions
        self._data.qvel[: self._bending] = speeds
        mujoco.mj_forward(self._model, self._data)
        self._sense()

    def engine(self) -> tuple[Any, int]:
        """Fresh engine data of the same model, to measure it alone, and the steps of a tick."""
        return mujoco.MjData(self._model), self._steps

    def copy_state(self, data: Any) -> None:
        """Put the robot's present state into ``data`` of :meth:`engine`."""
        data.qpos[:], data.qvel[:] = self._data.qpos, self._data.qvel
        data.qacc_warmstart[:] = self._data.qacc_warmstart

    @property
    def _bending(self) -> int:
        """How many joints arm and segment have; a ball comes after them."""
        return ARM_JOINTS + 2 * self._configuration.instrument.disk_count

    def register_trocar(self, position: np.ndarray) -> None:
        """The controller takes ``position`` (3,) m, base frame, for the trocar from now on.

        Where the trocar truly is cannot be known from that: the true one is where the true shaft
        passes nearest, if that is along the shaft, else where the true tip is, which touched it.
        """
        shaft = self._shaft_end - self._shaft_base
        along = float((position - self._shaft_base) @ shaft) / float(shaft @ shaft)
        if along < 1.0:
            self._trocar_offset = self._shaft_base + along * shaft - position
        else:
            self._trocar_offset = self._tip - position

    def truth(self, truth: np.ndarray) -> bool:
        """Where the robot is, from the physics."""
        t, bends = truth[0], self._physics.bend_positions
        t["position"] = self._tip
        quaternion_from_matrix(np.ascontiguousarray(self._tip_rotation), t["wxyz"])
        t["shaft_base"], t["shaft_end"] = self._shaft_base, self._shaft_end
        t["q"] = self._q
        t["uv"] = self._data.qpos[bends].sum(axis=0)
        t["trocar_position"] += self._trocar_offset
        t["tension"] = self._true_tension
        watch = self._watch
        t["contact_count"], t["contact_force"] = watch.count, watch.force_n
        t["contact_wrench"] = watch.wrench
        t["rings_passed"], t["rings_touched"] = watch.passed, watch.touched
        t["ball_position"], t["ball_progress"] = watch.ball_position, watch.ball_progress
        return True
