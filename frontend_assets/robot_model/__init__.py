"""The robot's looks: arm, instrument module and shaft as URDF and meshes, built from code.

``python -m frontend_assets.robot_model`` rebuilds the committed files from the default
configuration. The server asks :func:`ensure_model` for the folder; other viewers start from
``frontend_assets.robot_model.viewing``.
"""

from frontend_assets.robot_model.build import build_model, ensure_model

__all__ = ["build_model", "ensure_model"]
