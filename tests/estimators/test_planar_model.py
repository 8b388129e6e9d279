"""The planar model: against an independent form, its circles, its stability, its integrators and their noise."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from docking_runs import STEADY_RUDDER, accelerations, steady_circle

from estimators.core.errors import NotFiniteError, ParameterError
from estimators.planar import model as planar_model
from estimators.planar.model import PARAMETER_NAMES, PRESTERO, PlanarParameters, PlanarProcess, step_function

NO_NOISE = np.zeros(8)
STATE = np.array([3.0, -7.0, 0.4, 0.9, -0.06, 0.05, 0.2, -0.3])
INPUT = (0.08, 60.0)


def casadi_accelerations(nu, rudder, shaft_speed, parameters):
    symbols = ca.SX.sym("nu", 3), ca.SX.sym("d"), ca.SX.sym("n"), ca.SX.sym("p", len(PARAMETER_NAMES))
    function = ca.Function("l", list(symbols), [planar_model.accelerations(*symbols)])
    return np.array(function(nu, rudder, shaft_speed, parameters.vector())).ravel()


def all_coefficients(seed):
    """Parameters in which no coefficient vanishes, so that none can be forgotten or taken for another."""
    rng = np.random.default_rng(seed)
    values = {name: float(rng.uniform(-30.0, 30.0)) for name in PARAMETER_NAMES}
    masses = {"m": 30.0, "x_g": 0.05, "I_z": 4.0, "X_ud": -1.0, "Y_vd": -35.0, "Y_rd": 1.0, "N_vd": 2.0, "N_rd": -5.0}
    return PlanarParameters(**(values | masses))


@pytest.mark.parametrize("seed", range(5))
def test_accelerations_equal_an_independent_linear_solve(seed):
    parameters = all_coefficients(seed)
    rng = np.random.default_rng(100 + seed)
    nu = rng.uniform(-1.0, 1.0, 3) * (2.0, 1.0, 0.4)
    rudder, shaft_speed = rng.uniform(-0.3, 0.3), rng.uniform(-100.0, 100.0)
    expected = accelerations(nu, rudder, parameters, shaft_speed)
    # Rounding only: two orders of evaluation of sums of some 1e5.
    assert casadi_accelerations(nu, rudder, shaft_speed, parameters) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize(("radius", "speed"), [(200, 0.7998), (100, 0.7991), (40, 0.794), (12, 0.719)])
def test_steady_circles_of_the_paper(radius, speed):
    nu, rudder = steady_circle(radius)
    # A positive rudder turns to starboard; tolerances are half a unit of the last printed digit, for the speed with
    # the 0.8e-4 m/s that the rounding of the thrust, 1.0368 to 1.037 N, adds.
    assert math.degrees(rudder) == pytest.approx(STEADY_RUDDER[radius], abs=5e-3 if radius == 12 else 5e-4)
    assert math.hypot(nu[0], nu[1]) == pytest.approx(speed, abs=1.3e-4 if speed > 0.795 else 5.8e-4)
    assert casadi_accelerations(nu, rudder, 0.0, PRESTERO) == pytest.approx(np.zeros(3), abs=1e-9)


def test_process_settles_on_the_steady_circle():
    nu, rudder = steady_circle(40)
    x = np.array([0.0, 0.0, 0.0, 0.8, 0.0, 0.0, 0.0, 0.0])
    process = PlanarProcess(PRESTERO, NO_NOISE)
    for _ in range(600):
        x = process.evaluate(x, (rudder, 0.0), 0.5)
    # A fixed point of an integrator is one of the equations; surge, the slowest at 0.083 1/s, has decayed by e^-25.
    assert x[3:6] == pytest.approx(nu, abs=1e-9)


def test_eigenvalues_on_a_straight_course():
    x, p = ca.SX.sym("x", 3), PRESTERO.vector()
    l = planar_model.accelerations(x, ca.SX(0), ca.SX(0), ca.SX(p))
    A = np.array(ca.Function("A", [x], [ca.jacobian(l, x)])([0.8, 0.0, 0.0]))
    # Printed: -1.33, -0.31 and surge -0.083 1/s.
    assert sorted(np.linalg.eigvals(A).real) == pytest.approx([-1.33, -0.31, -0.083], abs=5e-3)


@pytest.mark.parametrize("integrator", ["euler", "midpoint"])
@pytest.mark.parametrize("n", [6, 8])
def test_jacobian_equals_finite_differences(integrator, n):
    process = PlanarProcess(PRESTERO, np.zeros(n), integrator=integrator)
    x, h = STATE[:n], 1e-5
    F = process.jacobian(x, INPUT, 0.5)
    columns = [
        (process.evaluate(x + h * e, INPUT, 0.5) - process.evaluate(x - h * e, INPUT, 0.5)) / (2 * h) for e in np.eye(n)
    ]
    # Central differences: truncation h^2 = 1e-10, rounding 1e-16 / h = 1e-11 times states of order 10.
    assert pytest.approx(np.array(columns).T, abs=1e-6) == F
    assert np.abs(F - np.eye(n)).max() > 0.1


def test_compiled_step_equals_casadi():
    for current in (False, True):
        x = STATE[: 8 if current else 6]
        for integrator in ("euler", "midpoint"):
            following, F = np.empty(x.size), np.zeros((x.size, x.size))
            kernels = planar_model.planar_kernels(current=current, integrator=integrator)
            kernels.step(x, INPUT, PRESTERO.vector(), 0.17, following, F)
            expected = step_function(current=current, integrator=integrator)(x, INPUT, PRESTERO.vector(), 0.17)
            # The same operations in the same order; a fused multiply-add may differ in the last digits.
            assert following == pytest.approx(np.array(expected[0]).ravel(), rel=1e-13)
            assert pytest.approx(np.array(expected[1].full()), rel=1e-12, abs=1e-14) == F


def test_compiled_prediction_equals_numpy():
    q = np.linspace(1e-4, 8e-4, 8)
    process = PlanarProcess(PRESTERO, q)
    root = np.random.default_rng(1).standard_normal((8, 8))
    P = root @ root.T
    x, h = STATE, 0.5 / 3
    mean, covariance, substeps = process.propagate(x, P, INPUT, 0.5)
    for _ in range(3):
        following, F = (np.array(a.full()) for a in step_function()(x, INPUT, PRESTERO.vector(), h))
        P = F @ P @ F.T + h / 2 * (F @ np.diag(q) @ F.T + np.diag(q))
        x = following.ravel()
    assert substeps == 3
    assert mean == pytest.approx(x, rel=1e-12)
    assert covariance == pytest.approx(P, rel=1e-11)  # rounding of elements of order 10
    assert (covariance == covariance.T).all()


def test_noise_does_not_depend_on_how_an_interval_is_split():
    process = PlanarProcess(PRESTERO, np.full(8, 1e-3))
    x, P, _ = process.propagate(STATE, np.zeros((8, 8)), INPUT, 0.2)
    _, split, _ = process.propagate(x, P, INPUT, 0.3)
    whole = process.covariance(STATE, INPUT, 0.5)
    # The rule is of second order: substeps of 0.15 to 0.2 s with rates of 1.3 1/s leave (0.26)^2 / 12 = 0.6 % locally.
    assert np.abs(split - whole).max() < 6e-3 * np.abs(whole).max()
    assert whole[6, 6] == pytest.approx(0.5e-3, rel=1e-12)  # a random walk: density times time


def test_euler_has_the_lateral_bias_of_the_old_heading_and_midpoint_has_not():
    nu, rudder = steady_circle(12)
    x = np.array([0.0, 0.0, 0.0, *nu, 0.0, 0.0])
    bias = {}
    for integrator in ("euler", "midpoint"):
        coarse = PlanarProcess(PRESTERO, NO_NOISE, integrator=integrator, max_substep=0.5).evaluate(
            x, (rudder, 0.0), 0.5
        )
        fine = PlanarProcess(PRESTERO, NO_NOISE, max_substep=0.005).evaluate(x, (rudder, 0.0), 0.5)
        bias[integrator] = np.linalg.norm((coarse - fine)[:2]) / 0.5
    # Velocity error |U| r dt / 2, to the order of r dt = 0.03.
    assert bias["euler"] == pytest.approx(math.hypot(nu[0], nu[1]) * nu[2] * 0.5 / 2, rel=0.03)
    assert bias["midpoint"] < 0.01 * bias["euler"]


@pytest.mark.parametrize(("integrator", "order"), [("euler", 1), ("midpoint", 2)])
def test_order_of_the_integrators(integrator, order):
    def end(step):
        process = PlanarProcess(PRESTERO, NO_NOISE, integrator=integrator, max_substep=step)
        return process.evaluate(STATE, INPUT, 0.8)

    exact = PlanarProcess(PRESTERO, NO_NOISE, max_substep=1e-4).evaluate(STATE, INPUT, 0.8)
    ratio = np.linalg.norm(end(0.1) - exact) / np.linalg.norm(end(0.05) - exact)
    assert ratio == pytest.approx(2**order, rel=0.15)  # the next order's share at a step of 0.1 s and rates of 1 1/s


def test_a_uniform_current_only_carries_along():
    process = PlanarProcess(PRESTERO, NO_NOISE)
    still = STATE.copy()
    still[6:] = 0.0
    a, b = process.evaluate(STATE, INPUT, 2.0), process.evaluate(still, INPUT, 2.0)
    assert a[:2] - b[:2] == pytest.approx(2.0 * STATE[6:], rel=1e-12)
    assert a[2:6] == pytest.approx(b[2:6], rel=1e-14)


def test_starboard_and_port_are_mirror_images():
    process = PlanarProcess(PRESTERO, NO_NOISE)
    mirror = np.array([1, -1, -1, 1, -1, -1, 1, -1])
    assert process.evaluate(mirror * STATE, (-INPUT[0], INPUT[1]), 1.0) == pytest.approx(
        mirror * process.evaluate(STATE, INPUT, 1.0), rel=1e-13
    )


def test_kicked_velocities_decay_and_stay_finite():
    process = PlanarProcess(PRESTERO, NO_NOISE)
    x = np.array([0.0, 0.0, 0.0, 8.0, 6.0, 3.0, 0.0, 0.0])  # an outlier's kick, far outside the limits
    speeds = []
    for _ in range(400):
        x = process.evaluate(x, (0.2, 0.0), 0.5)
        speeds.append(np.abs(x[3:6]))
    assert np.max(speeds[-1] - [1.0, 0.2, 0.1]) < 0.0  # back among the speeds of this vehicle at this rudder
    assert np.max(speeds) < 50.0


def test_heading_stays_wrapped():
    process = PlanarProcess(PRESTERO, NO_NOISE)
    x = STATE.copy()
    x[2] = math.pi - 0.01
    following = process.evaluate(x, INPUT, 0.5)
    assert -math.pi < following[2] < -3.0
    x[2] = 0.0
    assert math.remainder(following[2] - process.evaluate(x, INPUT, 0.5)[2] - math.pi + 0.01, 2 * math.pi) == (
        pytest.approx(0.0, abs=1e-12)
    )


def test_steady_surge_balances_thrust_and_drag():
    assert PRESTERO.steady_surge(0.0) == pytest.approx(0.8, abs=1e-4)  # 1.037 = 1.62 * 0.8^2
    driven = replace(PRESTERO, X_prop=0.0, X_nn=1e-4, X_nu=-2e-3, X_u=-0.5)
    u = driven.steady_surge(150.0)
    assert casadi_accelerations([u, 0.0, 0.0], 0.0, 150.0, driven)[0] == pytest.approx(0.0, abs=1e-12)
    assert driven.steady_surge(-150.0) == 0.0


def test_bad_parameters_and_inputs_are_refused_by_name():
    with pytest.raises(ParameterError, match="6 or 8"):
        PlanarProcess(PRESTERO, np.full(8, -1.0))
    with pytest.raises(ParameterError, match="must be finite"):
        PlanarProcess(replace(PRESTERO, Y_vv=math.nan), NO_NOISE)
    with pytest.raises(ParameterError, match="there are euler, midpoint"):
        PlanarProcess(PRESTERO, NO_NOISE, integrator="rk4")  # pyright: ignore[reportArgumentType]
    with pytest.raises(ParameterError, match="no drag"):
        PlanarParameters(m=1.0, I_z=1.0, X_prop=1.0).steady_surge(0.0)
    with pytest.raises(NotFiniteError, match="not finite"):
        PlanarProcess(PRESTERO, NO_NOISE).propagate(np.full(8, math.nan), np.eye(8), INPUT, 0.5)


def test_several_beliefs_move_on_at_once_as_each_does_alone():
    """Bit for bit, so that a filter of several modes is the same filter."""
    rng = np.random.default_rng(8)
    processes = [PlanarProcess(PRESTERO, rng.uniform(0.0, 0.1, 8)) for _ in range(3)]
    means = STATE + rng.normal(0.0, 0.1, (3, 8))
    roots = rng.normal(0.0, 0.3, (3, 8, 8))
    covariances = roots @ roots.transpose(0, 2, 1)
    together = processes[0].together(processes[1:])
    assert together is not None
    moved, grown = together(means, covariances, INPUT, 0.7)
    for k, process in enumerate(processes):
        mean, covariance, _ = process.propagate(means[k], covariances[k], INPUT, 0.7)
        assert (moved[k] == mean).all()
        assert (grown[k] == covariance).all()
    means[2, 4] = np.nan
    with pytest.raises(NotFiniteError):
        together(means, covariances, INPUT, 0.7)


@pytest.mark.parametrize(
    "other",
    [
        PlanarProcess(replace(PRESTERO, m=31.0), NO_NOISE),
        PlanarProcess(PRESTERO, NO_NOISE, max_substep=0.1),
        PlanarProcess(PRESTERO, NO_NOISE, integrator="euler"),
        PlanarProcess(PRESTERO, np.zeros(9), biases=("surge",)),
        object(),
    ],
)
def test_processes_that_differ_in_more_than_noise_do_not_move_at_once(other):
    assert PlanarProcess(PRESTERO, NO_NOISE).together([PlanarProcess(PRESTERO, np.ones(8)), other]) is None
