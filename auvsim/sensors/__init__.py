"""Sensors on board, one per file."""
