"""Rebuild the committed URDF and meshes from the default configuration."""

from __future__ import annotations

import sys
import tomllib
from importlib import resources

from frontend_assets.robot_model.build import FOLDER, build_model
from robot.configuration import parse


def main() -> int:
    """Write ``keyhole.urdf`` and ``meshes/`` beside this file."""
    source = resources.files("robot") / "keyhole.toml"
    configuration = parse(tomllib.loads(source.read_text(encoding="utf-8")), "keyhole.toml")
    print(build_model(configuration, FOLDER))
    return 0


if __name__ == "__main__":
    sys.exit(main())
