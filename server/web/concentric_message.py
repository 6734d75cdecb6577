"""What the state message tells of the concentric-tube arms beside what all robots share. Pure."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.concentric.concentric_robot import ARMS, describe_limits
from robot.concentric.design import METHODS
from robot.configuration import Configuration
from robot.records import Refusal
from server.web.state_message import (
    StateMessages,
    Surroundings,
    degrees,
    error_source,
    millimetres,
    pose,
    rounded,
)


class ConcentricMessages(StateMessages):
    """Makes state messages of the concentric-tube arms.

    Args:
        configuration: of the robot whose records come.
    """

    CONFIGURED = (*StateMessages.CONFIGURED, "method", "relative_limit_mm", "stability_limit")

    REFUSED = StateMessages.REFUSED | {
        Refusal.BEHIND_TROCAR: (
            "the target is behind the endoscope's face; the tip stays in front of it",
            "aim in front of it",
        ),
    }

    def __init__(self, configuration: Configuration) -> None:
        super().__init__(configuration)
        self._tubes = len(configuration.concentric.tubes)
        self._limits = configuration.concentric.limits

    def _set_configured(self, settings: NDArray[Any]) -> None:
        settings["method"] = METHODS.index(self._configuration.concentric.method)

    def load(self) -> None:
        """There is nothing to find out."""

    def _own(self, record: np.void, around: Surroundings) -> dict[str, Any]:
        truth, report = record["truth"], record["outcome"]["report"]
        status = int(report["solver_status"])
        return {
            "method": METHODS[int(record["input"]["settings"]["method"])],
            "errors": {
                "position_mm": rounded(truth["position_error"] * 1e3, 6),
                "relative_mm": rounded(truth["relative_error"] * 1e3, 6),
                "source": error_source(truth),
            },
            "relative_limit_mm": self._limits.relative_error_mm,
            "stability_limit": self._limits.stability_margin,
            "desired_b_mm": millimetres(report["desired_b"]),
            "commanded_b": pose(report["position_b"], report["wxyz_b"]),
            "true_b": pose(truth["position_b"], truth["wxyz_b"]),
            "arms": [self._arm(record, arm) for arm in range(len(ARMS))],
            "task_scale": {
                "relative": rounded(report["task_scale"][0], 5),
                "tracking": rounded(report["task_scale"][1], 5),
            },
            "limits": describe_limits(int(report["limits_active"]), status, self._tubes),
        }

    def _arm(self, record: np.void, arm: int) -> dict[str, Any]:
        report, n = record["outcome"]["report"], self._tubes
        first = 2 * n * arm
        bounds = slice(n * arm, n * (arm + 1))
        measured = record["input"]["measured_q"]
        return {
            "name": ARMS[arm],
            "translations_mm": millimetres(report["q"][first : first + n]),
            "translations_measured_mm": millimetres(measured[first : first + n]),
            "lower_mm": millimetres(report["bound_lower"][bounds]),
            "upper_mm": millimetres(report["bound_upper"][bounds]),
            "rotations_deg": degrees(report["q"][first + n : first + 2 * n]),
            "stability": rounded(report["stability"][arm], 5),
        }
