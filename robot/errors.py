"""The one base class of every refusal, and the refusals that concern the robot itself."""

from __future__ import annotations


class KeyholeError(Exception):
    """Base class of every error that Keyhole raises on purpose.

    A message tells in one line what happened, where, and what to do. ``code`` is a stable word for
    programs (it travels in API problem documents); subclasses carry their data as attributes.
    """

    code = "error"


class ConfigurationError(KeyholeError):
    """A configuration value cannot be used.

    Attributes:
        file: where the value was read from.
        key: dotted key, for example ``limits.bend_deg``.
        value: the refused value; None where it is missing or the whole table is meant.
        allowed: the allowed range or form in words.
    """

    code = "configuration"

    def __init__(self, file: str, key: str, value: object, allowed: str) -> None:
        written = "" if value is None else f" = {value!r}"
        super().__init__(f"{file}: {key}{written} is refused: {allowed}")
        self.file, self.key, self.value, self.allowed = file, key, value, allowed


class UnknownName(KeyholeError):
    """A name is not one of those that exist.

    Attributes:
        kind: what is named (``experiment``, ``priority case`` ...).
        name: the unknown name.
        known: the names that exist.
    """

    code = "unknown_name"

    def __init__(self, kind: str, name: object, known: tuple[str, ...]) -> None:
        super().__init__(f"unknown {kind} {name!r}; choose one of: {', '.join(known)}")
        self.kind, self.name, self.known = kind, name, known


class UnreachableStart(KeyholeError):
    """No arm posture puts the shaft through the trocar as the start asks.

    Attributes:
        position_error_m: what is left of the shaft base's position.
        orientation_error_rad: what is left of the shaft's orientation.
    """

    code = "unreachable_start"

    def __init__(self, position_error_m: float, orientation_error_rad: float) -> None:
        super().__init__(
            "the start cannot be reached by the arm: "
            f"{position_error_m * 1e3:.1f} mm and {orientation_error_rad:.3f} rad remain; "
            "move [trocar] position_m or turn [start] shaft_direction"
        )
        self.position_error_m = position_error_m
        self.orientation_error_rad = orientation_error_rad


class InvalidPose(KeyholeError):
    """A pose holds NaN or infinity, or a quaternion that is (nearly) zero.

    Attributes:
        what: which pose was refused.
    """

    code = "invalid_pose"

    def __init__(self, what: str, detail: str) -> None:
        super().__init__(f"{what}: {detail}")
        self.what = what
