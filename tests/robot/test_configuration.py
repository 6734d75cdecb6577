"""The configuration refuses what the robot could not be built from."""

from __future__ import annotations

import tomllib
from importlib import resources
from typing import Any

import pytest

from robot.configuration import parse
from robot.errors import ConfigurationError


def table() -> dict[str, Any]:
    return tomllib.loads(resources.files("robot").joinpath("keyhole.toml").read_text())


@pytest.mark.parametrize(
    ("section", "key", "value", "expected"),
    [
        ("start", "shaft_direction", [0.0, 0.0, 0.0], "a direction must not be zero"),
        ("start", "bend_direction_up", [0.6, 0.0, -0.8], "must not point along"),
        ("trocar", "wall_normal", [0.0, 0.0, 0.0], "a direction must not be zero"),
        ("module", "bend_direction", [1.0, 0.0, 0.0], "must be perpendicular"),
        ("limits", "lambda_min", 0.99, "lambda_min must be below lambda_max"),
        ("limits", "bend_deg", 171.0, "less than or equal to 170"),
        ("limits", "bend_deg", float("nan"), "Input should be"),
        ("commands", "speed_min_mm_s", 61.0, "must not exceed speed_max_mm_s"),
        ("instrument", "tendon_pitch_radius_m", 0.0023, "inside disk_diameter_m"),
        ("priority", "case", "3", "Input should be"),
        ("start", "bend_deg", 95.0, "start.bend_deg must not exceed limits.bend_deg"),
        ("server", "nonsense", 1, "Extra inputs are not permitted"),
    ],
)
def test_a_wrong_value_names_file_key_and_what_is_allowed(
    section: str, key: str, value: object, expected: str
) -> None:
    wrong = table()
    wrong[section][key] = value
    with pytest.raises(ConfigurationError) as refusal:
        parse(wrong, "lab.toml")
    message = str(refusal.value)
    assert message.startswith("lab.toml: ")
    assert expected in message
    assert "Value error" not in message
    assert "\n" not in message


def test_the_hash_tells_configurations_apart() -> None:
    other = table()
    other["limits"]["bend_deg"] = 80.0
    assert parse(table(), "a").hash64() == parse(table(), "b").hash64()
    assert parse(table(), "a").hash64() != parse(other, "a").hash64()
