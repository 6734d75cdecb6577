"""The robot's looks: arm, instrument module and shaft as URDF and meshes, built from code.

``python -m frontend_assets.robot_model`` rebuilds the committed files from the default
configuration. Viewers call :func:`ensure_model` and :func:`load_urdf`.
"""

from frontend_assets.robot_model.build import build_model, ensure_model
from frontend_assets.robot_model.viewing import disk_mesh, load_urdf

__all__ = ["build_model", "disk_mesh", "ensure_model", "load_urdf"]
