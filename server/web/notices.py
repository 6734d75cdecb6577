"""What the server tells open pages beside the state: refusals of others, and troubles."""

from __future__ import annotations

import threading
from collections import deque
from typing import Any, NamedTuple

_KEPT = 64


class Notice(NamedTuple):
    """One sentence for people.

    Attributes:
        number: grows with each.
        kind: ``refused`` or ``trouble``.
        text: the sentence.
        everyone: whether watchers are told too.
        stays: whether pages that are opened later are told as well.
    """

    number: int
    kind: str
    text: str
    everyone: bool
    stays: bool

    def message(self) -> dict[str, Any]:
        """As the stream sends it."""
        return {"type": "notice", "kind": self.kind, "text": self.text}


class Notices:
    """The notices of one web process. Its methods may be called from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._kept: deque[Notice] = deque(maxlen=_KEPT)
        self._staying: dict[str, Notice] = {}
        self._number = 0

    def post(self, kind: str, text: str, *, everyone: bool = False, stays: bool = False) -> None:
        """Tell it to every open page of the operator, or of everyone; what stays, only once."""
        with self._lock:
            if stays and text in self._staying:
                return
            self._number += 1
            notice = Notice(self._number, kind, text, everyone, stays)
            self._kept.append(notice)
            if stays and len(self._staying) < _KEPT:
                self._staying[text] = notice

    def staying(self) -> tuple[int, list[Notice]]:
        """For a page that was just opened: where it begins, and what it must know already."""
        with self._lock:
            return self._number, [one for one in self._staying.values() if one.everyone]

    def since(self, number: int, is_operator: bool) -> tuple[int, list[Notice]]:
        """The newest number, and what came after ``number`` for such a page."""
        if number == self._number:
            return number, []
        with self._lock:
            new = [one for one in self._kept if one.number > number]
            return self._number, [one for one in new if one.everyone or is_operator]
