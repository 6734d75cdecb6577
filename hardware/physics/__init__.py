"""The simulated robot: physics that shares nothing with the controller's kinematics."""
