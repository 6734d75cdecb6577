"""Within which time a fault must be noticed, and what it is called when it could not be tried."""

from __future__ import annotations

from enum import Enum

from robot.errors import KeyholeError


class Deadline(Enum):
    """Within which time a fault must be noticed."""

    LEADER = "the leader's time-out"
    BUS = "two missed bus cycles"
    HANG_UP = "100 ms"
    WATCHDOG = "the servos' watchdog: 60 ms"
    LOST_WEB = "the web process may be silent for 1 s"
    HUNG = "the supervisor's patience: 5 s"
    LATE = "the tick that came late"
    FLAT = "a reading that stays as it is for 60 ms"
    ALIGNED = "the longest delay of a tracker that sensing aligns"
    TOLD = "the devices' own report, ten times a second"
    RESTART = "until a process is started anew: 5 s"
    RECORDER = "the recorder's next write: 2 s"
    START = "the start of a console: 30 s"
    ANSWER = "the answer to what was asked"


class BenchFailed(KeyholeError):
    """The console could not be brought to where a fault can be injected."""

    code = "bench_failed"
