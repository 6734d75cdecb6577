"""Who leads: the first clutch that closes, and nobody by waiting."""

from __future__ import annotations

import pytest

from robot.records import LeaderKind
from server.control.leader_choice import NOBODY, LeaderChoice

GIZMO, POSE, TARGET = 0, 1, 2


@pytest.fixture
def choice() -> LeaderChoice:
    return LeaderChoice((LeaderKind.GIZMO, LeaderKind.API_POSE, LeaderKind.API_TARGET))


def test_nobody_leads_at_first(choice: LeaderChoice) -> None:
    choice.update(GIZMO, False, 1)
    assert (choice.active, choice.engaged) == (NOBODY, False)


def test_the_first_to_close_leads_until_it_opens(choice: LeaderChoice) -> None:
    choice.update(POSE, True, 1)
    choice.update(GIZMO, True, 1)
    assert (choice.active, choice.engaged) == (POSE, True)
    choice.update(POSE, False, 2)
    assert (choice.active, choice.engaged) == (POSE, False)


def test_waiting_with_a_closed_clutch_is_not_enough(choice: LeaderChoice) -> None:
    choice.update(POSE, True, 1)
    choice.update(GIZMO, True, 1)
    choice.update(POSE, False, 2)
    choice.update(GIZMO, True, 2)
    assert not choice.engaged
    choice.update(GIZMO, False, 3)
    choice.update(GIZMO, True, 4)
    assert (choice.active, choice.engaged) == (GIZMO, True)


def test_a_target_yields_and_comes_back_only_as_a_new_one(choice: LeaderChoice) -> None:
    choice.update(TARGET, True, 5)
    choice.update(TARGET, True, 5)
    assert (choice.active, choice.engaged) == (TARGET, True)
    choice.update(GIZMO, True, 1)
    choice.update(TARGET, True, 5)
    assert choice.active == GIZMO
    choice.update(GIZMO, False, 2)
    choice.update(TARGET, True, 5)
    assert not choice.engaged
    choice.update(TARGET, True, 6)
    assert (choice.active, choice.engaged) == (TARGET, True)


def test_a_target_does_not_interrupt_a_person(choice: LeaderChoice) -> None:
    choice.update(GIZMO, True, 1)
    choice.update(TARGET, True, 1)
    assert choice.active == GIZMO
    choice.update(GIZMO, False, 2)
    assert not choice.engaged


def test_the_next_target_replaces_the_last(choice: LeaderChoice) -> None:
    choice.update(TARGET, True, 1)
    choice.update(TARGET, True, 2)
    assert (choice.active, choice.engaged) == (TARGET, True)


def test_after_a_release_every_clutch_must_close_anew(choice: LeaderChoice) -> None:
    choice.update(GIZMO, True, 1)
    choice.release()
    choice.update(GIZMO, True, 2)
    assert not choice.engaged
    choice.update(GIZMO, False, 3)
    choice.update(GIZMO, True, 4)
    assert choice.engaged


def test_a_target_may_start_its_numbers_anew_after_it_opened(choice: LeaderChoice) -> None:
    choice.update(TARGET, True, 1)
    choice.update(TARGET, False, 1)
    choice.update(TARGET, True, 1)
    assert choice.engaged
