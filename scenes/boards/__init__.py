"""What the instrument works on: boards with pegs, a groove and a ball, or rings."""
