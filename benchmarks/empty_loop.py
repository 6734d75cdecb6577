"""An empty loop with the control process' rate, deadlines and scheduling: what the machine gives.

Runs as a process of its own. It is told on stdin, a line a measurement, how long to run and where
its deadlines lie, and answers with a line of JSON.
"""

from __future__ import annotations

import argparse
import json
import sys
import time

from server.control import realtime


def measure(period_ns: int, phase_ns: int, seconds: float) -> tuple[list[int], int]:
    """Lateness of every tick in ns, and how many deadlines were missed whole.

    Args:
        period_ns: between two deadlines.
        phase_ns: where in a period of the monotonic clock the deadlines lie.
        seconds: how long.
    """
    lateness: list[int] = []
    lost = 0
    deadline_ns = (time.monotonic_ns() // period_ns + 2) * period_ns + phase_ns
    ends_ns = deadline_ns + round(seconds * 1e9)
    while deadline_ns < ends_ns:
        wait_ns = deadline_ns - time.monotonic_ns()
        if wait_ns > 0:
            time.sleep(wait_ns * 1e-9)
        late_ns = time.monotonic_ns() - deadline_ns
        lateness.append(late_ns)
        missed = late_ns // period_ns
        if missed > 0:
            lost += missed
            deadline_ns += missed * period_ns
        deadline_ns += period_ns
    return lateness, lost


def main() -> None:
    """Enter real time as the control process does, then measure as often as asked."""
    parser = argparse.ArgumentParser(prog="keyhole empty loop")
    parser.add_argument("--rate-hz", type=float, required=True)
    parser.add_argument("--realtime", required=True)
    arguments = parser.parse_args()
    period_ns = round(1e9 / arguments.rate_hz)
    print(json.dumps({"realtime": realtime.enter(arguments.realtime)}), flush=True)
    for line in sys.stdin:
        order = json.loads(line)
        lateness, lost = measure(period_ns, order["phase_ns"], order["seconds"])
        print(json.dumps({"lateness_ns": lateness, "lost": lost}), flush=True)


if __name__ == "__main__":
    main()
