"""What a fake stylus plays."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hardware.control_channel import BadFault
from robot.errors import KeyholeError
from server.configuration_file import load
from server.fake_stylus.device import FakeStylus, named_path, places_of
from server.fake_stylus.faults import KNOWN, Faults, make, parse
from tests.server.fake_stylus.conftest import line_places

RATE = 500.0


def test_a_named_path_is_sampled_at_500_hz() -> None:
    path = named_path("circle", load())
    places = places_of(path, RATE)
    assert len(places) == round(path.duration_s * RATE) + 1
    assert places[0] == pytest.approx((0, 0, 0, 1, 0, 0, 0))
    steps = np.linalg.norm(np.diff(np.array(places)[:, :3], axis=0), axis=1)
    assert steps.max() < 0.03 * math.pi / 19.0 * 1.1 / RATE


def test_the_recorded_stylus_can_be_played() -> None:
    places = np.array(places_of(named_path("arc-stylus", load()), RATE))
    assert np.linalg.norm(np.diff(places[:, :3], axis=0), axis=1).sum() == pytest.approx(
        0.05, rel=0.2
    )


def test_a_path_that_is_none_is_refused() -> None:
    with pytest.raises(KeyholeError):
        named_path("no-such-path", load())


def test_it_stands_until_a_button_is_pressed_and_stamps_grow() -> None:
    stylus = FakeStylus(line_places(0.02, 1.0), RATE, 1, automatic=False)
    still = [stylus.next(step) for step in range(300)]
    assert {sample.position for sample in still} == {(0.0, 0.0, 0.0)}
    assert {sample.buttons for sample in still} == {0}
    stylus.press(2)
    moved = [stylus.next(300 + step) for step in range(300)]
    assert moved[0].position == (0.0, 0.0, 0.0), "the press itself moves nothing"
    assert moved[-1].position[0] > 0.005
    assert {sample.buttons for sample in moved} == {2}
    stylus.release()
    rest = [stylus.next(600 + step) for step in range(10)]
    assert {sample.position for sample in rest} == {moved[-1].position}
    samples = [*still, *moved, *rest]
    assert [sample.sequence for sample in samples] == list(range(1, 611))
    assert [sample.stamp_ns for sample in samples] == list(range(610))


def test_by_itself_it_presses_and_lets_go_again_and_again() -> None:
    stylus = FakeStylus(line_places(0.02, 1.0), RATE, 3, automatic=True)
    bits = np.array([stylus.next(step).buttons for step in range(4000)])
    presses = np.flatnonzero((bits[1:] == 3) & (bits[:-1] == 0))
    assert len(presses) >= 2
    held = np.flatnonzero(bits)
    assert 500 <= len(held) / len(presses) <= 800


@pytest.mark.parametrize(
    "text", ["dance", "nan:times=-1", "stale:colour=red", "late:delay_ms=soon"]
)
def test_a_fault_that_makes_no_sense_is_refused(text: str) -> None:
    with pytest.raises(KeyholeError):
        parse(text, 0)


def test_every_fault_has_a_name_and_ends_when_it_should() -> None:
    for name, known in KNOWN.items():
        faults = Faults()
        faults.add(make(name, {}, 0))
        struck = sum(faults.strikes(name, now) is not None for now in range(1, 100))
        assert struck == (known.times or 99)
    faults = Faults()
    faults.add(make("stale", {"for_ms": 1}, 0))
    assert faults.strikes("stale", 999_999) is not None
    assert faults.strikes("stale", 1_000_000) is None
    assert not faults.active


def test_options_of_a_fault() -> None:
    one, other = parse("teleport:value=7:times=3, late:delay_ms=40", 0)
    assert (one.value, one.times, other.delay_ms) == (7.0, 3, 40.0)
    with pytest.raises(BadFault):
        make("nan", {"times": "many"}, 0)
