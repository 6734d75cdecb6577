"""The loop of the robot that a configuration chooses: its controller, compiled, and its plant."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

from robot.calibration import Calibration
from robot.configuration import Configuration
from server.control.loop import ControlLoop
from server.memory.run_directory import RunDirectory


def make_loop(
    directory: RunDirectory, configuration: Configuration, say: Callable[[str], None]
) -> ControlLoop:
    """Make controller and plant, with every function compiled that a tick may need.

    Args:
        directory: where a calibration is kept for the other processes.
        configuration: chooses the robot.
        say: told what takes time.

    Raises:
        KeyholeError: a part of the robot cannot be used as it is configured.
    """
    say("compiling the controller (only after an update)")
    if configuration.robot == "concentric":
        return _concentric(configuration)
    return _instrument(directory, configuration, say)


def _instrument(
    directory: RunDirectory, configuration: Configuration, say: Callable[[str], None]
) -> ControlLoop:
    from hardware.choose import breakable_plant
    from robot.instrument_robot import InstrumentRobot
    from server.control.instrument_loop import InstrumentLoop
    from server.control.warm_up import warm_up

    warm_up(InstrumentRobot(configuration), configuration)
    calibration = directory.calibration()
    if calibration is None:
        calibration = _calibration(configuration, say)
        directory.write_calibration(calibration)
    robot = InstrumentRobot(configuration, calibration)
    start = robot.initial_state()["x"][0]
    return InstrumentLoop(robot, breakable_plant(configuration, start), configuration)


def _concentric(configuration: Configuration) -> ControlLoop:
    from hardware.choose import breakable_tubes
    from robot.concentric.concentric_robot import ConcentricRobot
    from server.control.concentric_loop import ConcentricLoop
    from server.control.warm_up import warm_up_tubes

    robot = ConcentricRobot(configuration)
    warm_up_tubes(robot)
    start = robot.initial_state()["q"][0]
    return ConcentricLoop(robot, breakable_tubes(configuration, start), configuration)


def _calibration(configuration: Configuration, say: Callable[[str], None]) -> Calibration:
    """The calibration that is kept for this robot; a simulated one is calibrated where none is."""
    from server.calibration.file import CalibrationFileError, default_path, load_if_there, save
    from server.calibration.sweep import calibration_for

    path = default_path(configuration)
    kept = load_if_there(path)
    if kept is not None:
        return kept
    if configuration.hardware.connected:
        # The bend of a real robot is measured by nothing here: it has to be given as a file.
        return Calibration()
    say("calibrating the tendons (a few seconds, once)")
    # Made whatever the mode is now: it may be chosen later.
    full = configuration.compensation.model_copy(update={"mode": "full"})
    made = calibration_for(configuration.model_copy(update={"compensation": full}))
    with contextlib.suppress(CalibrationFileError):
        save(path, made)
    return made
