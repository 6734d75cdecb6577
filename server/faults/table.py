"""All faults, each injected into a console of its kind, and the table of what was found."""

from __future__ import annotations

import contextlib
import platform
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from robot.configuration import Configuration
from robot.errors import KeyholeError, UnknownName
from server.configuration_file import load
from server.faults.bench import Bench
from server.faults.bus_faults import BUS_FAULTS
from server.faults.control_faults import CONTROL_FAULTS
from server.faults.fault import Fault, Finding, row
from server.faults.input_faults import INPUT_FAULTS
from server.faults.pose_faults import POSE_FAULTS
from server.faults.stylus_faults import STYLUS_FAULTS
from server.faults.surroundings_faults import SURROUNDINGS_FAULTS
from server.faults.system_faults import LAST_FAULTS, SYSTEM_FAULTS
from server.faults.tension_faults import TENSION_FAULTS, with_tension_unit

SCHEMA_VERSION = 1
_ATTEMPTS = 3
FAULTS: tuple[Fault, ...] = (
    *BUS_FAULTS,
    *STYLUS_FAULTS,
    *INPUT_FAULTS,
    *CONTROL_FAULTS,
    *SYSTEM_FAULTS,
    *SURROUNDINGS_FAULTS,
    *POSE_FAULTS,
    *LAST_FAULTS,
    *TENSION_FAULTS,
)


def chosen(names: Sequence[str]) -> tuple[Fault, ...]:
    """The faults of these names, in the table's order; all of them where none is named.

    Raises:
        UnknownName: a name is none.
    """
    known = tuple(fault.name for fault in FAULTS)
    for name in names:
        if name not in known:
            raise UnknownName("fault", name, known)
    return tuple(fault for fault in FAULTS if not names or fault.name in names)


def bench_configuration(base: Configuration) -> Configuration:
    """The configuration of the console that is broken: nothing stands before the instrument."""
    return base.model_copy(
        update={"simulation": base.simulation.model_copy(update={"board": "none"})}
    )


def run(
    faults: Sequence[Fault],
    configuration: Configuration | None = None,
    progress: Callable[[float, str], None] = lambda share, name: None,
) -> dict[str, Any]:
    """Inject each of ``faults``; the document of ``keyhole faults --json``.

    Args:
        faults: from :data:`FAULTS`.
        configuration: of the console; None for the default.
        progress: called with the share done and the name of the next fault.
    """
    started = time.monotonic()
    base = bench_configuration(configuration or load())
    rows: list[dict[str, Any]] = []
    with (
        tempfile.TemporaryDirectory(prefix="keyhole-faults-") as folder,
        # Who interrupts it gets what was measured until then.
        contextlib.suppress(KeyboardInterrupt),
    ):
        for kind in ("simulated", "hardware", "tension-unit"):
            own = [fault for fault in faults if fault.needs == kind]
            if not own:
                continue
            broken = with_tension_unit(base) if kind == "tension-unit" else base
            with Bench(Path(folder) / kind, broken, hardware=kind == "hardware") as bench:
                for fault in own:
                    progress(len(rows) / len(faults), fault.name)
                    rows.append(measured(bench, fault))
    progress(1.0, "")
    return {
        "schema_version": SCHEMA_VERSION,
        "machine": {"system": platform.platform(), "python": platform.python_version()},
        "seconds": round(time.monotonic() - started, 1),
        "complete": len(rows) == len(faults),
        "met": len(rows) == len(faults) and all(one["met"] for one in rows),
        "undetected": [one["fault"] for one in rows if not one["detected"]],
        "faults": rows,
    }


def measured(bench: Bench, fault: Fault) -> dict[str, Any]:
    """One row; what goes wrong with the injection itself is said in it, and the rest goes on.

    Where the robot was stopped by something else, as on a busy machine a leader's late sample does,
    nothing is known of the fault: it is injected again.
    """
    finding = Finding()
    for attempt in range(1, _ATTEMPTS + 1):
        try:
            finding = fault.measure(bench, fault)
        except (KeyholeError, OSError, IndexError) as error:
            with contextlib.suppress(KeyholeError, OSError):
                fault.mend(bench)
            finding = Finding(message=f"not measured: {error}")
        finding.attempts = max(finding.attempts, attempt)
        if finding.detected and finding.recovered is not False:
            break
    return row(fault, finding, bench.limit_ms(fault.deadline))


def printed(document: dict[str, Any]) -> str:
    """The table for people."""
    lines = [f"{'':2} {'fault':<28} {'noticed ms':>11} {'limit':>6} {'state':<13} "
             f"{'travel mm':>9} {'coast mm':>8}  message"]  # fmt: skip
    for one in document["faults"]:
        numbers = [
            "-" if one[key] is None else f"{one[key]:.{places}f}"
            for key, places in (
                ("detected_within_ms", 1),
                ("limit_ms", 0),
                ("commanded_travel_mm", 3),
                ("coast_mm", 3),
            )
        ]
        noticed, limit, travel, coast = numbers
        lines.append(
            f"{'ok' if one['met'] else '!!'} {one['fault']:<28} {noticed:>11} {limit:>6} "
            f"{one['state']:<13} {travel:>9} {coast:>8}  {one['message']}"
        )
    met = sum(one["met"] for one in document["faults"])
    lines.append(
        f"{met} of {len(document['faults'])} as demanded, "
        f"{len(document['undetected'])} undetected, in {document['seconds']:.0f} s"
    )
    return "\n".join(lines)
