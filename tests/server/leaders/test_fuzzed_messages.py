"""Whatever bytes come from a bridge, a refusal with a name is the worst that follows."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest

from robot.errors import KeyholeError
from server.fake_stylus.device import Sample
from server.fake_stylus.wording import OwnWording, RosWording
from server.leaders.rosbridge import Reader, Unreadable
from server.web.stylus_bridge import read_sample

SAMPLE = Sample((0.1, -0.2, 0.3), (1.0, 0.0, 0.0, 0.0), 1, 12_345, 1)
ROS = RosWording("/p", "/b")
WORDS = (b"NaN", b"1e999", b"null", b"Infinity", b"[[", b"\xff", b"9" * 30, b"-", b'\\ud800"')
MESSAGES = (
    ROS.pose(SAMPLE),
    ROS.buttons(SAMPLE),
    OwnWording().pose(SAMPLE),
    b'{"op":"status","level":"error","msg":"no"}',
)


def spoilt(message: bytes, rng: np.random.Generator) -> bytes:
    """The message with a few bytes changed, lost or put in."""
    data = bytearray(message)
    for _ in range(int(rng.integers(0, 5))):
        place, how = int(rng.integers(0, len(data) + 1)), float(rng.random())
        if how < 0.4:
            data[place : place + 1] = bytes([int(rng.integers(0, 256))])
        elif how < 0.6:
            del data[place : place + int(rng.integers(1, 20))]
        else:
            data[place:place] = WORDS[int(rng.integers(0, len(WORDS)))]
    return bytes(data)


@pytest.mark.parametrize("message", MESSAGES)
def test_no_bytes_do_more_than_be_refused(message: bytes, rng: np.random.Generator) -> None:
    reader = Reader("/p", "/b")
    for _ in range(1500):
        data = spoilt(message, rng)
        with contextlib.suppress(Unreadable):
            reader.read(data)
        with contextlib.suppress(KeyholeError):
            read_sample(data)
