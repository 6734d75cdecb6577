"""Two buttons: what they mean, and when a press no longer counts."""

from __future__ import annotations

import pytest

from robot.configuration import Stylus
from robot.records import DriveMode
from server.leaders.buttons import LONGEST_PRESS_S, ButtonScheme, ButtonWatch

MS = 1_000_000
TIMEOUT = 25 * MS


@pytest.mark.parametrize(
    ("names", "bits", "mode"),
    [
        (("both", "segment", "arm"), 0, None),
        (("both", "segment", "arm"), 1, DriveMode.BOTH),
        (("both", "segment", "arm"), 2, DriveMode.SEGMENT),
        (("both", "segment", "arm"), 3, DriveMode.ARM),
        (("arm", "none", "none"), 2, None),
        (("arm", "none", "none"), 1, DriveMode.ARM),
        (("none", "both", "both"), 3, DriveMode.BOTH),
    ],
)
def test_the_scheme_of_the_configuration(
    stylus_configuration: Stylus, names: tuple[str, str, str], bits: int, mode: DriveMode | None
) -> None:
    keys = ("first_button", "second_button", "both_buttons")
    configured = stylus_configuration.model_copy(update=dict(zip(keys, names, strict=True)))
    assert ButtonScheme(configured).mode(bits) == mode


def test_a_driver_that_repeats_is_dead_when_it_stops() -> None:
    watch = ButtonWatch(TIMEOUT)
    for step in range(1, 20):
        watch.heard(1, step * 8 * MS)
        assert not watch.are_dead(step * 8 * MS + 8 * MS)
    last = 19 * 8 * MS
    assert watch.repeats
    assert not watch.are_dead(last + 23 * MS)
    assert watch.are_dead(last + TIMEOUT)


def test_a_slow_repeating_driver_has_the_time_of_three_repeats() -> None:
    watch = ButtonWatch(TIMEOUT)
    for step in range(1, 20):
        watch.heard(1, step * 100 * MS)
    last = 19 * 100 * MS
    assert not watch.are_dead(last + 299 * MS)
    assert watch.are_dead(last + 301 * MS)


def test_a_driver_that_tells_changes_has_a_longest_press() -> None:
    watch = ButtonWatch(TIMEOUT)
    for step, bits in enumerate((1, 0, 1, 0, 1)):
        watch.heard(bits, step * 400 * MS + MS)
    last = 4 * 400 * MS + MS
    assert not watch.repeats
    assert not watch.are_dead(last + 30_000 * MS)
    assert watch.are_dead(last + round(LONGEST_PRESS_S * 1e9) + MS)


def test_buttons_that_are_not_pressed_are_never_dead() -> None:
    watch = ButtonWatch(TIMEOUT)
    for step in range(1, 20):
        watch.heard(0, step * 8 * MS)
    assert not watch.are_dead(10**12)
