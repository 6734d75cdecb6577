"""Tension control with redundant tendons (paper 3, II-A and II-C)."""
