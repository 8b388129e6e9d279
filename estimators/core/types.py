"""Types that filters share: beliefs, measurements, outcomes, and the contracts of process and measurement models."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

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


class Verdict(NamedTuple):
    """A filter's decision about a measurement; a plain tuple of the same three is accepted, too."""

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
    """A process model: x' = f(x, u, dt) + noise of covariance Q(x, u, dt)."""

    def evaluate(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """State (n,) after `dt` [s] with the input `u` held."""
        ...

    def jacobian(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """Derivative of `evaluate` with respect to `x`, (n, n)."""
        ...

    def covariance(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """Covariance of the noise gathered over `dt`, (n, n)."""
        ...


class MeasurementModel(Protocol):
    """A measurement model: y = g(x) + noise of covariance R(x, measurement)."""

    def evaluate(self, x: Array) -> Array:
        """Value (m,) expected in the state `x` (n,)."""
        ...

    def jacobian(self, x: Array) -> Array:
        """Derivative of `evaluate` with respect to `x`, (m, n)."""
        ...

    def covariance(self, x: Array, measurement: Measurement) -> Array:
        """Covariance of the measurement's noise, (m, m); most models return `measurement.covariance`."""
        ...

    def residual(self, value: Array, expected: Array) -> Array:
        """`value - expected` (m,), with angles wrapped to (-pi, pi]."""
        ...
