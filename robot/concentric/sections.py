"""An arm from the channel's exit to its tip: where its sections begin and end.

A tube's curved part begins at β_i + straight length, the tube ends at β_i + length; between these
places nothing changes. A place moves with its tube. That adds to a derivative the difference of
what stands before and behind it, times how far it moves (Leibniz). Where two places coincide the
pose is continuous but has a kink: the derivative is then that of one side, on which the place of
the tube further out comes first.
"""

from __future__ import annotations

import numpy as np

from robot.compiled import compiled
from robot.concentric.collocation import advance_overlap
from robot.concentric.helix import advance_helix
from robot.concentric.state import ArmState, curvature, share_out, twisting
from robot.concentric.vectors import add_to_column, column, combine, cross


@compiled
def places(q: np.ndarray, tubes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Arc lengths at which a tube begins to curve or ends, in their order along the arm.

    Args:
        q: (2n,) translations in m, rotations in rad.
        tubes: (n,) ``TUBE``.

    Returns:
        (2n,) m, not below 0 and none beyond the end of the innermost tube, which is the last; and
        (2n,) which: i where tube i begins to curve, n + i where it ends.
    """
    count = len(tubes)
    arc, which = np.empty(2 * count), np.empty(2 * count, np.int64)
    tip = q[0] + tubes[0]["length"]
    filled = 0
    for index in range(count - 1, -1, -1):
        for event in range(2):
            along = tubes[index]["length"] if event else tubes[index]["straight_length"]
            here = max(min(q[index] + along, tip), 0.0)
            slot = filled
            while slot > 0 and arc[slot - 1] > here:
                arc[slot], which[slot] = arc[slot - 1], which[slot - 1]
                slot -= 1
            arc[slot], which[slot] = here, index + event * count
            filled += 1
    return arc, which


@compiled
def advance(state: ArmState, length: float, first: int, with_shape: bool) -> None:
    """Advance ``state`` by ``length`` (m) within a section; see :func:`advance_helix`."""
    curved = 0
    for index in range(len(state.share)):
        if state.share[index] != 0.0:
            curved += 1
    if curved > 1:
        advance_overlap(state, length, first, with_shape)
    else:
        advance_helix(state, length, first, with_shape)


@compiled
def pass_place(
    state: ArmState, which: int, moves: bool, tubes: np.ndarray, coupling: float, with_shape: bool
) -> None:
    """Pass the place ``which``: one tube more is curved, or one less is there.

    Args:
        state: of the arm at the place, changed in place.
        which: as in :func:`places`.
        moves: False where the tube's own place is still inside the channel.
        tubes: (n,) ``TUBE``.
        coupling: as in :func:`share_out`.
        with_shape: whether derivatives of position and rotation are carried along.
    """
    count = len(tubes)
    index = which % count
    before = curvature(state)
    if moves:
        for tube in range(count):
            state.rate_change[tube, index] += twisting(state, tube, before)
    if which < count:
        state.curved[index] = state.present[index]
    else:
        state.curved[index] = state.present[index] = 0.0
    share_out(state, tubes, coupling)
    if not moves:
        return
    behind = curvature(state)
    for tube in range(count):
        state.rate_change[tube, index] -= twisting(state, tube, behind)
    if with_shape:
        x, y = before[0] - behind[0], before[1] - behind[1]
        turn = combine(x, column(state.rotation, 0), y, column(state.rotation, 1))
        position = (state.position[0], state.position[1], state.position[2])
        add_to_column(state.turn, index, 1.0, turn)
        add_to_column(state.moment, index, 1.0, cross(position, turn))


@compiled
def walk(
    state: ArmState,
    q: np.ndarray,
    tubes: np.ndarray,
    coupling: float,
    first: int,
    with_shape: bool,
    residual: np.ndarray,
    residual_change: np.ndarray,
) -> None:
    """Walk from the exit to the tip.

    Args:
        state: as :func:`robot.concentric.state.state_at_exit` left it; at the tip afterwards.
        q: (2n,) translations in m, rotations in rad.
        tubes: (n,) ``TUBE``.
        coupling: as in :func:`share_out`.
        first: derivatives by the parameters from this one on are carried along.
        with_shape: whether position and rotation (and their derivatives) are carried along.
        residual: (n,) filled with the torsion rate at each tube's end, rad/m: zero in a solution.
        residual_change: (n, 3n) filled with its derivative.
    """
    count = len(tubes)
    arc, which = places(q, tubes)
    here = 0.0
    for place in range(2 * count):
        if arc[place] > here:
            advance(state, arc[place] - here, first, with_shape)
            here = arc[place]
        index = which[place] % count
        moves = here > 0.0
        if which[place] >= count:
            residual[index] = state.rate[index]
            for parameter in range(3 * count):
                residual_change[index, parameter] = state.rate_change[index, parameter]
            if moves:
                residual_change[index, index] += twisting(state, index, curvature(state))
        pass_place(state, which[place], moves, tubes, coupling, with_shape)
