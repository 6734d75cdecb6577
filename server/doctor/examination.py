"""The examination from beginning to end."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from hardware.servos.errors import BusError
from robot.configuration import Servos
from server.doctor import arm, machine, ports, servo_bus
from server.doctor.finding import Finding, failure
from server.memory.run_directory import default_path


def examine(
    configuration_path: Path | None = None,
    port: str | None = None,
    baud_rate: int | None = None,
    scan: bool = False,
    run_directory: Path | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> list[Finding]:
    """Look at everything.

    Args:
        configuration_path: file that the user means; None for the one that comes along.
        port: in place of the configuration's.
        baud_rate: likewise.
        scan: whether to look for servos at every speed.
        run_directory: of the console; None for the usual one.
        say: told what takes long.
    """
    configuration, finding = machine.configuration(configuration_path)
    findings = [
        finding,
        machine.run_directory(run_directory or default_path()),
        machine.processors(),
        machine.scheduling(),
        machine.memory(),
    ]
    changed = {"port": port, "baud_rate": baud_rate}
    update = {key: value for key, value in changed.items() if value is not None}
    settings = configuration.servos.model_copy(update=update)
    connected = configuration.hardware.connected or port is not None
    paths, port_findings = ports.find(settings.port, connected)
    findings += port_findings
    for path in paths:
        findings += _servos(path, settings, scan, say)
    return findings + arm.examine(configuration.hardware)


def _servos(path: str, settings: Servos, scan: bool, say: Callable[[str], None]) -> list[Finding]:
    opened, findings = ports.open_port(path, settings.baud_rate)
    if opened is None:
        return findings
    say(f"asking the servos at {path}")
    try:
        findings += servo_bus.examine(opened, settings)
    except BusError as error:
        findings.append(
            failure(
                "servos",
                str(error),
                "the port went away while the servos were asked",
                "plug the adapter in again",
            )
        )
    finally:
        opened.close()
    return findings + servo_bus.scan(path, settings, say) if scan else findings
