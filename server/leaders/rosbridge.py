"""The rosbridge v2 protocol, as far as a stylus needs it: what is said, and how it is read.

ROS 1 and ROS 2 differ in the names of a stamp's parts and in the spelling of types; both are read.
Source: the protocol's description of version 2.1 (operations advertise, subscribe, publish,
status).
"""

from __future__ import annotations

import json
import math
from typing import NamedTuple

import msgspec

from robot.errors import KeyholeError

POSE_TYPE = "geometry_msgs/PoseStamped"
BUTTONS_TYPE = "sensor_msgs/Joy"
FORCE_TYPE = "geometry_msgs/WrenchStamped"
SERVO_TYPE = "std_msgs/Float32MultiArray"

LARGEST_MESSAGE = 4096
"""Bytes; a pose takes some 250."""

UNDECODABLE = (msgspec.MsgspecError, UnicodeDecodeError, RecursionError)
"""What the decoder raises; text that is no UTF-8 is not among its own errors."""


class Unreadable(KeyholeError):
    """A message of a bridge is not what it should be.

    Attributes:
        fault: ``malformed``, ``oversized`` or ``wrong_topic``.
    """

    code = "unreadable_message"

    def __init__(self, fault: str, detail: str) -> None:
        super().__init__(detail)
        self.fault = fault


class Pose(NamedTuple):
    """A pose as it came: position in m, quaternion w, x, y, z; ``stamp_ns`` 0 without a stamp.

    A number that is none (null, NaN) is NaN.
    """

    position: tuple[float, float, float]
    wxyz: tuple[float, float, float, float]
    stamp_ns: int


class Buttons(NamedTuple):
    """The buttons as they came: bit 0 the first, bit 1 the second; ``stamp_ns`` as in Pose."""

    bits: int
    stamp_ns: int


class Status(NamedTuple):
    """What the bridge says of itself."""

    level: str
    text: str


class _Time(msgspec.Struct):
    sec: int = 0
    nanosec: int = 0
    secs: int = 0
    nsecs: int = 0

    def ns(self) -> int:
        return (self.sec + self.secs) * 1_000_000_000 + self.nanosec + self.nsecs


class _Header(msgspec.Struct):
    stamp: _Time


class _Vector(msgspec.Struct):
    x: float | None
    y: float | None
    z: float | None


class _Quaternion(msgspec.Struct):
    x: float | None
    y: float | None
    z: float | None
    w: float | None


class _Pose(msgspec.Struct):
    position: _Vector
    orientation: _Quaternion


class _PoseStamped(msgspec.Struct):
    header: _Header
    pose: _Pose


class _Joy(msgspec.Struct):
    header: _Header
    buttons: list[int]


class _Envelope(msgspec.Struct):
    op: str
    topic: str = ""
    msg: msgspec.Raw = msgspec.Raw(b"null")
    level: str = ""


_envelope = msgspec.json.Decoder(_Envelope)
_pose = msgspec.json.Decoder(_PoseStamped)
_joy = msgspec.json.Decoder(_Joy)


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _finite_json(data: bytes) -> bytes:
    """``data`` with the NaN and Infinity that JSON does not know, and bridges write, as null."""
    try:
        found = json.loads(data, parse_constant=lambda _: None)
    except (ValueError, RecursionError):
        raise Unreadable("malformed", "a message is no JSON") from None
    return json.dumps(found).encode()


class Reader:
    """Reads what a rosbridge sends.

    Args:
        pose_topic: of a PoseStamped.
        buttons_topic: of a Joy.
    """

    def __init__(self, pose_topic: str, buttons_topic: str) -> None:
        self._pose_topic, self._buttons_topic = pose_topic, buttons_topic

    def read(self, data: bytes) -> Pose | Buttons | Status:
        """One message.

        Raises:
            Unreadable: it is too large, no JSON, of another topic, or of another type.
        """
        if len(data) > LARGEST_MESSAGE:
            raise Unreadable("oversized", f"a message of {len(data)} bytes")
        try:
            return self._read(data)
        except UNDECODABLE as error:
            if b"NaN" not in data and b"Infinity" not in data:
                raise Unreadable("malformed", f"a message cannot be read: {error}") from None
        try:
            return self._read(_finite_json(data))
        except UNDECODABLE as error:
            raise Unreadable("malformed", f"a message cannot be read: {error}") from None

    def _read(self, data: bytes) -> Pose | Buttons | Status:
        envelope = _envelope.decode(data)
        if envelope.op == "status":
            return Status(envelope.level, bytes(envelope.msg).decode(errors="replace").strip('"'))
        if envelope.op != "publish":
            raise Unreadable("wrong_topic", f"the operation {envelope.op!r} was not asked for")
        if envelope.topic == self._pose_topic:
            stamped = _pose.decode(envelope.msg)
            p, q = stamped.pose.position, stamped.pose.orientation
            return Pose(
                (_number(p.x), _number(p.y), _number(p.z)),
                (_number(q.w), _number(q.x), _number(q.y), _number(q.z)),
                stamped.header.stamp.ns(),
            )
        if envelope.topic == self._buttons_topic:
            joy = _joy.decode(envelope.msg)
            bits = sum(1 << place for place, down in enumerate(joy.buttons[:2]) if down)
            return Buttons(bits, joy.header.stamp.ns())
        raise Unreadable("wrong_topic", f"the topic {envelope.topic!r} was not asked for")


def subscribe(topic: str, message_type: str) -> bytes:
    """Ask for every message of a topic, the newest only where the bridge falls behind."""
    return msgspec.json.encode(
        {
            "op": "subscribe",
            "id": f"keyhole:{topic}",
            "topic": topic,
            "type": message_type,
            "throttle_rate": 0,
            "queue_length": 1,
        }
    )


def advertise(topic: str, message_type: str) -> bytes:
    """Say that messages of a topic will be published."""
    return msgspec.json.encode(
        {"op": "advertise", "id": f"keyhole:{topic}", "topic": topic, "type": message_type}
    )


def publish_force(topic: str, force: tuple[float, float, float], stamp_ns: int) -> bytes:
    """A WrenchStamped: ``force`` in N, no torque; ``stamp_ns`` as ROS 2 has it."""
    x, y, z = force
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    return (
        f'{{"op":"publish","topic":{json.dumps(topic)},"msg":{{"header":{{"stamp":{{"sec":{sec},'
        f'"nanosec":{nanosec}}},"frame_id":""}},"wrench":{{"force":{{"x":{x:.5f},"y":{y:.5f},'
        f'"z":{z:.5f}}},"torque":{{"x":0.0,"y":0.0,"z":0.0}}}}}}}}'
    ).encode()


def publish_servos(topic: str, angles_deg: list[float]) -> bytes:
    """A Float32MultiArray of servo angles in degrees."""
    layout: dict[str, object] = {"dim": [], "data_offset": 0}
    message = {"layout": layout, "data": [round(angle, 4) for angle in angles_deg]}
    return msgspec.json.encode({"op": "publish", "topic": topic, "msg": message})
