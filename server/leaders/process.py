"""The leader process: a stylus behind a rosbridge, led to control through mapped files.

It waits for the bridge, the supervisor and the clock in one call, and does nothing in between. It
takes part in no decision: what moves is the business of control, whom it tells poses and nothing
else, and the force that goes back is zero unless control says that the stylus leads.
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from robot.configuration import Configuration
from robot.record_types import record_types_of
from robot.records import LeaderKind, RecordTypes
from server.control.realtime import PRIORITY, enter, prefer
from server.leaders import rosbridge
from server.leaders.connection import Connection, ConnectionFailed, connect, wait
from server.leaders.control_view import ControlView
from server.leaders.led_stylus import NO_FORCE, Force
from server.leaders.sensed_force import make_force
from server.leaders.status import SAY_NS, StylusReport, StylusStatusFile
from server.leaders.stylus_input import StylusInput
from server.memory.leader_slot import LeaderSlot
from server.memory.run_directory import RunDirectory
from server.supervision.child_main import Stopped, child_parser, run_child

FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.25, 4.0
"""Between two attempts to connect; each is twice as long as the one before."""

_CONNECT_S = 1.0
_TICK_S = 0.05
_ASK_NS, _GIVE_UP_NS = 3_000_000_000, 6_000_000_000
_REPEAT_ZERO_NS = 100_000_000
_SERVO_NS = 10_000_000


class StylusLeader:
    """Leads by the stylus of one rosbridge.

    Args:
        directory: of a console whose mapped files exist.
        whole: the configuration of the console.
        types: of the robot that is led.
    """

    def __init__(self, directory: Path, whole: Configuration, types: RecordTypes) -> None:
        self._configuration = configuration = whole.stylus
        self._reader = rosbridge.Reader(configuration.pose_topic, configuration.buttons_topic)
        self._slot = LeaderSlot(directory, LeaderKind.STYLUS)
        self._status = StylusStatusFile(directory, writable=True)
        self._view = ControlView(directory, types)
        command = self._view.record["outcome"]["command"]
        assert command.dtype.names is not None
        # Only the instrument has servos that firmware elsewhere could follow.
        self._servo = command["servo"][0] if "servo" in command.dtype.names else None
        self.stylus = StylusInput(self._slot, configuration)
        self._felt = make_force(whole, self._view)
        self._report = StylusReport(configuration.url)
        self._connection: Connection | None = None
        self._message = "not connected yet"
        self._pause_s, self._next_ns = FIRST_PAUSE_S, 0
        self._said_ns = self._forced_ns = self._asked_ns = self._servos_ns = 0
        self._force: Force = NO_FORCE
        self._servos_sent: list[float] = []

    @property
    def enabled(self) -> bool:
        """Whether the robot was ENABLED when it was last looked."""
        return self._view.enabled

    def step(self, wait_s: float = _TICK_S) -> None:
        """Wait for what comes next, no longer than ``wait_s``, and take it in."""
        connection = self._connection
        if connection is None:
            pause_s = (self._next_ns - time.monotonic_ns()) * 1e-9
            if pause_s > 0.0:
                wait([], min(wait_s, pause_s))
            else:
                self._connect()
        elif wait([connection.fileno()], wait_s):
            self._take(connection.receive())
        now_ns = time.monotonic_ns()
        self._view.update(now_ns)
        if self.stylus.publish(now_ns, self._view.enabled):
            self._report.saw(self.stylus, now_ns)
            self._push_back(now_ns)
        elif now_ns - self._forced_ns > _REPEAT_ZERO_NS:
            self._push_back(now_ns)
        self._command_servos(now_ns)
        self._look_after(now_ns)
        if now_ns - self._said_ns >= SAY_NS:
            self._say(now_ns)

    def _connect(self) -> None:
        # The collector is off where this process is a real-time one; here nobody waits for it.
        gc.collect()
        configuration = self._configuration
        try:
            self._connection = connection = connect(configuration.url, _CONNECT_S)
        except ConnectionFailed as error:
            self._message = str(error)
            self._next_ns = time.monotonic_ns() + round(self._pause_s * 1e9)
            self._pause_s = min(2.0 * self._pause_s, LONGEST_PAUSE_S)
            return
        self._message = f"connected; no pose on {configuration.pose_topic} yet"
        self.stylus.connected(time.monotonic_ns())
        if configuration.force_topic:
            connection.send(rosbridge.advertise(configuration.force_topic, rosbridge.FORCE_TYPE))
        if configuration.servo_command_topic:
            topic = configuration.servo_command_topic
            connection.send(rosbridge.advertise(topic, rosbridge.SERVO_TYPE))
        connection.send(rosbridge.subscribe(configuration.pose_topic, rosbridge.POSE_TYPE))
        connection.send(rosbridge.subscribe(configuration.buttons_topic, rosbridge.BUTTONS_TYPE))

    def _take(self, messages: list[bytes]) -> None:
        stylus, counts = self.stylus, self.stylus.counts
        now_ns = time.monotonic_ns()
        for data in messages:
            try:
                said = self._reader.read(data)
            except rosbridge.Unreadable as refusal:
                setattr(counts, refusal.fault, getattr(counts, refusal.fault) + 1)
                self._message = f"{refusal}"
                continue
            if isinstance(said, rosbridge.Pose):
                stylus.take_pose(said.position, said.wxyz, said.stamp_ns, now_ns)
                self._pause_s = FIRST_PAUSE_S
            elif isinstance(said, rosbridge.Buttons):
                stylus.take_buttons(said.bits, said.stamp_ns, now_ns)
            else:
                self._message = f"the bridge says: {said.level}: {said.text}"

    def _push_back(self, now_ns: int) -> None:
        """Send the force; zero, now and then, while the stylus does not lead."""
        connection, topic = self._connection, self._configuration.force_topic
        if connection is None or not topic:
            return
        silent = now_ns - self.stylus.sample_ns > self._configuration.timeout_ms * 1e6
        force = NO_FORCE if silent else self._felt.at(self.stylus.position, now_ns)
        if force == NO_FORCE == self._force and now_ns - self._forced_ns < _REPEAT_ZERO_NS:
            return
        if connection.send(rosbridge.publish_force(topic, force, time.time_ns())):
            self._force, self._forced_ns = force, now_ns

    def _command_servos(self, now_ns: int) -> None:
        """Tell firmware that listens on a topic where the servos shall go, while ENABLED."""
        connection, topic = self._connection, self._configuration.servo_command_topic
        if connection is None or not topic or self._servo is None or not self._view.enabled:
            return
        if now_ns - self._servos_ns < _SERVO_NS:
            return
        angles = np.rad2deg(self._servo).tolist()
        if angles != self._servos_sent and connection.send(rosbridge.publish_servos(topic, angles)):
            self._servos_sent, self._servos_ns = angles, now_ns

    def _look_after(self, now_ns: int) -> None:
        """Notice a connection that is closed, or that is only there by name."""
        connection = self._connection
        if connection is None:
            return
        silent_ns = now_ns - connection.heard_ns
        if silent_ns > _GIVE_UP_NS:
            connection.close()
            self._lost(f"silent for {silent_ns * 1e-9:.0f} s", now_ns)
        elif connection.closed:
            self._lost(connection.closed, now_ns)
            connection.close()
        elif silent_ns > _ASK_NS and now_ns - self._asked_ns > _ASK_NS:
            self._asked_ns = now_ns
            connection.ping()

    def _lost(self, why: str, now_ns: int) -> None:
        # The last sample stays as it is: where it leads, its age is what makes control pause.
        self._connection, self._force = None, NO_FORCE
        self._message = f"the connection was lost: {why}"
        self._next_ns = now_ns + round(self._pause_s * 1e9)
        self._pause_s = min(2.0 * self._pause_s, LONGEST_PAUSE_S)

    def _say(self, now_ns: int) -> None:
        self._said_ns = now_ns
        stylus, connected = self.stylus, self._connection is not None
        silent_ms = (now_ns - stylus.sample_ns) * 1e-6
        if connected and stylus.sample_ns and silent_ms < self._configuration.timeout_ms:
            self._message = ""
        elif connected and not self._message:
            self._message = f"no new pose on {self._configuration.pose_topic}"
        status = self._report.fill(
            stylus,
            connected=connected,
            message=self._message,
            force=self._force,
            now_ns=now_ns,
        )
        self._status.write(status)

    def close(self) -> None:
        """Let the stylus go: no force, an open clutch, no connection."""
        connection = self._connection
        if connection is not None:
            if self._configuration.force_topic:
                topic = self._configuration.force_topic
                connection.send(rosbridge.publish_force(topic, NO_FORCE, time.time_ns()))
            connection.close()
        self._slot.close()
        self._status.close()
        self._view.close()


def _lead(arguments: argparse.Namespace, stopped: Stopped) -> None:
    directory = RunDirectory(arguments.run_directory)
    configuration = directory.configuration()
    types = record_types_of(configuration)
    leader = StylusLeader(directory.path, configuration, types)
    # On a busy machine samples otherwise come late, which control must take for silence.
    if not enter(configuration.control.realtime, PRIORITY - 10).startswith("SCHED_FIFO"):
        prefer()
    try:
        while not stopped():
            leader.step()
    finally:
        leader.close()


def main(argv: Sequence[str] | None = None) -> int:
    """``python -m server.leaders.process --run-directory DIR [--lifeline-fd N]``."""
    return run_child(child_parser("leader"), argv, _lead)


if __name__ == "__main__":
    sys.exit(main())
