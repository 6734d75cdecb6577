"""Tests of ``scenes``."""
