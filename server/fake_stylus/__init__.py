"""A stylus that is none: it plays a path at 500 Hz, presses its buttons, and fails on demand."""
