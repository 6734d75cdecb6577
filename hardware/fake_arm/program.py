"""The fake controller's sockets: commands, reports, and faults on demand, in one thread."""

from __future__ import annotations

import contextlib
import selectors
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hardware.arm.address import NORMAL_PORT, REAL_PORT, RICH_PORT, ArmAddress
from hardware.fake_arm import telling
from hardware.fake_arm.controller import Controller
from hardware.fake_arm.faults import FAULTS
from hardware.fake_arm.wire import PROTOCOLS, Register, Request, RequestReader, answer
from robot.errors import KeyholeError, UnknownName

_REAL_NS, _SLOW_NS = 10_000_000, 200_000_000
_LATE_NS = 200_000_000
_REMEMBERED = 8192
_CHUNK = 4096


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


class _Client:
    """One connection, with what it has not taken yet."""

    def __init__(self, connection: socket.socket, report: Callable[[Controller], bytes] | None):
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
    """A controller that listens; a context manager that starts and ends its thread.

    Attributes:
        controller: what it is; change it only through :meth:`inject` and :meth:`clear`.
        address: where it listens.
        goals: the newest streamed commands that it took or refused.
    """

    def __init__(self, controller: Controller, address: ArmAddress) -> None:
        """Bind the four ports.

        Args:
            controller: decides what is answered.
            address: host and ports.

        Raises:
            CannotListen: if one of them is taken or not permitted.
        """
        self.controller, self.address = controller, address
        self.goals: deque[Goal] = deque(maxlen=_REMEMBERED)
        self._active: set[str] = set()
        self._selector = selectors.DefaultSelector()
        self._clients: dict[int, _Client] = {}
        self._listeners: list[tuple[socket.socket, Callable[[Controller], bytes] | None]] = []
        self._late: deque[tuple[int, _Client, bytes]] = deque()
        self._asked: deque[Callable[[], None]] = deque()
        self._wake, self._woken = socket.socketpair()
        self._thread = threading.Thread(target=self._run, name="fake-arm", daemon=True)
        self._ending = False
        self._then = time.monotonic_ns()
        try:
            self._bind()
        except CannotListen:
            self._close_all()
            raise

    def __enter__(self) -> FakeArm:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending = True
        self._wake.send(b"\0")
        self._thread.join()
        self._close_all()

    def inject(self, name: str) -> int:
        """Let a fault happen; when it did, by the host's monotonic clock in ns.

        Raises:
            UnknownName: if there is no such fault.
        """
        return self._in_thread(name, self._inject)

    def clear(self, name: str) -> int:
        """Take the cause of a lasting fault away; when that was, in ns. Errors it raised stay.

        Raises:
            UnknownName: if there is no such fault.
        """
        return self._in_thread(name, self._clear)

    def state(self) -> dict[str, object]:
        """What the controller is and does, for people."""
        it = self.controller
        return {
            "mode": it.mode,
            "state": it.state,
            "error": it.error,
            "warning": it.warning,
            "enabled": it.enabled,
            "joints_rad": [round(float(angle), 6) for angle in it.q],
            "faults": sorted(self._active),
            "clients": len(self._clients),
        }

    def _in_thread(self, name: str, act: Callable[[str], None]) -> int:
        if name not in FAULTS:
            raise UnknownName("fault of the arm", name, tuple(FAULTS))
        done, stamps = threading.Event(), [0]

        def asked() -> None:
            act(name)
            stamps[0] = time.monotonic_ns()
            done.set()

        self._asked.append(asked)
        self._wake.send(b"\0")
        done.wait()
        return stamps[0]

    def _bind(self) -> None:
        ports = (
            (self.address.control, None),
            (NORMAL_PORT, telling.normal),
            (RICH_PORT, telling.rich),
            (REAL_PORT, telling.real),
        )
        for port, report in ports:
            listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            self._listeners.append((listener, report))
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                listener.bind((self.address.host, port))
                listener.listen()
            except OSError as error:
                reason = error.strerror or str(error)
                raise CannotListen(self.address.host, port, reason) from error
            listener.setblocking(False)
            self._selector.register(listener, selectors.EVENT_READ)
        self._woken.setblocking(False)
        self._selector.register(self._woken, selectors.EVENT_READ)

    def _run(self) -> None:
        reports = dict(self._listeners)
        next_real = next_slow = time.monotonic_ns()
        while not self._ending:
            due = min(next_real, next_slow, self._late[0][0] if self._late else next_real)
            ready = self._selector.select(max(due - time.monotonic_ns(), 0) * 1e-9)
            for key, _ in ready:
                found = key.fileobj
                if found is self._woken:
                    self._woken.recv(_CHUNK)
                elif found in reports:
                    self._accept(found, reports[found])
                else:
                    self._serve(self._clients.get(key.fd))
            while self._asked:
                self._asked.popleft()()
            now = time.monotonic_ns()
            self._pass_time(now)
            while self._late and self._late[0][0] <= now:
                _, client, data = self._late.popleft()
                self._send(client, data)
            if now >= next_real:
                self._report(telling.real)
                next_real = max(next_real + _REAL_NS, now)
            if now >= next_slow:
                self._report(telling.normal)
                self._report(telling.rich)
                next_slow = max(next_slow + _SLOW_NS, now)

    def _pass_time(self, now: int) -> None:
        self.controller.advance((now - self._then) * 1e-9)
        self._then = now

    def _accept(self, listener: object, report: Callable[[Controller], bytes] | None) -> None:
        assert isinstance(listener, socket.socket)
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
        self._selector.register(connection, selectors.EVENT_READ)

    def _serve(self, client: _Client | None) -> None:
        if client is None:
            return
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
        if "slow" in self._active:
            self._late.append((now + _LATE_NS, client, answer(request, status, data)))
        else:
            self._send(client, answer(request, status, data))

    def _report(self, form: Callable[[Controller], bytes]) -> None:
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
        descriptor = client.connection.fileno()
        if self._clients.pop(descriptor, None) is not None:
            self._selector.unregister(client.connection)
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

    def _close_all(self) -> None:
        for client in list(self._clients.values()):
            client.connection.close()
        for listener, _ in self._listeners:
            listener.close()
        self._selector.close()
        self._wake.close()
        self._woken.close()
