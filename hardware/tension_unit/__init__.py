"""The tension-feedback unit of paper 3, simulated: motors, gears, pulleys, torque cells."""
