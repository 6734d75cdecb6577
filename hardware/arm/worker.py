"""The thread that talks to the real arm: connects, prepares, streams, watches, and comes back."""

from __future__ import annotations

import threading
import time
from collections import deque
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from hardware.arm.codes import error_message, warning_message
from hardware.arm.errors import ArmUnreachable, WrongArm
from hardware.arm.follower import Follower, Verdict
from hardware.arm.report_reader import ReportReader, ask_for_real_time
from hardware.arm.session import READY_STATES, SERVO_MODE, Answer, ArmSession

_RETRY_S = 0.5
_LOOK_NS = 50_000_000
_LATE_NS = 50_000_000
_REST_S = 0.01
_TRIES, _TRY_S = 20, 0.05
_ENDING_S = 3.0


class Stage(IntEnum):
    """How far the arm is."""

    SEARCHING = 0
    PREPARING = 1
    READY = 2
    HELD = 3
    RELEASED = 4
    FAULT = 5


class Wish(IntEnum):
    """What the control loop wants done."""

    HOLD = 0
    RELEASE = 1
    RECOVER = 2


class Settings(NamedTuple):
    """What the thread goes by.

    Attributes:
        period_ns: between two streamed commands.
        delay_ns: commands are interpolated to this long ago, so that they have neighbours.
        lost_ns: a report older than this means that the connection is gone.
        mass_kg: of what the flange carries.
        centre_mm: its centre of mass in the flange frame, mm.
        realtime: whether to ask for real-time scheduling.
    """

    period_ns: int
    delay_ns: int
    lost_ns: int
    mass_kg: float
    centre_mm: tuple[float, float, float]
    realtime: bool


class ArmWorker:
    """Owns the connection. The control loop only leaves wishes and reads what stands here.

    Attributes:
        stage: how far the arm is.
        error: the controller's error code, 0 for none.
        warning: its warning code, 0 for none.
        message: what happened last and what to do, at most 128 bytes.
        sent: how many commands were streamed.
        reconnects: how often the connection came back.
        rate_hz: of the stream, over the last half second.
        recovering: whether it was asked to recover, and has not tried yet.
        doubted: whether the control loop took the connection for lost, and the thread has not seen
            to it yet.
    """

    def __init__(
        self, session: ArmSession, reports: ReportReader, follower: Follower, settings: Settings
    ) -> None:
        self._session, self._reports, self._follower = session, reports, follower
        self._settings = settings
        self.stage = Stage.SEARCHING
        self.error = self.warning = 0
        self.message = b""
        self.sent = self.reconnects = 0
        self.rate_hz = 0.0
        self._wishes: deque[Wish] = deque()
        self.recovering = self.doubted = False
        self._halt = False
        self._ending = False
        self._woken = threading.Event()
        self._known = False
        self._measured, self._goal = np.zeros(7), np.zeros(7)
        self._looked_ns = self._counted_ns = 0
        self._counted = 0
        self._thread = threading.Thread(target=self._run, name="arm", daemon=True)

    def start(self) -> None:
        """Begin to look for the controller."""
        self._thread.start()

    def wish(self, wish: Wish) -> None:
        """Leave a wish, from the control loop; what is not recovering ends the stream at once."""
        if wish == Wish.RECOVER:
            self.recovering = True
        else:
            self._halt = True
        self._wishes.append(wish)
        self._woken.set()

    def doubt(self) -> None:
        """The control loop takes the connection for lost: end the stream, connect anew.

        The thread may be waiting for an answer meanwhile; reports that come back before it has one
        must not let the stream go on.
        """
        self._halt = self.doubted = True

    def end(self) -> None:
        """Stop the arm under torque, disconnect, and end the thread."""
        self._halt = self._ending = True
        self._woken.set()
        if self._thread.is_alive():
            self._thread.join(_ENDING_S)

    def _run(self) -> None:
        if self._settings.realtime:
            ask_for_real_time()
        while not self._ending:
            try:
                self._connect()
                self._attend()
            except (ArmUnreachable, WrongArm) as error:
                self._say(str(error))
            except Exception as error:
                # The vendor's library raises whatever comes of an answer that it did not expect.
                self._say(f"the arm's library failed, connecting anew: {error!r}")
            self._lose()
            if not self._ending:
                self._rest(_RETRY_S)

    def _connect(self) -> None:
        self._say("looking for the arm's controller")
        self._reports.open()
        self._session.open()
        self._forget_wishes()
        self.doubted = False
        self.reconnects += self._known
        self.error, self.warning = self._session.codes()
        if self.error:
            self._fail(error_message(self.error))
        elif not self._known:
            self._prepare()
        elif self._reports.mode == SERVO_MODE and self._session.state() in READY_STATES:
            self.stage = Stage.READY
            self._say("connected again; it stands")
        else:
            self.stage = Stage.HELD
            self._say("connected again, but its controller was stopped: take hold of it")
        self._known = True

    def _forget_wishes(self) -> None:
        """What was wished meanwhile is done: it stood. Only a release is made up for."""
        release = Wish.RELEASE in self._wishes
        self._wishes.clear()
        self.recovering, self._halt = False, release
        if release:
            self._wishes.append(Wish.RELEASE)

    def _attend(self) -> None:
        """Serve the arm until it is lost or the end is wanted."""
        due = time.monotonic_ns()
        while not self._ending:
            while self._wishes:
                self._obey(self._wishes.popleft())
            now = time.monotonic_ns()
            if self.doubted or self._lost():
                raise ArmUnreachable("arm", "its reports stopped")
            if self._stream(now):
                due = max(due + self._settings.period_ns, now)
                time.sleep(max(due - time.monotonic_ns(), 0) * 1e-9)
                continue
            if now - self._looked_ns > _LOOK_NS:
                self._looked_ns = now
                self._look()
            self._rest(_REST_S)
            due = time.monotonic_ns()
        self._session.stop()

    def _lost(self) -> bool:
        reports = self._reports
        return not reports.connected or reports.age_ns() > self._settings.lost_ns

    def _stream(self, now: int) -> bool:
        """Send the command for now if there is one to follow; True if it was."""
        if self.stage != Stage.READY or self._halt:
            return False
        self._reports.newest(self._measured)
        verdict = self._follower.next(now - self._settings.delay_ns, self._measured, self._goal)
        if verdict != Verdict.FOLLOWED:
            self._tell(verdict)
            if not self._follower.following:
                return False
        answer = self._session.send(self._goal.tolist())
        self._count(now)
        if answer == Answer.LOST:
            raise ArmUnreachable("arm", "its controller stopped answering")
        if answer != Answer.TAKEN:
            self._look()
        elif time.monotonic_ns() - now > _LATE_NS:
            self._say("the arm's controller answers late; look at its network")
        return True

    def _look(self) -> None:
        """Ask for codes and state: while nothing is streamed, and when a command was refused."""
        error, self.warning = self._session.codes()
        if self.stage == Stage.FAULT and not error:
            return
        if error:
            if error != self.error or self.stage != Stage.FAULT:
                self.error = error
                self._fail(error_message(error))
        elif self.stage == Stage.READY:
            state = self._session.state()
            if state not in READY_STATES:
                # An error may have come, and stopped it, between the two questions.
                self.error, self.warning = self._session.codes()
                words = "somebody else stopped the arm; reboot the devices to go on"
                self._fail(error_message(self.error) if self.error else words)
            elif self.warning:
                self._say(warning_message(self.warning))

    def _obey(self, wish: Wish) -> None:
        self._follower.stop()
        if wish == Wish.RECOVER:
            self._prepare()
            return
        try:
            self._session.stop()
        except ArmUnreachable:
            self._wishes.appendleft(wish)
            raise
        if wish == Wish.RELEASE:
            self._session.release()
        if self.stage == Stage.FAULT:
            # Its cause must stay to be read.
            return
        if wish == Wish.RELEASE:
            self.stage = Stage.RELEASED
            self._say("released: its brakes are closed")
        elif self.stage != Stage.RELEASED:
            self.stage = Stage.HELD
            self._say("stopped; it holds under torque")

    def _prepare(self) -> None:
        """Make it ready to follow, standing where it is."""
        self.stage, self._halt = Stage.PREPARING, bool(self._wishes)
        self._say("opening the brakes and entering servo mode")
        self._session.prepare(self._settings.mass_kg, list(self._settings.centre_mm))
        self.error, self.warning = self._session.codes()
        state, tries = self._session.state(), 0
        while not self.error and state not in READY_STATES and tries < _TRIES and not self._ending:
            time.sleep(_TRY_S)
            state, tries = self._session.state(), tries + 1
        if self.error:
            self._fail(error_message(self.error))
        elif state not in READY_STATES:
            self._fail(f"the arm does not get ready (state {state}); look at its controller")
        else:
            self._follower.stop()
            self.stage = Stage.READY
            self._say("ready; it stands")
        self.recovering = Wish.RECOVER in self._wishes

    def _fail(self, message: str) -> None:
        self._follower.stop()
        self.stage = Stage.FAULT
        self._say(message)

    def _lose(self) -> None:
        self._follower.stop()
        self.stage, self.rate_hz = Stage.SEARCHING, 0.0
        self._session.close()
        self._reports.close()

    def _tell(self, verdict: Verdict) -> None:
        if verdict == Verdict.FAR:
            self._say("commands are far from where the arm stands; none is followed")
        elif verdict == Verdict.JUMPED:
            self._say("a command jumped; the arm stands until they come near again")
        elif verdict == Verdict.OUTSIDE:
            self._say("a command lies outside the joint limits; the arm stands")

    def _count(self, now: int) -> None:
        self.sent += 1
        passed = now - self._counted_ns
        if passed > 500_000_000:
            self.rate_hz = (self.sent - self._counted) * 1e9 / passed
            self._counted, self._counted_ns = self.sent, now

    def _rest(self, seconds: float) -> None:
        if self._woken.wait(seconds):
            self._woken.clear()

    def _say(self, message: str) -> None:
        self.message = message.encode()[:128]
