"""How the servos move: profiles, watchdog, torque, and what they pull on."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hardware.fake_servos.motor import ACCELERATION_UNIT, VELOCITY_UNIT
from hardware.fake_servos.simulation import Mounting
from hardware.fake_servos.tendons import Segment, SegmentShape
from hardware.servos.control_table import WATCHDOG_TRIPPED, HardwareError
from hardware.servos.protocol import ALERT, StatusError
from robot.tendons import servo_angles
from tests.hardware.fake_servos.wire_host import IDS, TAUT, WireHost

FREE = Mounting(slack_m=(1.0,) * 4)
"""Tendons so loose that they never pull."""


@pytest.mark.parametrize(("velocity", "acceleration"), [(30, 0), (87, 0), (87, 20), (200, 100)])
def test_a_motion_keeps_to_its_profile_and_arrives(velocity: int, acceleration: int) -> None:
    host = WireHost(FREE)
    host.drive(velocity, acceleration)
    servo = host.simulation.servos[0]
    host.aim({101: 3000})
    largest = rate = 0.0
    for _ in range(4000):
        before = servo.motor.trajectory_velocity
        host.sleep(1.0)
        largest = max(largest, abs(servo.motor.velocity))
        if servo.motor.trajectory != servo.motor.goal:
            rate = max(rate, abs(servo.motor.trajectory_velocity - before) * 1e3)
    assert largest <= 1.02 * velocity * VELOCITY_UNIT
    if acceleration:
        assert rate <= 1.01 * acceleration * ACCELERATION_UNIT
    # Friction and a loop without an integral part leave a few ticks.
    assert host.read(101, "present_position") == pytest.approx(3000, abs=6)
    assert host.read(101, "moving") == 0


def test_a_new_goal_on_the_way_turns_it_round_without_a_jump() -> None:
    host = WireHost(FREE)
    host.drive(87, 20)
    motor = host.simulation.servos[0].motor
    host.aim({101: 3000})
    host.sleep(500)
    host.aim({101: 1500})
    before = motor.trajectory
    for _ in range(3000):
        host.sleep(1.0)
        assert abs(motor.trajectory - before) <= 87 * VELOCITY_UNIT * 1.01e-3
        before = motor.trajectory
    assert motor.position == pytest.approx(1500, abs=6)


def test_torque_on_moves_nothing() -> None:
    host = WireHost(FREE)
    host.write(101, "goal_position", 500)
    host.write(101, "torque_enable", 1)
    before = host.simulation.servos[0].motor.position
    host.sleep(200)
    assert host.simulation.servos[0].motor.position == before
    assert host.read(101, "goal_position") == round(before)


@pytest.mark.parametrize("units", [1, 2, 5])
def test_the_watchdog_stops_it_when_the_host_is_silent(units: int) -> None:
    host = WireHost(FREE)
    host.drive()
    host.write(101, "bus_watchdog", units)
    for _ in range(50):
        host.aim({101: 4000})
        host.sleep(2.0)
    servo = host.simulation.servos[0]
    silent_ns = host.now_ns
    assert servo.motor.velocity > 1000
    host.sleep(1000)
    late_ms = (servo.tripped_ns - silent_ns) / 1e6
    assert units * 20 - 5 <= late_ms <= units * 20 + 2
    stopped = next(s for s in host.simulation.samples if s.stamp_ns >= servo.tripped_ns)
    # Ten milliseconds' worth of motion, and it holds under torque.
    assert abs(servo.motor.position - stopped.ticks[0]) < 30
    assert servo.motor.torque
    assert host.read(101, "bus_watchdog") == WATCHDOG_TRIPPED
    assert host.write(101, "goal_position", 3000) == StatusError.DATA_RANGE
    assert host.write(101, "bus_watchdog", 0) == 0
    host.sleep(200)
    assert servo.motor.velocity == 0.0
    assert host.write(101, "goal_position", 3000) == 0


def test_a_tripped_watchdog_trips_in_time_after_a_rest() -> None:
    """While all stand still no steps are made; the watchdog is noticed all the same."""
    host = WireHost(FREE)
    host.drive()
    host.write(101, "bus_watchdog", 2)
    host.now_ns += 500_000_000
    host.simulation.advance(host.now_ns)
    assert host.read(101, "bus_watchdog") == WATCHDOG_TRIPPED


def test_without_torque_a_bent_segment_springs_straight() -> None:
    host = WireHost(TAUT)
    host.drive()
    start = [servo.motor.position for servo in host.simulation.servos]
    host.aim({101: round(start[0] - 300), 103: round(start[2] + 300)})
    host.sleep(1500)
    bent = host.simulation.segment.u
    assert bent > 0.5
    host.sleep(1000)
    assert host.simulation.segment.u == pytest.approx(bent, abs=1e-3)
    for servo in IDS:
        host.write(servo, "torque_enable", 0)
    host.sleep(4000)
    assert abs(host.simulation.segment.u) < 0.35 * bent


def test_a_slack_tendon_loads_nothing_and_a_taut_one_does() -> None:
    host = WireHost()
    host.drive(15)
    start = [servo.motor.position for servo in host.simulation.servos]
    loads = []
    for pulled in range(0, 600, 20):
        host.aim({servo: round(tick - pulled) for servo, tick in zip(IDS, start, strict=True)})
        host.sleep(100)
        loads.append([abs(host.read(servo, "present_load")) / 10.0 for servo in IDS])
    # In percent: friction alone at first, then more and more of the tendon.
    assert max(loads[4]) < 4.0
    assert min(loads[-1]) > 10.0


def test_a_reversed_servo_pays_out_where_the_others_pull() -> None:
    host = WireHost(TAUT)
    host.simulation.reverse(1)
    host.drive()
    host.aim(
        {
            servo: round(s.motor.position - 200)
            for servo, s in zip(IDS, host.simulation.servos, strict=True)
        }
    )
    host.sleep(1500)
    tensions = host.simulation.segment.tensions_n
    assert tensions[1] == 0.0
    assert min(tensions[0], tensions[2], tensions[3]) > 0.5


def test_the_segment_bends_where_the_robots_tendons_say(rng: np.random.Generator) -> None:
    shape = SegmentShape()
    segment = Segment(shape)
    servo = np.empty(4)
    for _ in range(50):
        u, v = rng.uniform(-1.2, 1.2, 2)
        servo_angles(u, v, shape.pitch_radius_m, shape.pulley_radius_m, servo)
        # All tendons stretched by 2 mm more than the path takes.
        segment.settle(list(servo), [-2e-3] * 4)
        assert min(segment.tensions_n) > 0.0
        scale = shape.tendon_stiffness_n_m * 2 * shape.pitch_radius_m**2
        lost = shape.bending_stiffness_nm_rad / (scale + shape.bending_stiffness_nm_rad)
        assert (segment.u, segment.v) == pytest.approx((u * (1 - lost), v * (1 - lost)), abs=1e-6)


def test_the_segment_is_always_in_balance(rng: np.random.Generator) -> None:
    """Moments of tendons, backbone and stop sum up to nothing, from any start."""
    shape = SegmentShape()
    segment = Segment(shape)
    for _ in range(300):
        spools, slack = rng.uniform(-3.0, 3.0, 4), rng.uniform(-2e-3, 2e-3, 4)
        segment.settle(list(spools), list(slack))
        for bend, toward, away in ((segment.u, 0, 2), (segment.v, 3, 1)):
            pull = segment.tensions_n[toward] - segment.tensions_n[away]
            moment = shape.pitch_radius_m * pull - shape.bending_stiffness_nm_rad * bend
            stop = max(abs(bend) - math.radians(110.0), 0.0) * 5.0
            assert moment == pytest.approx(math.copysign(stop, bend), abs=1e-9)


@pytest.mark.parametrize(
    ("register", "value", "bit", "torque"),
    [
        ("volt", 5.0, HardwareError.INPUT_VOLTAGE, True),
        ("celsius", 80.0, HardwareError.OVERHEATING, False),
    ],
)
def test_protections_set_bits_and_the_mask_decides_on_torque(
    register: str, value: float, bit: HardwareError, torque: bool
) -> None:
    host = WireHost(FREE)
    host.drive()
    servo = host.simulation.servos[0]
    setattr(servo, f"forced_{register}", value)
    host.simulation.disturb()
    host.sleep(5)
    assert host.read(101, "hardware_error_status") == bit
    assert host.read(101, "torque_enable") == torque
    assert host.write(101, "led", 1) == ALERT


def test_pulling_against_a_stop_for_long_is_an_overload() -> None:
    stiff = SegmentShape(tendon_stiffness_n_m=80e3)
    host = WireHost(Mounting(slack_m=(0.0,) * 4, shape=stiff))
    host.drive()
    host.aim(dict.fromkeys(IDS, 0))
    host.sleep(6000)
    assert host.read(101, "hardware_error_status") == HardwareError.OVERLOAD
    assert host.read(101, "torque_enable") == 0


def test_a_stuck_encoder_makes_the_servo_run_away_unseen() -> None:
    host = WireHost(FREE)
    host.drive()
    servo = host.simulation.servos[0]
    servo.motor.stuck_at = servo.motor.position
    before = host.read(101, "present_position")
    host.aim({101: before + 200})
    host.sleep(500)
    assert host.read(101, "present_position") == before
    assert servo.motor.position > before + 300
