"""Processes, records, the web, the scene view and the command line."""
