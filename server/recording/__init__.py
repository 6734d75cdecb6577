"""Recordings: writing them, reading them back, checking them, and showing them again."""
