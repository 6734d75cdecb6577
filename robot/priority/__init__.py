"""Priorities: levels as selections of task rows, limits above them all, and two ways to solve."""
