"""Real-time scheduling where the system permits it, and plain words where it does not.

SCHED_FIFO is the one large gain: it keeps a drawing browser from delaying the control loop by
milliseconds. Locked memory keeps page faults out of the loop.
"""

from __future__ import annotations

import ctypes
import gc
import os
import resource
import sys

PRIORITY = 60
"""Above threaded interrupt handlers (50), below the kernel's own watchdogs (99)."""

_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
_PR_SET_TIMERSLACK = 29


def enter(wanted: str) -> str:
    """Make the calling thread a real-time thread and lock the memory of its process.

    Threads that it starts later are ordinary ones. An ordinary thread that holds the interpreter
    when the system puts it aside makes this one wait: start none that does more than wait itself.

    Args:
        wanted: "auto" to do what is permitted, "off" to do nothing.

    Returns:
        "SCHED_FIFO", with what is missing beside it, or "off: " and the reason.
    """
    _quiet_collector()
    if wanted == "off":
        return "off: switched off in the configuration ([control] realtime)"
    refusal = _schedule()
    if refusal:
        _shorten_timer_slack()
        return f"off: {refusal}"
    refusal = lock_memory()
    return f"SCHED_FIFO, memory not locked: {refusal}" if refusal else "SCHED_FIFO"


def _quiet_collector() -> None:
    gc.collect()
    gc.freeze()
    gc.disable()


def _schedule() -> str:
    """Ask for SCHED_FIFO; returns why not, or nothing."""
    if not hasattr(os, "sched_setscheduler"):
        return "this system has no SCHED_FIFO"
    # Threads started later from this one must not become real-time threads too.
    policy = os.SCHED_FIFO | getattr(os, "SCHED_RESET_ON_FORK", 0)
    try:
        os.sched_setscheduler(0, policy, os.sched_param(PRIORITY))
    except PermissionError:
        pass
    except OSError as error:
        return f"SCHED_FIFO: {error.strerror}"
    else:
        return ""
    limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[1]
    return (
        f"SCHED_FIFO is not permitted (rtprio limit {limit}, {PRIORITY} needed); "
        f"give the user 'rtprio {PRIORITY}' in /etc/security/limits.d and log in again"
    )


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
