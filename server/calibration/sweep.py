"""The free bending sweep that calibrates the tendons of a robot."""

from __future__ import annotations

import datetime
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hardware.choose import simulated_plant
from hardware.plant import Plant
from robot.arm import Arm
from robot.calibration import Calibration, TendonCalibration
from robot.configuration import Configuration
from robot.instrument_robot import InstrumentRobot
from robot.parameters import chord_ratio, parameters
from robot.records import COMMAND, SERVOS
from robot.rotations import matrix_from_quaternion
from robot.sensing.parameters import chord_length
from robot.sensing.sweep_calibration import fit_stretch, fit_sweep
from robot.sensing.tendon_fit import AxisFit, SweepTooPoor, bend_of, fit, sliding_shares
from robot.tendons import bend_from_servos, servo_angles, tendon_lengths
from robot.urdf import urdf_text

_SPEED_RAD_S = math.radians(40.0)
_SHARE_OF_LIMIT = 0.85
_PROGRESS_TICKS = 250


@dataclass(frozen=True)
class Sweep:
    """What a sweep recorded.

    Attributes:
        told: (n, 2) the servos' positions as bend (u, v), every tick, rad.
        seen_at: (m,) ticks at which the tracker saw the tip.
        seen: (m, 2) the bend that it saw, rad.
        tensions: (n, 4) of the tendons, every tick, N; None where nothing measures them.
    """

    told: np.ndarray
    seen_at: np.ndarray
    seen: np.ndarray
    tensions: np.ndarray | None


def sweep_bends(bend_limit: float, start: np.ndarray, dt_s: float) -> np.ndarray:
    """Bends (n, 2) of the sweep: straight, each coordinate to and fro, then once around, straight.

    Args:
        bend_limit: largest bend, rad.
        start: (2,) bend at the start, rad.
        dt_s: of a tick.
    """
    far = _SHARE_OF_LIMIT * bend_limit
    corners = [start, (0.0, 0.0)]
    for axis in np.eye(2):
        half = 0.5 * far
        turns = (far, -far, far, half, 0.8 * far, -half, -0.8 * far, 0.0)
        corners += [turn * axis for turn in turns]
    for angle in np.linspace(0.0, 2.0 * math.pi, 25):
        corners.append(0.7 * far * np.array([math.cos(angle), math.sin(angle)]))
    corners.append((0.0, 0.0))
    points = np.array(corners, float)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    times = np.concatenate([[0.0], np.cumsum(lengths / _SPEED_RAD_S)])
    steps = np.arange(0.0, times[-1], dt_s)
    return np.column_stack([np.interp(steps, times, points[:, axis]) for axis in range(2)])


def sweep(plant: Plant, configuration: Configuration, progress: Callable[[float], None]) -> Sweep:
    """Drive the servos of ``plant`` through the sweep while its arm stands still.

    Args:
        plant: free to bend, with a tracker of the tip.
        configuration: dimensions and limits.
        progress: called now and then with the share done.

    Raises:
        SweepTooPoor: the plant broke down, or no tracker answered.
    """
    p = parameters(configuration)[0]
    pitch, pulley, dt_s = float(p["pitch_radius"]), float(p["pulley_radius"]), plant.spec.tick_ns
    arm, flange_segment = Arm(urdf_text(configuration)), p["rotation_flange_segment"]
    command, rotation = np.zeros(1, COMMAND), np.empty((3, 3))
    command["q"] = plant.read().q
    start = np.array(bend_from_servos(plant.read().servo, pitch, pulley))
    bends = sweep_bends(float(p["bend_max"]), start, dt_s * 1e-9)
    told, seen_at, axes, newest = np.empty_like(bends), [], [], 0
    tensions = np.empty((len(bends), SERVOS))
    for tick, (u, v) in enumerate(bends):
        servo_angles(u, v, pitch, pulley, command["servo"][0])
        command["moving"] = 1
        plant.write(command)
        plant.advance()
        measurement = plant.read()
        if measurement.event or not measurement.valid:
            raise SweepTooPoor("the robot stopped answering during the sweep; start again")
        told[tick] = bend_from_servos(measurement.servo, pitch, pulley)
        tensions[tick] = measurement.tension
        sample = measurement.tracker
        then = tick - round(float(sample["age_s"]) * 1e9 / dt_s)
        if sample["sequence"] > newest and then >= 0:
            newest = int(sample["sequence"])
            arm.update(measurement.q)
            matrix_from_quaternion(sample["wxyz"], rotation)
            axes.append((arm.rotation @ flange_segment).T @ rotation[:, 2])
            seen_at.append(then)
        if tick % _PROGRESS_TICKS == 0:
            progress(tick / len(bends))
    if not axes:
        raise SweepTooPoor("no tracker saw the tip; a calibration needs one")
    measured = tensions if plant.read().tension_cells else None
    return Sweep(told, np.array(seen_at), bend_of(np.array(axes)), measured)


def tendon_calibration(
    found: Sweep, fits: list[AxisFit], configuration: Configuration
) -> TendonCalibration | None:
    """Stiffness and friction from the tensions of a sweep; None where nothing measured them.

    Raises:
        SweepUnusable: the tensions do not show them.
    """
    if found.tensions is None:
        return None
    p = parameters(configuration)[0]
    pitch, pulley = float(p["pitch_radius"]), float(p["pulley_radius"])
    instrument, sensing = configuration.instrument, configuration.sensing
    chord = chord_length(instrument)
    shares = sliding_shares(found.told, fits, float(p["chord"]))[found.seen_at]
    lengths, taken_up = np.empty((2, len(found.seen), SERVOS))
    for row, (at, (u, v)) in enumerate(zip(found.seen_at, found.seen, strict=True)):
        tendon_lengths(u, v, pitch, lengths[row])
        lengths[row] -= chord * (u * u + v * v)
        servo_angles(found.told[at, 0], found.told[at, 1], pitch, pulley, taken_up[row])
    tensions = found.tensions[found.seen_at]
    stiffness, pretension = fit_stretch(pulley * taken_up, lengths, tensions)
    fitted = fit_sweep(
        tensions, lengths, shares, (pitch, instrument.segment_length_m, chord),
        sensing.bending_stiffness_n_m2,
    )  # fmt: skip
    return TendonCalibration(
        bending_stiffness_n_m2=fitted.stiffness,
        stiffness_uncertainty=fitted.stiffness_deviation,
        friction=fitted.friction,
        friction_n=fitted.coulomb,
        friction_uncertainty=fitted.friction_deviation,
        tendon_stiffness_n_m=stiffness,
        pretension_n=tuple(pretension.tolist()),
        residual_mm=fitted.residual * 1e3,
    )


def calibrate(
    configuration: Configuration, progress: Callable[[float], None] = lambda _: None
) -> Calibration:
    """Calibrate the robot that ``configuration.simulation`` names, bending freely.

    Raises:
        SweepTooPoor: the sweep does not show what is needed.
        SweepUnusable: nor do its tensions.
    """
    free = configuration.simulation.model_copy(update={"board": "none"})
    configuration = configuration.model_copy(update={"simulation": free})
    x = InstrumentRobot(configuration).initial_state()["x"][0]
    plant = simulated_plant(configuration, x)
    try:
        found = sweep(plant, configuration, progress)
    finally:
        plant.close()
    chord = chord_ratio(configuration.instrument)
    fits = fit(found.told, found.seen_at, found.seen, chord)
    return Calibration(
        gain=(fits[0].gain, fits[1].gain),
        offset_rad=(fits[0].offset, fits[1].offset),
        friction_rad=(fits[0].friction, fits[1].friction),
        stick_rad=(fits[0].stick, fits[1].stick),
        residual_deg=math.degrees(max(fit.residual for fit in fits)),
        samples=len(found.seen),
        tendons=tendon_calibration(found, fits, configuration),
        robot=robot_name(configuration),
        configuration_hash=f"{configuration.hash64():016x}",
        made=datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M:%S UTC"),
    )


_KNOWN: dict[str, Calibration] = {}


def calibration_for(
    configuration: Configuration, progress: Callable[[float], None] = lambda _: None
) -> Calibration:
    """The calibration of the robot that ``configuration.simulation`` names, made once a process.

    Without compensation, or of a robot that has no tendons to stretch, it is the ideal one.
    """
    simulation = configuration.simulation
    if configuration.compensation.mode == "off" or simulation.plant == "kinematic":
        return Calibration()
    free = simulation.model_copy(update={"board": "none"})
    same = {"simulation": free, "priority": None, "compensation": None, "tendons": None}
    key = configuration.model_copy(update=same).model_dump_json(warnings=False)
    if key not in _KNOWN:
        _KNOWN[key] = calibrate(configuration, progress)
    return _KNOWN[key]


def robot_name(configuration: Configuration) -> str:
    """Which robot the configuration names, in words."""
    if configuration.hardware.connected:
        return "hardware, servos " + " ".join(str(number) for number in configuration.servos.ids)
    simulation = configuration.simulation
    if simulation.plant == "kinematic":
        return "kinematic"
    unit = ", tension unit" if simulation.actuation == "tension-unit" else ""
    return f"{simulation.plant}, preset {simulation.preset}, seed {simulation.seed}{unit}"
