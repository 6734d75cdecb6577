"""The stylus of a bridge without ROS: samples at our own WebSocket, judged as a rosbridge's are."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Annotated, Any

import msgspec
from numpy.typing import NDArray

from robot.configuration import Configuration
from robot.records import LeaderKind
from server.leaders.control_view import ControlView
from server.leaders.led_stylus import NO_FORCE, Force
from server.leaders.rosbridge import UNDECODABLE
from server.leaders.sensed_force import make_force
from server.leaders.status import SAY_NS, StylusReport, StylusStatusFile
from server.leaders.stylus_input import StylusInput
from server.memory.leader_slot import LeaderSlot
from server.memory.link import WebLink
from server.web.lease import Lease
from server.web.refusals import NotReady, UnreadableRequest

LARGEST_MESSAGE = 1024
_ASIDE_NS = 500_000_000
"""A bridge that was silent for so long makes room for another."""


class StylusMessage(msgspec.Struct, forbid_unknown_fields=True):
    """One sample of a stylus. A coordinate that is not known is null."""

    position_mm: tuple[float | None, float | None, float | None]
    orientation_wxyz: tuple[float | None, float | None, float | None, float | None]
    buttons: Annotated[int, msgspec.Meta(ge=0, le=3)]
    stamp_ns: Annotated[int, msgspec.Meta(ge=0, lt=1 << 62)] = 0
    renew: bool = False


_messages = msgspec.json.Decoder(StylusMessage)


def _number(value: float | None, scale: float = 1.0) -> float:
    return float("nan") if value is None else scale * value


def read_sample(data: bytes) -> StylusMessage:
    """One message of a bridge.

    Raises:
        UnreadableRequest: it is too long or none that is taken.
    """
    if len(data) > LARGEST_MESSAGE:
        raise UnreadableRequest(f"the message is longer than {LARGEST_MESSAGE} bytes")
    try:
        return _messages.decode(data)
    except UNDECODABLE as error:
        if b"NaN" in data or b"Infinity" in data:
            return _without_numbers(data)
        raise UnreadableRequest(f"a sample cannot be read: {error}") from None


def _without_numbers(data: bytes) -> StylusMessage:
    """A sample with NaN or infinity, which JSON does not know: null in its place."""
    for word in (b"-Infinity", b"Infinity", b"NaN"):
        data = data.replace(word, b"null")
    try:
        return _messages.decode(data)
    except UNDECODABLE as error:
        raise UnreadableRequest(f"a sample cannot be read: {error}") from None


class StylusBridge:
    """Takes the samples of one bridge at a time. Belongs to the event loop.

    Args:
        link: to the control process.
        lease: who drives.
        configuration: whether a rosbridge leads in place of this, and what buttons mean.
        clock_ns: the host's monotonic clock.
    """

    def __init__(
        self,
        link: WebLink,
        lease: Lease,
        configuration: Configuration,
        clock_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        stylus = configuration.stylus
        self._lease, self._clock_ns = lease, clock_ns
        self._timeout_ns = round(stylus.timeout_ms * 1e6)
        self._elsewhere = stylus.source != "off"
        self._file = StylusStatusFile(link.directory)
        if self._elsewhere:
            return
        self._view = ControlView(link.directory, link.types)
        self._stylus = StylusInput(LeaderSlot(link.directory, LeaderKind.STYLUS), stylus)
        self._felt = make_force(configuration, self._view)
        self._report = StylusReport("this console's own WebSocket")
        self._bridge: object = None
        self._heard_ns = self._said_ns = 0
        self._force: Force = NO_FORCE
        self._message = "no bridge is connected"
        self._told: NDArray[Any] | None = None

    def check(self) -> None:
        """Refuse bridges where the stylus is a rosbridge's.

        Raises:
            NotReady: it is.
        """
        if self._elsewhere:
            raise NotReady(
                None, 'the stylus is led by a rosbridge here ([stylus] source = "rosbridge")'
            )

    def take(self, bridge: object, data: bytes) -> StylusMessage:
        """Take in one message of an operator's bridge.

        Args:
            bridge: from whom; one at a time leads.
            data: as it came.

        Raises:
            UnreadableRequest: it is no sample; counted.
            NotReady: another bridge is at work.
        """
        now_ns = self._clock_ns()
        self._give_place(bridge, now_ns)
        stylus = self._stylus
        try:
            sample = read_sample(data)
        except UnreadableRequest:
            if len(data) > LARGEST_MESSAGE:
                stylus.counts.oversized += 1
            else:
                stylus.counts.malformed += 1
            raise
        x, y, z = sample.position_mm
        a, b, c, d = sample.orientation_wxyz
        stylus.take_buttons(sample.buttons, sample.stamp_ns, now_ns)
        stylus.take_pose(
            (_number(x, 1e-3), _number(y, 1e-3), _number(z, 1e-3)),
            (_number(a), _number(b), _number(c), _number(d)),
            sample.stamp_ns,
            now_ns,
        )
        self._view.update(now_ns)
        stylus.publish(now_ns, self._view.enabled)
        self._report.saw(stylus, now_ns)
        self._heard_ns, self._message = now_ns, ""
        return sample

    def _give_place(self, bridge: object, now_ns: int) -> None:
        if self._bridge is bridge:
            return
        if self._bridge is not None and now_ns - self._heard_ns < _ASIDE_NS:
            raise NotReady(None, "another bridge has the stylus; end it first")
        self._bridge = bridge
        self._heard_ns = now_ns
        self._stylus.connected(now_ns)

    def left(self, bridge: object) -> None:
        """A bridge is gone. Where it led, the age of its last sample makes control pause."""
        if not self._elsewhere and self._bridge is bridge:
            self._bridge, self._message = None, "no bridge is connected"

    def force(self, bridge: object) -> tuple[Force, bool]:
        """What a bridge's stylus shall feel now, N, in its own frame; and whether it leads."""
        if self._elsewhere:
            return NO_FORCE, False
        now_ns = self._clock_ns()
        silent = self._bridge is not bridge or now_ns - self._heard_ns > self._timeout_ns
        if silent:
            self._force = NO_FORCE
            return NO_FORCE, False
        self._view.update(now_ns)
        self._force = self._felt.at(self._stylus.position, now_ns)
        return self._force, self._felt.is_engaged

    def status(self) -> NDArray[Any] | None:
        """What is known of the stylus, (1,) STYLUS_STATUS; None where its process is silent."""
        if self._elsewhere:
            return self._file.read()
        now_ns = self._clock_ns()
        if self._told is None or now_ns - self._said_ns >= SAY_NS:
            self._said_ns = now_ns
            self._told = self._report.fill(
                self._stylus,
                connected=self._bridge is not None,
                message=self._message,
                force=self._force,
                now_ns=now_ns,
            )
        return self._told
