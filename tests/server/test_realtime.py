"""Real-time scheduling: on where permitted, and in words where not. In processes of their own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from server.control import realtime

ROOT = Path(__file__).resolve().parents[2]

REPORT = """
import gc, json, os, sys, threading
from server.control import realtime
{before}
words = realtime.enter({wanted!r})
policies = []
later = threading.Thread(target=lambda: policies.append(os.sched_getscheduler(0)))
later.start(); later.join()
reset = getattr(os, "SCHED_RESET_ON_FORK", 0)
print(json.dumps({{"words": words, "fifo": os.sched_getscheduler(0) & ~reset == os.SCHED_FIFO,
    "thread_fifo": policies[0] & ~reset == os.SCHED_FIFO, "gc": gc.isenabled()}}))
"""

WITHOUT_RIGHTS = """
import ctypes, resource
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
resource.setrlimit(resource.RLIMIT_MEMLOCK, (65536, 65536))
if os.geteuid() == 0:
    os.setgid(65534); os.setuid(65534)
"""


def enter(wanted: str, before: str = "") -> Any:
    result = subprocess.run(
        [sys.executable, "-c", REPORT.format(wanted=wanted, before=before)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(result.stdout)


def test_auto_takes_what_is_permitted() -> None:
    told = enter("auto")
    assert told["words"].startswith("SCHED_FIFO" if told["fifo"] else "off: ")
    assert not told["gc"]


def test_threads_started_later_stay_ordinary() -> None:
    assert not enter("auto")["thread_fifo"]


def test_off_is_off() -> None:
    told = enter("off")
    assert told["words"].startswith("off: switched off in the configuration")
    assert not told["fifo"]


def test_without_the_right_it_says_what_to_do() -> None:
    told = enter("auto", WITHOUT_RIGHTS)
    assert not told["fifo"]
    assert told["words"].startswith("off: SCHED_FIFO is not permitted (rtprio limit 0")
    assert "/etc/security/limits.d" in told["words"]


PREFERRED = """
import json, os, sys, threading
from pathlib import Path
from server.control import realtime
{before}
permitted = realtime.prefer()
niceness = []
later = threading.Thread(target=lambda: niceness.append(os.getpriority(os.PRIO_PROCESS, 0)))
later.start(); later.join()
group = Path("/proc/self/autogroup")
words = group.read_text() if group.exists() else ""
print(json.dumps({{"permitted": permitted, "nice": niceness[0], "group": words}}))
"""


def prefer(before: str = "") -> Any:
    result = subprocess.run(
        [sys.executable, "-c", PREFERRED.format(before=before)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        start_new_session=True,
    )
    return json.loads(result.stdout)


def test_a_preferred_process_goes_first_where_that_is_permitted() -> None:
    told = prefer()
    if told["permitted"]:
        assert told["nice"] == realtime.PREFERENCE
        assert not told["group"] or told["group"].split()[-1] == str(realtime.PREFERENCE)
    else:
        assert told["nice"] == os.getpriority(os.PRIO_PROCESS, 0)


def test_without_the_right_a_process_is_an_ordinary_one() -> None:
    told = prefer(WITHOUT_RIGHTS + "resource.setrlimit(resource.RLIMIT_NICE, (0, 0))\n")
    assert not told["permitted"]
    assert told["nice"] == os.getpriority(os.PRIO_PROCESS, 0)
    assert not told["group"] or told["group"].split()[-1] != str(realtime.PREFERENCE)
