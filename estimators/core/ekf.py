"""The extended Kalman filter without state of its own: belief in, belief out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimators.core import loops
from estimators.core.consistency import chi_square
from estimators.core.errors import NotFiniteError, NotPositiveDefiniteError
from estimators.core.types import Array, Gaussian, Measurement, MeasurementModel, ProcessModel


@dataclass(frozen=True, kw_only=True, slots=True)
class Innovation:
    """Innovation of a measurement, with its covariance and gain."""

    residual: Array  # (m,)
    covariance: Array  # (m, m) of the residual, S = H P H' + R
    gain: Array  # (n, m) Kalman gain
    nis: float  # residual' S^-1 residual
    accepted: bool  # False: outside the gate, the belief is as it was


def predict(belief: Gaussian, process: ProcessModel, u: Sequence[float], dt: float) -> Gaussian:
    """The belief after `dt` [s] with the input `u` held: f(x), F P F' + Q.

    Raises:
        NotFiniteError: The prediction is not finite.
    """
    mean, covariance, _ = process.propagate(belief.mean, belief.covariance, u, dt)
    return Gaussian(mean=mean, covariance=covariance)


def correct(
    belief: Gaussian, measurement: Measurement, model: MeasurementModel, gate: float | None = None
) -> tuple[Gaussian, Innovation]:
    """The belief after a measurement, in Joseph's form.

    Args:
        belief: State before the measurement.
        measurement: Value (m,) and covariance (m, m).
        model: Measurement model of the sensor.
        gate: Probability with which a measurement that fits the models is accepted, 0.999 say; None accepts all.

    Raises:
        NotPositiveDefiniteError: The innovation's covariance is not positive definite.
        NotFiniteError: The correction is not finite.
    """
    x = belief.mean
    expected, H = model.shown(x, measurement)
    residual = model.residual(measurement.value, expected)
    limit = math.inf if gate is None else chi_square(gate, residual.size)
    return correct_linear(belief, H, residual, model.covariance(x, measurement), limit)


def correct_iterated(
    belief: Gaussian, measurement: Measurement, model: MeasurementModel, gate: float | None = None, iterations: int = 5
) -> tuple[Gaussian, Innovation]:
    """Corrects, linearised anew at each result (Gauss-Newton): for ranges as short as their beacon is uncertain.

    The gate judges the first innovation. The last step's derivative makes the covariance (Bell and Cathey 1993).
    """
    x = belief.mean
    result, first = correct(belief, measurement, model, gate)
    if not first.accepted or model.is_linear:
        return result, first
    for _ in range(iterations - 1):
        before = result.mean
        expected, H = model.shown(before, measurement)
        residual = model.residual(measurement.value, expected) - H @ (x - before)
        result, _ = correct_linear(belief, H, residual, model.covariance(before, measurement))
        step = result.mean - before
        if float(step @ step) < 1e-12 * max(1.0, float(before @ before)):
            break
    return result, first


def correct_second_order(
    belief: Gaussian, measurement: Measurement, model: MeasurementModel, gate: float | None = None
) -> tuple[Gaussian, Innovation]:
    """Corrects by a measurement with the model's second derivatives (Gaussian second-order filter).

    The value expected is larger by half the trace of A P, and its noise by half the trace of A P B P, of the second
    derivatives A and B of two components. Source: Bar-Shalom, Li, Kirubarajan (2001), 10.3.3.
    """
    if model.is_linear:
        return correct(belief, measurement, model, gate)
    x = belief.mean
    expected, H = model.shown(x, measurement)
    spread = model.hessian(x, measurement) @ belief.covariance  # (m, n, n)
    shift = 0.5 * np.trace(spread, axis1=1, axis2=2)
    R = model.covariance(x, measurement) + 0.5 * np.einsum("aij,bji->ab", spread, spread)
    residual = model.residual(measurement.value, expected + shift)
    return correct_linear(belief, H, residual, R, math.inf if gate is None else chi_square(gate, residual.size))


def correct_linear(
    belief: Gaussian, H: Array, residual: Array, R: Array, limit: float = math.inf
) -> tuple[Gaussian, Innovation]:
    """Corrects by H (m, n), residual (m,) and R (m, m) at hand; `limit` is the largest accepted NIS."""
    mean, covariance, gain, S, nis, status = loops.correct(belief.mean, belief.covariance, H, residual, R, limit)
    if status == loops.NOT_POSITIVE_DEFINITE:
        raise NotPositiveDefiniteError(
            f"innovation covariance {S.tolist()} of residual {residual} is not positive definite"
        )
    if status == loops.NOT_FINITE:
        raise NotFiniteError(f"correction of {belief.mean} by the residual {residual} is not finite")
    innovation = Innovation(residual=residual, covariance=S, gain=gain, nis=nis, accepted=status == loops.OK)
    return (Gaussian(mean=mean, covariance=covariance) if innovation.accepted else belief), innovation


def fuse(belief: Gaussian, measurement: Measurement, model: MeasurementModel) -> tuple[Gaussian, float]:
    """The belief after a measurement without a gate, and its NIS: `correct` for those who need no more."""
    if model.is_angle:
        H, R = model.jacobian(belief.mean, measurement), model.covariance(belief.mean, measurement)
        return correct_angle(belief, H, measurement.value, R)
    corrected, innovation = correct(belief, measurement, model)
    return corrected, innovation.nis


def correct_angle(belief: Gaussian, H: Array, value: Array, R: Array) -> tuple[Gaussian, float]:
    """The belief after a measured angle (1,) [rad] that is H x, H (1, n), but for whole turns; and its NIS.

    The same numbers as of `correct` in half its time.

    Raises:
        NotPositiveDefiniteError, NotFiniteError: As `correct`.
    """
    mean, covariance, nis, status = loops.correct_angle(belief.mean, belief.covariance, H, value, R)
    if status != loops.OK:
        residual = np.array([loops.wrap(value[0] - H[0] @ belief.mean)])
        correct_linear(belief, H, residual, R)  # says what is wrong
    return Gaussian(mean=mean, covariance=covariance), nis
