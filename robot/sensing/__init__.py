"""What sensors say beyond the encoders, and what it changes."""
