"""Frames on the fake controller's command port, and its faults by name."""

from __future__ import annotations

import itertools
import struct

import numpy as np
import pytest

from hardware.arm.address import ArmAddress
from hardware.arm.reports import NORMAL, REAL, RICH
from hardware.fake_arm import telling
from hardware.fake_arm.faults import FAULTS
from hardware.fake_arm.program import CannotListen, FakeArm
from hardware.fake_arm.wire import Request, RequestReader, answer
from robot.errors import UnknownName
from tests.hardware.fake_arm.rig import START, controller, fake_arm


def packed(request: Request) -> bytes:
    head = (request.transaction, request.protocol, 1 + len(request.data), request.register)
    return struct.pack(">HHHB", *head) + request.data


def test_requests_are_found_however_the_bytes_are_cut(rng: np.random.Generator) -> None:
    for _ in range(50):
        sent = [
            Request(
                int(rng.integers(1 << 16)),
                int(rng.integers(4)),
                int(rng.integers(256)),
                rng.bytes(int(rng.integers(0, 60))),
            )
            for _ in range(5)
        ]
        stream = b"".join(map(packed, sent))
        cuts = [0, *sorted(rng.integers(0, len(stream) + 1, 6).tolist()), len(stream)]
        reader, found = RequestReader(), []
        for begin, end in itertools.pairwise(cuts):
            found += reader.feed(stream[begin:end])
        assert found == sent


def test_a_length_that_cannot_be_is_forgotten_and_the_next_request_read() -> None:
    reader = RequestReader()
    assert reader.feed(b"\0\1\0\2\0\0\7") == []
    assert reader.feed(b"\0\1\0\2\xff\xff\7abc") == []
    request = Request(5, 2, 13, b"")
    assert reader.feed(packed(request)) == [request]


def test_an_answer_repeats_the_head() -> None:
    assert answer(Request(7, 2, 13, b""), 0x40, b"\4") == b"\0\7\0\2\0\3\x0d\x40\4"


def test_reports_have_their_lengths_and_tell_the_joints() -> None:
    arm = controller()
    for form, made in ((REAL, telling.real), (NORMAL, telling.normal), (RICH, telling.rich)):
        data = made(arm)
        report = np.frombuffer(data, form)[0]
        assert report["length"] == len(data) == form.itemsize
        np.testing.assert_allclose(report["q"], START, rtol=1e-6)
    assert (REAL.itemsize, NORMAL.itemsize, RICH.itemsize) == (135, 145, 314)


def test_unknown_faults_are_refused_with_the_names_there_are() -> None:
    with fake_arm() as fake, pytest.raises(UnknownName, match="emergency-stop"):
        fake.inject("gremlins")
    assert all(fault.meaning for fault in FAULTS.values())


def test_a_taken_port_is_told() -> None:
    with fake_arm() as fake:
        other = ArmAddress(fake.address.host, fake.address.control)
        with pytest.raises(CannotListen, match="--listen"):
            FakeArm(controller(), other)
