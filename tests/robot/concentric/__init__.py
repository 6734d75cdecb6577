"""Tests of ``robot.concentric``."""
