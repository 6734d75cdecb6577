"""A byte-exact simulator of XL430-W250 servos on a pseudo-terminal, for any driver."""
