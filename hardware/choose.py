"""Which robot stands behind the controller."""

from __future__ import annotations

import numpy as np

from hardware.arm.device import ArmDevice
from hardware.faulty_plant import FaultyPlant, plant_faults
from hardware.kinematic_plant import KinematicPlant
from hardware.physics.plant import PhysicsPlant
from hardware.plant import Plant
from robot.configuration import Configuration
from robot.records import ARM_JOINTS
from scenes.boards.board import board


def make_plant(configuration: Configuration, x: np.ndarray) -> Plant:
    """The plant that the configuration names, standing at ``x`` if it is simulated.

    Args:
        configuration: describes robot, simulation and hardware.
        x: (10,) the controller's configuration at the start.

    Raises:
        KeyholeError: a real part cannot be used as it is configured.
    """
    if configuration.hardware.connected:
        return _real(configuration, x)
    return simulated_plant(configuration, x)


def simulated_plant(configuration: Configuration, x: np.ndarray) -> Plant:
    """The simulated robot that ``configuration.simulation`` names, standing at ``x`` (10,)."""
    simulation = configuration.simulation
    if simulation.plant == "kinematic":
        return KinematicPlant(configuration, x)
    return PhysicsPlant(configuration, x, board(simulation.board, configuration))


def breakable_tubes(configuration: Configuration, q: np.ndarray) -> Plant:
    """Simulated concentric-tube arms that stand at ``q`` (4n,) and may be broken on request."""
    from hardware.tube_plant import TubePlant

    return FaultyPlant(TubePlant(configuration, q), plant_faults(configuration))


def breakable_plant(configuration: Configuration, x: np.ndarray) -> Plant:
    """As :func:`make_plant`; a simulated robot may then be broken on request."""
    plant = make_plant(configuration, x)
    if not plant.spec.simulated:
        return plant
    unit = plant if isinstance(plant, PhysicsPlant) else None
    return FaultyPlant(plant, plant_faults(configuration), unit)


def _real(configuration: Configuration, x: np.ndarray) -> Plant:
    from hardware.hybrid_plant import HybridPlant
    from hardware.module.module import InstrumentModule

    arm = _arm(configuration, x[:ARM_JOINTS])
    try:
        return HybridPlant(configuration, arm, InstrumentModule(configuration))
    except BaseException:
        arm.close()
        raise


def _arm(configuration: Configuration, q: np.ndarray) -> ArmDevice:
    wanted = configuration.hardware.arm
    if wanted == "xarm":
        from hardware.arm.xarm import XArm

        return XArm(configuration)
    if wanted == "locked":
        from hardware.arm.locked import LockedArm

        return LockedArm(q)
    from hardware.arm.simulated import SimulatedArm
    from hardware.physics.preset import PRESETS

    speeds = np.array([joint.speed_rad_s for joint in configuration.arm.joints])
    return SimulatedArm(q, PRESETS[configuration.simulation.preset], speeds)
