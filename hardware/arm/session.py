"""One connection to an xArm's controller through its vendor's library. Everything here waits.

Three habits of the library are kept away from the rest of the program: it prints, it gives every
socket of the process a time-out, and it prefers a socket file in /tmp that anybody could have put
there.
"""

from __future__ import annotations

import contextlib
import importlib
import logging
import socket
import sys
from enum import IntEnum
from typing import Any

from hardware.arm.address import ArmAddress
from hardware.arm.errors import ArmLibraryMissing, ArmUnreachable, WrongArm

AXES = 7
ANSWER_MS = 500
SERVO_MODE = 1
READY_STATES = (0, 1, 2)
STOPPED_STATE = 4
COLLISION_SENSITIVITY = 3
_QUIETED = ("xarm.x3.base", "xarm.core.wrapper.uxbus_cmd_tcp")
_FINE, _ERROR, _WARNING, _TIMEOUT, _INVALID = 0, 1, 2, 3, 10


class Answer(IntEnum):
    """What came of a streamed command."""

    TAKEN = 0
    ERROR = 1
    NOT_READY = 2
    LOST = 3


class ArmSession:
    """Opens, prepares, streams, stops, releases and closes."""

    def __init__(self, address: ArmAddress) -> None:
        """Load the library; connect to nothing yet.

        Raises:
            ArmLibraryMissing: if it is not there.
        """
        self._address = address
        self._wrapper, settings = _library()
        settings.SocketConf.TCP_CONTROL_PORT = address.control
        settings.UxbusConf.SET_TIMEOUT = settings.UxbusConf.GET_TIMEOUT = ANSWER_MS
        self._api: Any = None

    def open(self) -> None:
        """Connect.

        Raises:
            ArmUnreachable: if there is no answer.
            WrongArm: if it is not an arm of seven joints.
        """
        api = self._wrapper.XArmAPI(
            self._address.host,
            is_radian=True,
            do_not_open=True,
            enable_report=False,
            timed_comm=False,
            forbid_uds=True,
            check_joint_limit=False,
            check_cmdnum_limit=False,
        )
        self._api = api
        before = socket.getdefaulttimeout()
        try:
            api.connect()
        except Exception as error:
            # The library raises plain exceptions.
            raise ArmUnreachable(str(self._address), "its controller does not answer") from error
        finally:
            socket.setdefaulttimeout(before)
        if api.axis != AXES:
            raise WrongArm(str(self._address), api.axis)

    def close(self) -> None:
        """Disconnect."""
        if self._api is not None:
            # What is left of a connection that broke may fail in any way.
            with contextlib.suppress(Exception):
                self._api.disconnect()
            self._api = None

    def codes(self) -> tuple[int, int]:
        """Error and warning codes now.

        Raises:
            ArmUnreachable: if there is no answer.
        """
        code, found = self._api.get_err_warn_code()
        self._check(code)
        return int(found[0]), int(found[1])

    def state(self) -> int:
        """The controller's state now: 0 to 2 moving or ready, 3 paused, 4 stopped.

        Raises:
            ArmUnreachable: if there is no answer.
        """
        code, state = self._api.get_state()
        self._check(code)
        return int(state)

    def prepare(self, mass_kg: float, centre_mm: list[float]) -> None:
        """Clean errors, open the brakes, tell the payload, and enter servo mode, standing.

        Args:
            mass_kg: of what the flange carries.
            centre_mm: its centre of mass in the flange frame, mm.

        Raises:
            ArmUnreachable: if there is no answer.
        """
        api = self._api
        api.clean_error()
        api.clean_warn()
        self._check(api.motion_enable(enable=True))
        self._check(api.set_mode(SERVO_MODE))
        self._check(api.set_state(0))
        api.set_tcp_load(mass_kg, centre_mm)
        api.core.set_collis_sens(COLLISION_SENSITIVITY)
        self._check(api.set_state(0))

    def send(self, q: list[float]) -> Answer:
        """Stream one command of seven joint angles, rad."""
        core = self._api.core
        code = core.move_servoj(q, 0.0, 0.0, 0.0)[0]
        if code in (_FINE, _WARNING):
            return Answer.TAKEN if core.state_is_ready else Answer.NOT_READY
        if code == _ERROR:
            return Answer.ERROR
        if code == _INVALID:
            return Answer.NOT_READY
        return Answer.LOST

    def stop(self) -> None:
        """Stop, under torque."""
        self._check(self._api.set_state(STOPPED_STATE))

    def release(self) -> None:
        """Close the brakes and let go of torque."""
        self._check(self._api.motion_enable(enable=False))

    def _check(self, code: int) -> None:
        # Positive codes tell of the arm, and are asked for apart; these are of the connection.
        if code < 0 or code in (_TIMEOUT, 8):
            raise ArmUnreachable(str(self._address), "its controller stopped answering")


def _library() -> tuple[Any, Any]:
    """The library's modules ``xarm.wrapper`` and ``XCONF``, made quiet."""
    try:
        # It prints when it is imported, and logs to what stdout is then.
        with contextlib.redirect_stdout(sys.stderr):
            wrapper = importlib.import_module("xarm.wrapper")
            settings = importlib.import_module("xarm.core.config.x_config").XCONF
            quieted = [importlib.import_module(name) for name in _QUIETED]
    except (ImportError, OSError) as error:
        raise ArmLibraryMissing(str(error)) from error
    for module in quieted:
        vars(module)["print"] = _say_nothing
    importlib.import_module("xarm.core.utils.log").logger.setLevel(logging.CRITICAL)
    logging.getLogger("origin.print").setLevel(logging.CRITICAL)
    return wrapper, settings


def _say_nothing(*_: object, **__: object) -> None:
    """Stands for ``print`` where the library talks to itself; codes are told in our own words."""
