"""What filters pass round: beliefs, measurements, and the two kinds of model a user may bring."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from estimators.core.errors import NotFiniteError

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Gaussian:
    """A belief: mean and covariance of a state."""

    mean: Array  # (n,)
    covariance: Array  # (n, n) symmetric, positive semi-definite


@dataclass(frozen=True, kw_only=True, slots=True)
class Measurement:
    """A measured value with the time it was true and the time it arrived."""

    kind: str  # names the sensor, and with it the measurement model: "compass", "usbl"
    value: Array  # (m,)
    covariance: Array  # (m, m) positive definite
    stamp: float  # when it was true [s]
    received: float  # when it arrived [s]
    sequence: int | None = None  # counts one sensor's measurements; None if the sensor does not count
    source: str = ""  # which of several alike: a beacon, a landmark, another vehicle
    parameters: tuple[float, ...] = ()  # what its model must know besides: where the beacon was, how deep the vehicle


class Verdict(NamedTuple):
    """What a filter decided about a measurement; a plain tuple of the same three will do where time is short."""

    measurement: Measurement
    reason: str = ""  # why it was refused; "" if it was used
    nis: float = math.nan  # its normalised innovation squared; NaN if none was computed


Verdicts = tuple[tuple[Measurement, str, float], ...]


class Outcome(NamedTuple):
    """The fate of one measurement.

    A later outcome of the same measurement (kind, source, stamp and sequence) replaces an earlier one: late packets
    are replayed, and a filter that recovers takes what it had refused before.
    """

    kind: str
    source: str
    stamp: float  # when it was true [s]
    sequence: int  # -1 if the sensor does not count
    accepted: bool
    reason: str  # "" if accepted
    nis: float  # NaN if it was not judged by one


class ProcessModel(Protocol):
    """How a state moves on: x' = f(x, u, dt) + noise of covariance Q(x, u, dt).

    A model that inherits from this class brings `evaluate`, `jacobian` and `covariance`; the other methods are made of
    them, and overridden where a model can do better.
    """

    angles: tuple[int, ...] = ()  # states kept in (-pi, pi]

    def evaluate(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """State (n,) after `dt` [s] with the input `u` held."""
        ...

    def jacobian(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """Derivative of `evaluate` with respect to `x`, (n, n)."""
        ...

    def covariance(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """Covariance of the noise gathered over `dt`, (n, n)."""
        ...

    def propagate(self, mean: Array, covariance: Array, u: Sequence[float], dt: float) -> tuple[Array, Array, int]:
        """Mean and covariance F P F' + Q after `dt`, and in how many steps.

        Raises:
            NotFiniteError: The prediction is not finite.
        """
        F = self.jacobian(mean, u, dt)
        P = F @ covariance @ F.T + self.covariance(mean, u, dt)
        x = wrapped(self.evaluate(mean, u, dt), self.angles)
        if not (np.isfinite(x).all() and np.isfinite(P).all()):
            raise NotFiniteError(f"prediction over {dt:g} s from {mean} with input {u} is not finite")
        return x, 0.5 * (P + P.T), 1

    def move(self, points: Array, u: Sequence[float], dt: float) -> Array:
        """States (k, n) after `dt`, each from one of `points` (k, n); angles within half a turn of the first's."""
        moved = np.array([self.evaluate(x, u, dt) for x in points])
        return moved[0] + wrapped((moved - moved[0]).T, self.angles).T


class MeasurementModel(Protocol):
    """What a sensor shows of a state: y = g(x) + noise of covariance R(x, measurement).

    A model sees the measurement it is to explain, for what that says of itself: its source, a beacon's place. A model
    that inherits from this class brings `evaluate` and `jacobian`; the rest has the usual form.
    """

    is_linear: bool = False  # its derivative H is the same everywhere
    is_angle: bool = False  # besides, its one component is H x but for whole turns

    def evaluate(self, x: Array, measurement: Measurement) -> Array:
        """Value (m,) expected in the state `x` (n,)."""
        ...

    def jacobian(self, x: Array, measurement: Measurement) -> Array:
        """Derivative of `evaluate` with respect to `x`, (m, n)."""
        ...

    def hessian(self, x: Array, measurement: Measurement) -> Array:
        """Second derivatives of `evaluate`, (m, n, n): for second-order filters; by differences of `jacobian`."""
        steps = 1e-4 * np.maximum(1.0, np.abs(x))
        columns = [
            (self.jacobian(x + offset, measurement) - self.jacobian(x - offset, measurement)) / (2.0 * step)
            for step, offset in zip(steps, np.diag(steps), strict=True)
        ]
        result = np.stack(columns, axis=-1)
        return 0.5 * (result + np.swapaxes(result, 1, 2))

    def evaluate_each(self, points: Array, measurement: Measurement) -> Array:
        """Values (k, m) expected in each of the states `points` (k, n)."""
        return np.array([self.evaluate(x, measurement) for x in points])

    def covariance(self, x: Array, measurement: Measurement) -> Array:
        """Covariance of the measurement's noise, (m, m)."""
        return measurement.covariance

    def residual(self, value: Array, expected: Array) -> Array:
        """`value - expected` (m,), with angles wrapped to (-pi, pi]."""
        return value - expected

    def shown(self, x: Array, measurement: Measurement) -> tuple[Array, Array]:
        """`evaluate` and `jacobian` at once."""
        return self.evaluate(x, measurement), self.jacobian(x, measurement)


Models = Mapping[Any, MeasurementModel]  # by kind, or by (kind, source), a source not empty
NO_MODEL = "no_model"  # why a measurement is refused of which a filter has no model


def model_of(models: Models, measurement: Measurement) -> MeasurementModel | None:
    """The model of a measurement's kind and source, or else of its kind; None if there is neither."""
    if not measurement.source:
        return models.get(measurement.kind)
    return models.get((measurement.kind, measurement.source)) or models.get(measurement.kind)


def wrapped(x: Array, angles: tuple[int, ...]) -> Array:
    """A copy of x (n, ...) with its rows `angles` in (-pi, pi]."""
    x = np.array(x, dtype=float)
    for index in angles:
        x[index] -= 2.0 * math.pi * np.ceil((x[index] - math.pi) / (2.0 * math.pi))
    return x
