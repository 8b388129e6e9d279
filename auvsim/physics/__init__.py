"""Hydrodynamics in MuJoCo: forces, the fluid callback, scenes, the world and its truth."""

from auvsim.base.neighbours import check_estimators

check_estimators()
