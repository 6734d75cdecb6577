"""Tests of ``hardware.tension_unit``."""
