"""Tests of the simulated rod."""
