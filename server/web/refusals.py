"""The refusals of the web process, each with the HTTP status under which it leaves the server."""

from __future__ import annotations

from typing import ClassVar

from robot.errors import KeyholeError


class WebRefusal(KeyholeError):
    """Base class of what the web process refuses by itself; ``status`` is its HTTP status."""

    status: ClassVar[int] = 400


class NotAdmitted(WebRefusal):
    """The request carries neither the token nor the cookie of a session."""

    code = "not_admitted"
    status = 401

    def __init__(
        self,
        detail: str = "this needs the console's token: open the address that `keyhole` printed, "
        "or send the header `Authorization: Bearer TOKEN`",
    ) -> None:
        super().__init__(detail)


class WrongToken(NotAdmitted):
    """The request carries a token that is not this console's, or no longer."""

    code = "wrong_token"

    def __init__(self) -> None:
        super().__init__(
            "this token is wrong or has expired: a console that was started again has a new one; "
            "take the one that `keyhole` printed at its last start"
        )


class SessionExpired(NotAdmitted):
    """The browser was let in too long ago.

    Attributes:
        hours: how long a session lasts.
    """

    code = "session_expired"

    def __init__(self, hours: float) -> None:
        super().__init__(
            f"this browser's session has ended after {hours:g} h: open the address that `keyhole` "
            "printed once more"
        )
        self.hours = hours


class ForeignOrigin(WebRefusal):
    """The request comes from a page of another server.

    Attributes:
        origin: the refused origin.
    """

    code = "foreign_origin"
    status = 403

    def __init__(self, origin: str) -> None:
        super().__init__(
            f"requests from pages of {origin!r} are refused; use the console's own page"
        )
        self.origin = origin


class ForeignHost(WebRefusal):
    """The request names a host that is not this server, as after DNS rebinding.

    Attributes:
        host: the refused name.
        allowed: names under which the server answers.
    """

    code = "foreign_host"
    status = 421

    def __init__(self, host: str, allowed: tuple[str, ...]) -> None:
        super().__init__(f"this server does not answer as {host!r}; use {' or '.join(allowed)}")
        self.host, self.allowed = host, allowed


class BodyTooLarge(WebRefusal):
    """The request's body is larger than any that makes sense.

    Attributes:
        limit_bytes: the largest body that is read.
    """

    code = "body_too_large"
    status = 413

    def __init__(self, limit_bytes: int) -> None:
        super().__init__(f"the body is larger than {limit_bytes} bytes")
        self.limit_bytes = limit_bytes


class NotTheOperator(WebRefusal):
    """Only the operator may do this.

    Attributes:
        operator: who is the operator, or None.
    """

    code = "not_the_operator"
    status = 403

    def __init__(self, operator: str | None) -> None:
        holder = f"{operator} is the operator" if operator else "nobody is the operator"
        super().__init__(f"{holder}; take control first")
        self.operator = operator


class LeaseHeld(WebRefusal):
    """Another operator holds the lease, or it is offered to another.

    Attributes:
        operator: who holds it.
        offered_to: whom it is offered to, or None.
        expires_in_s: when it ends unless it is renewed.
        wanted: who wanted it.
    """

    code = "lease_held"
    status = 409

    def __init__(
        self, operator: str, offered_to: str | None, expires_in_s: float, wanted: str = ""
    ) -> None:
        if offered_to is None:
            text = f"{operator} is the operator; ask for a hand-over or wait for a release"
        else:
            text = f"{operator} has offered control to {offered_to}"
        super().__init__(text)
        self.operator, self.offered_to, self.wanted = operator, offered_to, wanted
        self.expires_in_s = round(expires_in_s, 1)


class NobodyToAsk(WebRefusal):
    """There is no other operator who could be asked for control."""

    code = "nobody_to_ask"
    status = 409

    def __init__(self) -> None:
        super().__init__("nobody else drives; take control")


class AlreadyAsked(WebRefusal):
    """Somebody else asks for control already.

    Attributes:
        operator: who does.
    """

    code = "already_asked"
    status = 409

    def __init__(self, operator: str) -> None:
        super().__init__(f"{operator} asks for control already; wait for the answer")
        self.operator = operator


class HandingOver(WebRefusal):
    """Nothing moves while control is offered to somebody.

    Attributes:
        offered_to: to whom.
    """

    code = "handing_over"
    status = 409

    def __init__(self, offered_to: str) -> None:
        super().__init__(
            f"control is offered to {offered_to}, and nothing moves meanwhile; "
            "withdraw the offer first"
        )
        self.offered_to = offered_to


class OutOfRange(WebRefusal):
    """A number lies outside what the configuration allows.

    Attributes:
        name: the field.
        value: the refused number.
        low: smallest allowed number.
        high: largest allowed number.
    """

    code = "out_of_range"
    status = 422

    def __init__(self, name: str, value: float, low: float, high: float) -> None:
        super().__init__(f"{name} = {value:g} is refused: it must lie between {low:g} and {high:g}")
        self.name, self.value, self.low, self.high = name, value, low, high


class TargetTooFar(WebRefusal):
    """A target lies further from the tip than a target may.

    Attributes:
        distance_mm: how far.
        limit_mm: how far it may be.
    """

    code = "target_too_far"
    status = 422

    def __init__(self, distance_mm: float, limit_mm: float) -> None:
        super().__init__(
            f"the target is {distance_mm:.1f} mm from the tip; the limit is {limit_mm:g} mm: "
            "go there in shorter steps"
        )
        self.distance_mm, self.limit_mm = round(distance_mm, 3), limit_mm


class NotReady(WebRefusal):
    """The robot cannot take this in its present state.

    Attributes:
        state: the safety state, or None where it is not known.
        reason: why.
    """

    code = "not_ready"
    status = 409

    def __init__(self, state: str | None, reason: str) -> None:
        super().__init__(reason)
        self.state, self.reason = state, reason


class DevicesNotReady(WebRefusal):
    """The robot's devices are not ready to be enabled.

    Attributes:
        readiness: a stable word for why.
    """

    code = "devices_not_ready"
    status = 409

    def __init__(self, readiness: str, detail: str) -> None:
        super().__init__(detail)
        self.readiness = readiness


class NotSimulated(WebRefusal):
    """Faults are injected into simulated robots only."""

    code = "not_simulated"
    status = 409

    def __init__(self) -> None:
        super().__init__("this robot is real: it is not broken on purpose")


class RobotNotSelected(WebRefusal):
    """This console drives another robot now.

    Attributes:
        asked: the robot that the request is for.
        driven: the one that is driven.
    """

    code = "robot_not_selected"
    status = 409

    def __init__(self, asked: str, driven: str) -> None:
        super().__init__(
            f"this console drives the robot {driven!r} now; disable it, then "
            f"POST /api/v1/robots/{asked}/select, to drive {asked!r}"
        )
        self.asked, self.driven = asked, driven


class TrocarRefused(WebRefusal):
    """The shaft cannot be meant to go through a trocar at this place.

    Attributes:
        distance_mm: from the shaft's axis.
        farthest_mm: how far it may be.
        lambda_along_shaft: where it stands along the shaft.
        low: smallest allowed lambda.
        high: largest allowed lambda.
    """

    code = "trocar_refused"
    status = 422

    def __init__(
        self,
        distance_mm: float,
        farthest_mm: float,
        lambda_along_shaft: float,
        low: float,
        high: float,
    ) -> None:
        super().__init__(
            f"this place is {distance_mm:.1f} mm from the shaft's axis (at most {farthest_mm:g}) "
            f"at \u03bb = {lambda_along_shaft:.3f} (allowed {low:g} to {high:g}); "
            "check the numbers, they are in mm in the base frame"
        )
        self.distance_mm, self.farthest_mm = round(distance_mm, 3), farthest_mm
        self.lambda_along_shaft, self.low, self.high = round(lambda_along_shaft, 4), low, high


class NotInserted(WebRefusal):
    """The shaft does not go through the trocar as it is registered.

    Attributes:
        distance_mm: from the trocar to the shaft's axis.
        farthest_mm: how far it may be.
        lambda_along_shaft: where the trocar stands along the shaft.
        low: smallest allowed lambda.
        high: largest allowed lambda.
    """

    code = "not_inserted"
    status = 409

    def __init__(
        self,
        distance_mm: float,
        farthest_mm: float,
        lambda_along_shaft: float,
        low: float,
        high: float,
    ) -> None:
        where = f"\u03bb = {lambda_along_shaft:.3f}, allowed {low:g} to {high:g}"
        super().__init__(
            f"the shaft does not go through the trocar: {distance_mm:.1f} mm beside it (at most "
            f"{farthest_mm:g}), {where}; insert the shaft, or register the trocar anew"
        )
        self.distance_mm, self.farthest_mm = round(distance_mm, 3), farthest_mm
        self.lambda_along_shaft, self.low, self.high = round(lambda_along_shaft, 4), low, high


class BoardNeeded(WebRefusal):
    """An experiment is made for another board than the one that stands there.

    Attributes:
        experiment: its name.
        needed: name of its board.
        present: name of the board that stands there.
    """

    code = "board_needed"
    status = 409

    def __init__(self, experiment: str, needed: str, present: str) -> None:
        super().__init__(
            f"{experiment} needs the board {needed}, and {present or 'no board'} is there: "
            f"disable the robot, choose the board {needed}, enable, and start it again"
        )
        self.experiment, self.needed, self.present = experiment, needed, present


class ControlSilent(WebRefusal):
    """The control process does not answer.

    Attributes:
        waited_s: how long it was waited for.
    """

    code = "control_silent"
    status = 503

    def __init__(self, detail: str, waited_s: float = 0.0) -> None:
        super().__init__(detail)
        self.waited_s = waited_s


class UnreadableRequest(WebRefusal):
    """A message or body is not what the interface describes."""

    code = "unreadable_request"
    status = 422


class AlreadyRecording(WebRefusal):
    """One recording is made at a time.

    Attributes:
        file: name of the one that is being made.
    """

    code = "already_recording"
    status = 409

    def __init__(self, file: str) -> None:
        super().__init__(f"{file} is being recorded; stop that first")
        self.file = file


class RecordingFailed(WebRefusal):
    """A recording cannot be made."""

    code = "recording_failed"
    status = 507


class RecorderSilent(ControlSilent):
    """The recorder process does not answer."""

    code = "recorder_silent"


class OnlyAReplay(WebRefusal):
    """This console shows a recording, and there is no robot that could do what was asked."""

    code = "only_a_replay"
    status = 409

    def __init__(self) -> None:
        super().__init__("this is a replay of a recording: there is no robot, and nothing moves")


class NoReplay(WebRefusal):
    """This console shows a robot, not a recording."""

    code = "no_replay"
    status = 404

    def __init__(self) -> None:
        super().__init__("this console shows a robot; show a recording with 'keyhole replay FILE'")


class ReplaySilent(ControlSilent):
    """The replay process does not answer."""

    code = "replay_silent"
