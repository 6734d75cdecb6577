"""What the doctor finds on a bus of simulated servos, broken in every way that it knows."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from hardware.fake_servos.client import FakeServos, FakeServosProcess
from hardware.servos.bus import ServoBus
from hardware.servos.port import SerialPort
from server.configuration_file import load
from server.doctor import ports, servo_bus
from server.doctor.finding import Finding, Level

SETTINGS = load().servos


@pytest.fixture(scope="module")
def fake(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FakeServos]:
    with FakeServosProcess(tmp_path_factory.mktemp("doctor") / "servos") as running:
        yield running.servos


@pytest.fixture
def healthy(fake: FakeServos) -> Iterator[FakeServos]:
    yield fake
    fake.clear()
    port = SerialPort(str(fake.link), 1_000_000)
    for servo in SETTINGS.ids:
        ServoBus(port).reboot(servo)
    port.close()
    time.sleep(0.2)


def _examined(
    fake: FakeServos, baud_rate: int = 1_000_000, ids: tuple[int, ...] = SETTINGS.ids
) -> list[Finding]:
    port, findings = ports.open_port(str(fake.link), baud_rate)
    assert port is not None
    settings = SETTINGS.model_copy(update={"baud_rate": baud_rate, "ids": ids})
    try:
        return findings + servo_bus.examine(port, settings)
    finally:
        port.close()


def _bad(findings: list[Finding]) -> list[Finding]:
    return [finding for finding in findings if finding.level is not Level.OK]


def test_a_good_bus(healthy: FakeServos) -> None:
    findings = _examined(healthy)
    areas = [finding.area for finding in findings]
    assert areas == ["adapter latency", "servos", *(f"servo {n}" for n in SETTINGS.ids), "bus"]
    # A busy machine may be too slow for the wanted rate; nothing else may be wrong.
    assert [finding.area for finding in _bad(findings)] in ([], ["bus"])
    assert findings[2].data == {"firmware": 46, "volt": 12.0, "celsius": 32.0, "torque": False}


def test_a_servo_of_another_id(healthy: FakeServos) -> None:
    missing, stranger = _bad(_examined(healthy, ids=(101, 102, 103, 99)))
    assert (missing.level, missing.data) == (Level.FAIL, {"missing": [99]})
    assert (stranger.level, stranger.data) == (Level.WARN, {"others": [104]})


def test_a_missing_servo(healthy: FakeServos) -> None:
    healthy.inject("silent", servo=102)
    (missing,) = _bad(_examined(healthy))
    assert missing.level is Level.FAIL
    assert missing.data == {"missing": [102]}
    assert missing.what == "servo 102 silent at 1000000 baud"
    assert "cable" in missing.advice


def test_supply_heat_and_faults_of_its_own(healthy: FakeServos) -> None:
    healthy.inject("voltage", servo=101, value=8.0)
    healthy.inject("overheat", servo=103, value=70.0)
    healthy.inject("overheat", servo=104, value=60.0)
    bad = {finding.area: finding for finding in _bad(_examined(healthy)) if finding.area != "bus"}
    levels = {area: finding.level for area, finding in bad.items()}
    assert levels == {
        "servo 101": Level.FAIL,
        "servo 103": Level.FAIL,
        "servo 104": Level.WARN,
    }
    assert bad["servo 101"].what == "8.0 V at its connector; 9.0 to 13.5 V are allowed"
    assert bad["servo 103"].data == {"celsius": 70.0}
    healthy.clear()
    healthy.inject("overload", servo=102)
    (overloaded,) = (finding for finding in _bad(_examined(healthy)) if finding.area != "bus")
    assert overloaded.data == {"hardware_error": 32}
    assert "reboot" in overloaded.advice


def test_a_wrong_speed_is_found_by_a_scan(
    fake: FakeServos, monkeypatch: pytest.MonkeyPatch
) -> None:
    (nobody,) = _bad(_examined(fake, 57_600))
    assert nobody.data == {"missing": list(SETTINGS.ids)}
    assert "--scan" in nobody.advice
    monkeypatch.setattr(servo_bus, "BAUD_RATES", (57_600, 1_000_000))
    settings = SETTINGS.model_copy(update={"baud_rate": 57_600})
    said: list[str] = []
    (found,) = servo_bus.scan(str(fake.link), settings, said.append)
    assert found.level is Level.WARN
    assert found.data == {"baud_rate": 1_000_000, "ids": list(SETTINGS.ids)}
    assert "baud_rate = 1000000" in found.advice
    assert said == ["listening at 57600 baud", "listening at 1000000 baud"]


def test_lost_answers_are_counted(healthy: FakeServos) -> None:
    # Broadcast ping, five questions to each servo at most, then the exchanges.
    healthy.inject("crc-flip", after=25, times=3)
    (bus,) = _bad(_examined(healthy))
    assert bus.level is Level.FAIL
    assert bus.data["whole"] < bus.data["of"]


def test_a_port_in_use(healthy: FakeServos) -> None:
    first, _ = ports.open_port(str(healthy.link), 1_000_000)
    assert first is not None
    second, (finding,) = ports.open_port(str(healthy.link), 1_000_000)
    first.close()
    assert second is None
    assert finding.level is Level.FAIL
    assert "another program" in finding.meaning


def test_a_port_without_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "ttyUSB0"
    path.touch()
    monkeypatch.setattr(os, "access", lambda *_: False)
    monkeypatch.setattr(ports, "_group", lambda _: "dialout")
    allowed, (finding,) = ports.find(str(path), True)
    assert allowed == []
    assert finding.level is Level.FAIL
    assert "usermod -aG dialout" in finding.advice


@pytest.mark.parametrize(("needed", "level"), [(True, Level.FAIL), (False, Level.WARN)])
def test_no_port_at_all(tmp_path: Path, needed: bool, level: Level) -> None:
    allowed, (finding,) = ports.find(str(tmp_path / "none"), needed)
    assert (allowed, finding.level) == ([], level)


def test_an_adapter_that_dawdles(fake: FakeServos, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ports, "latency_timer_ms", lambda _: 16)
    port, (finding,) = ports.open_port(str(fake.link), 1_000_000)
    assert port is not None
    port.close()
    assert finding.level is Level.WARN
    assert "echo 1 >" in finding.advice
