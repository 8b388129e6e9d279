"""The planar model's own equations with this package's loops behind them, as one compiled module each.

The loops stand in ordinary files, but are compiled as part of a generated one that begins with the CasADi model written
out as Python: machine code on disk then changes whenever the model does.
"""

import hashlib
import inspect
import platform
from functools import lru_cache
from types import ModuleType

import casadi as ca
import numba

from auvsim.identification import filter_loops, information_loops, segment_loops
from estimators.core import loops
from estimators.core.compiling import is_ready, load
from estimators.core.kernels import python_source
from estimators.planar.model import PARAMETER_NAMES, accelerations, step_function


@lru_cache
def segments() -> ModuleType:
    """The functions of `segment_loops`, compiled at their first call."""
    return load_behind("planar_segments", _linearise(), segment_loops)


@lru_cache
def information() -> ModuleType:
    """The functions of `information_loops`, which build on those of `segment_loops`, compiled at their first call."""
    return load_behind("planar_information", _linearise(), segment_loops, information_loops)


@lru_cache
def filters() -> ModuleType:
    """The functions of `filter_loops`, on the step that the docking filters take, compiled at their first call."""
    arguments = ("x", "u", "p", "h"), ("following", "F")
    return load_behind(
        "planar_record_filter", python_source(step_function(), "step", *arguments, scalars=("h",)), filter_loops
    )


def is_warm() -> bool:
    """Whether a fit starts at once; if not, the first one compiles for some seconds."""
    return is_ready(segments().normal_equations) and is_ready(filters().trace)


def _linearise() -> str:
    nu, u, p = ca.SX.sym("nu", 3), ca.SX.sym("u", 2), ca.SX.sym("p", len(PARAMETER_NAMES))
    l = accelerations(nu, u[0], u[1], p)
    function = ca.Function("linearise", [nu, u, p], ca.cse([l, ca.jacobian(l, nu), ca.jacobian(l, p)]))
    return python_source(function, "linearise", ("nu", "u", "p"), ("l", "A", "B"))


def load_behind(name: str, model: str, *behind: ModuleType) -> ModuleType:
    """A module of the model's source with the loops of other modules behind it."""
    loops_hash = hashlib.sha256(inspect.getsource(loops).encode()).hexdigest()[:16]
    comment = f"# Machine code made of this depends on Python {platform.python_version()}, numba {numba.__version__}"
    imports = "import math\n\nfrom estimators.core.compiling import compiled"
    head = f"{comment}, loops {loops_hash}.\n{imports}\n\n\n@compiled\n"
    return load(name, head + "\n\n".join((model, *map(inspect.getsource, behind))))
