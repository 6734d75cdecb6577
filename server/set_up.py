"""Make ``.venv`` beside the checkout when it is missing or outdated, then become the real program.

``./keyhole`` calls this file with a bare Python, so it imports the standard library only. The
environment is built aside, stamped, and moved into place when complete: ``.venv`` is either whole
or absent, whenever an earlier set-up was interrupted.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn

ROOT = Path(__file__).resolve().parent.parent
HOME = ROOT / ".venv"
LOG = ROOT / ".venv.log"
STAMP = "keyhole-stamp"
TESTS_STAMP = "keyhole-tests-stamp"
TESTS_UNFINISHED = "keyhole-tests-unfinished"


class SetUpError(Exception):
    """The set-up cannot go on; the message says in one line why and what to do."""


def main(arguments: Sequence[str]) -> int:
    """Set up what ``arguments`` need and replace this process by the program or the test run.

    Args:
        arguments: those of ``./keyhole``; a first ``test`` runs the tests with the rest.

    Returns:
        The exit status of a set-up that failed; after one that succeeds nothing returns.
    """
    signal.signal(signal.SIGTERM, _terminate)
    for name in ("PYTHONPATH", "PYTHONHOME"):
        os.environ.pop(name, None)
    testing = list(arguments[:1]) == ["test"]
    try:
        ensure(tests=testing)
        python = str(HOME / "bin" / "python")
        if testing:
            os.execv(python, [python, str(ROOT / "tests" / "run_all.py"), *arguments[1:]])
        program = str(HOME / "bin" / "keyhole")
        os.execv(program, [program, *arguments])
    except (SetUpError, OSError) as error:
        _say(str(error))
        return 1
    except KeyboardInterrupt:
        _say("interrupted; the next ./keyhole sets up anew")
        return 130


def ensure(*, tests: bool) -> None:
    """Make ``.venv`` whole, with what the tests need if asked; returns at once when it is.

    Args:
        tests: also install the ``test`` extra.

    Raises:
        SetUpError: a part of Python is missing, or an installation failed.
        OSError: the checkout cannot be written.
    """
    digest = _digest()
    if _current(digest, tests=tests):
        return
    with _lock() as lock:
        if _current(digest, tests=tests):
            return
        began = time.monotonic()
        if not _current(digest, tests=False) or (HOME / TESTS_UNFINISHED).exists():
            _build(digest, lock)
        if tests:
            _install_tests(digest, lock)
        _say(f"set up in {time.monotonic() - began:.0f} s")


def missing_part() -> str | None:
    """Name the command that installs what this Python lacks to make environments, if anything."""
    if importlib.util.find_spec("venv") and importlib.util.find_spec("ensurepip"):
        return None
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    sudo = "" if os.geteuid() == 0 else "sudo "
    if shutil.which("apt-get"):
        return f"{sudo}apt-get install python{version}-venv"
    return f"the package of your system that holds the modules venv and ensurepip of {version}"


def _digest() -> str:
    """Hash of everything that the environment depends on: pins, project, interpreter, place."""
    project = _project()
    packaging = project.get("tool", {}).get("setuptools")
    relevant = [project["build-system"], project["project"], packaging]
    digest = hashlib.sha256(json.dumps(relevant, sort_keys=True).encode())
    digest.update((ROOT / "constraints.txt").read_bytes())
    digest.update(f"{sys.version_info[:2]} {os.fsencode(ROOT)!r}".encode())
    return digest.hexdigest()


def _project() -> dict[str, Any]:
    with (ROOT / "pyproject.toml").open("rb") as file:
        return tomllib.load(file)


def _current(digest: str, *, tests: bool) -> bool:
    names = (STAMP, TESTS_STAMP) if tests else (STAMP,)
    return all(_read(HOME / name) == digest for name in names) and _starts()


def _starts() -> bool:
    """Tell whether the environment's interpreter still runs; its system may have replaced it."""
    if Path(sys.prefix) == HOME:
        return True
    try:
        command = [str(HOME / "bin" / "python"), "-I", "-c", ""]
        return subprocess.run(command, capture_output=True, check=False).returncode == 0
    except OSError:
        return False


def _read(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8")
    except OSError:
        return None


@contextlib.contextmanager
def _lock() -> Iterator[int]:
    """Hold the set-up for this process and its children, so that none writes beside another."""
    with (ROOT / ".venv.lock").open("w", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            _say("another set-up is running; waiting for it")
            fcntl.flock(file, fcntl.LOCK_EX)
        yield file.fileno()


def _build(digest: str, lock: int) -> None:
    """Build the environment aside and move it into place."""
    command = missing_part()
    if command:
        raise SetUpError(f"this Python cannot make environments; install: {command}")
    _remove_leftovers()
    LOG.write_text("", encoding="utf-8")
    aside = ROOT / f".venv.partial-{os.getpid()}"
    version = ".".join(map(str, sys.version_info[:3]))
    _say(f"setting up .venv with Python {version}, once; this takes about a minute")
    # Inside an outdated .venv its own interpreter runs this file.
    base = getattr(sys, "_base_executable", sys.executable)
    _run(
        [base, "-I", "-m", "venv", "--prompt", "keyhole", str(aside)],
        "making the environment",
        lock,
    )
    builders: list[str] = _project()["build-system"]["requires"]
    if builders:
        _pip(aside, builders, "installing what builds the package", lock)
    wanted = ["--no-build-isolation", "-e", "."]
    _pip(aside, wanted, "installing the pinned packages", lock)
    if (ROOT / "server" / "compile_controller.py").exists():
        _compile(aside, lock)
    _rename_inside(aside)
    (aside / STAMP).write_text(digest, encoding="utf-8")
    if HOME.exists() or HOME.is_symlink():
        HOME.rename(ROOT / f".venv.old-{os.getpid()}")
    aside.rename(HOME)
    _remove_leftovers()


def _compile(environment: Path, lock: int) -> None:
    """Fill the cache of compiled functions, so that the first start is as quick as later ones."""
    command = [str(environment / "bin" / "python"), "-m", "server.compile_controller"]
    try:
        _run(command, "compiling the controller (once)", lock)
    except SetUpError as error:
        _say(f"{error}; going on without")


def _remove_leftovers() -> None:
    for leftover in (*ROOT.glob(".venv.partial-*"), *ROOT.glob(".venv.old-*")):
        if leftover.is_symlink():
            leftover.unlink()
        else:
            shutil.rmtree(leftover)


def _install_tests(digest: str, lock: int) -> None:
    """Add the ``test`` extra in place; a mark tells the next run if this one does not finish."""
    (HOME / TESTS_UNFINISHED).touch()
    names: list[str] = _project()["project"].get("optional-dependencies", {}).get("test", [])
    if names:
        _pip(HOME, names, "installing what the tests need", lock)
    (HOME / TESTS_STAMP).write_text(digest, encoding="utf-8")
    (HOME / TESTS_UNFINISHED).unlink()


def _pip(environment: Path, wanted: list[str], title: str, lock: int) -> None:
    pip = [str(environment / "bin" / "python"), "-I", "-m", "pip", "--no-input"]
    options = ["--disable-pip-version-check", "--only-binary", ":all:", "-c", "constraints.txt"]
    _run([*pip, "install", *options, *wanted], title, lock)


def _run(command: list[str], title: str, lock: int) -> None:
    """Run ``command`` in the checkout with its output in the log, whose end explains a failure."""
    _say(title)
    with LOG.open("a", encoding="utf-8") as log:
        log.write(f"\n# {title}\n")
        log.flush()
        result = subprocess.run(
            command,
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            pass_fds=(lock,),
            check=False,
        )
    if result.returncode:
        lines = LOG.read_text(encoding="utf-8", errors="replace").splitlines()
        sys.stderr.write("".join(f"    {line}\n" for line in lines[-12:]))
        raise SetUpError(f"{title} failed; the whole output is in {LOG}")


def _rename_inside(aside: Path) -> None:
    """Write the final place into the scripts, which name their interpreter by its full path."""
    before, after = os.fsencode(aside), os.fsencode(HOME)
    for path in (aside / "pyvenv.cfg", *(aside / "bin").iterdir()):
        if path.is_symlink() or not path.is_file():
            continue
        content = path.read_bytes()
        if before in content and b"\0" not in content:
            path.write_bytes(content.replace(before, after))


def _terminate(_number: int, _frame: object) -> NoReturn:
    raise SystemExit(143)


def _say(message: str) -> None:
    print(f"keyhole: {message}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
