"""The unscented Kalman filter without state of its own: belief in, belief out (Julier and Uhlmann 2004).

The correction is that of `ekf` with the sensor linearised by the sigma points instead of its derivative: with
H = P_yx P^-1 and the rest of P_yy as noise, S = P_yy + R and K = P_xy S^-1 are those of the unscented transform.
"""

from collections.abc import Sequence

import numpy as np

from estimators.core import ekf, loops
from estimators.core.consistency import chi_square
from estimators.core.ekf import Innovation
from estimators.core.errors import NotFiniteError, NotPositiveDefiniteError
from estimators.core.types import Array, Gaussian, Measurement, MeasurementModel, ProcessModel

CENTRE = 0.0  # weight of the central point (kappa = 0), which remains the reference of angles


def sigma_points(belief: Gaussian) -> tuple[Array, Array]:
    """Points (2n + 1, n), the mean first, and their weights.

    Raises:
        NotPositiveDefiniteError: The covariance is not positive definite.
    """
    points, weights, positive = loops.sigma_points(belief.mean, belief.covariance, CENTRE)
    if not positive:
        raise NotPositiveDefiniteError(f"covariance of {belief.mean} is not positive definite")
    return points, weights


def predict(belief: Gaussian, process: ProcessModel, u: Sequence[float], dt: float) -> Gaussian:
    """The belief after `dt` [s] with the input `u` held: moments of the moved sigma points, plus Q.

    Raises:
        NotFiniteError: The prediction is not finite.
        NotPositiveDefiniteError: The covariance is not positive definite.
    """
    points, weights = sigma_points(belief)
    mean, P = loops.moments(process.move(points, u, dt), weights, process.covariance(belief.mean, u, dt))
    if not loops.is_finite(mean, P):
        raise NotFiniteError(f"prediction over {dt:g} s from {belief.mean} with input {u} is not finite")
    for index in process.angles:
        mean[index] = loops.wrap(mean[index])
    return Gaussian(mean=mean, covariance=P)


def correct(
    belief: Gaussian, measurement: Measurement, model: MeasurementModel, gate: float | None = None
) -> tuple[Gaussian, Innovation]:
    """The belief after a measurement; arguments and errors as of `ekf.correct`.

    A sensor whose model says that it `is_linear` needs no sigma points: its derivative gives the same.
    """
    if model.is_linear:
        return ekf.correct(belief, measurement, model, gate)
    points, weights = sigma_points(belief)
    values = [model.evaluate(x, measurement) for x in points]
    # Differences from the central value, so that angles may be wrapped.
    shown = np.array([model.residual(value, values[0]) for value in values])
    mean = weights @ shown
    spread = shown - mean
    deviations = points - belief.mean
    cross = (weights * spread.T) @ deviations
    H = np.ascontiguousarray(np.linalg.solve(belief.covariance, cross.T).T, dtype=np.float64)
    rest = (weights * spread.T) @ spread - H @ cross.T
    R = model.covariance(belief.mean, measurement) + 0.5 * (rest + rest.T)
    residual = model.residual(measurement.value, values[0]) - mean
    limit = np.inf if gate is None else chi_square(gate, residual.size)
    return ekf.correct_linear(belief, H, residual, R, limit)
