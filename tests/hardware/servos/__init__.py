"""Tests of ``hardware.servos``."""
