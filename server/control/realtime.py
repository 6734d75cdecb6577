"""Real-time scheduling and priority where the system permits them, plain words where it does not.

SCHED_FIFO is the one large gain: it keeps a drawing browser from delaying the control loop by
milliseconds. Locked memory keeps page faults out of the loop.
"""

from __future__ import annotations

import ctypes
import gc
import os
import resource
import sys
from pathlib import Path

PRIORITY = 60
"""Above threaded interrupt handlers (50), below the kernel's own watchdogs (99)."""

PREFERENCE = -15
"""Niceness of the process that hands the operator's motion on, where it may be below 0."""

_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
_PR_SET_TIMERSLACK = 29


def enter(wanted: str, priority: int = PRIORITY) -> str:
    """Make the calling thread a real-time thread and lock the memory of its process.

    Threads that it starts later are ordinary ones. An ordinary thread that holds the interpreter
    when the system puts it aside makes this one wait: start none that does more than wait itself.

    Args:
        wanted: "auto" to do what is permitted, "off" to do nothing.
        priority: under SCHED_FIFO.

    Returns:
        "SCHED_FIFO", with what is missing beside it, or "off: " and the reason.
    """
    _quiet_collector()
    if wanted == "off":
        return "off: switched off in the configuration ([control] realtime)"
    refusal = _schedule(priority)
    if refusal:
        _shorten_timer_slack()
        return f"off: {refusal}"
    refusal = lock_memory()
    return f"SCHED_FIFO, memory not locked: {refusal}" if refusal else "SCHED_FIFO"


def prefer() -> bool:
    """Let this process wait less for a processor than ordinary ones; call before its threads start.

    A browser that draws in software takes all it can get: on two cores the samples of a dragged
    gizmo then came 0.1 to 0.4 s late, which control must take for a leader that has gone silent.

    Returns:
        Whether the system permitted it, which takes the right to a niceness below 0.
    """
    try:
        os.setpriority(os.PRIO_PROCESS, 0, PREFERENCE)
        # Where sessions share the processors, niceness counts within a session only.
        group = Path("/proc/self/autogroup")
        if os.getsid(0) == os.getpid() and group.exists():
            group.write_text(str(PREFERENCE), encoding="ascii")
    except OSError:
        return False
    return True


def _quiet_collector() -> None:
    gc.collect()
    gc.freeze()
    gc.disable()


def _schedule(priority: int) -> str:
    """Ask for SCHED_FIFO; returns why not, or nothing."""
    if not hasattr(os, "sched_setscheduler"):
        return "this system has no SCHED_FIFO"
    # Threads started later from this one must not become real-time threads too.
    policy = os.SCHED_FIFO | getattr(os, "SCHED_RESET_ON_FORK", 0)
    try:
        os.sched_setscheduler(0, policy, os.sched_param(priority))
    except PermissionError:
        limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[1]
        return (
            f"SCHED_FIFO is not permitted (rtprio limit {limit}, {PRIORITY} needed); "
            f"give the user 'rtprio {PRIORITY}' in /etc/security/limits.d and log in again"
        )
    except OSError as error:
        return f"SCHED_FIFO: {error.strerror}"
    return ""


def lock_memory() -> str:
    """Keep every page that was touched in memory; returns why not, or nothing."""
    try:
        mlockall = ctypes.CDLL(None, use_errno=True).mlockall
    except (OSError, AttributeError):
        return "this system has no mlockall"
    soft, hard = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if hard == resource.RLIM_INFINITY and soft != hard:
        resource.setrlimit(resource.RLIMIT_MEMLOCK, (hard, hard))
    unlimited = hard == resource.RLIM_INFINITY or os.geteuid() == 0
    # Under a limit, locking the future would let an ordinary allocation fail some day.
    flags = _MCL_CURRENT | _MCL_ONFAULT | (_MCL_FUTURE if unlimited else 0)
    if mlockall(flags) == 0:
        return ""
    reason = os.strerror(ctypes.get_errno())
    return f"{reason} (memlock limit {hard} bytes; give the user 'memlock unlimited')"


def _shorten_timer_slack() -> None:
    """Wake ordinary threads when asked, not up to 50 µs later; real-time threads have no slack."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1000, 0, 0, 0)
