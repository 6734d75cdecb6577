"""What the robot works in: reference paths and the experiments that run on them."""
