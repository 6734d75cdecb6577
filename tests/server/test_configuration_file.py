"""Reading configuration files: every broken one is refused in one line that says where."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot.errors import ConfigurationError
from server.configuration_file import load

DEFAULT = Path(__file__).resolve().parents[2] / "robot" / "keyhole.toml"


def test_without_a_file_the_own_configuration_is_used() -> None:
    assert load() == load(DEFAULT)


def test_a_json_copy_is_the_same_configuration(tmp_path: Path) -> None:
    copy = tmp_path / "copy.json"
    copy.write_text(load().model_dump_json())
    assert load(copy) == load()
    assert load(copy).hash64() == load().hash64()


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.toml", b"[limits", "is not TOML: "),
        ("a.toml", b"schema_version = 1\nx = =", "line 2"),
        ("a.toml", b"\xff\xfe", "is not UTF-8 at byte 0"),
        ("a.toml", b"", "schema_version is refused: Field required"),
        ("a.json", b"{", "is not JSON: "),
        ("a.json", b"[1]", "schema_version is refused: Field required"),
    ],
)
def test_broken_files_are_refused(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(ConfigurationError) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_wrong_values_are_refused_with_key_and_range(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(DEFAULT.read_text().replace("rate_hz = 500.0", "rate_hz = 5"))
    with pytest.raises(ConfigurationError, match=r"control\.rate_hz = 5 is refused: .* 10"):
        load(path)


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="No such file"):
        load(tmp_path / "none.toml")
    with pytest.raises(ConfigurationError, match="Is a directory"):
        load(tmp_path)
