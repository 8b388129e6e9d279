"""Time of fits, beside SciPy's least squares and mujoco.sysid on the same data in the same run.

Run with `pytest tests/benchmarks/test_identification_speed.py --benchmark-enable`; times are printed, not judged. On a
machine that does other work, too, `--benchmark-timer=time.process_time` counts what a fit itself takes.
mujoco.sysid (`pip install auvsim[compare]`) identifies parameters of MuJoCo's own models. It has no planar model and no
parameter of hydrodynamics with added mass; it can be given a rollout of one's own. It is handed the compiled planar
model here, whole records from known first states, and its own finite differences, optimiser and residuals.
"""

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

from auvsim.identification import compiled
from auvsim.identification.fit import DEFAULT_FREE, NO_NUISANCES, with_values
from auvsim.identification.least_squares import fit_least_squares
from auvsim.identification.prediction_error import PredictionErrorOptions, fit_prediction_error
from auvsim.identification.segment_problem import Problem
from auvsim.identification.segments import SegmentOptions, fit_segments
from auvsim.identification.simulated import SHEETS, Vessel, simulate
from auvsim.identification.states import smoothed
from estimators.planar.model import PARAMETER_NAMES, PlanarParameters, PlanarProcess

# The REMUS-100 condensed at 1 m/s, rounded.
PARAMETERS = PlanarParameters(
    m=31.03, I_z=4.031, X_ud=-0.839, Y_vd=-29.44, N_rd=-3.426, X_uu=-6.1, X_vr=29.44, X_dd=-0.1,
    X_nn=4.1e-3, X_nu=-0.159, Y_uv=-53.6, Y_ur=15.8, Y_dd=-3.41, Y_vv=-220.0, Y_rr=17.4,
    N_uv=-7.49, N_ur=-11.2, N_dd=2.51, N_vv=41.9, N_rr=-27.3,
)  # fmt: skip
VESSEL = Vessel(parameters=PARAMETERS)
TRUTH = np.array([getattr(PARAMETERS, name) for name in DEFAULT_FREE])
START = with_values(PARAMETERS, DEFAULT_FREE, TRUTH * np.random.default_rng(0).uniform(0.7, 1.3, len(TRUTH)))
OPTIONS = SegmentOptions(nuisances=SHEETS)
SHORT = ("X_uu", "Y_uv", "N_ur", "N_dd")


@pytest.fixture(scope="module", autouse=True)
def _compile():
    fit_segments([simulate(VESSEL, "multisine", 0, 20.0).record], START, DEFAULT_FREE, OPTIONS)


def record(benchmark, duration, taste=300.0):
    """A record of so many seconds; without --benchmark-enable only a taste of it."""
    return simulate(VESSEL, "multisine", 1, duration if benchmark.enabled else min(duration, taste)).record


@pytest.mark.parametrize("duration", [300.0, 3000.0])
def test_fit_of_segments(benchmark, duration):
    """The whole fit of 14 parameters, current and biases, from a start wrong by up to 30 %."""
    data = record(benchmark, duration)
    fit = benchmark.pedantic(fit_segments, ([data], START, DEFAULT_FREE, OPTIONS), rounds=5)
    benchmark.extra_info["iterations"] = fit.iterations
    assert fit.converged


@pytest.mark.parametrize("duration", [300.0, 3000.0])
def test_one_step_of_segments(benchmark, duration):
    """Sensitivities, normal equations, elimination and step: one iteration of the fit."""
    data = record(benchmark, duration)
    problem = Problem([data], START, DEFAULT_FREE, OPTIONS, 5.0, [smoothed(data, START, SHEETS.vector())])
    values, firsts = START.vector()[problem.indices], [cut.held for cut in problem.cuts]

    def step():
        H, g, _ = problem.reduced(problem.at(values, problem.nuisances, firsts), 1e-6)
        return np.linalg.solve(H, g)

    assert np.isfinite(benchmark(step)).all()


def test_least_squares(benchmark):
    data = record(benchmark, 300.0)
    assert benchmark(fit_least_squares, [data], START).improved


def test_prediction_error(benchmark):
    data = record(benchmark, 300.0, taste=60.0)
    rough = fit_segments([data], START, DEFAULT_FREE, OPTIONS).parameters
    options = PredictionErrorOptions(nuisances=SHEETS)
    fit = benchmark.pedantic(fit_prediction_error, ([data], rough, DEFAULT_FREE, options), rounds=1)
    assert math.isfinite(fit.cost)


def whole_record(free):
    """A record without constant errors, and the residuals of its rollout from a known first state."""
    run = simulate(Vessel(parameters=PARAMETERS, errors=NO_NUISANCES), "multisine", 2, 300.0)
    process, increments = PlanarProcess(PARAMETERS, np.zeros(8)), np.zeros((len(run.record.times) - 1, 8))
    first, there = run.states[0], np.isfinite(run.record.measured[:, 2:6])
    places = [PARAMETER_NAMES.index(name) for name in free]

    def residuals(values):
        process._p[places] = values  # the compiled walk with other parameters
        shown = process.walk(first, run.record.inputs[:-1], run.record.step, increments)[:, 2:6]
        return ((shown - run.record.measured[:, 2:6]) / run.record.deviations[2:6])[there]

    return run, residuals


def near(free):
    """A start wrong by 10 %: whole records run away from one that is much worse."""
    sides = np.where(np.arange(len(free)) % 2, 0.9, 1.1)
    return np.array([getattr(PARAMETERS, name) for name in free]) * sides


def is_lowest(residuals, values, free):
    """Whether values fit at least as well as the truth does."""
    truth = np.array([getattr(PARAMETERS, name) for name in free])
    return np.sum(residuals(np.asarray(values)) ** 2) <= 1.001 * np.sum(residuals(truth) ** 2)


FREES = pytest.mark.parametrize("free", [SHORT, DEFAULT_FREE], ids=["4", "14"])


@FREES
def test_whole_record_here(benchmark, free):
    run, _ = whole_record(free)
    options = SegmentOptions(nuisances=NO_NUISANCES, length=math.inf)
    start = with_values(PARAMETERS, free, near(free))
    fit = benchmark.pedantic(fit_segments, ([run.record], start, free, options), rounds=3)
    assert fit.converged
    truth = np.array([getattr(PARAMETERS, name) for name in free])
    assert np.abs((fit.values - truth) / fit.deviations).max() < 4.0  # 14 normal deviates: one seed in 1000


@FREES
def test_whole_record_in_scipy(benchmark, free):
    """Finite differences over the same compiled model, first state known."""
    _, residuals = whole_record(free)
    found = benchmark.pedantic(least_squares, (residuals, near(free)), {"x_scale": np.abs(near(free))}, rounds=3)
    benchmark.extra_info["runs of the model"] = found.nfev
    assert is_lowest(residuals, found.x, free)


@FREES
def test_whole_record_in_mujoco_sysid(benchmark, free):
    """Its optimiser on the same residuals, by its own finite differences; it is given them as a function."""
    sysid = pytest.importorskip("mujoco.sysid")
    if not hasattr(sysid, "optimize"):
        pytest.skip("mujoco.sysid has not its dependencies; pip install auvsim[compare]")
    _, residuals = whole_record(free)
    parameters = sysid.ParameterDict(
        {
            name: sysid.Parameter(name, v, min_value=min(0.2 * v, 5.0 * v), max_value=max(0.2 * v, 5.0 * v))
            for name, v in zip(free, near(free).tolist(), strict=True)
        }
    )

    def function(x, _):
        columns = np.atleast_2d(x.T).reshape(-1, len(free)) if x.ndim == 2 else x[None]
        return [np.stack([residuals(column) for column in columns], axis=-1)], [], []

    options = {"verbose": False, "x_scale": np.abs(near(free))}
    _, found = benchmark.pedantic(sysid.optimize, (parameters, function), options, rounds=3)
    assert is_lowest(residuals, found.x, free)


def test_fourteen_parameters_and_segments_in_scipy(benchmark):
    """60 s of what `test_fit_of_segments` does for 300 s: first states are unknowns, and differences dense."""
    data = record(benchmark, 60.0)
    states = [smoothed(data, START, SHEETS.vector())]
    problem = Problem([data], START, DEFAULT_FREE, OPTIONS, 5.0, states)
    k, count = len(DEFAULT_FREE), len(problem.cuts[0].held)
    loops, there = compiled.segments(), np.isfinite(data.measured)
    assert loops is compiled.segments()

    def residuals(w):
        point = problem.at(w[:k], w[None, k : k + 6], [np.ascontiguousarray(w[k + 6 :].reshape(count, 6))])
        return np.concatenate([point.residuals[0][there], w[k : k + 6] / SHEETS.vector()])

    first = np.concatenate([START.vector()[problem.indices], np.zeros(6), problem.cuts[0].held.ravel()])
    found = benchmark.pedantic(
        least_squares, (residuals, first), {"x_scale": "jac", "max_nfev": 20 if benchmark.enabled else 2}, rounds=1
    )
    assert np.isfinite(found.cost)
