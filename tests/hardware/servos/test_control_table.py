"""The control table holds together."""

from __future__ import annotations

from itertools import pairwise

import pytest

from hardware.servos.control_table import BAUD_RATES, PRESENT, TABLE, Register


def test_no_two_registers_overlap() -> None:
    for before, after in pairwise(TABLE.values()):
        assert before.end <= after.address, (before.name, after.name)


@pytest.mark.parametrize("register", TABLE.values(), ids=lambda register: register.name)
def test_a_registers_range_can_be_written_and_read_back(register: Register) -> None:
    assert register.minimum <= register.initial <= register.maximum
    assert register.eeprom == (register.address < 64)
    for value in {register.minimum, register.initial, register.maximum}:
        data = register.encode(value)
        assert len(data) == register.size
        assert register.decode(data) == value


def test_a_cycle_reads_21_bytes_from_the_load() -> None:
    assert PRESENT == (126, 147)


def test_the_paper_and_the_bench_know_their_baud_rates() -> None:
    assert (BAUD_RATES.index(57_600), BAUD_RATES.index(1_000_000)) == (1, 3)
