"""What is well and what is not on this machine, and what to do about it. Nothing is changed."""
