"""Tests of the servo simulator."""
