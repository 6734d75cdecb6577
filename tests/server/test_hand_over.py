"""Control goes from hand to hand in sight of both, and nothing moves meanwhile."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest

from server.web.access import Caller
from server.web.lease import WISH_S, Lease
from server.web.refusals import AlreadyAsked, LeaseHeld, NobodyToAsk, NotTheOperator
from tests.server.api_client import JSON, ROBOT, ApiClient, problem_in
from tests.server.console_process import ConsoleProcess

ADA, GRACE, EVE = Caller("ada", None), Caller("grace", None), Caller("eve", None)


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def lease(clock: Clock) -> Lease:
    """Held by Ada for longer than any test."""
    held = Lease(1000.0, clock)
    held.take("Ada", ADA)
    return held


def test_a_request_stands_until_it_is_answered_or_forgotten(lease: Lease, clock: Clock) -> None:
    assert lease.ask("Grace", GRACE) == lease.wish
    with pytest.raises(AlreadyAsked):
        lease.ask("Eve", EVE)
    with pytest.raises(NotTheOperator):
        lease.end_wish(EVE)
    clock.now += WISH_S
    assert lease.end_wish(ADA) is None
    eve = lease.ask("Eve", EVE)
    assert lease.end_wish(ADA) == eve
    grace = lease.ask("Grace", GRACE)
    assert lease.end_wish(GRACE) == grace
    assert lease.end_wish(ADA) is None


def test_there_must_be_somebody_to_ask(lease: Lease) -> None:
    with pytest.raises(NobodyToAsk):
        lease.ask("Ada", ADA)
    with pytest.raises(NobodyToAsk):
        Lease(5.0).ask("Grace", GRACE)


def test_an_answer_is_for_whoever_asked_and_nobody_of_that_name(lease: Lease) -> None:
    lease.ask("Grace", GRACE)
    lease.offer("Grace", ADA)
    with pytest.raises(LeaseHeld):
        lease.take("Grace", EVE)
    with pytest.raises(LeaseHeld):
        lease.take("Eve", EVE)
    holder, before = lease.take("Grace", GRACE)
    assert (holder.operator, before and before.operator) == ("Grace", "Ada")
    assert lease.wish is None
    assert lease.offered_to is None


def test_an_offer_can_be_withdrawn(lease: Lease) -> None:
    lease.offer("Grace", ADA)
    with pytest.raises(NotTheOperator):
        lease.withdraw_offer(GRACE)
    assert lease.withdraw_offer(ADA) == "Grace"
    assert lease.offered_to is None
    with pytest.raises(LeaseHeld):
        lease.take("Grace", GRACE)


@pytest.fixture
def grace(console: ConsoleProcess) -> Iterator[httpx.Client]:
    """Another person's browser."""
    with httpx.Client(base_url=console.base, timeout=10.0) as browser:
        assert browser.get(f"/?token={console.token}").status_code == 303
        yield browser


def operator_of(client: ApiClient) -> JSON:
    found = client.state()["operator"]
    assert isinstance(found, dict)
    return found


def test_the_robot_does_not_move_while_it_is_handed_over(
    driver: ApiClient, grace: httpx.Client
) -> None:
    driver.done("POST", "/path", {"experiment": "circle"})
    driver.until(lambda s: s["path"] is not None, "it moves")
    asked = grace.post(f"{ROBOT}/lease/request", json={"operator": "Grace"})
    assert asked.status_code == 204
    assert operator_of(driver)["asked_by"] == "Grace"
    driver.done("POST", "/lease/hand-over", {"to": "Grace"})
    state = driver.state()
    assert state["operator"]["offered_to"] == "Grace"
    assert state["safety"]["state"] == "PAUSED"
    assert state["path"] is None
    assert not state["engaged"]
    problem = driver.refused("POST", "/enable")
    assert (problem["status"], problem["code"]) == (409, "handing_over")
    assert problem["offered_to"] == "Grace"
    still = driver.state()["commanded"]
    taken = grace.post(f"{ROBOT}/lease", json={"operator": "Grace"})
    assert taken.status_code == 200
    after = grace.get(f"{ROBOT}/state").json()
    assert after["operator"]["you"]
    assert after["operator"]["asked_by"] is after["operator"]["offered_to"] is None
    assert after["safety"]["state"] == "PAUSED"
    assert after["commanded"] == still
    assert grace.post(f"{ROBOT}/enable").status_code == 200
    assert driver.refused("POST", "/disable")["code"] == "not_the_operator"
    assert grace.delete(f"{ROBOT}/lease").status_code == 204


def test_an_operator_can_decline_and_withdraw(driver: ApiClient, grace: httpx.Client) -> None:
    request = f"{ROBOT}/lease/request"
    assert grace.post(request, json={"operator": "Grace"}).status_code == 204
    driver.done("DELETE", "/lease/request")
    assert operator_of(driver)["asked_by"] is None
    assert driver.state()["safety"]["state"] == "ENABLED"
    taken = grace.post(f"{ROBOT}/lease", json={"operator": "Grace"})
    assert problem_in(taken)["code"] == "lease_held"
    driver.done("POST", "/lease/hand-over", {"to": "Grace"})
    driver.done("DELETE", "/lease/hand-over")
    assert operator_of(driver)["offered_to"] is None
    driver.done("POST", "/enable")
    assert grace.post(request, json={"operator": "Grace"}).status_code == 204
    assert grace.delete(request).status_code == 204
    assert problem_in(grace.delete(f"{ROBOT}/lease/hand-over"))["code"] == "not_the_operator"
    assert driver.refused("POST", "/lease/request", {"operator": "Ada"})["code"] == "nobody_to_ask"
