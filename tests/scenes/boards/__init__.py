"""Tests of ``scenes.boards``."""
