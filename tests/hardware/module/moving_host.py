"""A host that homes, over and over, until it is killed: ``python -m ... PORT``."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from hardware.module.module import InstrumentModule
from robot.records import Readiness
from server.configuration_file import load


def run(port: Path) -> None:
    """Drive the servos at ``port`` slowly; says "moving" when they begin to."""
    configuration = load()
    servos = configuration.servos.model_copy(update={"port": str(port), "homing_speed_deg_s": 10.0})
    module = InstrumentModule(configuration.model_copy(update={"servos": servos}))
    angles, loads = np.zeros(4), np.zeros(4)
    while True:
        if module.read(angles, loads).readiness == Readiness.NOT_HOMED:
            module.home()
            print("moving", flush=True)
            time.sleep(0.5)
        time.sleep(0.01)


if __name__ == "__main__":
    run(Path(sys.argv[1]))
