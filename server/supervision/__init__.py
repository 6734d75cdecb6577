"""The supervisor: starts, watches and ends the other processes."""
