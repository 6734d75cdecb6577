"""The servo bus: Dynamixel Protocol 2.0 on a serial port."""
