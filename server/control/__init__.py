"""The control process: the only loop, its deadlines, and who leads."""
