"""The instrument module: four servos, their tendons, and the thread that talks to them."""
