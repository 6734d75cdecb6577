"""The lease by itself, with a clock of its own."""

from __future__ import annotations

import pytest

from server.web.access import Caller
from server.web.lease import Lease
from server.web.refusals import LeaseHeld, NotTheOperator

SECONDS = 5.0
PAGE, OTHER_PAGE = Caller("page", None), Caller("other", None)
PROGRAM = Caller(None, None)


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def lease(clock: Clock) -> Lease:
    return Lease(SECONDS, clock)


def test_the_first_who_takes_it_has_it(lease: Lease) -> None:
    holder, before = lease.take("Ada", PAGE)
    assert before is None
    assert lease.holder == holder
    assert lease.is_held_by(PAGE)
    assert lease.is_held_by(Caller(None, holder.lease_id))
    for other in (OTHER_PAGE, PROGRAM, Caller(None, "guess"), Caller(None, ""), Caller(None, "é")):
        assert not lease.is_held_by(other)
        with pytest.raises(NotTheOperator):
            lease.check(other)


def test_two_programs_without_a_session_are_two(lease: Lease) -> None:
    lease.take("Ada", PROGRAM)
    assert not lease.is_held_by(PROGRAM)
    with pytest.raises(LeaseHeld):
        lease.take("Ada", PROGRAM)


def test_a_second_operator_is_refused_and_told_who_drives(lease: Lease) -> None:
    lease.take("Ada", PAGE)
    with pytest.raises(LeaseHeld) as refusal:
        lease.take("Grace", OTHER_PAGE)
    assert refusal.value.operator == "Ada"
    assert refusal.value.expires_in_s == SECONDS


def test_taking_again_renews_and_keeps_the_identity(lease: Lease, clock: Clock) -> None:
    first, _ = lease.take("Ada", PAGE)
    clock.now += 4.0
    again, before = lease.take("Ada L.", PAGE)
    assert before is None
    assert again.lease_id == first.lease_id
    assert lease.expires_in_s == SECONDS


def test_it_expires_unless_it_is_renewed(lease: Lease, clock: Clock) -> None:
    holder, _ = lease.take("Ada", PAGE)
    clock.now += 4.9
    lease.renew(PAGE)
    clock.now += 4.9
    assert lease.expire() is None
    clock.now += 0.2
    assert lease.holder is None
    assert not lease.is_held_by(PAGE)
    with pytest.raises(NotTheOperator):
        lease.renew(PAGE)
    assert lease.expire() == holder
    assert lease.expire() is None


def test_an_expired_lease_can_be_taken_by_another(lease: Lease, clock: Clock) -> None:
    lease.take("Ada", PAGE)
    clock.now += SECONDS
    holder, before = lease.take("Grace", OTHER_PAGE)
    assert (holder.operator, before) == ("Grace", None)


def test_it_is_handed_over_to_one_name_only(lease: Lease) -> None:
    first, _ = lease.take("Ada", PAGE)
    lease.offer("Grace", PAGE)
    with pytest.raises(LeaseHeld) as refusal:
        lease.take("Mallory", Caller("third", None))
    assert refusal.value.offered_to == "Grace"
    assert lease.is_held_by(PAGE)
    holder, before = lease.take("Grace", OTHER_PAGE)
    assert before == first
    assert holder.lease_id != first.lease_id
    assert not lease.is_held_by(PAGE)
    assert lease.offered_to is None


def test_only_the_holder_offers_and_releases(lease: Lease) -> None:
    lease.take("Ada", PAGE)
    with pytest.raises(NotTheOperator):
        lease.offer("Mallory", OTHER_PAGE)
    with pytest.raises(NotTheOperator):
        lease.release(OTHER_PAGE)
    assert lease.release(PAGE).operator == "Ada"
    assert lease.holder is None
    with pytest.raises(NotTheOperator):
        lease.release(PAGE)
