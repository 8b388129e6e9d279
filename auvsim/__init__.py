"""AUV docking on exact MuJoCo hydrodynamics."""

from auvsim.base.renderer import choose_renderer

__version__ = "0.1.0"

choose_renderer()  # before anything here imports MuJoCo
