"""The audit log: what happened to a console, by whom, and what was refused."""
