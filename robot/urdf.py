"""The URDF of arm, instrument module and shaft, written from the configuration.

Frames, root first: the arm's links by their configured names (the first is the base), then
``flange`` (equal to the last arm frame), ``module`` (equal to the flange), ``shaft`` (origin at
the shaft base, z along the shaft, x along the bend direction) and ``segment_base`` (origin at the
end of the rigid shaft, same axes). Metres, radians, kilograms; all axes of rotation are +z.

Numbers are written with every digit, so that kinematics from the text equal the configuration's.
"""

from __future__ import annotations

from typing import NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from robot.configuration import Arm, Configuration, Instrument, Joint, Link, Module

FLANGE, MODULE, SHAFT, SEGMENT_BASE = "flange", "module", "shaft", "segment_base"

ARM_MESHES: tuple[tuple[str, ...], ...] = (
    ("base_shell", "base_dark", "base_metal"),
    ("link1_shell", "link1_dark"),
    ("link2_shell", "link2_dark"),
    ("link3_shell", "link3_dark"),
    ("link4_shell", "link4_dark"),
    ("link5_shell", "link5_dark"),
    ("link6_shell", "link6_dark"),
    ("link7_shell", "link7_dark", "link7_metal"),
)
"""Meshes (GLB, one colour each) of the eight arm links, base first."""
MODULE_MESHES = ("module_ivory", "module_servo", "module_dark", "module_metal")
SHAFT_MESHES = ("shaft_metal",)


class Tube(NamedTuple):
    """A cylinder for collision: from ``start`` to ``end`` [m, link frame], ``radius`` [m]."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float


ARM_TUBES: tuple[tuple[Tube, ...], ...] = (
    (Tube((0, 0, 0), (0, 0, 0.155), 0.048), Tube((0, 0, 0), (0, 0, 0.012), 0.063)),
    (Tube((0, 0, -0.112), (0, 0, 0.048), 0.048), Tube((0, -0.048, 0), (0, 0.075, 0), 0.047)),
    (
        Tube((0, -0.192, 0), (0, -0.068, 0), 0.042),
        Tube((0, -0.110, 0), (0, -0.110, 0.115), 0.042),
        Tube((0, -0.150, 0.097), (0, 0.047, 0.097), 0.022),
    ),
    (
        Tube((0, 0, -0.101), (0, 0, 0.020), 0.042),
        Tube((0.0525, 0.060, 0), (0.0525, -0.067, 0), 0.0425),
    ),
    (
        Tube((0.0775, -0.169, 0), (0.0775, -0.052, 0), 0.042),
        Tube((0.0680, -0.092, 0), (0.0680, -0.092, 0.100), 0.040),
        Tube((0.0700, -0.090, 0.087), (-0.0150, 0.020, 0.087), 0.020),
    ),
    (
        Tube((0, 0, -0.173), (0, 0, -0.095), 0.042),
        Tube((0, 0.050, -0.110), (0, 0.055, 0.035), 0.030),
    ),
    (
        Tube((0, 0, -0.037), (0, 0, 0.058), 0.037),
        Tube((0.076, -0.030, 0), (0.076, 0.069, 0), 0.037),
    ),
    (Tube((0, 0, -0.028), (0, 0, 0), 0.037),),
)
"""Coarse bodies of the eight arm links, in each link's own frame."""


def urdf_text(configuration: Configuration, mesh_directory: str = "meshes") -> str:
    """The whole robot as URDF.

    Args:
        configuration: sections ``arm``, ``module`` and ``instrument`` are used.
        mesh_directory: where the visual meshes stand, relative to the URDF file, ``/`` separated.

    Returns:
        URDF text, ending in a newline; the same configuration gives the same bytes.
    """
    arm, module, instrument = configuration.arm, configuration.module, configuration.instrument
    lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(arm.name)}>"]
    lines += _arm(arm, mesh_directory)
    lines += _fixed_joint(FLANGE, arm.links[-1].name)
    lines += [f'  <link name="{FLANGE}"/>']
    lines += _fixed_joint(MODULE, FLANGE)
    lines += _module(module, mesh_directory)
    shaft_rpy = roll_pitch_yaw(shaft_rotation(module))
    lines += _fixed_joint(SHAFT, MODULE, module.shaft_base_m, shaft_rpy)
    lines += _shaft(instrument, mesh_directory)
    lines += _fixed_joint(SEGMENT_BASE, SHAFT, (0.0, 0.0, instrument.shaft_length_m))
    lines += [f'  <link name="{SEGMENT_BASE}"/>', "</robot>", ""]
    return "\n".join(lines)


def shaft_rotation(module: Module) -> NDArray[np.float64]:
    """Rotation of the shaft frame in the flange frame, shape (3, 3).

    z is ``shaft_direction``, x is ``bend_direction`` (both normalised), y completes the right hand.
    """
    z = np.array(module.shaft_direction) / np.linalg.norm(module.shaft_direction)
    x = np.array(module.bend_direction) - z * (z @ np.array(module.bend_direction))
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def roll_pitch_yaw(rotation: NDArray[np.float64]) -> tuple[float, float, float]:
    """URDF angles [rad] of a rotation matrix ``Rz(yaw) Ry(pitch) Rx(roll)``, shape (3, 3).

    At a pitch of a quarter turn yaw is taken as zero.
    """
    cosine = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    pitch = float(np.arctan2(-rotation[2, 0], cosine))
    if cosine < 1e-9:
        return float(np.arctan2(-rotation[1, 2], rotation[1, 1])), pitch, 0.0
    roll = float(np.arctan2(rotation[2, 1], rotation[2, 2]))
    return roll, pitch, float(np.arctan2(rotation[1, 0], rotation[0, 0]))


def _arm(arm: Arm, mesh_directory: str) -> list[str]:
    lines: list[str] = []
    for index, link in enumerate(arm.links):
        if index:
            lines += _revolute_joint(arm.joints[index - 1], arm.links[index - 1].name, link.name)
        lines += _arm_link(link, ARM_MESHES[index], ARM_TUBES[index], mesh_directory)
    return lines


def _arm_link(
    link: Link, meshes: tuple[str, ...], tubes: tuple[Tube, ...], mesh_directory: str
) -> list[str]:
    return [
        f"  <link name={quoteattr(link.name)}>",
        *_inertial(link.mass_kg, link.centre_of_mass_m, link.inertia_kg_m2),
        *_visuals(meshes, mesh_directory),
        *(line for tube in tubes for line in _collision(tube)),
        "  </link>",
    ]


def _module(module: Module, mesh_directory: str) -> list[str]:
    radius = sum(module.adapter_size_m) / 4
    height = 2 * abs(module.centre_of_mass_m[2])
    inertia = _cylinder_inertia(module.mass_kg, radius, height)
    return [
        f'  <link name="{MODULE}">',
        *_inertial(module.mass_kg, module.centre_of_mass_m, inertia),
        *_visuals(MODULE_MESHES, mesh_directory),
        *_collision(Tube((0, 0, 0), (0, 0, module.shaft_base_m[2] + 0.013), radius)),
        "  </link>",
    ]


def _shaft(instrument: Instrument, mesh_directory: str) -> list[str]:
    length, radius = instrument.shaft_length_m, instrument.shaft_diameter_m / 2
    inertia = _cylinder_inertia(instrument.shaft_mass_kg, radius, length)
    return [
        f'  <link name="{SHAFT}">',
        *_inertial(instrument.shaft_mass_kg, (0.0, 0.0, length / 2), inertia),
        *_visuals(SHAFT_MESHES, mesh_directory),
        *_collision(Tube((0, 0, 0), (0, 0, length), radius)),
        "  </link>",
    ]


def _cylinder_inertia(mass: float, radius: float, height: float) -> tuple[float, ...]:
    """Of a uniform cylinder about its centre, axis z: ixx, ixy, ixz, iyy, iyz, izz [kg m^2]."""
    across = mass * (3 * radius**2 + height**2) / 12
    return (across, 0.0, 0.0, across, 0.0, mass * radius**2 / 2)


def _inertial(
    mass: float, centre: tuple[float, float, float], inertia: tuple[float, ...]
) -> list[str]:
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    terms = " ".join(f'{n}="{_number(v)}"' for n, v in zip(names, inertia, strict=True))
    return [
        "    <inertial>",
        f"      {_origin(centre)}",
        f'      <mass value="{_number(mass)}"/>',
        f"      <inertia {terms}/>",
        "    </inertial>",
    ]


def _visuals(meshes: tuple[str, ...], mesh_directory: str) -> list[str]:
    paths = (quoteattr(f"{mesh_directory}/{mesh}.glb") for mesh in meshes)
    return [f"    <visual><geometry><mesh filename={p}/></geometry></visual>" for p in paths]


def _collision(tube: Tube) -> list[str]:
    start, end = np.array(tube.start, float), np.array(tube.end, float)
    length = float(np.linalg.norm(end - start))
    x, y, z = (end - start) / length
    # pitch then yaw alone turn z onto the axis: Rz(yaw) Ry(pitch) z = (sp cy, sp sy, cp)
    rpy = (0.0, float(np.arctan2(np.hypot(x, y), z)), float(np.arctan2(y, x)))
    shape = f'<cylinder radius="{_number(tube.radius)}" length="{_number(length)}"/>'
    return [
        "    <collision>",
        f"      {_origin(tuple((start + end) / 2), rpy)}",
        f"      <geometry>{shape}</geometry>",
        "    </collision>",
    ]


def _revolute_joint(joint: Joint, parent: str, child: str) -> list[str]:
    limit = " ".join(
        f'{name}="{_number(value)}"'
        for name, value in (
            ("lower", joint.lower_rad),
            ("upper", joint.upper_rad),
            ("effort", joint.effort_nm),
            ("velocity", joint.speed_rad_s),
        )
    )
    return [
        f'  <joint name={quoteattr(joint.name)} type="revolute">',
        f"    {_origin(joint.origin_xyz_m, joint.origin_rpy_rad)}",
        f"    <parent link={quoteattr(parent)}/>",
        f"    <child link={quoteattr(child)}/>",
        '    <axis xyz="0 0 1"/>',
        f"    <limit {limit}/>",
        f'    <dynamics damping="{_number(joint.damping_nm_s_rad)}" friction="0.0"/>',
        "  </joint>",
    ]


def _fixed_joint(
    child: str,
    parent: str,
    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> list[str]:
    return [
        f'  <joint name="{child}_joint" type="fixed">',
        f"    {_origin(xyz, rpy)}",
        f"    <parent link={quoteattr(parent)}/>",
        f'    <child link="{child}"/>',
        "  </joint>",
    ]


def _origin(xyz: tuple[float, ...], rpy: tuple[float, ...] = (0.0, 0.0, 0.0)) -> str:
    place = " ".join(_number(value) for value in xyz)
    turn = " ".join(_number(value) for value in rpy)
    return f'<origin xyz="{place}" rpy="{turn}"/>'


def _number(value: float) -> str:
    """Shortest text that reads back as the same double; minus zero becomes zero."""
    return repr(float(value) + 0.0)
