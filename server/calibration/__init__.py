"""Calibration of the tendons: the sweep that makes one, and the file that keeps it."""
