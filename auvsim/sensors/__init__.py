"""Sensors on board: one sensor a file."""
