"""Vehicles and structures: loading their models, and their actuation."""
