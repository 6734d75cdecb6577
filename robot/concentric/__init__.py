"""The second robot: two concentric-tube arms that leave one endoscope side by side."""
