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

    def __init__(self) -> None:
        super().__init__(
            "this needs the console's token: open the address that `keyhole` printed, "
            "or send the header `Authorization: Bearer TOKEN`"
        )


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
    """

    code = "lease_held"
    status = 409

    def __init__(self, operator: str, offered_to: str | None, expires_in_s: float) -> None:
        if offered_to is None:
            text = f"{operator} is the operator; ask for a hand-over or wait for a release"
        else:
            text = f"{operator} has offered control to {offered_to}"
        super().__init__(text)
        self.operator, self.offered_to = operator, offered_to
        self.expires_in_s = round(expires_in_s, 1)


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
