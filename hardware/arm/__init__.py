"""The arm that carries the instrument module: locked, simulated, or a real xArm 7."""
