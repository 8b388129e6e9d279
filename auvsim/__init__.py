"""AUV docking on exact MuJoCo hydrodynamics."""

__version__ = "0.1.0"
