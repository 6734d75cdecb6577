"""The private directory that the processes of one console share.

It belongs to the supervisor, which alone makes and removes what is in it: the lock, the token, the
validated configuration, and the mapped files. The other processes open it by its path.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import secrets
import stat
import tempfile
from pathlib import Path
from typing import Any

from robot.calibration import Calibration
from robot.configuration import Configuration
from robot.errors import KeyholeError

_LOCK = "console.lock"
_CONTROL_LOCK = "control.lock"
_TOKEN = "token"
_CONFIGURATION = "configuration.json"
_CALIBRATION = "calibration.json"
_CONSOLE = "console.json"


class RunDirectoryError(KeyholeError):
    """The run directory cannot be used.

    Attributes:
        path: the directory.
    """

    code = "run_directory"

    def __init__(self, path: Path, detail: str) -> None:
        super().__init__(f"run directory {path}: {detail}")
        self.path = path


class AlreadyRunning(KeyholeError):
    """Another console holds the run directory.

    Attributes:
        path: the directory.
        console: what the other console wrote about itself (``pid``, ``address``), maybe empty.
    """

    code = "already_running"

    def __init__(self, path: Path, console: dict[str, Any]) -> None:
        who = f"process {console['pid']}, {console['address']}" if console else "address unknown"
        super().__init__(
            f"another console is running ({who}); stop it first, "
            f"or start this one with its own --run-directory (now {path})"
        )
        self.path, self.console = path, console


def default_path() -> Path:
    """Where the run directory is by default: on a memory file system where there is one.

    On a disk the writing back of mapped pages would stall the control process.
    """
    name = f"keyhole-{os.getuid()}"
    for parent in (os.environ.get("XDG_RUNTIME_DIR", ""), "/dev/shm"):
        if parent and os.path.isdir(parent) and os.access(parent, os.W_OK | os.X_OK):
            return Path(parent) / name
    return Path(tempfile.gettempdir()) / name


def _make_private(path: Path) -> None:
    """Make the directory, or accept one that exists if it is ours, real and closed to others."""
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = path.lstat()
    except OSError as error:
        raise RunDirectoryError(path, error.strerror or "cannot be made") from None
    if not stat.S_ISDIR(found.st_mode):
        raise RunDirectoryError(path, "is not a directory")
    if found.st_uid != os.getuid():
        raise RunDirectoryError(path, "belongs to another user")
    if stat.S_IMODE(found.st_mode) & 0o077:
        raise RunDirectoryError(path, f"is open to others; close it with: chmod 700 {path}")


def _lock(path: Path) -> int | None:
    """A descriptor that holds the lock until it is closed, or None when another holds it."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


class RunDirectory:
    """The files of one running console.

    The supervisor takes it with :meth:`take`; every other process opens it with the constructor.

    Args:
        path: an existing run directory.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self._lock: int | None = None

    @classmethod
    def take(cls, path: Path | str) -> RunDirectory:
        """Make the directory where needed, lock it, and clear what an earlier console left.

        Raises:
            AlreadyRunning: another console holds it.
            RunDirectoryError: it cannot be made, or others could look into it.
        """
        directory = cls(path)
        _make_private(directory.path)
        lock = _lock(directory.path / _LOCK)
        if lock is None:
            raise AlreadyRunning(directory.path, directory._console_or_nothing())
        directory._lock = lock
        directory._clear()
        return directory

    def _clear(self) -> None:
        for entry in self.path.iterdir():
            # The lock files stay: removing one that another process opens would make two locks.
            if entry.name not in (_LOCK, _CONTROL_LOCK) and entry.is_file():
                entry.unlink()

    def give_back(self) -> None:
        """Remove the files and let the lock go. Harmless when the directory was not taken."""
        if self._lock is None:
            return
        with contextlib.suppress(OSError):
            self._clear()
        os.close(self._lock)
        self._lock = None

    def lock_control(self) -> int | None:
        """The lock that only one control process holds: a descriptor to keep, or None if taken.

        It outlives a killed supervisor until its control process has ended, so that never two
        of them drive one robot.
        """
        return _lock(self.path / _CONTROL_LOCK)

    def write(self, name: str, content: bytes) -> Path:
        """Write a file, closed to others, that appears whole or not at all; returns its path."""
        unfinished = self.path / f".{name}.new"
        descriptor = os.open(
            unfinished, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600
        )
        with open(descriptor, "wb") as file:
            file.write(content)
        os.replace(unfinished, self.path / name)
        return self.path / name

    def new_token(self) -> str:
        """Make and store this console's token (url-safe, 192 random bits)."""
        token = secrets.token_urlsafe(24)
        self.write(_TOKEN, token.encode())
        return token

    def token(self) -> str:
        """This console's token."""
        return self._read(_TOKEN).decode()

    def write_configuration(self, configuration: Configuration) -> None:
        """Store the validated configuration that every process of this console uses."""
        self.write(_CONFIGURATION, configuration.model_dump_json().encode())

    def configuration(self) -> Configuration:
        """The configuration of this console, as the supervisor validated it at the start."""
        return Configuration.model_validate_json(self._read(_CONFIGURATION))

    def change_robot(self, configuration: Configuration) -> None:
        """From now on this console drives the robot of another ``configuration``."""
        self.write_configuration(configuration)
        self.write_console(self.console() | {"robot": configuration.robot})
        # The calibration of the robot before; the next one's control finds its own.
        (self.path / _CALIBRATION).unlink(missing_ok=True)

    def write_calibration(self, calibration: Calibration) -> None:
        """Store the calibration that every process of this console uses."""
        self.write(_CALIBRATION, calibration.model_dump_json().encode())

    def calibration(self) -> Calibration | None:
        """The calibration of this console; None where the tendons are taken as ideal."""
        try:
            content = (self.path / _CALIBRATION).read_bytes()
        except OSError:
            return None
        return Calibration.model_validate_json(content)

    def write_console(self, console: dict[str, Any]) -> None:
        """Store what others may know of this console (``pid``, ``host``, ``port`` ...)."""
        self.write(_CONSOLE, json.dumps(console).encode())

    def console(self) -> dict[str, Any]:
        """What the supervisor wrote: ``pid, host, port, address, robot, started_ns``."""
        found = json.loads(self._read(_CONSOLE))
        if not isinstance(found, dict):
            raise RunDirectoryError(self.path, f"{_CONSOLE} is damaged")
        return found

    def _console_or_nothing(self) -> dict[str, Any]:
        try:
            return self.console()
        except (KeyholeError, ValueError):
            return {}

    def _read(self, name: str) -> bytes:
        try:
            return (self.path / name).read_bytes()
        except OSError as error:
            detail = f"{name}: {error.strerror}; is a console running there?"
            raise RunDirectoryError(self.path, detail) from None
