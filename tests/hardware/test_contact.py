"""What the physics plant says about rings, the ball, and what the instrument touches."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
import pytest

from hardware.physics.contact import ContactWatch
from hardware.physics.model import PhysicsModel, build
from hardware.physics.plant import PhysicsPlant
from hardware.physics.preset import IDEAL, draw
from scenes.boards.board import Board, Ring, board
from scenes.boards.solids import fixed
from tests.hardware import physics_robot as here

CLEAR = 0.004


class Watched:
    """A watch over a board, and a tip that is put where the test wants it."""

    def __init__(self, one: Board) -> None:
        self.model: PhysicsModel = build(
            here.configuration(), IDEAL, draw(IDEAL, np.random.default_rng(0)), one
        )
        self.data = mujoco.MjData(self.model.model)
        self.watch = ContactWatch(self.model, one)

    def tip_at(self, *places: np.ndarray) -> int:
        """The rings passed after the tip was at these places, one a tick."""
        for place in places:
            self.watch.look(self.data, np.asarray(place, float))
        return self.watch.passed

    def ball_at(self, place: np.ndarray) -> float:
        """Its progress."""
        first = self.model.ball_position
        self.data.qpos[first : first + 3] = place
        self.watch.look(self.data, np.zeros(3))
        return self.watch.ball_progress


CENTRES = (np.array([0.5, 0.0, 0.1]), np.array([0.5, 0.05, 0.1]))
AXIS = np.array([0.6, 0.0, 0.8])
ASIDE = np.array([0.0, 1.0, 0.0])


def rings() -> Watched:
    both = tuple(Ring(fixed(centre), fixed(AXIS), CLEAR, ()) for centre in CENTRES)
    return Watched(Board("two rings", "Two rings", (), both))


@pytest.mark.parametrize("ring", [0, 1])
@pytest.mark.parametrize("aside", [0.0, 0.9, -0.9])
def test_a_ring_is_passed_from_the_front_within_its_opening(ring: int, aside: float) -> None:
    watched = rings()
    start = CENTRES[ring] + aside * CLEAR * ASIDE
    steps = [start + along * AXIS for along in (-0.01, -0.004, -0.0005)]
    assert watched.tip_at(*steps) == 0
    assert watched.tip_at(start + 0.0005 * AXIS) == 1 << ring
    assert watched.tip_at(*steps[::-1]) == 1 << ring


def test_both_rings_may_be_passed() -> None:
    watched = rings()
    for centre in CENTRES:
        watched.tip_at(centre - 0.001 * AXIS, centre + 0.001 * AXIS)
    assert watched.watch.passed == 0b11


@pytest.mark.parametrize("aside", [1.05, -1.05, 3.0])
def test_the_way_beside_a_ring_does_not_pass_it(aside: float) -> None:
    watched = rings()
    start = CENTRES[0] + aside * CLEAR * ASIDE
    for along in np.linspace(-0.01, 0.01, 41):
        assert watched.tip_at(start + along * AXIS) == 0


def test_from_behind_a_ring_is_not_passed() -> None:
    watched = rings()
    for along in np.linspace(0.01, -0.01, 41):
        assert watched.tip_at(CENTRES[0] + along * AXIS) == 0


def test_around_a_ring_and_into_it_from_behind_does_not_pass_it() -> None:
    watched = rings()
    before, outside = CENTRES[0] - 0.001 * AXIS, CENTRES[0] - 0.001 * AXIS + 2.0 * CLEAR * ASIDE
    behind = outside + 0.002 * AXIS
    assert watched.tip_at(before, outside, behind, CENTRES[0] + 0.001 * AXIS) == 0


@pytest.mark.parametrize("name", ["silicon-sine", "silicon-arc"])
def test_the_balls_progress_grows_from_0_to_1_along_its_groove(name: str) -> None:
    one = board(name, here.configuration())
    assert one.groove is not None
    watched, line = Watched(one), one.groove.centre_line
    along = [watched.ball_at(place) for place in line]
    assert along[0] == 0.0
    assert along[-1] == pytest.approx(1.0, abs=1e-12)
    assert all(now > before for before, now in itertools.pairwise(along))
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    np.testing.assert_allclose(along, lengths / lengths[-1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["silicon-sine", "silicon-arc"])
def test_a_ball_beside_its_groove_counts_as_where_it_is_nearest(name: str) -> None:
    one = board(name, here.configuration())
    assert one.groove is not None
    watched, line = Watched(one), one.groove.centre_line
    up = np.array([0.0, 0.0, 1.0])
    middle = line[len(line) // 2]
    assert watched.ball_at(middle + 0.001 * up) == pytest.approx(watched.ball_at(middle), abs=1e-9)
    assert watched.ball_at(line[0] - 2.0 * (line[1] - line[0])) == 0.0
    beyond = watched.ball_at(line[-1] + 2.0 * (line[-1] - line[-2]))
    assert beyond == pytest.approx(1.0, abs=1e-12)
    assert np.array_equal(watched.watch.ball_position, line[-1] + 2.0 * (line[-1] - line[-2]))


def pressed(part_of_ring: bool = False) -> PhysicsPlant:
    """An instrument that bends against a plate, and cannot."""
    plant = here.physics("ideal", board=here.obstacle(part_of_ring))
    found = here.truth(plant)
    assert (found["contact_count"], found["contact_force"]) == (0, 0.0)
    here.bend(plant, 1.5, 0.0, 1.0)
    return plant


def test_what_the_instrument_presses_on_is_felt() -> None:
    plant = pressed()
    free = here.physics("ideal")
    here.bend(free, 1.5, 0.0, 1.0)
    found = here.truth(plant)
    assert found["contact_count"] >= 1
    assert 0.01 < found["contact_force"] < 20.0
    assert plant.read().contact_n == found["contact_force"]
    assert here.bend_deg(plant)[0] < here.bend_deg(free)[0]
    assert np.linalg.norm(found["position"] - here.truth(free)["position"]) > 0.05e-3
    assert here.truth(free)["contact_count"] == 0
    assert free.read().contact_n == 0.0


def test_the_harder_it_presses_the_more_force_there_is_and_none_when_it_lets_go() -> None:
    plant = pressed()
    light = float(here.truth(plant)["contact_force"])
    here.bend(plant, 1.57, 0.0, 0.5)
    assert here.truth(plant)["contact_force"] > 1.1 * light
    here.bend(plant, float(here.start()[7]), 0.0, 0.8)
    found = here.truth(plant)
    assert (found["contact_count"], found["contact_force"]) == (0, 0.0)


def test_a_part_of_a_ring_that_was_touched_is_remembered() -> None:
    plant = pressed(part_of_ring=True)
    assert here.truth(plant)["rings_touched"] == 1
    here.bend(plant, float(here.start()[7]), 0.0, 0.8)
    assert here.truth(plant)["rings_touched"] == 1
    assert here.truth(pressed())["rings_touched"] == 0
