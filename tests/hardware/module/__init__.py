"""Tests of ``hardware.module``."""
