"""AUV docking on exact MuJoCo hydrodynamics."""

from auvsim.base.compiled import choose_cache
from auvsim.base.renderer import choose_renderer

__version__ = "0.1.0"

RENDERER_NOTE = choose_renderer()  # before anything here imports MuJoCo
CACHE_NOTE = choose_cache()  # before anything here imports numba
