"""Tests of ``robot``."""
