"""Headless runs: what is asked for, the run, and its figures."""
