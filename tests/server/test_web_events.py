"""What pages are told beside the state: to whom, once, and never a flood."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.audit.reader import newest
from server.audit.writer import AuditLog
from server.web.access import Caller
from server.web.acts import act_of, route_of
from server.web.events import Asked, WebEvents
from server.web.lease import Lease
from server.web.notices import Notices
from server.web.refusals import ForeignOrigin, NotAdmitted, OutOfRange
from tests.server.console_process import eventually

PAGE = Caller("a-session", None)


def texts(notices: Notices, since: int, is_operator: bool) -> list[str]:
    return [one.text for one in notices.since(since, is_operator)[1]]


def test_refusals_are_for_the_operator_and_troubles_for_everyone() -> None:
    notices = Notices()
    notices.post("refused", "for the operator")
    notices.post("trouble", "for everyone", everyone=True)
    assert texts(notices, 0, is_operator=True) == ["for the operator", "for everyone"]
    assert texts(notices, 0, is_operator=False) == ["for everyone"]
    number, _ = notices.since(0, is_operator=True)
    assert texts(notices, number, is_operator=True) == []


def test_what_stays_is_told_once_and_to_pages_that_are_opened_later() -> None:
    notices = Notices()
    for _ in range(5):
        notices.post("trouble", "the scene is gone", everyone=True, stays=True)
    assert texts(notices, 0, is_operator=False) == ["the scene is gone"]
    number, staying = notices.staying()
    assert [one.text for one in staying] == ["the scene is gone"]
    assert texts(notices, number, is_operator=False) == []


def test_of_many_refusals_alike_the_operator_sees_one(tmp_path: Path) -> None:
    log = AuditLog("web", tmp_path)
    events = WebEvents(log, Lease(5.0))
    asked = Asked("POST", "/api/v1/robots/instrument/enable", "192.0.2.7")
    for _ in range(100):
        events.refused(asked, NotAdmitted())
        events.refused(asked, ForeignOrigin("http://evil.example"))
    log.close()
    assert texts(events.notices, 0, is_operator=True) == [
        "Refused: somebody at 192.0.2.7 without a token tried to enable the robot.",
        "Refused: a page of http://evil.example tried to enable the robot.",
    ]
    assert len(newest(tmp_path, 1000)) == 2


def test_other_refusals_stay_between_the_server_and_who_asked(tmp_path: Path) -> None:
    log = AuditLog("web", tmp_path)
    lease = Lease(5.0)
    lease.take("Ada", PAGE)
    events = WebEvents(log, lease)
    put = Asked("PUT", "/api/v1/robots/instrument/teleoperation", "127.0.0.1", PAGE, b'{"a": 1}')
    events.asked(put, 422, OutOfRange("motion_scale", 9.0, 0.1, 2.0))
    events.asked(Asked("GET", "/api/v1/robots/instrument/state", "127.0.0.1", PAGE), 200, None)
    log.close()
    assert texts(events.notices, 0, is_operator=True) == []
    (entry,) = newest(tmp_path, 10)
    assert (entry["by"], entry["code"], entry["body"]) == ("Ada", "out_of_range", {"a": 1})


def test_a_log_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    where = tmp_path / "audit"
    where.write_text("in the way")
    log = AuditLog("web", where)
    events = WebEvents(log, Lease(5.0))
    events.note("tried", "anything")
    eventually(lambda: log.trouble, "the trouble")
    for _ in range(10):
        events.tick()
    (text,) = texts(events.notices, 0, is_operator=False)
    assert text.startswith("The audit log cannot be written")
    log.close()


def test_a_scene_that_fails_is_logged_and_told_to_all(tmp_path: Path) -> None:
    log = AuditLog("web", tmp_path)
    events = WebEvents(log, Lease(5.0))
    events.scene_failed("ZeroDivisionError: no range")
    log.close()
    assert [one["event"] for one in newest(tmp_path, 10)] == ["scene_failed"]
    assert "robot is not affected" in texts(events.notices, 0, is_operator=False)[0]


@pytest.mark.parametrize(
    ("method", "path", "words"),
    [
        ("POST", "/api/v1/robots/instrument/lease", "take control"),
        ("POST", "/api/v1/robots/instrument/gremlins", "POST /api/v1/robots/instrument/gremlins"),
        ("GET", "/", "open the page"),
        ("GET", "/viser", "open the scene"),
        ("DELETE", "/" + "x" * 5000, "DELETE /" + "x" * 119),
    ],
)
def test_requests_have_words(method: str, path: str, words: str) -> None:
    assert act_of(method, path) == words
    assert route_of("/api/v1/robots/instrument") == "/api/v1/robots/instrument"
