"""The leader process between a rosbridge and control: samples, forces, and every fault."""

from __future__ import annotations

import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot.configuration import Configuration
from robot.records import INSTRUMENT, DriveMode, Safety
from robot.sensing.faults import SensingFault
from server.leaders.connection import ConnectionFailed, connect
from server.leaders.process import StylusLeader
from server.leaders.status import StylusStatusFile
from server.memory.run_directory import RunDirectory
from server.supervision.child_process import module_command, module_environment
from tests.server.fake_stylus.conftest import BUTTONS, FORCES, POSES, SERVOS, RunningStylus
from tests.server.leaders.conftest import ControlSide


class Bench:
    """A fake stylus, the leader process' inside in a thread, and the control side of its files."""

    def __init__(
        self, fake: RunningStylus, control: ControlSide, configuration: Configuration
    ) -> None:
        self.fake, self.control = fake, control
        self.leader = StylusLeader(control.directory, configuration, INSTRUMENT)
        self.status = StylusStatusFile(control.directory)
        self._ending = threading.Event()
        self.safety, self.engaged, self.told_invalid = Safety.ENABLED, False, False
        self._thread = threading.Thread(target=self._lead)
        self._thread.start()

    def _lead(self) -> None:
        while not self._ending.is_set():
            self.control.say(self.safety, engaged=self.engaged)
            self.leader.step()
            # As control would, which looks more often than a test on a busy machine can.
            if self.control.published and self.closed() and np.isnan(self.control.position()).all():
                self.told_invalid, self.safety = True, Safety.PAUSED
        self.leader.close()

    def until(self, condition: Callable[[], Any], what: str) -> Any:
        ends = time.monotonic() + 20.0
        while time.monotonic() < ends:
            found = condition()
            if found:
                return found
            time.sleep(0.005)
        raise AssertionError(f"not in time: {what}; {self.counts()}, {self.message()!r}")

    def counts(self) -> dict[str, int]:
        status = self.status.read()
        if status is None:
            return {}
        counts = status["counts"][0]
        return {name: int(counts[name]) for name in counts.dtype.names}

    def message(self) -> str:
        status = self.status.read()
        return "" if status is None else str(status["message"][0].decode())

    def age_s(self) -> float:
        return (time.monotonic_ns() - self.control.stamp_ns()) * 1e-9

    def lead(self, bits: int = 1) -> None:
        """Press until control would see it: on a busy machine a press may meet a silent control."""
        presses = iter(range(8))

        def closed() -> bool:
            next(presses)
            released_ns = self.fake.ask(release=True)["stamp_ns"]
            self.until(lambda: self._let_go_since(released_ns), "let go")
            self.until(lambda: self.control.published and not self.closed(), "open")
            self.until(lambda: self.leader.enabled, "the leader knows that the robot is enabled")
            self.fake.ask(press=bits)
            ends = time.monotonic() + 2.0
            while not self.closed() and time.monotonic() < ends:
                time.sleep(0.005)
            return self.closed()

        self.until(closed, "the clutch is closed")

    def _let_go_since(self, when_ns: int) -> bool:
        """Whether a driver that is known to repeat its buttons has told that they are up."""
        stylus = self.leader.stylus
        told = stylus.buttons.heard_ns > when_ns and stylus.buttons.repeats
        return told and stylus.is_released

    def closed(self) -> bool:
        return bool(self.control.sample()["clutch"])

    def end(self) -> None:
        self._ending.set()
        self._thread.join(10.0)


@pytest.fixture
def force_source() -> str:
    return "spring"


@pytest.fixture
def bench(
    fake: RunningStylus, control: ControlSide, configuration: Configuration, force_source: str
) -> Iterator[Bench]:
    topics = {
        "force_source": force_source,
        "url": fake.server.address,
        "pose_topic": POSES,
        "buttons_topic": BUTTONS,
        "force_topic": FORCES,
        "servo_command_topic": SERVOS,
        # On a busy machine a thread may wait for long.
        "timeout_ms": 300.0,
    }
    stylus = configuration.stylus.model_copy(update=topics)
    running = Bench(fake, control, configuration.model_copy(update={"stylus": stylus}))
    yield running
    running.end()


def test_samples_go_to_control_and_forces_come_back(bench: Bench, fake: RunningStylus) -> None:
    bench.lead(3)
    assert bench.control.sample()["mode"] == DriveMode.ARM
    bench.until(lambda: bench.control.position()[0] > 0.002, "the stylus moves")
    sent = dict((stamp, number) for number, stamp in fake.ask(sent=True)["sent"])  # noqa: C402
    assert int(bench.control.sample()["sequence"]) >= min(sent)
    assert fake.ask(state=True)["force_n"] == [0, 0, 0]
    # The tip stays where it is, so the spring pulls the stylus back.
    bench.engaged = True
    bench.until(lambda: fake.ask(state=True)["force_n"][0] < -0.05, "the force is felt")
    assert all(np.linalg.norm(f[1:]) < 0.881 for f in fake.ask(forces=True)["forces"])
    bench.engaged = False
    bench.until(lambda: fake.ask(state=True)["force_n"] == [0, 0, 0], "no force any more")
    status = bench.until(bench.status.read, "the leader process speaks")[0]
    assert status["connected"]
    assert status["rate_hz"] > 50.0
    assert status["buttons_repeat"]
    assert status["url"].decode() == fake.server.address
    fake.ask(release=True)
    bench.until(lambda: not bench.closed(), "the clutch opens")


@pytest.mark.parametrize("force_source", ["sensed"])
def test_the_sensed_force_comes_back_while_it_is_valid(bench: Bench, fake: RunningStylus) -> None:
    report = bench.control.record["outcome"]["report"]
    report["estimate_force"], report["estimate_force_covariance"] = (-0.3, 0.0, 0.0), 1e-6
    report["estimate_force_covariance"] *= np.eye(3)
    bench.lead(3)
    bench.engaged = True
    bench.until(lambda: fake.ask(state=True)["force_n"][0] < -0.15, "it pushes as the tissue does")
    assert all(np.linalg.norm(f[1:]) < 0.881 for f in fake.ask(forces=True)["forces"])
    report["estimate_fault"] = int(SensingFault.TRACKER_LOST)
    report["estimate_force"] = 0.0
    bench.until(lambda: fake.ask(state=True)["force_n"] == [0, 0, 0], "it fades")
    report["estimate_fault"], report["estimate_force"] = 0, (-0.3, 0.0, 0.0)
    bench.until(lambda: fake.ask(state=True)["force_n"][0] < -0.15, "it comes back")
    bench.engaged = False
    bench.until(lambda: fake.ask(state=True)["force_n"] == [0, 0, 0], "no force any more")


def test_servo_commands_go_out_while_enabled(bench: Bench, fake: RunningStylus) -> None:
    bench.safety = Safety.DISABLED
    bench.control.record["outcome"]["command"]["servo"] = np.deg2rad([1.0, -2.0, 3.0, -4.0])
    bench.until(lambda: fake.ask(state=True)["clients"], "connected")
    time.sleep(0.1)
    assert fake.ask(state=True)["servo_deg"] is None
    bench.safety = Safety.ENABLED
    sent = bench.until(lambda: fake.ask(state=True)["servo_deg"], "the servo command")
    assert sent == [1.0, -2.0, 3.0, -4.0]


@pytest.mark.parametrize("name", ["nan", "infinity", "null", "zero-quaternion"])
def test_a_pose_that_is_none_reaches_control_as_such(
    bench: Bench, fake: RunningStylus, name: str
) -> None:
    bench.lead()
    fake.ask(inject=name)
    bench.until(lambda: bench.told_invalid, "control is told, and pauses")
    bench.until(lambda: not bench.closed(), "the clutch is open")
    bench.safety = Safety.ENABLED
    time.sleep(0.1)
    assert not bench.closed(), "it must be pressed anew"
    bench.lead()
    bench.until(lambda: bench.counts()["invalid"] == 1, "counted")


@pytest.mark.parametrize(
    ("name", "counted"),
    [
        ("stale", None),
        ("repeated-stamp", "repeated"),
        ("buttons-dead", "buttons_dead"),
        ("buttons-frozen", "buttons_dead"),
        ("late", "late"),
    ],
)
def test_what_lasts_makes_the_sample_old(
    bench: Bench, fake: RunningStylus, name: str, counted: str | None
) -> None:
    bench.lead()
    fake.ask(inject=name, delay_ms=400)
    bench.until(lambda: bench.age_s() > 0.3 and bench.closed(), "control sees a silent leader")
    bench.safety = Safety.PAUSED
    if counted:
        bench.until(lambda: bench.counts().get(counted), "counted")
    fake.ask(clear=True)
    bench.safety = Safety.ENABLED
    bench.lead()


@pytest.mark.parametrize(
    ("name", "counted"),
    [
        ("out-of-order", "out_of_order"),
        ("malformed", "malformed"),
        ("wrong-type", "malformed"),
        ("wrong-topic", "wrong_topic"),
        ("oversized", "oversized"),
    ],
)
def test_what_passes_is_dropped_and_counted(
    bench: Bench, fake: RunningStylus, name: str, counted: str
) -> None:
    bench.lead()
    fake.ask(inject=name)
    bench.until(lambda: bench.counts().get(counted), "counted")
    assert bench.closed()
    assert np.isfinite(bench.control.position()).all()


def test_q_and_minus_q_are_harmless(bench: Bench, fake: RunningStylus) -> None:
    bench.lead()
    before = bench.control.published
    fake.ask(inject="negated-quaternion")
    bench.until(lambda: bench.control.published > before + 50, "it goes on")
    assert bench.closed()
    assert bench.counts()["invalid"] == 0


def test_a_drop_out_while_it_leads_is_a_silent_leader_until_it_comes_back(
    bench: Bench, fake: RunningStylus
) -> None:
    bench.lead()
    fake.ask(inject="drop-out", delay_ms=700)
    bench.until(lambda: bench.age_s() > 0.3 and bench.closed(), "control sees a silent leader")
    bench.safety = Safety.PAUSED
    bench.until(lambda: "lost" in bench.message() or "ws://" in bench.message(), "it is told")
    bench.safety = Safety.ENABLED
    bench.until(lambda: bench.age_s() < 0.1, "samples come again")
    assert not bench.closed(), "the button was held all the time"
    bench.lead()


def test_a_press_before_the_robot_is_enabled_does_not_lead(bench: Bench) -> None:
    bench.safety = Safety.PAUSED
    bench.until(lambda: bench.control.published, "samples come")
    bench.fake.ask(press=1)
    bench.until(lambda: "let go" in bench.message(), "it is told why")
    bench.safety = Safety.ENABLED
    time.sleep(0.1)
    assert not bench.closed()
    bench.lead()


def test_the_process_says_what_is_amiss_and_ends_when_asked(
    directory: Path, configuration: Configuration
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        free = listener.getsockname()[1]
    url = f"ws://127.0.0.1:{free}"
    changed = configuration.stylus.model_copy(update={"source": "rosbridge", "url": url})
    run = RunDirectory(directory)
    run.write_configuration(configuration.model_copy(update={"stylus": changed}))
    command = module_command("server.leaders.process", ("--run-directory", str(directory)))
    process = subprocess.Popen(command, env=module_environment())
    status = StylusStatusFile(directory)
    try:
        ends = time.monotonic() + 20.0
        while (said := status.read()) is None and time.monotonic() < ends:
            time.sleep(0.02)
        assert said is not None
        assert not said["connected"][0]
        assert url in said["message"][0].decode()
    finally:
        process.terminate()
        assert process.wait(10.0) == 0


@pytest.mark.parametrize("url", ["http://x", "ws://", "wss://127.0.0.1:1", "ws://127.0.0.1:1", "x"])
def test_what_cannot_be_connected_to_is_named(url: str) -> None:
    with pytest.raises(ConnectionFailed) as refusal:
        connect(url, 1.0)
    assert url in str(refusal.value)


def test_a_server_that_is_no_websocket_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def answer() -> None:
            wire, _ = listener.accept()
            wire.recv(4096)
            wire.sendall(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n")
            wire.close()

        thread = threading.Thread(target=answer)
        thread.start()
        with pytest.raises(ConnectionFailed, match="404"):
            connect(f"ws://127.0.0.1:{listener.getsockname()[1]}", 5.0)
        thread.join()
