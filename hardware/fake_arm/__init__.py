"""A stand-in for an xArm 7's controller that the vendor's own library connects to."""
