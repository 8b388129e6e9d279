"""Hydrodynamics in MuJoCo: forces, the fluid callback, scenes, the world and its truth."""
