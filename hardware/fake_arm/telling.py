"""The reports that the fake controller sends by itself."""

from __future__ import annotations

import numpy as np

from hardware.arm.reports import NORMAL, REAL, RICH
from hardware.fake_arm.controller import VERSION, Controller

_ALL = 0x7F
_AXES, _TYPE = 7, 7
_SENSITIVITY = 3


def _head(controller: Controller, form: np.dtype) -> np.ndarray:
    report = np.zeros((), form)
    report["length"] = form.itemsize
    report["state_and_mode"] = controller.state | controller.mode << 4
    report["q"] = controller.q
    return report


def _fill_normal(report: np.ndarray, controller: Controller) -> None:
    report["brakes"] = report["enabled"] = _ALL if controller.enabled else 0
    report["error"], report["warning"] = controller.error, controller.warning
    report["payload"] = controller.payload
    report["collision_sensitivity"] = controller.collision_sensitivity
    report["teaching_sensitivity"] = _SENSITIVITY
    report["gravity"] = (0.0, 0.0, -1.0)


def real(controller: Controller) -> bytes:
    """Joints and state, as the fast report has them."""
    return _head(controller, REAL).tobytes()


def normal(controller: Controller) -> bytes:
    """With error codes, brakes and payload."""
    report = _head(controller, NORMAL)
    _fill_normal(report, controller)
    return report.tobytes()


def rich(controller: Controller) -> bytes:
    """With what the arm is and what it may do."""
    report = _head(controller, RICH)
    _fill_normal(report, controller)
    report["arm_type"], report["axes"] = _TYPE, _AXES
    report["version"] = VERSION.rpartition(",")[2].encode()
    report["temperature_c"] = 30
    return report.tobytes()
