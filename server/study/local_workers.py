"""Workers on this machine: one process a core, each with one run at a time."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import wait as wait_for
from multiprocessing.synchronize import Event

from robot.errors import KeyholeError
from server.study.work import Outcome, Work, perform

_POLL_S = 0.2
_stop: Event | None = None


class WorkerLost(KeyholeError):
    """A process of a study ended unexpectedly."""

    code = "worker_lost"


def default_jobs() -> int:
    """As many as there are cores for this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _begin(stop: Event) -> None:
    """Called in a new worker: the parent decides about its end, and it does not outlive it."""
    global _stop  # noqa: PLW0603 - a pool's worker has no other place for what it is begun with
    _stop = stop
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    wait_for([sentinel])
    os._exit(1)


def _do(work: Work) -> Outcome:
    stop = _stop
    assert stop is not None
    return perform(work, stop.is_set)


def local_outcomes(
    works: Sequence[Work], jobs: int, stopped: Callable[[], bool]
) -> Iterator[tuple[Work, Outcome]]:
    """Outcomes as they come, in any order.

    Args:
        works: what to do.
        jobs: how many processes.
        stopped: asked now and then; once it says yes, runs are given up and no more come.

    Raises:
        WorkerLost: a process was killed or crashed.
    """
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    count = max(1, min(jobs, len(works)))
    with ProcessPoolExecutor(count, context, _begin, (stop,)) as pool:
        pending: dict[Future[Outcome], Work] = {pool.submit(_do, work): work for work in works}
        try:
            while pending:
                done, _ = wait(pending, timeout=_POLL_S, return_when=FIRST_COMPLETED)
                for future in done:
                    yield pending.pop(future), future.result()
                if stopped():
                    return
        except BrokenProcessPool:
            raise WorkerLost(
                "a process of the study ended unexpectedly (out of memory?); what was finished is "
                "kept: start again with fewer --jobs"
            ) from None
        finally:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)
