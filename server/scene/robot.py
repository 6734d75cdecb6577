"""The arm with its instrument module and rigid shaft, drawn from the URDF.

Every link is a scene node below its parent link, so a moving joint is one message: its turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import viser
from numpy.typing import NDArray

ROOT = "/robot"
JOINT_RESOLUTION = 5e-6
"""Turns smaller than this (rad) are not sent: 5 micrometres at a metre's reach."""

Quaternion = tuple[float, float, float, float]
Point = tuple[float, float, float]


class Visual(NamedTuple):
    """A mesh on a link: file below the URDF's folder, pose in the link frame (m, wxyz)."""

    file: str
    position: Point
    wxyz: Quaternion


class LinkNode(NamedTuple):
    """A link: its name, its parent's, the joint that moves it ("" for a fixed one), its pose."""

    name: str
    parent: str
    joint: str
    position: Point
    wxyz: Quaternion
    visuals: tuple[Visual, ...]


def read_links(urdf: str) -> list[LinkNode]:
    """Links of a URDF, parents first; joints turn about their own z."""
    robot = ElementTree.fromstring(urdf)
    visuals = {
        link.attrib["name"]: tuple(_visual(visual) for visual in link.findall("visual"))
        for link in robot.findall("link")
    }
    waiting = list(robot.findall("joint"))
    children = {_link_of(joint, "child") for joint in waiting}
    nodes = [
        LinkNode(name, "", "", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), visuals[name])
        for name in visuals
        if name not in children
    ]
    for node in nodes:
        for joint in waiting:
            if _link_of(joint, "parent") == node.name:
                child = _link_of(joint, "child")
                moving = joint.attrib["name"] if joint.attrib["type"] != "fixed" else ""
                nodes.append(LinkNode(child, node.name, moving, *_origin(joint), visuals[child]))
    return nodes


def _link_of(joint: ElementTree.Element, role: str) -> str:
    element = joint.find(role)
    return "" if element is None else element.attrib["link"]


def _visual(visual: ElementTree.Element) -> Visual:
    mesh = visual.find("geometry/mesh")
    return Visual("" if mesh is None else mesh.attrib["filename"], *_origin(visual))


def _origin(element: ElementTree.Element) -> tuple[Point, Quaternion]:
    origin = element.find("origin")
    attributes = {} if origin is None else origin.attrib
    x, y, z = (float(number) for number in attributes.get("xyz", "0 0 0").split())
    roll, pitch, yaw = (float(number) / 2 for number in attributes.get("rpy", "0 0 0").split())
    about_z = (math.cos(yaw), 0.0, 0.0, math.sin(yaw))
    about_y = (math.cos(pitch), 0.0, math.sin(pitch), 0.0)
    about_x = (math.cos(roll), math.sin(roll), 0.0, 0.0)
    return (x, y, z), _product(_product(about_z, about_y), about_x)


def _product(left: Quaternion, right: Quaternion) -> Quaternion:
    a, b, c, d = left
    w, x, y, z = right
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


class SceneRobot:
    """Nodes below ``/robot``; the base link's frame is the world."""

    def __init__(
        self, server: viser.ViserServer, model_directory: Path, joints: Sequence[str]
    ) -> None:
        """Build the nodes.

        Args:
            server: draws.
            model_directory: holds ``keyhole.urdf`` and its meshes.
            joints: names of the moving joints in the order of the angles given to :meth:`update`.

        Raises:
            OSError: a file of the model cannot be read.
        """
        self._scene = server.scene
        self.paths: dict[str, str] = {"": ROOT}
        """Scene node of each link."""
        self._frames: dict[str, tuple[viser.FrameHandle, Quaternion]] = {}
        self._scene.add_frame(ROOT, show_axes=False)
        urdf = (model_directory / "keyhole.urdf").read_text(encoding="utf-8")
        for node in read_links(urdf):
            self._add(node, model_directory)
        self._moving = [self._frames[joint] for joint in joints]
        self._drawn = np.full(len(joints), np.nan)

    def _add(self, node: LinkNode, model_directory: Path) -> None:
        path = f"{self.paths[node.parent]}/{node.name}"
        self.paths[node.name] = path
        frame = self._scene.add_frame(path, show_axes=False, position=node.position, wxyz=node.wxyz)
        if node.joint:
            self._frames[node.joint] = (frame, node.wxyz)
        for visual in node.visuals:
            if visual.file.endswith(".glb"):
                self._scene.add_glb(
                    f"{path}/{Path(visual.file).stem}",
                    (model_directory / visual.file).read_bytes(),
                    position=visual.position,
                    wxyz=visual.wxyz,
                )

    def update(self, angles: NDArray[np.float64]) -> None:
        """Turn the joints to ``angles`` (rad), where they differ from what is drawn."""
        for index, (frame, rest) in enumerate(self._moving):
            angle = float(angles[index])
            if abs(angle - self._drawn[index]) < JOINT_RESOLUTION:
                continue
            self._drawn[index] = angle
            frame.wxyz = _product(rest, (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)))
