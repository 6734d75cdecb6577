"""On what a recording was made: bit for bit the same is promised only there."""

from __future__ import annotations

import platform
from importlib import metadata

from server.version import version

PACKAGES = ("numpy", "numba", "llvmlite", "daqp", "pin", "libpinocchio", "mujoco-core", "scipy")


def versions() -> dict[str, str]:
    """Version of this program, of Python, and of every package that computes."""
    found = {"keyhole": version(), "python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found


def machine() -> dict[str, str]:
    """Operating system, machine type, and the processor for which numba compiles."""
    from llvmlite import binding

    return {
        "system": platform.system(),
        "machine": platform.machine(),
        "processor": str(binding.get_host_cpu_name()),
    }


def differences(recorded: dict[str, str]) -> list[str]:
    """What is otherwise here than where ``recorded`` was made, each in words."""
    here = {**versions(), **machine()}
    return [
        f"{name}: {recorded[name]} then, {now} now"
        for name, now in here.items()
        if recorded.get(name, now) != now
    ]
