"""Estimators of a vehicle that a dock locates acoustically (Qiu and Li 2019, and beyond)."""
