"""The 3D scene that viser shows."""
