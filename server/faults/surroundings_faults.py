"""Faults of what surrounds the console: its clock, its disk, its configuration, its recorder."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import time

from robot.records import Safety
from robot.safety import Event
from server.faults.bench import Bench
from server.faults.demands import Deadline
from server.faults.fault import Fault, Finding, Group
from server.faults.stopping import LOOK_S, stopped
from server.faults.watching import safety
from server.memory.mapped import MappedReadError, MappedSlot
from server.memory.recording_link import RECORDING, RECORDING_FILE, read_status
from server.memory.stylus_records import STYLUS_STATUS, STYLUS_STATUS_FILE
from server.supervision.child_process import module_command, module_environment

_JUMP_S = 7200.0
_NOTICE_S = 10.0


def _goes_on(bench: Bench, finding: Finding) -> bool:
    finding.state = bench.now()[0].name
    return bool((safety(bench.watch.records()) == Safety.ENABLED).all())


def _clock_jumps(bench: Bench, _fault: Fault) -> Finding:
    """Nothing depends on the wall clock; that it jumped is noted."""
    bench.arm()
    bench.watch.mark()
    before = len(bench.audit("clock_jumped"))
    began = time.monotonic()
    bench.clock.set_ahead(_JUMP_S)
    finding = Finding(tolerated=True)
    noted = bench.audit("clock_jumped")
    while len(noted) == before and time.monotonic() - began < _NOTICE_S:
        time.sleep(0.05)
        noted = bench.audit("clock_jumped")
    finding.detected_within_ms = (time.monotonic() - began) * 1e3
    time.sleep(LOOK_S)
    finding.detected = len(noted) > before and _goes_on(bench, finding)
    finding.message = str(noted[-1].get("text", "")) if noted else ""
    finding.counter = f"audit log: clock_jumped +{len(noted) - before}"
    bench.clock.set_ahead(0.0)
    finding.recovered = bench.drives()
    return finding


def _recorder(bench: Bench) -> MappedSlot:
    return MappedSlot(bench.console.directory / RECORDING_FILE, RECORDING)


def _disk_full(bench: Bench, _fault: Fault) -> Finding:
    """The recorder says so and ends the recording; driving goes on.

    The limit on the size of files stands for the full disk: the same error at the same call.
    """
    bench.arm()
    bench.watch.mark()
    slot = _recorder(bench)
    started = bench.api.call("POST", "/recording", {})
    time.sleep(LOOK_S)
    pid, size = read_status(slot).pid, read_status(slot).size
    limits = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    began = time.monotonic()
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (size + 1000, limits[1]))
    while read_status(slot).records and time.monotonic() - began < _NOTICE_S:
        time.sleep(0.01)
    status = read_status(slot)
    finding = Finding(tolerated=True)
    finding.detected_within_ms = (time.monotonic() - began) * 1e3
    finding.detected = started.ok and not status.records and _goes_on(bench, finding)
    finding.message = status.message
    finding.counter = f"recording state {status.state.name}, {status.ticks} ticks kept"
    if status.pid:
        resource.prlimit(status.pid, resource.RLIMIT_FSIZE, limits)
    bench.api.call("DELETE", "/recording")
    slot.close()
    finding.recovered = bench.drives()
    return finding


def _recorder_killed(bench: Bench, _fault: Fault) -> Finding:
    """The next recorder goes on in a second file where the first one ended."""
    bench.arm()
    bench.watch.mark()
    slot = _recorder(bench)
    bench.api.call("POST", "/recording", {})
    time.sleep(LOOK_S)
    before = read_status(slot)
    began = time.monotonic()
    os.kill(before.pid, signal.SIGKILL)
    while read_status(slot).pid == before.pid and time.monotonic() - began < 2 * _NOTICE_S:
        time.sleep(0.01)
    finding = Finding(tolerated=True, detected_within_ms=(time.monotonic() - began) * 1e3)
    time.sleep(LOOK_S)
    status = read_status(slot)
    finding.detected = status.records and status.lost == 0 and _goes_on(bench, finding)
    finding.message = status.message
    finding.counter = f"a new recorder, {status.gaps} gaps, {status.lost} ticks lost"
    bench.api.call("DELETE", "/recording")
    slot.close()
    finding.recovered = bench.drives()
    return finding


def _broken_configuration(bench: Bench, _fault: Fault) -> Finding:
    """A console with a broken configuration does not start, and says where it is wrong."""
    finding = Finding(tolerated=True)
    wrong = {
        "broken.toml": "[limits\nbend_deg = 90.0\n",
        "wrong.json": bench.configuration.model_dump_json().replace(
            '"bend_deg":', '"bend_deg":1e9,"bent_deg":', 1
        ),
    }
    began = time.monotonic()
    said = []
    for name, text in wrong.items():
        file = bench.folder / name
        file.write_text(text, encoding="utf-8")
        ended = subprocess.run(
            module_command("server.command_line", ["console", "--no-browser", "--port", "0",
                           "--run-directory", str(bench.folder / "other"), "--config", str(file)]),
            env=module_environment(), capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        said.append((ended.returncode, ended.stderr.strip().replace(str(bench.folder), "")))
    finding.detected_within_ms = (time.monotonic() - began) * 1e3
    finding.detected = all(status == 2 and "\n" not in words for status, words in said)
    finding.state, finding.message = "not started", said[0][1]
    finding.counter = f"exit status {said[0][0]} and {said[1][0]}"
    return finding


def _leader_pid(bench: Bench) -> int:
    slot = MappedSlot(bench.console.directory / STYLUS_STATUS_FILE, STYLUS_STATUS)
    try:
        return int(slot.read()["pid"][0])
    except MappedReadError:
        return 0
    finally:
        slot.close()


def _kill_leader(bench: Bench) -> int:
    began_ns = time.monotonic_ns()
    os.kill(_leader_pid(bench), signal.SIGKILL)
    return began_ns


SURROUNDINGS_FAULTS = (
    Fault("recorder-killed", Group.SYSTEM, "SIGKILL of the recorder while it records",
          _recorder_killed, Deadline.RESTART),
    Fault("disk-full", Group.SYSTEM, "The disk is full while recording", _disk_full,
          Deadline.RECORDER),
    Fault("wall-clock-jump", Group.SYSTEM, "The wall clock jumps by two hours", _clock_jumps,
          Deadline.ANSWER),
    Fault("broken-configuration", Group.SYSTEM, "The configuration file is broken",
          _broken_configuration, Deadline.START),
    Fault("leader-killed", Group.SYSTEM, "SIGKILL of the stylus' process", stopped,
          Deadline.LEADER, begin=_kill_leader, events=(Event.LEADER_STALE,),
          state=Safety.PAUSED, needs="hardware"),
)  # fmt: skip
