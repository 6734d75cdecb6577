"""A browser at viser's port, reduced to what the scene needs of it: it says that it looks, and it
drags the gizmo.
"""

from __future__ import annotations

import contextlib
import threading
from typing import Any

import msgspec
import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Subprotocol


class ViserBrowser:
    """One WebSocket of the viser client; reads and forgets what it is sent."""

    def __init__(self, port: int) -> None:
        self._socket = connect(
            f"ws://127.0.0.1:{port}",
            subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
            compression=None,
            max_size=None,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.send(
            "ViewerCameraMessage",
            wxyz=(1.0, 0.0, 0.0, 0.0),
            position=(1.0, 0.0, 0.0),
            fov=0.7,
            near=0.01,
            far=100.0,
            image_height=700,
            image_width=1000,
            look_at=(0.0, 0.0, 0.0),
            up_direction=(0.0, 0.0, 1.0),
        )

    def _read(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            for _ in self._socket:
                pass

    def send(self, kind: str, **fields: Any) -> None:
        """Send one message of the viser client."""
        self._socket.send(msgspec.msgpack.encode({"type": kind, **fields}))

    def take_gizmo(self) -> None:
        """Press the mouse on it."""
        self.send("TransformControlsDragStartMessage", name="/gizmo", owner="")

    def move_gizmo(self, position: tuple[float, float, float]) -> None:
        """Drag it to ``position`` (m), upright."""
        self.send(
            "TransformControlsUpdateMessage",
            name="/gizmo",
            wxyz=(1.0, 0.0, 0.0, 0.0),
            position=position,
            owner="",
        )

    def let_go(self) -> None:
        """Release the mouse."""
        self.send("TransformControlsDragEndMessage", name="/gizmo", owner="")

    def close(self) -> None:
        """Close the page."""
        self._socket.close()
        self._reader.join(timeout=5.0)
