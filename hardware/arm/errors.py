"""Why the real arm cannot be used, by name."""

from __future__ import annotations

from robot.errors import KeyholeError


class ArmLibraryMissing(KeyholeError):
    """The vendor's library is not installed.

    Attributes:
        reason: what the import said.
    """

    code = "arm_library_missing"

    def __init__(self, reason: str) -> None:
        super().__init__(
            f"the real arm needs the package xarm-python-sdk ({reason}); it is the extra "
            "keyhole[xarm]: install it with .venv/bin/pip install -c constraints.txt "
            'xarm-python-sdk, or choose [hardware] arm = "simulated"'
        )
        self.reason = reason


class ArmUnreachable(KeyholeError):
    """The controller cannot be reached, or has stopped answering.

    Attributes:
        address: where it was looked for.
    """

    code = "arm_unreachable"

    def __init__(self, address: str, what: str) -> None:
        super().__init__(
            f"{address}: {what}; check its power, its cable and [hardware] arm_address"
        )
        self.address = address


class WrongArm(KeyholeError):
    """The controller belongs to another arm.

    Attributes:
        axes: how many joints that one has.
    """

    code = "wrong_arm"

    def __init__(self, address: str, axes: int) -> None:
        super().__init__(f"{address}: an arm of {axes} joints, not an xArm 7; correct arm_address")
        self.axes = axes
