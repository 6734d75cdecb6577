"""The stand-in for a stylus as a program: samples, faults and control channel in one loop.

It sleeps until the next sample is due or somebody speaks to it.
"""

from __future__ import annotations

import gc
import os
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import msgspec

from hardware.control_channel import BadRequest, ControlChannel
from server.fake_stylus.device import FakeStylus, Sample
from server.fake_stylus.faults import Fault, Faults, make, parse
from server.fake_stylus.wording import OwnWording, RosWording, as_null, number
from server.leaders.connection import wait
from server.leaders.rosbridge import UNDECODABLE

RATE_HZ = 500.0
BUTTONS_EVERY = 3
"""A driver that repeats its buttons does so with every third pose."""

_LOGGED = 20_000
_ROWS = 5000
_BACKWARDS_NS = 20_000_000
_PRIORITY = 40
"""Below a control loop: what is simulated here has no scheduler, but must not starve others."""

_CORRUPT = ("malformed", "oversized", "wrong-topic", "wrong-type")


class Outlet(Protocol):
    """Where samples go: clients of a rosbridge that we play, or a console that we are a client of.

    Attributes:
        wording: how samples are said.
        forces: (monotonic ns, N, N, N) of the forces that came back.
        servos: (monotonic ns, degrees) of the servo commands that came.
    """

    wording: RosWording | OwnWording
    forces: deque[tuple[int, float, float, float]]
    servos: deque[tuple[int, list[float]]]

    def descriptors(self) -> list[int]:
        """What to wait on."""
        ...

    def serve(self, descriptor: int) -> None:
        """Do what is to be done at one of :meth:`descriptors`."""
        ...

    def look_after(self, now_ns: int) -> None:
        """Do what is due without anybody asking."""
        ...

    def say(self, message: bytes, *, buttons: bool) -> bool:
        """Send a message to whoever wants it; False where nobody does."""
        ...

    def drop(self, until_ns: int) -> None:
        """Break every connection; no new one until then."""
        ...

    def state(self) -> dict[str, Any]:
        """For the control channel."""
        ...

    def close(self) -> None:
        """End it."""
        ...


@dataclass(frozen=True)
class Options:
    """What the program is started with.

    Attributes:
        control: path of the control channel.
        faults: as on the command line; injected at once.
        repeats_buttons: whether unchanged buttons are told again and again.
        realtime: whether to ask for SCHED_FIFO, so that samples come in time on a busy machine.
    """

    control: Path
    faults: str = ""
    repeats_buttons: bool = True
    realtime: bool = True


class Program:
    """Everything that runs.

    Args:
        stylus: what is played.
        outlet: where it goes.
        options: see :class:`Options`.
    """

    def __init__(self, stylus: FakeStylus, outlet: Outlet, options: Options) -> None:
        self._stylus, self._outlet, self._options = stylus, outlet, options
        self._faults = Faults()
        for fault in parse(options.faults, time.monotonic_ns()):
            self._faults.add(fault)
        self._sent: deque[tuple[int, int]] = deque(maxlen=_LOGGED)
        self._newest: Sample | None = None
        self._delayed: deque[tuple[int, bytes, bool]] = deque()
        self._bits = -1
        self._frozen: dict[str, int] = {}
        self._due_ns = time.monotonic_ns()
        self.control = ControlChannel(options.control, self._answer, time.monotonic_ns)

    def run(self, stopped: Callable[[], bool]) -> None:
        """Play until ``stopped()``; that is asked at every sample."""
        period_ns = round(1e9 / RATE_HZ)
        try:
            while not stopped():
                now_ns = time.monotonic_ns()
                waited = [*self.control.descriptors(), *self._outlet.descriptors()]
                for descriptor in wait(waited, (self._due_ns - now_ns) * 1e-9):
                    if descriptor in self.control.descriptors():
                        self.control.serve(descriptor)
                    else:
                        self._outlet.serve(descriptor)
                now_ns = time.monotonic_ns()
                if now_ns < self._due_ns:
                    continue
                # What was missed is not made up for: a device does not either.
                missed = (now_ns - self._due_ns) // period_ns
                self._due_ns += (missed + 1) * period_ns
                self._outlet.look_after(now_ns)
                self._tell(self._stylus.next(now_ns), now_ns)
        finally:
            self._outlet.close()
            self.control.close()

    # Samples

    def _tell(self, sample: Sample, now_ns: int) -> None:
        strikes = self._faults.strikes
        self._newest = sample
        if self._faults.active:
            fault = strikes("drop-out", now_ns)
            if fault is not None:
                self._outlet.drop(now_ns + round(fault.delay_ms * 1e6))
            for name in _CORRUPT:
                if strikes(name, now_ns):
                    self._outlet.say(self._outlet.wording.wrong(name), buttons=False)
            if strikes("stale", now_ns):
                return
        delay = strikes("late", now_ns) if self._faults.active else None
        self._tell_buttons(sample, now_ns, delay)
        digits = number
        if self._faults.active:
            sample = self._struck(sample, now_ns)
            if strikes("null", now_ns):
                sample, digits = sample._replace(position=(float("nan"), 0.0, 0.0)), as_null
        self._say(self._outlet.wording.pose(sample, digits), now_ns, delay, sample.sequence)
        while self._delayed and self._delayed[0][0] <= now_ns:
            _, message, buttons = self._delayed.popleft()
            self._outlet.say(message, buttons=buttons)

    def _say(self, message: bytes, now_ns: int, delay: Fault | None, sequence: int = 0) -> None:
        """Send it, now or late; what is delayed must not be overtaken."""
        if delay is not None or self._delayed:
            due_ns = now_ns + (round(delay.delay_ms * 1e6) if delay else 0)
            if self._delayed:
                due_ns = max(due_ns, self._delayed[-1][0])
            self._delayed.append((due_ns, message, sequence == 0))
        elif self._outlet.say(message, buttons=sequence == 0) and sequence:
            self._sent.append((sequence, now_ns))

    def _tell_buttons(self, sample: Sample, now_ns: int, delay: Fault | None) -> None:
        wording = self._outlet.wording
        if not isinstance(wording, RosWording):
            return
        changed = sample.buttons != self._bits
        due = self._options.repeats_buttons and sample.sequence % BUTTONS_EVERY == 0
        if not (changed or due):
            return
        if self._faults.active:
            if self._faults.strikes("buttons-dead", now_ns):
                return
            if self._faults.strikes("buttons-frozen", now_ns):
                stamp_ns = self._frozen.setdefault("buttons", sample.stamp_ns)
                sample = sample._replace(stamp_ns=stamp_ns)
        self._bits = sample.buttons
        self._say(wording.buttons(sample), now_ns, delay)

    def _struck(self, sample: Sample, now_ns: int) -> Sample:
        """The sample with the faults of a pose that are in force."""
        strikes = self._faults.strikes
        x, y, z = sample.position
        if strikes("out-of-order", now_ns):
            sample = sample._replace(stamp_ns=sample.stamp_ns - _BACKWARDS_NS)
        if strikes("repeated-stamp", now_ns):
            sample = sample._replace(stamp_ns=self._frozen.setdefault("pose", sample.stamp_ns))
        if strikes("nan", now_ns):
            sample = sample._replace(position=(float("nan"), y, z))
        if strikes("infinity", now_ns):
            sample = sample._replace(position=(x, float("inf"), z))
        if strikes("zero-quaternion", now_ns):
            sample = sample._replace(wxyz=(0.0, 0.0, 0.0, 0.0))
        if sample.sequence % 2 and strikes("negated-quaternion", now_ns):
            a, b, c, d = sample.wxyz
            sample = sample._replace(wxyz=(-a, -b, -c, -d))
        teleport = strikes("teleport", now_ns)
        if teleport is not None:
            sample = sample._replace(position=(x + 1e-3 * teleport.value, y, z))
        return sample

    # The control channel

    def _answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """Do what one request asks for; its first known key says what."""
        acts: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
            "inject": self._asked_to_inject,
            "clear": self._asked_to_clear,
            "press": self._asked_to_press,
            "release": self._asked_to_release,
            "state": self._asked_for_state,
            "sent": self._asked_for_sent,
            "forces": lambda _: {"forces": list(self._outlet.forces)[-_ROWS:]},
            "servos": lambda _: {"servos": list(self._outlet.servos)[-_ROWS:]},
        }
        for key, act in acts.items():
            if request.get(key):
                return act(request)
        raise BadRequest(f"no such request; send one of: {', '.join(acts)}")

    def _asked_to_inject(self, request: dict[str, Any]) -> dict[str, Any]:
        options = {key: value for key, value in request.items() if key != "inject"}
        fault = make(str(request["inject"]), options, time.monotonic_ns())
        self._frozen.clear()
        self._faults.add(fault)
        return {"fault": fault.as_dict()}

    def _asked_to_clear(self, request: dict[str, Any]) -> dict[str, Any]:
        name = request["clear"]
        return {"cleared": self._faults.clear(None if name is True else str(name))}

    def _asked_to_press(self, request: dict[str, Any]) -> dict[str, Any]:
        bits = request["press"]
        if bits not in (1, 2, 3):
            raise BadRequest("press 1 (the first button), 2 (the second) or 3 (both)")
        self._stylus.press(int(bits))
        return {"buttons": self._stylus.bits}

    def _asked_to_release(self, _: dict[str, Any]) -> dict[str, Any]:
        self._stylus.release()
        return {"buttons": 0}

    def _asked_for_state(self, _: dict[str, Any]) -> dict[str, Any]:
        newest = self._newest
        return {
            "sequence": newest.sequence if newest else 0,
            "position_mm": [1e3 * value for value in newest.position] if newest else None,
            "buttons": self._stylus.bits,
            "cpu_s": time.process_time(),
            "faults": [fault.as_dict() for fault in self._faults.active.values()],
            **self._outlet.state(),
        }

    def _asked_for_sent(self, request: dict[str, Any]) -> dict[str, Any]:
        since, rows = int(request.get("since_ns", 0)), int(request.get("rows", _ROWS))
        return {"sent": [one for one in self._sent if one[1] >= since][-rows:]}


def forces_in(text: bytes) -> Any:
    """A message from the other end, decoded; None where it is no JSON object."""
    try:
        found = msgspec.json.decode(text)
    except UNDECODABLE:
        return None
    return found if isinstance(found, dict) else None


def serve(
    stylus: FakeStylus, outlet: Outlet, options: Options, stopped: Callable[[], bool]
) -> None:
    """Play until ``stopped()``.

    Raises:
        UnknownName, BadFault: the faults make no sense.
    """
    program = Program(stylus, outlet, options)
    if options.realtime:
        _prefer()
    gc.collect()
    gc.freeze()
    gc.disable()
    program.run(stopped)


def _prefer() -> None:
    """Be in time also on a busy machine, where the system permits it."""
    if hasattr(os, "sched_setscheduler"):
        policy = os.SCHED_FIFO | getattr(os, "SCHED_RESET_ON_FORK", 0)
        try:
            os.sched_setscheduler(0, policy, os.sched_param(_PRIORITY))
        except OSError:
            return
