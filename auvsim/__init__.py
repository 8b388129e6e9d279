"""Simulation of autonomous underwater vehicles with exact added-mass hydrodynamics in MuJoCo.

`run`, `load_scenario`, `read_log` and `summarise` are imported when they are first used: `import auvsim` stays fast.
"""

from importlib import import_module
from typing import Any

from auvsim.base.compiled import choose_cache
from auvsim.base.renderer import choose_renderer

__version__ = "0.1.0"

RENDERER_NOTE = choose_renderer()  # before anything here imports MuJoCo
CACHE_NOTE = choose_cache()  # before anything here imports numba

_FIRST_CELL = {  # the names of a notebook's first cell, and where they are
    "run": ("auvsim.simulation.run", "run"),
    "load_scenario": ("auvsim.simulation.loading", "load_scenario"),
    "read_log": ("auvsim.data.log", "read"),
    "summarise": ("auvsim.analysis.summary", "summarise"),
}


def __getattr__(name: str) -> Any:
    if name not in _FIRST_CELL:
        raise AttributeError(f"module 'auvsim' has no attribute '{name}'; it offers {', '.join(_FIRST_CELL)}")
    module, attribute = _FIRST_CELL[name]
    return getattr(import_module(module), attribute)
