"""Breaks a running console on purpose, and measures what it does about it."""
