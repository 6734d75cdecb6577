"""Reading the configuration file."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path

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

    Raises:
        ConfigurationError: the file cannot be read, is no TOML, or holds a wrong value; the
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
        table = tomllib.loads(content.decode())
    except UnicodeDecodeError as error:
        raise ConfigurationUnreadable(name, f"is not UTF-8 at byte {error.start}") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigurationUnreadable(name, f"is not TOML: {error}") from None
    return parse(table, name)
