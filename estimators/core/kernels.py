"""Compiled steps of process models: CasADi expressions written out as Python, which numba compiles.

So a user's machine needs no C compiler.
"""

import hashlib
import inspect
import math
import platform
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

import casadi as ca
import numba

from estimators.core import loops
from estimators.core.compiling import load
from estimators.core.errors import ParameterError

OPERATIONS = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_NEG: "-{0}",
    ca.OP_EXP: "math.exp({0})",
    ca.OP_LOG: "math.log({0})",
    ca.OP_POW: "{0} ** {1}",
    ca.OP_CONSTPOW: "{0} ** {1}",
    ca.OP_SQRT: "math.sqrt({0})",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2.0 * {0}",
    ca.OP_INV: "1.0 / {0}",
    ca.OP_SIN: "math.sin({0})",
    ca.OP_COS: "math.cos({0})",
    ca.OP_TAN: "math.tan({0})",
    ca.OP_ASIN: "math.asin({0})",
    ca.OP_ACOS: "math.acos({0})",
    ca.OP_ATAN: "math.atan({0})",
    ca.OP_ATAN2: "math.atan2({0}, {1})",
    ca.OP_SINH: "math.sinh({0})",
    ca.OP_COSH: "math.cosh({0})",
    ca.OP_TANH: "math.tanh({0})",
    ca.OP_FABS: "abs({0})",
    ca.OP_SIGN: "1.0 * ({0} > 0.0) - 1.0 * ({0} < 0.0)",
    ca.OP_FMIN: "min({0}, {1})",
    ca.OP_FMAX: "max({0}, {1})",
    # Comparisons give 0.0 or 1.0, without a branch.
    ca.OP_LT: "1.0 * ({0} < {1})",
    ca.OP_LE: "1.0 * ({0} <= {1})",
    ca.OP_EQ: "1.0 * ({0} == {1})",
    ca.OP_NE: "1.0 * ({0} != {1})",
    ca.OP_NOT: "1.0 * ({0} == 0.0)",
    ca.OP_AND: "1.0 * ({0} != 0.0) * 1.0 * ({1} != 0.0)",
    ca.OP_OR: "max(1.0 * ({0} != 0.0), 1.0 * ({1} != 0.0))",
    ca.OP_IF_ELSE_ZERO: "({1} if {0} != 0.0 else 0.0)",
}

KERNELS = '''

@compiled
def predict(mean, covariance, u, p, q, duration, substeps):
    """Mean and covariance after `duration` in equal `substeps`, and whether they are finite."""
    n = mean.size
    x, following = mean.copy(), np.empty(n)
    P, F, work = covariance.copy(), np.zeros((n, n)), np.empty((n, n))
    h = duration / substeps
    for _ in range(substeps):
        step(x, u, p, h, following, F)
        propagate(F, P, q, h, work)
        x, following = following, x
    for index in {wrapped}:
        x[index] = wrap(x[index])
    return x, P, is_finite(x, P)


@compiled
def predict_each(means, covariances, u, p, q, duration, substeps):
    """`predict` of each of several beliefs (m, n), (m, n, n), with noise of its own (m, n); whether all are finite."""
    X, P, finite = np.empty_like(means), np.empty_like(covariances), True
    for k in range(means.shape[0]):
        X[k], P[k], one = predict(means[k], covariances[k], u, p, q[k], duration, substeps)
        finite = finite and one
    return X, P, finite


@compiled
def move(points, u, p, duration, substeps):
    """Carries each of `points` (k, n) on by `duration` with the input held, in place and without wrapping angles."""
    n = points.shape[1]
    following, F = np.empty(n), np.empty((n, n))
    h = duration / substeps
    for point in points:
        for _ in range(substeps):
            step(point, u, p, h, following, F)
            point[:] = following


@compiled
def walk(start, inputs, p, h, increments):
    """States (k + 1, n) from `start`: steps of `h` under `inputs` (k, 2), each followed by noise (k, n)."""
    count, n = increments.shape
    states, F = np.empty((count + 1, n)), np.empty((n, n))
    states[0] = start
    for k in range(count):
        step(states[k], inputs[k], p, h, states[k + 1], F)
        states[k + 1] += increments[k]
    return states
'''

MOTION_KERNELS = '''

@compiled
def predict(mean, covariance, u, p, q, qu, duration, substeps):
    """Mean and covariance after `duration` in equal `substeps`, dx'/dx (n, n), and whether they are finite."""
    n = mean.size
    x, following = mean.copy(), np.empty(n)
    P, F, G, work = covariance.copy(), np.zeros((n, n)), np.zeros((n, qu.size)), np.empty((n, n))
    total = np.eye(n)
    h = duration / substeps
    for _ in range(substeps):
        step(x, u, p, h, following, F, G)
        propagate(F, P, q, h, work)
        for k in range(qu.size):
            if qu[k] > 0.0:
                for i in range(n):
                    for j in range(n):
                        P[i, j] += h * qu[k] * G[i, k] * G[j, k]
        if substeps > 1:
            total = F @ total
        x, following = following, x
    if substeps == 1:
        total = F
    for index in {wrapped}:
        x[index] = wrap(x[index])
    return x, P, total, is_finite(x, P)


@compiled
def move(points, u, p, duration, substeps):
    """Carries each of `points` (k, n) on by `duration` with the input held, in place and without wrapping angles."""
    n = points.shape[1]
    following, F, G = np.empty(n), np.empty((n, n)), np.empty((n, len(u)))
    h = duration / substeps
    for point in points:
        for _ in range(substeps):
            step(point, u, p, h, following, F, G)
            point[:] = following
'''


def step_kernels(function: ca.Function, wrapped: Sequence[int] = ()) -> ModuleType:
    """Compiles a discrete process model, given as an SX function (x, u, p, h) -> (x', F = dx'/dx).

    The module has `step(x, u, p, h, x', F)`, which fills its last two arguments (F only where it can differ from zero),
    and `predict(mean, covariance, u, p, q, duration, substeps) -> (mean, covariance, finite)`, where q (n,) holds power
    spectral densities of the process noise and the states `wrapped` are angles kept in (-pi, pi]; and `predict_each`,
    `move` and `walk` for several beliefs, many points and long trajectories, see KERNELS.
    """
    wrapping = repr((*wrapped,)) if wrapped else "range(0)"
    return _loaded(function, "step", ("x", "u", "p", "h"), ("following", "F"), KERNELS.format(wrapped=wrapping))


def motion_kernels(function: ca.Function, wrapped: Sequence[int] = ()) -> ModuleType:
    """Compiles a discrete process model, given as an SX function (x, u, p, h) -> (x', dx'/dx, dx'/du / h).

    The module has `predict(mean, covariance, u, p, q, qu, duration, substeps) -> (mean, covariance, dx'/dx, finite)`,
    with power spectral densities q (n,) of the states' noise and qu (k,) of the inputs'; and `move`.
    """
    wrapping = repr((*wrapped,)) if wrapped else "range(0)"
    kernels = MOTION_KERNELS.format(wrapped=wrapping)
    return _loaded(function, "step", ("x", "u", "p", "h"), ("following", "F", "G"), kernels, ("F", "G"))


def sensor_function(function: ca.Function) -> Callable[[Sequence[float], Sequence[float], list[float], Any], None]:
    """A sensor (x, z) -> (value, d value/dx) as plain Python `show(x, z, value, H)`, which fills its last two.

    So short that numba gains nothing over lists of numbers, and needs no seconds to compile.
    """
    space: dict[str, Any] = {"math": math}
    exec(python_source(function, "show", ("x", "z"), ("value", "H"), matrices=("H",)), space)
    return space["show"]


def _loaded(
    function: ca.Function,
    name: str,
    inputs: Sequence[str],
    outputs: Sequence[str],
    kernels: str,
    matrices: Sequence[str] = (),
) -> ModuleType:
    loops_hash = hashlib.sha256(inspect.getsource(loops).encode()).hexdigest()[:16]
    source = (
        f"# Written from the CasADi function {function.name()}. Machine code made of it depends on\n"
        f"# Python {platform.python_version()}, numba {numba.__version__}, loops {loops_hash}.\n"
        "import math\n\nimport numpy as np\n\n"
        "from estimators.core.compiling import compiled\n"
        "from estimators.core.loops import is_finite, propagate, wrap\n\n\n"
        "@compiled\n" + python_source(function, name, inputs, outputs, scalars=("h",), matrices=matrices) + kernels
    )
    return load(function.name(), source)


def python_source(
    function: ca.Function,
    name: str,
    inputs: Sequence[str],
    outputs: Sequence[str],
    scalars: Sequence[str] = (),
    matrices: Sequence[str] = (),
) -> str:
    """Straight-line Python of an SX `function`: reads its inputs, fills the structural nonzeros of its outputs.

    Outputs of one column are vectors, but for those named in `matrices`.

    Raises:
        ParameterError: The function holds an operation that has no scalar Python form.
    """
    lines = [f"def {name}({', '.join([*inputs, *outputs])}):"]
    names: dict[int, str] = {}  # work-vector element -> the variable that holds it now; each variable is assigned once
    places = [_places(function.sparsity_out(k), outputs[k] in matrices) for k in range(function.n_out())]
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_OUTPUT:
            lines.append(f"    {outputs[target[0]]}[{places[target[0]][target[1]]}] = {names[source[0]]}")
            continue
        if operation == ca.OP_CONST:
            value = repr(float(function.instruction_constant(k)))
        elif operation == ca.OP_INPUT:
            argument = inputs[source[0]]
            value = argument if argument in scalars else f"{argument}[{source[1]}]"
        elif operation in OPERATIONS:
            value = OPERATIONS[operation].format(*(names[i] for i in source))
        else:
            raise ParameterError(
                f"no Python form of CasADi operation {operation} in {function.name()}; known: see OPERATIONS"
            )
        names[target[0]] = f"w{k}"
        lines.append(f"    w{k} = {value}")
    return "\n".join(lines) + "\n"


def _places(sparsity: ca.Sparsity, is_matrix: bool) -> list[str]:
    """The index of every structural nonzero, in CasADi's order: "i" of a column, "i, j" of a matrix."""
    rows, columns = sparsity.row(), sparsity.get_col()
    is_vector = sparsity.is_column() and not is_matrix
    return [f"{i}" if is_vector else f"{i}, {j}" for i, j in zip(rows, columns, strict=True)]
