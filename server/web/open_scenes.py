"""The scenes that browsers show, so that the operator's page can let go what is dragged in them."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterator


class OpenScenes:
    """All connections to viser. Belongs to the event loop.

    viser's client forgets that a gizmo is held when the server changes how it looks, and then never
    says that it was let go. The page sees the mouse button come up, and says so beside it.
    """

    def __init__(self) -> None:
        self._asked: set[asyncio.Event] = set()

    @contextlib.contextmanager
    def one(self) -> Iterator[asyncio.Event]:
        """A scene is open for the length of the block; the event asks it to let go."""
        asked = asyncio.Event()
        self._asked.add(asked)
        try:
            yield asked
        finally:
            self._asked.discard(asked)

    def let_go(self) -> None:
        """Nothing is dragged any more: the operator's mouse button is up."""
        for asked in self._asked:
            asked.set()
