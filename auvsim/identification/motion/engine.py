"""The terms' equations with the loops of fits and predictions behind them, as one compiled module."""

from functools import lru_cache
from types import ModuleType

import casadi as ca
import numpy as np

from auvsim.identification import segment_loops
from auvsim.identification.compiled import load_behind
from auvsim.identification.motion import rollout_loops
from auvsim.identification.segment_problem import Equations
from estimators.core.compiling import is_ready
from estimators.core.kernels import python_source
from estimators.planar.terms import INPUTS, PARAMETERS, accelerations


@lru_cache
def loops() -> ModuleType:
    """The functions of `segment_loops` and `rollout_loops` on the terms, compiled at their first call."""
    nu, u, p = ca.SX.sym("nu", 3), ca.SX.sym("u", INPUTS), ca.SX.sym("p", len(PARAMETERS))
    l = accelerations(nu, u, p)
    function = ca.Function("linearise", [nu, u, p], ca.cse([l, ca.jacobian(l, nu), ca.jacobian(l, p)]))
    source = python_source(function, "linearise", ("nu", "u", "p"), ("l", "A", "B"))
    return load_behind("terms_segments", source, segment_loops, rollout_loops)


EQUATIONS = Equations(PARAMETERS, loops, lambda p: not np.isnan(p).any())


def is_warm() -> bool:
    """Whether a fit starts at once; if not, the first one compiles for some seconds."""
    return is_ready(loops().normal_equations)
