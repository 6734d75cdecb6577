"""Real-time scheduling of the servo thread, where the system permits it."""

from __future__ import annotations

import os

PRIORITY = 59
"""Just below the control loop (60): its cycle waits for ticks, never the other way round."""


def prefer_this_thread() -> bool:
    """Give the calling thread SCHED_FIFO; whether the system permitted it."""
    if not hasattr(os, "sched_setscheduler"):
        return False
    policy = os.SCHED_FIFO | getattr(os, "SCHED_RESET_ON_FORK", 0)
    try:
        os.sched_setscheduler(0, policy, os.sched_param(PRIORITY))
    except OSError:
        return False
    return True
