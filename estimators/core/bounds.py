"""The posterior Cramér-Rao bound: the covariance that no estimator can stay below (Tichavsky, Muravchik, Nehorai 1998).

The recursion in information form, J' = D22 - D21 (J + D11)^-1 D12 with D11 = E[F' Q^-1 F], D12 = -E[F' Q^-1],
D22 = E[Q^-1] + E[H' R^-1 H], expectations over sampled truths. It is a filter like any other, for a `History`: so the
bound of delayed, lost or shuffled measurements is that of what had arrived.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from estimators.core import loops
from estimators.core.ekf import Innovation
from estimators.core.errors import NotPositiveDefiniteError
from estimators.core.history import Input, Node
from estimators.core.types import (
    NO_MODEL,
    Array,
    Gaussian,
    Measurement,
    Models,
    ProcessModel,
    Verdict,
    Verdicts,
    model_of,
)

Truths = Callable[[float], Array]  # time [s] -> true states (k, n), one of each sampled trajectory


class BoundState(NamedTuple):
    """What a node keeps."""

    time: float  # [s]
    information: Array  # J (n, n), the inverse of the bound
    mean: Array  # (n,) of the truths
    outliers: int = 0
    innovation: Innovation | None = None
    verdicts: Verdicts = ()

    @property
    def belief(self) -> Gaussian:
        """The truths' mean and the bound of the covariance of any estimate's error."""
        return Gaussian(mean=self.mean, covariance=inverse(self.information))


class PosteriorBound:
    """The posterior Cramér-Rao bound along sampled truths, for a `History`.

    With one trajectory it is the bound conditional on it, which is that of an extended Kalman filter linearised at the
    truth; the more the trajectories differ, the lower (the less sharp) it lies.

    Args:
        process: Process model; its noise must reach all states.
        models: Measurement model of each kind; kinds not named are ignored.
        truths: True states at a time.
        first: (nodes, index) -> the covariance (n, n) at the node at which an estimator starts, or None.
        noise: Compass noise that a `DockingEstimator` is to assume, a `DockingNoise`.
    """

    def __init__(
        self,
        process: ProcessModel,
        models: Models,
        truths: Truths,
        first: Callable[[Sequence[Node], int], Array | None],
        noise: Any = None,
    ) -> None:
        self.noise = noise
        self._process, self._models, self._truths, self._first = process, models, truths, first

    def start(self, nodes: Sequence[Node[BoundState]], index: int) -> BoundState | None:
        """The bound at the node where an estimator starts; the measurements there are in it."""
        covariance = self._first(nodes, index)
        if covariance is None:
            return None
        time, verdicts = nodes[index].time, tuple(map(Verdict, nodes[index].measurements))
        return BoundState(time, inverse(covariance), self._truths(time).mean(axis=0), verdicts=verdicts)

    def predict(self, state: BoundState, u: Input, duration: float) -> BoundState:
        """The bound after `duration` [s].

        Raises:
            NotPositiveDefiniteError: The process noise does not reach all states.
        """
        truths = self._truths(state.time)
        F = np.array([self._process.jacobian(x, u, duration) for x in truths])
        weights = np.array([inverse(self._process.covariance(x, u, duration)) for x in truths])
        mean_weight, weighted = weights.mean(axis=0), (weights @ F).mean(axis=0)
        Q = inverse(mean_weight)
        F_mean = Q @ weighted
        # By the matrix inversion lemma equal to Tichavsky's form, which loses digits where the noise is small; the last
        # term is what the differences between the trajectories say, and zero for a single one.
        J = state.information + (np.swapaxes(F, 1, 2) @ weights @ F).mean(axis=0) - F_mean.T @ weighted
        information = inverse(Q + F_mean @ inverse(J) @ F_mean.T)
        time = state.time + duration
        return BoundState(time, information, self._truths(time).mean(axis=0))

    def correct(self, state: BoundState, node_time: float, measurements: Sequence[Measurement]) -> BoundState:
        """The bound with the information of a node's measurements."""
        information = state.information.copy()
        verdicts = []
        for measurement in measurements:
            if (model := model_of(self._models, measurement)) is not None:
                for x in (truths := self._truths(node_time)):
                    H, R = model.jacobian(x, measurement), model.covariance(x, measurement)
                    information += H.T @ np.linalg.solve(R, H) / len(truths)
            verdicts.append(Verdict(measurement, "" if model is not None else NO_MODEL))
        return BoundState(node_time, information, state.mean, verdicts=tuple(verdicts))


def inverse(matrix: Array) -> Array:
    """Inverse of a symmetric positive definite matrix, scaled to a unit diagonal first.

    Raises:
        NotPositiveDefiniteError: It is not.
    """
    diagonal = np.diagonal(matrix)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = matrix * np.outer(scale, scale)
    if not loops.factor(scaled)[1]:
        raise NotPositiveDefiniteError(f"no bound: matrix with diagonal {diagonal} is not positive definite")
    result = np.linalg.inv(scaled) * np.outer(scale, scale)
    return 0.5 * (result + result.T)
