"""Which messages a browser may send to viser.

viser answers to whatever any client sends: gizmos move for everybody, uploads land on the disk,
and one message opens a public tunnel. So only what is listed here passes, in the form in which the
viser client sends it, and what moves the robot passes only from the operator.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import msgspec

LARGEST_MESSAGE = 65_536
"""Bytes. The largest of what passes is a few hundred."""

_Name = Annotated[str, msgspec.Meta(max_length=256)]
_Vector = tuple[float, float, float]
_Quaternion = tuple[float, float, float, float]


class _Message(msgspec.Struct, tag_field="type", forbid_unknown_fields=True):
    """A message of the viser client; the class' name is its type."""


class ViewerCameraMessage(_Message):
    """Where the client's own camera is."""

    wxyz: _Quaternion
    position: _Vector
    fov: float
    near: float
    far: float
    image_height: int
    image_width: int
    look_at: _Vector
    up_direction: _Vector


class GuiUpdateMessage(_Message):
    """A control in viser's own panel, which changes how the scene looks and nothing else."""

    uuid: _Name
    updates: dict[str, Any]


class TransformControlsDragStartMessage(_Message):
    """A gizmo is taken."""

    name: _Name
    owner: _Name = ""


class TransformControlsUpdateMessage(_Message):
    """A gizmo moves."""

    name: _Name
    wxyz: _Quaternion
    position: _Vector
    owner: _Name = ""


class TransformControlsDragEndMessage(_Message):
    """A gizmo is let go."""

    name: _Name
    owner: _Name = ""


Allowed = (
    ViewerCameraMessage
    | GuiUpdateMessage
    | TransformControlsDragStartMessage
    | TransformControlsUpdateMessage
    | TransformControlsDragEndMessage
)
_decoder: msgspec.msgpack.Decoder[Allowed] = msgspec.msgpack.Decoder(Allowed, strict=False)


def _is_pose(message: TransformControlsUpdateMessage) -> bool:
    numbers = (*message.position, *message.wxyz)
    return all(map(math.isfinite, numbers)) and math.hypot(*message.wxyz) > 1e-6


class ViserFilter:
    """Decides on the messages of one browser, in their order.

    Attributes:
        refused_drags: how often somebody took a gizmo who may not.
    """

    def __init__(self) -> None:
        self._dragged: dict[str, TransformControlsDragEndMessage] = {}
        self.refused_drags = 0

    def passes(self, frame: bytes, is_operator: bool) -> bool:
        """Whether ``frame`` may go on to viser.

        Args:
            frame: one binary WebSocket message.
            is_operator: whether its sender holds the lease at this moment.
        """
        if len(frame) > LARGEST_MESSAGE:
            return False
        try:
            message = _decoder.decode(frame)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
            return False
        match message:
            case TransformControlsDragStartMessage():
                if is_operator:
                    end = TransformControlsDragEndMessage(message.name, message.owner)
                    self._dragged[message.name] = end
                else:
                    self.refused_drags += 1
                return is_operator
            case TransformControlsUpdateMessage():
                return is_operator and _is_pose(message)
            case TransformControlsDragEndMessage():
                # The end of a drag that was let through ends it for viser too, lease or not.
                return self._dragged.pop(message.name, None) is not None or is_operator
            case _:
                return True

    def ends_of_drags(self) -> list[bytes]:
        """Frames that let go, once, every gizmo that the browser holds.

        For a browser that has lost the lease: viser would go on holding the gizmo for it.
        """
        frames = [msgspec.msgpack.encode(end) for end in self._dragged.values()]
        self._dragged.clear()
        return frames
