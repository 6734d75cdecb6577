"""The machine without its devices: configuration, run directory, real-time scheduling, memory."""

from __future__ import annotations

import os
import resource
import shutil
import sys
import threading
from pathlib import Path

from robot.configuration import Configuration
from robot.errors import KeyholeError
from server.configuration_file import load
from server.control.realtime import PRIORITY
from server.doctor.finding import Finding, failure, fine, warning
from server.memory.run_directory import AlreadyRunning, RunDirectory, RunDirectoryError

_ENOUGH_BYTES = 256 * 2**20
_LIMITS = "/etc/security/limits.d/keyhole.conf"


def configuration(path: Path | None) -> tuple[Configuration, Finding]:
    """The configuration to examine by, and what is to be said of it.

    Args:
        path: file that the user means; None for the one that comes along.
    """
    try:
        found = load(path)
    except KeyholeError as error:
        finding = failure(
            "configuration",
            str(error),
            "nothing starts with this file; the rest is examined with the one that comes along",
            "correct the value; docs/configuration.md lists every key with its range",
        )
        return load(), finding
    name = "the one that comes along" if path is None else str(path)
    return found, fine("configuration", f"{name}: valid")


def run_directory(path: Path) -> Finding:
    """Whether a console could use this directory; it is free again afterwards."""
    area = "run directory"
    try:
        RunDirectory.take(path).give_back()
    except AlreadyRunning as error:
        return warning(
            area,
            f"{path}: another console is running there",
            "its devices are in use, so that what is said of them here may be incomplete",
            "end that console, or take another --run-directory",
            **error.console,
        )
    except RunDirectoryError as error:
        return failure(area, str(error), "the console does not start", "repair it, or remove it")
    free = shutil.disk_usage(path).free
    if free < _ENOUGH_BYTES:
        return warning(
            area,
            f"{path}: {free / 2**20:.0f} MiB are free",
            "the console keeps the last seconds of every tick there",
            "make room on that file system",
            free_bytes=free,
        )
    return fine(area, f"{path}: {free / 2**20:.0f} MiB are free", free_bytes=free)


def scheduling() -> Finding:
    """Whether a thread may become a real-time thread; one is made to try, and ends at once."""
    area = "real time"
    if not hasattr(os, "sched_setscheduler"):
        return warning(
            area,
            f"{sys.platform} has no SCHED_FIFO",
            "other programs can delay a tick by tens of milliseconds",
            "use Linux where a real robot is driven",
        )
    refused: list[OSError] = []

    def attempt() -> None:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        except OSError as error:
            refused.append(error)

    thread = threading.Thread(target=attempt)
    thread.start()
    thread.join()
    if not refused:
        return fine(area, "SCHED_FIFO is permitted", priority=PRIORITY)
    limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[1]
    return warning(
        area,
        f"SCHED_FIFO is refused ({refused[0].strerror}; rtprio limit {limit})",
        "other programs can delay a tick by tens of milliseconds, and the servos' watchdog or "
        "ours then stops the motion",
        f"as root: echo '{_user()} - rtprio {PRIORITY}' >> {_LIMITS}; then log in again",
        rtprio_limit=limit,
    )


def memory() -> Finding:
    """Whether a process may lock its memory."""
    area = "memory"
    hard = resource.getrlimit(resource.RLIMIT_MEMLOCK)[1]
    if hard == resource.RLIM_INFINITY or os.geteuid() == 0:
        return fine(area, "may be locked")
    return warning(
        area,
        f"only {hard / 2**20:.0f} MiB may be locked",
        "a page that was put aside delays the tick that needs it",
        f"as root: echo '{_user()} - memlock unlimited' >> {_LIMITS}; then log in again",
        memlock_limit_bytes=hard,
    )


def processors() -> Finding:
    """Whether there is a core for control and one for the rest."""
    count = (
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
    if count >= 2:
        return fine("processors", f"{count} cores", cores=count)
    return warning(
        "processors",
        "one core",
        "page and scene take the time that control needs",
        "use a machine with two cores or more, or watch the page from another machine",
        cores=count,
    )


def _user() -> str:
    return os.environ.get("SUDO_USER") or os.environ.get("USER") or str(os.getuid())
