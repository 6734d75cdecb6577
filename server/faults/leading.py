"""A leader that never lets go: samples of a clutched device over the stream, and how they go wrong.

It keeps its clutch closed whatever the console does, so that whatever stops the robot must do so by
itself, and whatever starts it again shows.
"""

from __future__ import annotations

import contextlib
import json
import logging
import math
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from server.faults.access import Api

Sample = dict[str, Any]
Tamper = Callable[[Sample, int], Sample | None]
"""What becomes of a sample, given how many were tampered with before it; None: it is not sent."""

PERIOD_S = 0.008
_RADIUS_MM, _TURN_S, _BACK_S = 8.0, 2.5, 0.6
_SWING_RAD, _SWING_S = 1.4, 4.0
_SILENT = logging.getLogger("keyhole.faults.leader")
"""A connection that is cut on purpose is nothing to report."""
_SILENT.addHandler(logging.NullHandler())
_SILENT.propagate = False
_HEARTBEAT_S, _RENEW_S, _RETRY_S = 0.4, 2.0, 0.1


class Circle:
    """Where the leader's hand is: on its way to a circle about a centre, then on it.

    Args:
        centre_mm: (3,) base frame.
    """

    def __init__(self, centre_mm: NDArray[Any]) -> None:
        self._centre = centre_mm
        self._away: NDArray[Any] = np.zeros(3)
        self._since = self._then = self._swung_since = time.monotonic()
        self._pull, self._pulled = np.zeros(3), np.zeros(3)
        self._swing = self._swung = 0.0

    def pull(self, direction_mm: NDArray[Any] | None) -> None:
        """Pull (3,) away from the circle, gently; None lets go again."""
        self._pull = np.zeros(3) if direction_mm is None else direction_mm

    def swing(self, turns: bool) -> None:
        """Turn to and fro as well, or no longer."""
        self._swing, self._swung_since = _SWING_RAD if turns else 0.0, time.monotonic()

    def turn(self) -> list[float]:
        """How it is turned: a quaternion w, x, y, z."""
        phase = 2.0 * math.pi * (time.monotonic() - self._swung_since) / _SWING_S
        half = -0.25 * self._swung * (1.0 - math.cos(phase))
        return [math.cos(half), math.sin(half), 0.0, 0.0]

    def begin_at(self, position_mm: NDArray[Any]) -> None:
        """Go on from there, (3,), without a jump."""
        self._since = time.monotonic()
        self._away = position_mm - self._centre - self._on_circle(0.0)

    @staticmethod
    def _on_circle(after_s: float) -> NDArray[Any]:
        angle = 2.0 * math.pi * after_s / _TURN_S
        return _RADIUS_MM * np.array([math.cos(angle), math.sin(angle), 0.0])

    def now(self) -> list[float]:
        """Where it is, mm."""
        after_s = time.monotonic() - self._since
        away = self._away * math.exp(-after_s / _BACK_S)
        now = time.monotonic()
        share, self._then = min(1.0, (now - self._then) / _BACK_S), now
        self._pulled = self._pulled + share * (self._pull - self._pulled)
        self._swung += share * (self._swing - self._swung)
        found = self._centre + self._on_circle(after_s) + away + self._pulled
        return [float(one) for one in found]


class StreamLeader:
    """Sends samples, heartbeats and renewals over the console's stream from a thread of its own.

    Args:
        api: of the console, with the lease.
        circle: where the hand is.
        leads: whether it sends samples at all, or only lets the operator live.

    Attributes:
        clutch: whether the clutch is closed.
        problems: what the console refused, newest last, with its time in ns.
        tampered_ns: when the first tampered sample was, or would have been, sent; 0 before.
        quiet: neither samples nor heartbeats are sent, as from a page that is asleep.
    """

    def __init__(self, api: Api, circle: Circle, *, leads: bool = True) -> None:
        self.api, self.circle, self._leads = api, circle, leads
        self.clutch, self.quiet = False, False
        self.problems: list[tuple[int, dict[str, Any]]] = []
        self.tampered_ns = 0
        self._tamper: Tamper | None = None
        self._tampered = 0
        self._over = threading.Event()
        self._socket: Connection | None = None
        self._thread = threading.Thread(target=self._run, name="leader", daemon=True)
        self._thread.start()

    def tamper(self, how: Tamper | None) -> None:
        """Change every sample from now on; None for no longer."""
        self._tampered = self.tampered_ns = 0
        self._tamper = how

    def cut(self) -> int:
        """Cut the connection without a farewell; returns when, ns. It comes back by itself."""
        socket, now = self._socket, time.monotonic_ns()
        if socket is not None:
            with contextlib.suppress(OSError):
                socket.socket.shutdown(2)
        return now

    def close(self) -> None:
        """Open the clutch and end."""
        self._over.set()
        self._thread.join(5.0)

    def _run(self) -> None:
        while not self._over.is_set():
            # A lease that is taken anew meanwhile needs a connection that bears it.
            lease = self.api.lease
            try:
                with connect(
                    self.api.stream_address + "?rate_hz=1",
                    additional_headers=self.api.headers,
                    compression=None,
                    proxy=None,
                    open_timeout=2.0,
                    close_timeout=0.2,
                    ping_interval=None,
                    logger=_SILENT,
                ) as socket:
                    self._socket = socket
                    threading.Thread(target=self._read, args=(socket,), daemon=True).start()
                    self._send(socket, lease)
            except (OSError, TimeoutError, WebSocketException):
                self._over.wait(_RETRY_S)
            finally:
                self._socket = None

    def _read(self, socket: Connection) -> None:
        with contextlib.suppress(OSError, WebSocketException):
            for text in socket:
                message = json.loads(text)
                if message["type"] == "problem":
                    self.problems.append((time.monotonic_ns(), message["problem"]))
                    del self.problems[:-50]

    def _send(self, socket: Connection, lease: str) -> None:
        due = time.monotonic()
        beat = renewed = 0.0
        while not self._over.is_set() and self.api.lease == lease:
            now = time.monotonic()
            if not self.quiet and now - beat > _HEARTBEAT_S:
                beat = now
                socket.send('{"type": "heartbeat"}')
            if not self.quiet and lease and now - renewed > _RENEW_S:
                renewed = now
                socket.send('{"type": "renew"}')
            sample = self._sample()
            if sample is not None:
                socket.send(json.dumps(sample))
            due = max(due + PERIOD_S, time.monotonic())
            self._over.wait(max(0.0, due - time.monotonic()))

    def _sample(self) -> Sample | None:
        if self.quiet or not self._leads or not self.api.lease:
            return None
        sample: Sample | None = {
            "type": "leader",
            "position_mm": self.circle.now(),
            "orientation_wxyz": self.circle.turn(),
            "clutch": self.clutch,
        }
        if self._tamper is not None:
            self.tampered_ns = self.tampered_ns or time.monotonic_ns()
            sample = self._tamper(sample or {}, self._tampered)
            self._tampered += 1
        return sample
