"""Why the instrument module cannot be used yet, by name. Ids are those of the servos."""

from __future__ import annotations

from collections.abc import Sequence

from robot.errors import KeyholeError


class ModuleError(KeyholeError):
    """Base class of what keeps the instrument module from working.

    Attributes:
        servos: ids of the servos concerned.
    """

    code = "instrument_module"

    def __init__(self, servos: Sequence[int], message: str) -> None:
        names = " ".join(str(servo) for servo in servos)
        super().__init__(f"servo{'s' * (len(servos) > 1)} {names}: {message}")
        self.servos = tuple(servos)


class WrongModel(ModuleError):
    """A servo is not an XL430-W250.

    Attributes:
        model: the number that it gives.
    """

    code = "wrong_servo_model"

    def __init__(self, servo: int, model: int) -> None:
        super().__init__([servo], f"model {model} is no XL430-W250; correct [servos] ids")
        self.model = model


class NeedsRelease(ModuleError):
    """Settings must be written that a servo takes only without torque.

    Attributes:
        registers: their names.
    """

    code = "servo_needs_release"

    def __init__(self, servo: int, registers: Sequence[str]) -> None:
        names = ", ".join(registers)
        super().__init__([servo], f"{names} can be set without torque only: release, then home")
        self.registers = tuple(registers)


class NeverTaut(ModuleError):
    """A tendon did not become taut within the homing range.

    Attributes:
        travel_deg: how far each was pulled.
    """

    code = "tendon_never_taut"

    def __init__(self, servos: Sequence[int], travel_deg: float) -> None:
        super().__init__(
            servos,
            f"not taut after {travel_deg:.0f} deg: the tendon is slack or torn; wind it up by hand "
            "or raise [servos] homing_range_deg",
        )
        self.travel_deg = travel_deg


class NeverLoose(ModuleError):
    """A tendon stays under load although it was let out by the whole homing range.

    Attributes:
        travel_deg: how far it was let out.
    """

    code = "tendon_never_loose"

    def __init__(self, servos: Sequence[int], travel_deg: float) -> None:
        super().__init__(
            servos,
            f"still under load after {travel_deg:.0f} deg were let out: the tendon is wound up too "
            "far or caught; let it out by hand",
        )
        self.travel_deg = travel_deg


class WrongDirection(ModuleError):
    """A servo becomes taut when it turns the other way than configured."""

    code = "servo_direction"

    def __init__(self, servo: int, direction: int) -> None:
        super().__init__(
            [servo],
            f"turns the wrong way: set its [servos] directions to {-direction}, then home",
        )
        self.direction = direction


class WrongTendon(ModuleError):
    """Pulling at a servo loads another than the one opposite to it.

    Attributes:
        loaded: id of the servo that was loaded.
        opposite: id of the one that should have been.
    """

    code = "wrong_tendon"

    def __init__(self, servo: int, loaded: int, opposite: int) -> None:
        super().__init__(
            [servo],
            f"pulling it loads {loaded} rather than {opposite}: put [servos] ids in the order of "
            "the tendons, then home",
        )
        self.loaded, self.opposite = loaded, opposite


class NoRoom(ModuleError):
    """The range around the zero does not fit into the servo's one turn.

    Attributes:
        zero: tick of the straight segment.
        needed: ticks on either side that the largest bend takes, and some more.
    """

    code = "servo_no_room"

    def __init__(self, servo: int, zero: int, needed: int) -> None:
        super().__init__(
            [servo],
            f"straight is at tick {zero}, which leaves less than {needed} ticks to an end; "
            "turn the spool on its shaft so that it is near 2048, then home",
        )
        self.zero, self.needed = zero, needed
