"""Tests of ``hardware``."""
