"""The fake controller's sockets: commands, reports, and faults on demand, in a loop that sleeps."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from hardware.arm.address import NORMAL_PORT, REAL_PORT, RICH_PORT, ArmAddress
from hardware.control_channel import BadRequest, ControlChannel
from hardware.fake_arm import telling
from hardware.fake_arm.controller import Controller
from hardware.fake_arm.faults import FAULTS, Wanted, check_name
from hardware.fake_arm.wire import PROTOCOLS, Register, Request, RequestReader, answer
from robot.errors import KeyholeError

_REAL_NS, _SLOW_NS = 10_000_000, 200_000_000
_LATE_NS = 200_000_000
_REMEMBERED = 8192
_CHUNK = 4096
_ROWS = 5000
_PRIORITY = 40
"""Below a control loop: a real controller has a processor of its own."""

_Report: TypeAlias = Callable[[Controller], bytes]


class CannotListen(KeyholeError):
    """A port of the fake controller cannot be had.

    Attributes:
        address: host and port.
    """

    code = "cannot_listen"

    def __init__(self, host: str, port: int, reason: str) -> None:
        super().__init__(
            f"cannot listen on {host}:{port}: {reason}; choose another address or command port "
            "with --listen ADDRESS:PORT (127.0.0.2:5020; ports above 1023 need no rights)"
        )
        self.address = f"{host}:{port}"


class Goal(NamedTuple):
    """One streamed command: when its bytes had come (host's monotonic clock), and the joints."""

    stamp_ns: int
    q: tuple[float, ...]


def _prefer() -> None:
    """Be in time also on a busy machine, where the system permits it."""
    if hasattr(os, "sched_setscheduler"):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))


class _Planned(NamedTuple):
    due_ns: int
    begins: bool
    name: str


def _acts(faults: Sequence[Wanted], now: int) -> list[_Planned]:
    """What shall happen when."""
    found = []
    for fault in faults:
        begin = now + round(fault.after_ms * 1e6)
        found.append(_Planned(begin, True, fault.name))
        if fault.for_ms:
            found.append(_Planned(begin + round(fault.for_ms * 1e6), False, fault.name))
    return found


class _Client:
    """One connection, with what it has not taken yet."""

    def __init__(self, connection: socket.socket, report: _Report | None):
        self.connection, self.report = connection, report
        self.reader = RequestReader()
        self.waiting = b""

    def send(self, data: bytes) -> None:
        """Send, or keep what is not taken; a report is left out where one still waits."""
        if self.waiting and self.report is not None:
            return
        self.waiting += data
        self.flush()

    def flush(self) -> None:
        with contextlib.suppress(BlockingIOError):
            self.waiting = self.waiting[self.connection.send(self.waiting) :]


class FakeArm:
    """A controller that listens. As a context manager it runs in a thread of its own.

    Attributes:
        controller: what it is; change it only through :meth:`inject` and :meth:`clear`.
        address: where it listens.
        goals: the newest streamed commands, taken or refused.
    """

    def __init__(
        self,
        controller: Controller,
        address: ArmAddress,
        control: Path | None = None,
        faults: Sequence[Wanted] = (),
    ) -> None:
        """Bind the ports.

        Args:
            controller: decides what is answered.
            address: host and command port.
            control: path of a control channel, if there shall be one.
            faults: what shall happen, counted from now.

        Raises:
            CannotListen: if a port is taken or not permitted.
        """
        self.controller, self.address = controller, address
        self.goals: deque[Goal] = deque(maxlen=_REMEMBERED)
        self._active: set[str] = set()
        self._clients: dict[int, _Client] = {}
        self._listeners: dict[int, tuple[socket.socket, _Report | None]] = {}
        self._late: deque[tuple[int, _Client, bytes]] = deque()
        self._asked: deque[Callable[[], None]] = deque()
        self._wake, self._woken = socket.socketpair()
        self._woken.setblocking(False)
        self._thread = threading.Thread(target=self._turn_until_ended, name="fake-arm", daemon=True)
        self._ending = False
        self._then = self._next_real = self._next_slow = time.monotonic_ns()
        self._plan = sorted(_acts(faults, self._then))
        self._channel: ControlChannel | None = None
        try:
            self._bind()
            if control is not None:
                self._channel = ControlChannel(control, self._reply, time.monotonic_ns)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> FakeArm:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending = True
        self._wake.send(b"\0")
        self._thread.join()
        self.close()

    def run(self, stopped: Callable[[], bool], realtime: bool = False) -> None:
        """Serve in the calling thread.

        Args:
            stopped: asked at every report whether to end.
            realtime: whether to ask for SCHED_FIFO, so that reports come in time on a busy machine.
        """
        if realtime:
            _prefer()
        while not stopped():
            self._turn()

    def close(self) -> None:
        """Give the ports back."""
        for client in list(self._clients.values()):
            client.connection.close()
        for listener, _ in self._listeners.values():
            listener.close()
        if self._channel is not None:
            self._channel.close()
        self._wake.close()
        self._woken.close()

    def inject(self, name: str) -> int:
        """From another thread: let a fault happen; when it did, by the monotonic clock in ns.

        Raises:
            UnknownName: there is no such fault.
        """
        return self._in_thread(name, self._inject)

    def clear(self, name: str) -> int:
        """From another thread: take the cause of a lasting fault away; when that was, in ns.

        Errors that it raised stay until they are cleaned.

        Raises:
            UnknownName: there is no such fault.
        """
        return self._in_thread(name, self._clear)

    def state(self) -> dict[str, Any]:
        """What the controller is and does, for people."""
        it = self.controller
        return {
            "mode": it.mode,
            "state": it.state,
            "error": int(it.error),
            "warning": int(it.warning),
            "enabled": it.enabled,
            "joints_rad": [round(float(angle), 6) for angle in it.q],
            "faults": sorted(self._active),
            "clients": len(self._clients),
            "cpu_s": time.process_time(),
        }

    def _in_thread(self, name: str, act: Callable[[str], None]) -> int:
        check_name(name)
        done, stamps = threading.Event(), [0]

        def asked() -> None:
            act(name)
            stamps[0] = time.monotonic_ns()
            done.set()

        self._asked.append(asked)
        self._wake.send(b"\0")
        done.wait()
        return stamps[0]

    def _reply(self, request: dict[str, Any]) -> dict[str, Any]:
        """What the control channel answers."""
        if "inject" in request:
            check_name(str(request["inject"]))
            self._inject(str(request["inject"]))
            return {}
        if "clear" in request:
            wanted = request["clear"]
            for name in FAULTS if wanted is True else [str(wanted)]:
                check_name(name)
                self._clear(name)
            return {}
        if "state" in request:
            return self.state()
        if "goals" in request:
            since, rows = int(request.get("since_ns", 0)), int(request.get("rows", _ROWS))
            return {"goals": [goal for goal in self.goals if goal.stamp_ns > since][-rows:]}
        raise BadRequest("ask for inject, clear, state or goals")

    def _bind(self) -> None:
        ports: tuple[tuple[int, _Report | None], ...] = (
            (self.address.control, None),
            (NORMAL_PORT, telling.normal),
            (RICH_PORT, telling.rich),
            (REAL_PORT, telling.real),
        )
        for port, report in ports:
            listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            self._listeners[listener.fileno()] = (listener, report)
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                listener.bind((self.address.host, port))
                listener.listen()
            except OSError as error:
                reason = error.strerror or str(error)
                raise CannotListen(self.address.host, port, reason) from error
            listener.setblocking(False)

    def _turn_until_ended(self) -> None:
        while not self._ending:
            self._turn()

    def _turn(self) -> None:
        """Wait for the next thing to do, and do it."""
        due = min(self._next_real, self._late[0][0] if self._late else self._next_real)
        channel = self._channel.descriptors() if self._channel is not None else []
        waited = [self._woken.fileno(), *self._listeners, *self._clients, *channel]
        ready = select.select(waited, [], [], max(due - time.monotonic_ns(), 0) * 1e-9)[0]
        for descriptor in ready:
            if descriptor in self._listeners:
                self._accept(*self._listeners[descriptor])
            elif descriptor in self._clients:
                self._serve(self._clients[descriptor])
            elif descriptor in channel and self._channel is not None:
                self._channel.serve(descriptor)
            elif descriptor == self._woken.fileno():
                self._woken.recv(_CHUNK)
        while self._asked:
            self._asked.popleft()()
        now = time.monotonic_ns()
        while self._plan and self._plan[0].due_ns <= now:
            planned = self._plan.pop(0)
            (self._inject if planned.begins else self._clear)(planned.name)
        self._pass_time(now)
        while self._late and self._late[0][0] <= now:
            _, client, data = self._late.popleft()
            self._send(client, data)
        if now >= self._next_real:
            self._report(telling.real)
            self._next_real = max(self._next_real + _REAL_NS, now)
        if now >= self._next_slow:
            self._report(telling.normal)
            self._report(telling.rich)
            self._next_slow = max(self._next_slow + _SLOW_NS, now)

    def _pass_time(self, now: int) -> None:
        self.controller.advance((now - self._then) * 1e-9)
        self._then = now

    def _accept(self, listener: socket.socket, report: _Report | None) -> None:
        try:
            connection, _ = listener.accept()
        except OSError:
            return
        if "unplugged" in self._active:
            connection.close()
            return
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._clients[connection.fileno()] = _Client(connection, report)

    def _serve(self, client: _Client) -> None:
        try:
            received = client.connection.recv(_CHUNK)
        except BlockingIOError:
            return
        except OSError:
            received = b""
        if not received:
            self._drop(client)
            return
        if client.report is not None:
            return
        now = time.monotonic_ns()
        for request in client.reader.feed(received):
            if request.protocol in PROTOCOLS and "silent" not in self._active:
                self._answer(client, request, now)

    def _answer(self, client: _Client, request: Request, now: int) -> None:
        self._pass_time(now)
        if request.register == Register.MOVE_SERVO_JOINTS and len(request.data) >= 28:
            q = np.frombuffer(request.data, "<f4", 7)
            self.goals.append(Goal(now, tuple(float(angle) for angle in q)))
        status, data = self.controller.handle(request)
        if "short-answers" in self._active:
            data = b""
        if "slow" in self._active:
            self._late.append((now + _LATE_NS, client, answer(request, status, data)))
        else:
            self._send(client, answer(request, status, data))

    def _report(self, form: _Report) -> None:
        clients = [client for client in self._clients.values() if client.report is form]
        if not clients or self._active & {"silent", "no-reports"}:
            return
        data = form(self.controller)
        if "wrong-report" in self._active:
            data = b"\xff" + data[1:]
        if "not-a-number" in self._active:
            data = data[:11] + np.float32(np.nan).tobytes() + data[15:]
        for client in clients:
            self._send(client, data)

    def _send(self, client: _Client, data: bytes) -> None:
        try:
            client.send(data)
        except OSError:
            self._drop(client)

    def _drop(self, client: _Client) -> None:
        if self._clients.pop(client.connection.fileno(), None) is not None:
            client.connection.close()

    def _inject(self, name: str) -> None:
        fault = FAULTS[name]
        if fault.lasts:
            self._active.add(name)
        if fault.error:
            if fault.lasts:
                self.controller.pressed.add(fault.error)
            self.controller.fail(fault.error)
        if name == "stopped":
            self.controller.stop()
        if name in {"drop", "unplugged"}:
            for client in list(self._clients.values()):
                self._drop(client)

    def _clear(self, name: str) -> None:
        self._active.discard(name)
        self.controller.pressed.discard(FAULTS[name].error)
