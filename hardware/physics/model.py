"""The MuJoCo model of arm, module, instrument and board: built from the configuration's numbers,
none of the controller's code.

The continuum segment is a chain of as many links as it has disks. Between two links a universal
joint stands in the middle of the element; the order of its two hinges alternates along the chain,
so that a bend out of both planes does not twist it. Four pull-only tendons run through sites on the
disks. Rotation about +y leans the tip to +x, about +x to -y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from hardware.physics.preset import Drawn, Preset
from robot.configuration import Configuration, Joint, Link
from scenes.boards.board import Ball, Board, Solid

STEP_S = 0.001
SEGMENT_LINK_KG = 0.00003
NITI_MODULUS_PA = 60e9
_STIFFNESS_DAMPING_S = 0.005
"""Joint damping over joint stiffness in the segment."""
_INSTRUMENT, _BOARD, _BALL = 1, 2, 4
"""Collision bits: the instrument touches board and ball, the ball both; nothing touches itself."""
SPEED_DAMPING_S = 0.004
"""Damping over stiffness of the arm's joints; their reference leads by as much."""


@dataclass(frozen=True)
class PhysicsModel:
    """The compiled model and where things are in it.

    Attributes:
        model: compiled.
        arm_positions: (7,) addresses of the joints in qpos.
        bend_positions: (n, 2) addresses of the hinges about y and x in qpos, base first.
        instrument_geoms: first and last geom of shaft and segment.
        board_geoms: geom of each colliding solid of the board, -1 for others.
        ball_position: address of the ball's free joint in qpos, or -1.
        ball_geom: geom of the ball, or -1.
        tip_site: site at the tip. shaft_sites: at the shaft's base and end.
    """

    model: Any
    arm_positions: np.ndarray
    bend_positions: np.ndarray
    instrument_geoms: tuple[int, int]
    board_geoms: np.ndarray
    ball_position: int
    ball_geom: int
    tip_site: int
    shaft_sites: tuple[int, int]


def hinge_stiffness(configuration: Configuration, preset: Preset) -> float:
    """N m/rad of one hinge: E I over the length of an element (Euler-Bernoulli)."""
    instrument = configuration.instrument
    radius = 0.5 * preset.backbone_diameter_m
    element = instrument.segment_length_m / instrument.disk_count
    return NITI_MODULUS_PA * 0.25 * math.pi * radius**4 / element


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    out = np.empty(4)
    mujoco.mju_mat2Quat(out, rotation.flatten())
    return out


def _from_rpy(rpy: tuple[float, float, float]) -> np.ndarray:
    roll, pitch, yaw = rpy
    out, half = np.empty(4), np.empty(4)
    mujoco.mju_axisAngle2Quat(out, np.array([0.0, 0.0, 1.0]), yaw)
    for axis, angle in ((np.array([0.0, 1.0, 0.0]), pitch), (np.array([1.0, 0.0, 0.0]), roll)):
        mujoco.mju_axisAngle2Quat(half, axis, angle)
        mujoco.mju_mulQuat(out, out.copy(), half)
    return out


def _turned(wxyz: np.ndarray, vector: np.ndarray) -> np.ndarray:
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return wxyz
    turn, out = np.empty(4), np.empty(4)
    mujoco.mju_axisAngle2Quat(turn, vector / angle, angle)
    mujoco.mju_mulQuat(out, wxyz, turn)
    return out


def _inertia(body: Any, link: Link) -> None:
    body.explicitinertial = True
    body.mass, body.ipos = link.mass_kg, link.centre_of_mass_m
    xx, xy, xz, yy, yz, zz = link.inertia_kg_m2
    body.fullinertia = [xx, yy, zz, xy, xz, yz]


def _arm_link(parent: Any, joint: Joint, link: Link, stiffness: float, drawn: Any) -> Any:
    offset, turn = drawn
    body = parent.add_body(
        name=link.name,
        pos=np.array(joint.origin_xyz_m) + offset,
        quat=_turned(_from_rpy(joint.origin_rpy_rad), turn),
    )
    _inertia(body, link)
    body.gravcomp = 1.0
    body.add_joint(
        name=joint.name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=[0.0, 0.0, 1.0],
        stiffness=[stiffness, 0.0, 0.0],
        damping=[stiffness * SPEED_DAMPING_S, 0.0, 0.0],
    )
    return body


def _cylinder(body: Any, mass: float, radius: float, length: float, centre: Any) -> None:
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    body.explicitinertial = True
    body.mass, body.ipos = mass, centre
    body.inertia = [across, across, 0.5 * mass * radius**2]


def _collision(body: Any, name: str, radius: float, start: float, end: float) -> None:
    """A capsule along the body's z axis, or a sphere where start and end are one."""
    bits = {"contype": _INSTRUMENT, "conaffinity": 0, "mass": 0.0, "friction": [0.2, 0.0, 0.0]}
    if end - start < 1e-9:
        body.add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0, 0],
            pos=[0, 0, start], **bits,
        )  # fmt: skip
        return
    body.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[radius, 0, 0],
        fromto=[0, 0, start, 0, 0, end], **bits,
    )  # fmt: skip


def _shaft(flange: Any, configuration: Configuration, preset: Preset) -> Any:
    module, instrument = configuration.module, configuration.instrument
    box = flange.add_body(name="module")
    radius = 0.25 * sum(module.adapter_size_m)
    height = 2.0 * abs(module.centre_of_mass_m[2])
    _cylinder(box, module.mass_kg, radius, height, module.centre_of_mass_m)
    box.gravcomp = 1.0 - preset.payload_error
    z, x = np.array(module.shaft_direction), np.array(module.bend_direction)
    z, x = z / np.linalg.norm(z), x / np.linalg.norm(x)
    rotation = np.column_stack([x, np.cross(z, x), z])
    shaft = box.add_body(name="shaft", pos=module.shaft_base_m, quat=_quaternion(rotation))
    length, radius = instrument.shaft_length_m, 0.5 * instrument.shaft_diameter_m
    _cylinder(shaft, instrument.shaft_mass_kg, radius, length, [0.0, 0.0, 0.5 * length])
    shaft.gravcomp = 1.0 - preset.payload_error
    shaft.add_site(name="shaft_base", pos=[0, 0, 0])
    shaft.add_site(name="shaft_end", pos=[0, 0, length])
    _collision(shaft, "shaft", radius, radius, length)
    return shaft


def _tendon_sites(body: Any, disk: int, z: float, pitch: float) -> None:
    for tendon in range(4):
        angle = 0.5 * math.pi * tendon
        place = [pitch * math.cos(angle), pitch * math.sin(angle), z]
        body.add_site(name=f"disk{disk}_tendon{tendon}", pos=place)


def _segment(shaft: Any, configuration: Configuration, preset: Preset) -> None:
    instrument = configuration.instrument
    count = instrument.disk_count
    element = instrument.segment_length_m / count
    pitch, radius = instrument.tendon_pitch_radius_m, 0.5 * instrument.disk_diameter_m
    stiffness = hinge_stiffness(configuration, preset)
    _tendon_sites(shaft, 0, instrument.shaft_length_m, pitch)
    parent, place = shaft, instrument.shaft_length_m + 0.5 * element
    for disk in range(1, count + 1):
        body = parent.add_body(name=f"disk{disk}", pos=[0.0, 0.0, place])
        _cylinder(body, SEGMENT_LINK_KG, radius, element, [0.0, 0.0, 0.0])
        hinges = [("y", [0.0, 1.0, 0.0]), ("x", [1.0, 0.0, 0.0])]
        for axis, direction in hinges if disk % 2 else hinges[::-1]:
            body.add_joint(
                name=f"bend{disk}_{axis}",
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=direction,
                stiffness=[stiffness, 0.0, 0.0],
                damping=[stiffness * _STIFFNESS_DAMPING_S, 0.0, 0.0],
            )
        _tendon_sites(body, disk, 0.5 * element, pitch)
        # The foremost point of the last capsule is the tip.
        foremost = instrument.segment_length_m - radius - (disk - 0.5) * element
        _collision(body, f"disk{disk}", radius, min(0.0, foremost), min(element, foremost))
        parent, place = body, element
    parent.add_site(name="tip", pos=[0.0, 0.0, 0.5 * element])


def _solid(world: Any, solid: Solid) -> None:
    shapes = {
        "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
        "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
        "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
        "box": mujoco.mjtGeom.mjGEOM_BOX,
    }
    world.add_geom(
        name=f"board {solid.name}",
        type=shapes[solid.kind],
        size=solid.size,
        pos=solid.position,
        quat=solid.wxyz,
        contype=_BOARD,
        conaffinity=_INSTRUMENT,
        friction=[solid.friction, 0.0, 0.0],
    )


def _ball(world: Any, ball: Ball) -> None:
    body = world.add_body(name="ball", pos=ball.position)
    body.add_freejoint(name="ball")
    body.add_geom(
        name="ball",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[ball.radius, 0, 0],
        mass=ball.mass_kg,
        contype=_BALL,
        conaffinity=_INSTRUMENT | _BOARD,
        condim=6,
        friction=[ball.friction, 0.0, ball.rolling_friction],
    )


def _options(spec: Any) -> None:
    spec.option.timestep = STEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.solver = mujoco.mjtSolver.mjSOL_CG
    spec.compiler.degree = False


def build(configuration: Configuration, preset: Preset, drawn: Drawn, board: Board) -> PhysicsModel:
    """Compile the model of one robot in front of one board.

    Args:
        configuration: dimensions and masses.
        preset: stiffness and errors.
        drawn: what the seed drew for this robot.
        board: what stands in front of it.
    """
    spec = mujoco.MjSpec()
    _options(spec)
    arm = configuration.arm
    parent = spec.worldbody.add_body(name=arm.links[0].name)
    _inertia(parent, arm.links[0])
    for index, joint in enumerate(arm.joints):
        errors = (drawn.origin_offsets_m[index], drawn.axis_turns_rad[index])
        stiffness = preset.joint_stiffness_nm_rad[index]
        parent = _arm_link(parent, joint, arm.links[index + 1], stiffness, errors)
    shaft = _shaft(parent, configuration, preset)
    _segment(shaft, configuration, preset)
    for tendon in range(4):
        route = spec.add_tendon(name=f"tendon{tendon}")
        route.stiffness = [drawn.stiffness_n_m[tendon], 0.0, 0.0]
        route.springlength = [0.0, 1.0]
        for disk in range(configuration.instrument.disk_count + 1):
            route.wrap_site(f"disk{disk}_tendon{tendon}")
    for solid in board.solids:
        if solid.collides:
            _solid(spec.worldbody, solid)
    if board.ball is not None:
        _ball(spec.worldbody, board.ball)
    return _indexed(spec.compile(), configuration, board)


def _indexed(model: Any, configuration: Configuration, board: Board) -> PhysicsModel:
    count = configuration.instrument.disk_count
    joints = [model.joint(joint.name).qposadr[0] for joint in configuration.arm.joints]
    bends = [
        [model.joint(f"bend{disk}_{axis}").qposadr[0] for axis in "yx"]
        for disk in range(1, count + 1)
    ]
    geoms = [
        model.geom(f"board {solid.name}").id if solid.collides else -1 for solid in board.solids
    ]
    ball = board.ball is not None
    return PhysicsModel(
        model,
        np.array(joints),
        np.array(bends),
        (model.geom("shaft").id, model.geom(f"disk{count}").id),
        np.array(geoms, dtype=np.int64),
        int(model.joint("ball").qposadr[0]) if ball else -1,
        int(model.geom("ball").id) if ball else -1,
        model.site("tip").id,
        (model.site("shaft_base").id, model.site("shaft_end").id),
    )
