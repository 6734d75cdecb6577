"""The force on a stylus' hand, kept passive: no more energy comes back than the hand has put in.

A force that is rendered late or in steps gives back more than pressing into it took: walls buzz,
and a light hand is thrown out. So the guard sits at the stylus' port and keeps an account, with
f_n the force sent at pose x_n,

    E_(n+1) = E_n - max f . (x_(n+1) - x_n)    over every f that can have acted meanwhile,

which is f_n alone where a force acts at once, and those of the last ``delay_s`` where poses and
forces are under way for up to so long. The wanted force is sent as far as three bounds let it:

    |f| <= limit,    |f| d <= E + R,    |f| <= sqrt(2 k E) + b v.

In the second, d is the farthest that the hand can get along the force until the next one acts, from
its speed, an acceleration of ``HAND_M_S2`` of its own, and that of a stylus that nobody holds by
the force itself: the account holds for motion that is yet unknown. R is what may be risked to find
out whether the hand presses; without it an empty account would stay empty. The third is the force
of a spring of stiffness k that has stored E, and of a damper while the hand presses at speed v: a
force that runs out of energy ends smoothly. After Hannaford and Ryu's passivity observer, with the
force limited beforehand rather than corrected afterwards.

A wall that is felt late gives back more than was pressed into it, as if it had a negative damping
of stiffness times delay; so the guard damps the stylus while there is a force, and what that takes
is in the account. Where nothing is touched a drag that nobody feels keeps a little in it. Nothing
else is saved up: the account never holds more than a contact whose force grows with its depth can
have stored at the present force and depth, so what one contact took pays for no other.

The price: a hand at rest is not pushed farther than its own work pays for, as by a tissue that
comes toward the tip; and where the way is long, a hand that trembles in a stiff contact loses some
of the force with time, until it presses anew.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)

HAND_M_S2 = 5.0
"""The largest acceleration that is expected of a hand which holds a stylus in a contact."""
APPARENT_KG = 0.045
"""Of a stylus that nobody holds; a hand only adds to it."""
RISK_J = 2e-7
"""R above: the most that a hand can be given without having given it."""
READY_J = 2e-5
"""What the drag fills the account with where nothing is touched: enough for 0.2 N at once."""
DRAG_N, DRAG_M = 0.005, 1e-4
"""The drag, and the travel over which it turns round: friction, which needs no speed."""
STIFFEST_N_M = 1000.0
"""k above."""
DAMPING_SHARE, SMOOTHING_S = 0.3, 0.02
"""Damping is never more than this share of the force, and takes the speed smoothed."""
CONTACT_N, DEEPEST_M = 0.02, 0.01
"""A smaller force is that of no contact, and no contact counts as deeper."""
JUMP_M = 0.05
"""A hand does not move farther from one sample to the next: another place begins."""


class _Sent(NamedTuple):
    """A force that was sent at a pose, and when."""

    t: float
    x: float
    y: float
    z: float
    fx: float
    fy: float
    fz: float


class PassivityGuard:
    """Keeps the force on one stylus passive. All vectors are in one frame, of any orientation.

    Args:
        force_limit: no force is larger, N.
        damping: of the stylus while there is a force, N s/m: stiffness times delay of the stiffest
            wall that is to be felt in full.
        delay_s: longest way of a force to the stylus and of the pose back, together.
        resolution: of the poses, m.

    Attributes:
        energy: what the hand has put in and may get back, at the last pose, J.
        held_back: share of the wanted force that the last step took away, 0 to 1.
    """

    def __init__(
        self,
        force_limit: float,
        damping: float = 8.0,
        delay_s: float = 0.0,
        resolution: float = 0.0,
    ) -> None:
        self._limit, self._damping = force_limit, damping
        self._delay, self._resolution = delay_s, resolution
        self._sent: deque[_Sent] = deque()
        self._place = self._drag_place = self._contact_place = ZERO
        self._velocity = self._smooth = ZERO
        self._now = self._period = self._window = 0.0
        self.energy = self.held_back = 0.0

    def reset(self) -> None:
        """Begin at an unknown place: what the hand put in is gone, what it was lent is not."""
        self.energy = min(self.energy, 0.0)
        self.held_back = 0.0
        self._sent.clear()
        self._velocity = self._smooth = ZERO
        self._window = 0.0

    def step(self, position: Vector, wanted: Vector, dt: float) -> Vector:
        """The force to send; zero at the first pose, and where a number is not finite.

        Args:
            position: of the stylus, m, the newest that was heard of.
            wanted: force on the stylus, N, same frame.
            dt: since the last step, s.
        """
        if not math.isfinite(sum(position) + sum(wanted) + dt) or dt <= 0.0:
            self.reset()
            return ZERO
        if not self._sent or math.dist(position, self._place) > JUMP_M:
            self.reset()
            self._place = self._drag_place = self._contact_place = position
            return self._send(ZERO)
        self._account(position, dt)
        wanted = _no_longer(wanted, self._limit)
        size = math.hypot(*wanted)
        self._forget(size)
        force = self._bounded(wanted)
        self.held_back = max(0.0, 1.0 - _dot(force, wanted) / (size * size)) if size > 0.0 else 0.0
        return self._send(force)

    def _account(self, position: Vector, dt: float) -> None:
        """Book the worst that can have been done on the way from the last pose to this one."""
        last = self._sent[-1]
        dx, dy, dz = position[0] - last.x, position[1] - last.y, position[2] - last.z
        before, self._now = self._now, self._now + dt
        self._place = position
        self._period = max(dt, self._period + 0.02 * (dt - self._period))
        work = weakest = math.inf
        strongest, until = 0.0, self._now
        for sent in reversed(self._sent):
            if sent is not last and until <= before - self._delay:
                break
            work = min(work, -(sent.fx * dx + sent.fy * dy + sent.fz * dz))
            size = math.hypot(sent.fx, sent.fy, sent.fz)
            weakest, strongest = min(weakest, size), max(strongest, size)
            until = sent.t
        # One force gives way to another somewhere on a way that need not be straight.
        self.energy += work - 0.125 * HAND_M_S2 * dt * dt * (strongest - weakest)
        self._estimate_velocity()
        x, y, z = self._smooth
        share = 1.0 - math.exp(-dt / SMOOTHING_S)
        x, y, z = x + share * (dx / dt - x), y + share * (dy / dt - y), z + share * (dz / dt - z)
        self._smooth = (x, y, z)
        self._drag_place = _within(self._drag_place, position, DRAG_M)

    def _estimate_velocity(self) -> None:
        """Mean velocity over about half of the time for which forces have to be answered for."""
        since, horizon = self._sent[0], self._period + self._delay
        for sent in reversed(self._sent):
            if sent.t <= self._now - 0.5 * horizon + 1e-9:
                since = sent
                break
        self._window = self._now - since.t
        x, y, z = self._place[0] - since.x, self._place[1] - since.y, self._place[2] - since.z
        way = math.sqrt(x * x + y * y + z * z)
        # A step of the encoder may be no motion.
        share = max(way - self._resolution, 0.0) / (way * self._window) if way > 0.0 else 0.0
        self._velocity = (x * share, y * share, z * share)

    def _forget(self, size: float) -> None:
        """Drop what no contact of this force, N, and of the present depth can have stored."""
        if size < CONTACT_N:
            self._contact_place = self._place
        depth = min(math.dist(self._place, self._contact_place), DEEPEST_M)
        self.energy = min(self.energy, READY_J + size * depth)

    def _bounded(self, wanted: Vector) -> Vector:
        """The wanted force within the bounds, with damping and drag."""
        velocity, size = self._smooth, math.hypot(*wanted)
        if size > 0.0:
            pressing = max(-_dot(wanted, velocity) / size, 0.0)
            stored = math.sqrt(2.0 * STIFFEST_N_M * max(self.energy, 0.0))
            wanted = _no_longer(wanted, stored + self._damping * pressing)
        most, speed = DAMPING_SHARE * math.hypot(*wanted), math.hypot(*velocity)
        damping = self._damping if self._damping * speed <= most else most / speed
        lack = min(max(2.0 - 2.0 * self.energy / READY_J, 0.0), 1.0)
        drag = lack * DRAG_N / DRAG_M
        x, y, z = (
            wanted[i] - damping * velocity[i] - drag * (self._place[i] - self._drag_place[i])
            for i in range(3)
        )
        return _no_longer((x, y, z), min(self._limit, self._affordable((x, y, z))))

    def _affordable(self, force: Vector) -> float:
        """The largest force in the direction of ``force`` that the account pays for, N.

        Until another one acts, after a time h, the hand gets no farther along it than
        d = v h + a h^2 / 2 + f h^2 / (2 m). Forces under way come first, for as long as they act.
        """
        size = math.hypot(*force)
        if size == 0.0:
            return 0.0
        allowed, delay = self.energy + RISK_J, self._delay
        horizon = self._period + delay
        along = self._along(force, size)
        way = _way(along, horizon) + self._resolution
        yielding = 0.5 * horizon * horizon / APPARENT_KG
        most = _largest(way, yielding, allowed)
        if delay > 0.0:
            # What is under way still takes its part of the way, and of the energy.
            way -= max(_way(along, delay), 0.0)
            yielding -= 0.5 * delay * delay / APPARENT_KG
            most = min(most, _largest(way, yielding, allowed - self._committed()))
        return most

    def _along(self, force: Vector, size: float) -> float:
        """The largest speed that the hand can have by now in the direction of a force, m/s."""
        last = self._sent[-1]
        pushed = (force[0] * last.fx + force[1] * last.fy + force[2] * last.fz) / size
        gained = HAND_M_S2 + max(pushed, 0.0) / APPARENT_KG
        return _dot(force, self._velocity) / size + 0.5 * gained * self._window

    def _committed(self) -> float:
        """The most that forces which were sent before can still cost, J."""
        cost, until = 0.0, self._now
        for sent in reversed(self._sent):
            left = self._delay - (self._now - until)
            if left <= 0.0:
                break
            size = math.hypot(sent.fx, sent.fy, sent.fz)
            if size > 0.0:
                along = self._along((sent.fx, sent.fy, sent.fz), size)
                way = _way(along, left) + 0.5 * (size / APPARENT_KG) * left * left
                cost = max(cost, size * way)
            until = sent.t
        return cost

    def _send(self, force: Vector) -> Vector:
        sent = self._sent
        sent.append(_Sent(self._now, *self._place, *force))
        oldest = self._now - 2.0 * (self._period + self._delay)
        while len(sent) > 2 and sent[1].t < oldest:
            sent.popleft()
        return force


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _no_longer(vector: Vector, limit: float) -> Vector:
    size = math.hypot(*vector)
    if size <= limit:
        return vector
    share = limit / size
    return (vector[0] * share, vector[1] * share, vector[2] * share)


def _within(follower: Vector, leader: Vector, play: float) -> Vector:
    """The follower, drawn along where the leader is farther than ``play`` from it."""
    x, y, z = leader[0] - follower[0], leader[1] - follower[1], leader[2] - follower[2]
    way = math.sqrt(x * x + y * y + z * z)
    if way <= play:
        return follower
    share = 1.0 - play / way
    return (follower[0] + share * x, follower[1] + share * y, follower[2] + share * z)


def _way(speed: float, horizon: float) -> float:
    """How far a hand gets within ``horizon`` that has this speed, m."""
    return (speed + 0.5 * HAND_M_S2 * horizon) * horizon


def _largest(way: float, yielding: float, allowed: float) -> float:
    """The largest f >= 0 with f (way + yielding f) <= allowed."""
    root = way * way + 4.0 * yielding * allowed
    if root <= 0.0:
        return 0.0
    root = math.sqrt(root)
    if way < 0.0:
        return (root - way) / (2.0 * yielding)
    return max(2.0 * allowed / (way + root), 0.0)
