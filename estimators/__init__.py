"""Estimators for underwater vehicles: process models, filters and the handling of delayed measurements.

A library of its own: it needs numpy, scipy, casadi and numba and knows nothing of any simulator, so that it also runs
on a real vehicle's log. States, angles and currents are in north-east-down, SI units and radians.
"""
