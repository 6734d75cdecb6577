"""How a child process notices that its supervisor is gone, however that ended.

The supervisor keeps the writing end of a pipe and never writes; the kernel closes it with the
supervisor, and the reading end in each child then reports the end of the file.
"""

from __future__ import annotations

import os
import select
import signal
import threading
import time

_GRACE_S = 5.0


class Lifeline:
    """The reading end of the supervisor's pipe.

    Args:
        descriptor: the inherited descriptor; None for a process that nobody supervises.
    """

    def __init__(self, descriptor: int | None) -> None:
        self._poll = select.poll()
        if descriptor is not None:
            self._poll.register(descriptor, select.POLLIN)

    def is_cut(self) -> bool:
        """Whether the supervisor is gone. Never waits."""
        return bool(self._poll.poll(0))


def end_with_supervisor(descriptor: int | None) -> None:
    """Ask this process to end, by SIGTERM, when the supervisor is gone; by force 5 s later.

    For processes with nothing to put in order but themselves. Returns at once.
    """
    if descriptor is None:
        return

    def watch() -> None:
        poll = select.poll()
        poll.register(descriptor, select.POLLIN)
        poll.poll()
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_GRACE_S)
        os._exit(1)

    threading.Thread(target=watch, name="lifeline", daemon=True).start()
