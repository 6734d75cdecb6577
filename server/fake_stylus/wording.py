"""A stylus' samples as messages, as a rosbridge sends them and as our own WebSocket takes them.

Written by hand, so that NaN, null and other nonsense can be said, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from server.fake_stylus.device import Sample

_ODD = {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}


def number(value: float) -> str:
    """A number as bridges write it."""
    text = f"{value:.7g}"
    return _ODD.get(text, text)


def as_null(value: float) -> str:
    """A number where NaN is null."""
    return "null" if math.isnan(value) else number(value)


Digits = Callable[[float], str]


class RosWording:
    """As a rosbridge with a driver of CRTK names behind it.

    Args:
        pose_topic: of a PoseStamped.
        buttons_topic: of a Joy.
    """

    def __init__(self, pose_topic: str, buttons_topic: str) -> None:
        self.pose_topic, self.buttons_topic = pose_topic, buttons_topic

    def pose(self, sample: Sample, digits: Digits = number) -> bytes:
        """A PoseStamped; its stamp is the host's monotonic clock."""
        x, y, z = map(digits, sample.position)
        w, a, b, c = map(digits, sample.wxyz)
        return (
            f'{{"op":"publish","topic":"{self.pose_topic}","msg":{{{self._header(sample)},'
            f'"pose":{{"position":{{"x":{x},"y":{y},"z":{z}}},"orientation":{{"x":{a},"y":{b},'
            f'"z":{c},"w":{w}}}}}}}}}'
        ).encode()

    def buttons(self, sample: Sample) -> bytes:
        """A Joy with two buttons."""
        first, second = sample.buttons & 1, sample.buttons >> 1 & 1
        return (
            f'{{"op":"publish","topic":"{self.buttons_topic}","msg":{{{self._header(sample)},'
            f'"axes":[],"buttons":[{first},{second}]}}}}'
        ).encode()

    @staticmethod
    def _header(sample: Sample) -> str:
        sec, nanosec = divmod(sample.stamp_ns, 1_000_000_000)
        stamp = f'"stamp":{{"sec":{sec},"nanosec":{nanosec}}}'
        return f'"header":{{"seq":{sample.sequence},{stamp},"frame_id":"stylus"}}'

    def wrong(self, fault: str) -> bytes:
        """A message with that fault of the wording itself."""
        if fault == "malformed":
            return b'{"op":"publish","topic":"' + self.pose_topic.encode() + b'","msg":{"hea'
        if fault == "oversized":
            pad = b"0" * 20_000
            return b'{"op":"publish","topic":"/x","msg":{"data":"' + pad + b'"}}'
        if fault == "wrong-topic":
            return b'{"op":"publish","topic":"/nobody/asked","msg":{"data":1}}'
        topic = self.pose_topic.encode()
        return b'{"op":"publish","topic":"' + topic + b'","msg":{"data":"left"}}'


class OwnWording:
    """As our own WebSocket takes it; the buttons stand in the same message."""

    def pose(self, sample: Sample, digits: Digits = number) -> bytes:
        """One sample; its stamp is the host's monotonic clock."""
        x, y, z = (digits(1e3 * value) for value in sample.position)
        w, a, b, c = map(digits, sample.wxyz)
        return (
            f'{{"position_mm":[{x},{y},{z}],"orientation_wxyz":[{w},{a},{b},{c}],'
            f'"buttons":{sample.buttons},"stamp_ns":{sample.stamp_ns}}}'
        ).encode()

    def wrong(self, fault: str) -> bytes:
        """A message with that fault of the wording itself."""
        if fault == "malformed":
            return b'{"position_mm":[0,0,'
        if fault == "oversized":
            return b'{"position_mm":[' + b"0," * 10_000 + b"0]}"
        return b'{"position":"left"}'
