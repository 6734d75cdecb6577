"""Reading the configuration file."""

from __future__ import annotations

import json
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

from robot.configuration import Configuration, parse
from robot.errors import ConfigurationError, KeyholeError

_DEFAULT = "keyhole.toml"


class ConfigurationUnreadable(ConfigurationError):
    """The configuration file cannot be read, or is no TOML.

    Attributes:
        file: the file.
        detail: why, with line and column where it is a matter of syntax.
    """

    def __init__(self, file: str, detail: str) -> None:
        KeyholeError.__init__(self, f"{file}: {detail}")
        self.file, self.key, self.value, self.allowed = file, "(whole file)", None, detail
        self.detail = detail


def load(path: Path | str | None = None) -> Configuration:
    """Read and validate a configuration file; without one, the configuration that comes along.

    A file whose name ends in ``.json`` is read as JSON, every other as TOML.

    Raises:
        ConfigurationError: the file cannot be read or parsed, or holds a wrong value; the
            message is one line with the file, the place and the reason.
    """
    if path is None:
        content = resources.files("robot").joinpath(_DEFAULT).read_bytes()
        name = _DEFAULT
    else:
        name = str(path)
        try:
            content = Path(path).read_bytes()
        except OSError as error:
            raise ConfigurationUnreadable(name, error.strerror or "cannot be read") from None
    try:
        table = _parse_json(content) if name.endswith(".json") else tomllib.loads(content.decode())
    except UnicodeDecodeError as error:
        raise ConfigurationUnreadable(name, f"is not UTF-8 at byte {error.start}") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigurationUnreadable(name, f"is not TOML: {error}") from None
    except json.JSONDecodeError as error:
        raise ConfigurationUnreadable(name, f"is not JSON: {error}") from None
    return parse(table, name)


def _parse_json(content: bytes) -> dict[str, Any]:
    table = json.loads(content.decode())
    return table if isinstance(table, dict) else {}
