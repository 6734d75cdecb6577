"""Who leads when several leaders speak at once."""

from __future__ import annotations

from robot.records import LeaderKind

NOBODY = -1


class LeaderChoice:
    """Chooses the active leader: the first whose clutch closes, until it opens.

    A leader that is left out does not become active by waiting: its clutch must open and close
    again, so that nobody takes over without having acted. The standing target of the API is the
    exception on both sides: it yields to any leader whose clutch closes, and engages only with a
    new target.

    Args:
        kinds: the kind of each leader; its place here names it in :meth:`update`.

    Attributes:
        active: place of the leader that is active, or was last; NOBODY before the first.
        engaged: whether the active leader leads.
    """

    def __init__(self, kinds: tuple[LeaderKind, ...]) -> None:
        self._is_target = [kind == LeaderKind.API_TARGET for kind in kinds]
        self._closed = [False] * len(kinds)
        self._sequences: list[int | None] = [None] * len(kinds)
        self.active = NOBODY
        self.engaged = False

    def update(self, place: int, closed: bool, sequence: int) -> None:
        """Take a new sample of the leader at ``place``: its clutch and its sequence number."""
        known = self._sequences[place]
        closes = sequence != known if self._is_target[place] else not self._closed[place]
        self._closed[place] = closed
        self._sequences[place] = sequence if closed else None
        if place == self.active and not closed:
            self.engaged = False
        yields = not self.engaged or self._is_target[self.active]
        if closed and closes and yields:
            self.active, self.engaged = place, True

    def release(self) -> None:
        """Let nobody lead until a clutch closes anew."""
        self.engaged = False
