"""What a rosbridge says, and what is not taken of it."""

from __future__ import annotations

import json
import math

import pytest

from server.fake_stylus.device import Sample
from server.fake_stylus.wording import RosWording, as_null
from server.leaders import rosbridge
from server.leaders.rosbridge import Buttons, Pose, Reader, Status, Unreadable

POSES, BUTTONS = "/arm/measured_cp", "/arm/buttons"
WORDING = RosWording(POSES, BUTTONS)
SAMPLE = Sample((0.1, -0.2, 0.3), (0.5, -0.5, 0.5, 0.5), 2, 12_345_678_901, 7)


@pytest.fixture
def reader() -> Reader:
    return Reader(POSES, BUTTONS)


def test_poses_and_buttons_come_through(reader: Reader) -> None:
    assert reader.read(WORDING.pose(SAMPLE)) == Pose(SAMPLE.position, SAMPLE.wxyz, SAMPLE.stamp_ns)
    assert reader.read(WORDING.buttons(SAMPLE)) == Buttons(2, SAMPLE.stamp_ns)


def test_stamps_of_ros_1_are_read_too(reader: Reader) -> None:
    text = WORDING.pose(SAMPLE).replace(b'"sec"', b'"secs"').replace(b'"nanosec"', b'"nsecs"')
    found = reader.read(text)
    assert isinstance(found, Pose)
    assert found.stamp_ns == SAMPLE.stamp_ns


@pytest.mark.parametrize(("pressed", "bits"), [([], 0), ([1], 1), ([0, 1], 2), ([1, 1, 1], 3)])
def test_a_joy_may_have_any_number_of_buttons(
    reader: Reader, pressed: list[int], bits: int
) -> None:
    message = {"header": {"stamp": {"sec": 1}}, "axes": [], "buttons": pressed}
    text = json.dumps({"op": "publish", "topic": BUTTONS, "msg": message}).encode()
    assert reader.read(text) == Buttons(bits, 1_000_000_000)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_none_are_read_as_such(reader: Reader, value: float) -> None:
    found = reader.read(WORDING.pose(SAMPLE._replace(position=(value, 0.0, 0.0))))
    assert isinstance(found, Pose)
    assert math.isnan(found.position[0])
    found = reader.read(WORDING.pose(SAMPLE._replace(position=(math.nan, 0.0, 0.0)), as_null))
    assert isinstance(found, Pose)
    assert math.isnan(found.position[0])


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (WORDING.wrong("malformed"), "malformed"),
        (WORDING.wrong("oversized"), "oversized"),
        (WORDING.wrong("wrong-topic"), "wrong_topic"),
        (WORDING.wrong("wrong-type"), "malformed"),
        (b"", "malformed"),
        (b"\xff\xfe", "malformed"),
        (b"[]", "malformed"),
        (b"NaN", "malformed"),
        (b'{"op":"publish","topic":"/arm/measured_cp"}', "malformed"),
        (b'{"op":"call_service","topic":"/arm/measured_cp"}', "wrong_topic"),
        (b"[" * 4000, "malformed"),
        (b"[NaN," * 800, "malformed"),
        (WORDING.buttons(SAMPLE).replace(b"[0,1]", b'["left"]'), "malformed"),
        (WORDING.pose(SAMPLE).replace(b'"x":0.1', b'"x":"0.1"'), "malformed"),
    ],
)
def test_what_cannot_be_read_has_a_name(reader: Reader, text: bytes, fault: str) -> None:
    with pytest.raises(Unreadable) as refusal:
        reader.read(text)
    assert refusal.value.fault == fault


def test_what_the_bridge_says_of_itself(reader: Reader) -> None:
    said = reader.read(b'{"op":"status","level":"error","msg":"no such topic"}')
    assert said == Status("error", "no such topic")


def test_what_is_sent_is_what_the_protocol_says() -> None:
    asked = json.loads(rosbridge.subscribe(POSES, rosbridge.POSE_TYPE))
    assert (asked["op"], asked["topic"], asked["type"]) == ("subscribe", POSES, rosbridge.POSE_TYPE)
    assert asked["queue_length"] == 1
    told = json.loads(rosbridge.publish_force("/arm/servo_cf", (0.1, -0.25, 0.0), 3_000_000_004))
    assert told["topic"] == "/arm/servo_cf"
    assert told["msg"]["wrench"]["force"] == {"x": 0.1, "y": -0.25, "z": 0.0}
    assert told["msg"]["wrench"]["torque"] == {"x": 0.0, "y": 0.0, "z": 0.0}
    assert told["msg"]["header"]["stamp"] == {"sec": 3, "nanosec": 4}
    odd = json.loads(rosbridge.publish_force('/"odd"', (0.0, 0.0, 0.0), 0))
    assert odd["topic"] == '/"odd"'
    servos = json.loads(rosbridge.publish_servos("/servo_command", [10.0, -10.0, 0.123456, 0.0]))
    assert servos["msg"]["data"] == [10.0, -10.0, 0.1235, 0.0]
