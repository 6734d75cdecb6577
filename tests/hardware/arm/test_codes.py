"""The table of codes, and addresses of controllers."""

from __future__ import annotations

import pytest
from xarm.core.config.x_code import ControllerErrorCodeMap, ControllerWarnCodeMap

from hardware.arm.address import ArmAddress, InvalidArmAddress, arm_address
from hardware.arm.codes import ERRORS, WARNINGS, error_message, warning_message
from hardware.devices import TEXT


def test_every_message_fits_and_says_what_to_do() -> None:
    messages = [*map(error_message, range(256)), *map(warning_message, range(256))]
    assert all(len(message.encode()) <= TEXT and ";" in message for message in messages)
    assert "joint 7" in error_message(17)


def test_the_codes_are_ones_that_the_vendor_knows() -> None:
    assert ERRORS.keys() <= ControllerErrorCodeMap.keys()
    assert WARNINGS.keys() <= ControllerWarnCodeMap.keys()


def test_the_words_are_our_own() -> None:
    for table, theirs in ((ERRORS, ControllerErrorCodeMap), (WARNINGS, ControllerWarnCodeMap)):
        for code, meaning in table.items():
            assert meaning.what not in str(theirs[code])


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("192.168.1.203", ArmAddress("192.168.1.203", 502)),
        ("127.0.0.1:5020", ArmAddress("127.0.0.1", 5020)),
        (" localhost ", ArmAddress("127.0.0.1", 502)),
    ],
)
def test_addresses(text: str, address: ArmAddress) -> None:
    assert arm_address(text) == address
    assert arm_address(str(address)) == address


@pytest.mark.parametrize("text", ["", "arm.local", "192.168.1", "1.2.3.4:0", "1.2.3.4:70000"])
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(InvalidArmAddress, match="arm_address"):
        arm_address(text)
