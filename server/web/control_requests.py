"""Requests to the control process, each waited for until control has taken it in."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.records import LeaderKind, Request, Safety
from robot.safety import REASONS, Event, check_request, successor
from scenes.trocar_motion import Breathing
from server.memory.link import WebLink
from server.memory.link_records import TrocarSource
from server.web.devices_view import readiness_view
from server.web.refusals import ControlSilent, DevicesNotReady, NotReady
from server.web.state_source import StateSource

ANSWER_S = 1.0
"""How long control may take to answer before the caller is told that it does not."""

_POLL_S = 0.001
_LED_S, _LED_POLL_S = 2.0, 0.02
_BOARD_S = 5.0
"""Likewise for a change of the board, which has to be built."""


def safety_of(record: NDArray[Any]) -> Safety:
    """The safety state in a (1,) record."""
    return Safety(int(record["outcome"]["state"]["safety"][0]))


class ControlRequests:
    """Asks control, and tells whether it did as it was asked. Belongs to the event loop.

    Args:
        link: to the control process.
        source: of the newest record.
        check_stand: refuses to enable a robot that stands wrong, by its (1,) record.
    """

    def __init__(
        self, link: WebLink, source: StateSource, check_stand: Callable[[NDArray[Any]], None]
    ) -> None:
        self._link, self._source, self._check_stand = link, source, check_stand
        self._settings_lock = asyncio.Lock()
        self._fault = ("", 0)

    async def ask(self, request: Request) -> None:
        """Ask for a change of the safety state.

        Raises:
            RequestRefused: the transition table does not allow it.
            DevicesNotReady: it would enable a robot whose devices are not ready.
            NotInserted: it would enable a robot whose shaft does not go through the trocar.
            NotReady: control took it in and did not follow it.
            ControlSilent: control does not answer.
        """
        record = self._source.fresh_record()
        before = safety_of(record)
        check_request(before, request)
        if request == Request.ENABLE:
            check_ready(record)
            self._check_stand(record)
        record = await self._taken_in(self._link.request(request))
        wanted, after = successor(before, Event(request)), safety_of(record)
        if after != wanted:
            reason = REASONS[Event(int(record["outcome"]["state"]["reason"][0]))]
            raise NotReady(after.name, f"the robot is in {after.name}: {': '.join(reason)}")

    async def emergency_stop(self) -> None:
        """Stop all motion; nothing is checked or waited for before it is sent.

        Raises:
            ControlSilent: sent, but control does not confirm it.
        """
        number = self._link.emergency_stop()
        self._source.forget_texts()
        await self._taken_in(number)

    async def settings(self, change: Callable[[Any], None]) -> None:
        """Change the operator's choices.

        Args:
            change: sets fields of the settings; what it leaves alone stays as it is.

        Raises:
            ControlSilent: control does not answer.
        """
        async with self._settings_lock:
            settings = self._source.fresh_record()["input"]["settings"].copy()
            if "lock_arm" in (settings.dtype.names or ()):
                # The arm is locked by the path that plays, and no longer than it plays.
                settings["lock_arm"] = 0
            change(settings[0])
            await self._taken_in(self._link.settings(settings))

    async def start_path(
        self, samples: NDArray[np.float64], name: str, lock_arm: bool = False
    ) -> None:
        """Play a path.

        Args:
            samples: (n, 8), time in s, translation in m, unit quaternion.
            name: shown while it plays.
            lock_arm: whether the arm stands still meanwhile.

        Raises:
            NotReady: the robot is not enabled, or something else leads it.
            ControlSilent: control does not answer.
        """
        record = self._source.fresh_record()
        check_enabled(record)
        if record["header"]["path_id"][0] != 0:
            raise NotReady(safety_of(record).name, "a path is playing; stop it first")
        check_free(record)
        number = await asyncio.to_thread(self._link.start_path, samples, name, lock_arm)
        record = await self._taken_in(number)
        if record["header"]["path_id"][0] == 0:
            raise NotReady(safety_of(record).name, "control did not start the path; see its log")

    async def stop_path(self) -> None:
        """Stop the path that plays, if any.

        Raises:
            ControlSilent: control does not answer.
        """
        self._source.fresh_record()
        await self._taken_in(self._link.stop_path())

    async def register_trocar(self, source: TrocarSource, position: NDArray[np.float64]) -> None:
        """Register the trocar at ``position`` (3,), base frame, m.

        Raises:
            NotReady: the robot is neither DISABLED nor PAUSED.
            ControlSilent: control does not answer.
        """
        states = (Safety.DISABLED, Safety.PAUSED)
        _check_in(self._source.fresh_record(), states, "disable it first")
        record = await self._taken_in(self._link.register_trocar(source, position))
        _check_in(record, states, "disable it first")

    async def trocar_reached(self) -> None:
        """Wait until the shaft, led to the trocar after enabling, is there; a breath is not."""
        ends = time.monotonic() + _LED_S
        while time.monotonic() < ends and not self._link.status()["breathing"].amplitude_m:
            if not self._source.fresh_record()["input"]["trocar_velocity"].any():
                return
            await asyncio.sleep(_LED_POLL_S)

    async def breathe(self, breathing: Breathing) -> None:
        """Let the trocar breathe like that from the next breath on.

        Raises:
            ControlSilent: control does not answer.
        """
        self._source.fresh_record()
        await self._taken_in(self._link.breathe(breathing))

    async def change_board(self, name: str) -> None:
        """Put the board of that name before the instrument.

        Raises:
            NotReady: the robot is not DISABLED.
            ControlSilent: control does not answer.
        """
        from scenes.boards.board import BOARD_NAMES

        states = (Safety.DISABLED,)
        _check_in(self._source.fresh_record(), states, "disable it first")
        number = self._link.change_board(BOARD_NAMES.index(name))
        record = await self._taken_in(number, _BOARD_S)
        _check_in(record, states, "disable it first")

    async def inject_fault(self, name: str) -> None:
        """Break the simulated robot, or mend it with "".

        Raises:
            ControlSilent: control does not answer.
        """
        self._source.fresh_record()
        await self._taken_in(self._link.inject_fault(name))
        self._fault = (name, self._restarts())

    @property
    def fault(self) -> str:
        """Name of the fault that was injected into the present control process, or empty."""
        name, restarts = self._fault
        return name if restarts == self._restarts() else ""

    def _restarts(self) -> int:
        return int(self._link.status()["control_restarts"])

    async def ask_devices(
        self, send: Callable[[], int], states: tuple[Safety, ...], what: str
    ) -> None:
        """Ask the devices for something, in one of ``states``; ``what`` leads there.

        Raises:
            NotReady: the robot is in another state.
            ControlSilent: control does not answer.
        """
        _check_in(self._source.fresh_record(), states, what)
        await self._taken_in(send())

    async def _taken_in(self, number: int, within_s: float = ANSWER_S) -> NDArray[Any]:
        """The first record seen after control had taken in request ``number``."""
        ends = time.monotonic() + within_s
        while time.monotonic() < ends:
            record = self._source.record()
            if record is not None and record["header"]["request_sequence"][0] >= number:
                self._source.forget_texts()
                return record
            await asyncio.sleep(_POLL_S)
        raise ControlSilent(f"control did not answer within {within_s:g} s", within_s)


def _check_in(record: NDArray[Any], states: tuple[Safety, ...], what: str) -> None:
    """Raise :class:`NotReady` unless the robot is in one of ``states``."""
    safety = safety_of(record)
    if safety not in states:
        words = "reset it first" if safety == Safety.FAULT else what
        raise NotReady(safety.name, f"the robot is in {safety.name}: {words}")


def check_ready(record: NDArray[Any]) -> None:
    """Raise :class:`DevicesNotReady` unless the (1,) ``record`` says that the devices are ready."""
    ready = readiness_view(int(record["input"]["readiness"][0]))
    if ready["state"] != "ready":
        raise DevicesNotReady(ready["state"], f"{ready['reason']}: {ready['action']}")


def check_free(record: NDArray[Any]) -> None:
    """Raise :class:`NotReady` where a leader other than a standing target or a path leads."""
    state = record["outcome"]["state"][0]
    yields = (LeaderKind.API_TARGET, LeaderKind.PATH)
    if state["engaged"] and state["leader_kind"] not in yields:
        leader = LeaderKind(int(state["leader_kind"])).name.lower()
        raise NotReady(safety_of(record).name, f"the {leader} leads the tip; let it go first")


def check_enabled(record: NDArray[Any]) -> None:
    """Raise :class:`NotReady` unless the (1,) ``record`` says that the robot is enabled."""
    safety = safety_of(record)
    if safety == Safety.ENABLED:
        return
    reset = "reset, then " if safety == Safety.FAULT else ""
    raise NotReady(safety.name, f"the robot is in {safety.name}: {reset}enable it first")
