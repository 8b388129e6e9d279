"""The particle filter for a `History`: any process, any sensors, beliefs of any shape (Gordon, Salmond, Smith 1993).

Random numbers are drawn from the state of the node before, so that a replay gives the same particles bit for bit.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from estimators.core.errors import NotFiniteError
from estimators.core.history import Input, Node
from estimators.core.types import NO_MODEL, Array, Gaussian, Measurement, Models, ProcessModel, Verdicts, model_of


class ParticleState(NamedTuple):
    """What a node keeps."""

    particles: Array  # (k, n)
    weights: Array  # (k,) of sum 1
    key: int  # of the random numbers drawn so far
    angles: tuple[int, ...] = ()
    outliers: int = 0
    verdicts: Verdicts = ()

    @property
    def belief(self) -> Gaussian:
        """Mean and covariance; angles about the direction of their mean."""
        centre = self.weights @ self.particles
        for index in self.angles:
            s, c = self.weights @ np.sin(self.particles[:, index]), self.weights @ np.cos(self.particles[:, index])
            centre[index] = math.atan2(s, c)
        offsets = self.particles - centre
        for index in self.angles:
            offsets[:, index] = np.remainder(offsets[:, index] + math.pi, 2.0 * math.pi) - math.pi
        return Gaussian(mean=centre, covariance=(self.weights * offsets.T) @ offsets)

    @property
    def effective(self) -> float:
        """How many equally weighted particles these are worth."""
        return 1.0 / float(self.weights @ self.weights)


class ParticleFilter:
    """Bootstrap particle filter with systematic resampling.

    Args:
        process: How each particle moves; its noise is drawn from `process.covariance` at the mean.
        sensors: What each kind, or (kind, source), of measurement shows.
        start: Draws the particles (k, n) at a node, with a generator; None if its measurements do not suffice.
        threshold: Share of effective particles below which they are resampled.
        tail: Probability that a measurement is an outlier, which leaves the weights as they are.
        reach: Standard deviations over which such an outlier is spread evenly.
        seed: Of its random numbers.
    """

    def __init__(
        self,
        process: ProcessModel,
        sensors: Models,
        start: Callable[[Sequence[Node], int, np.random.Generator], Array | None],
        *,
        threshold: float = 0.5,
        tail: float = 0.0,
        reach: float = 100.0,
        seed: int = 0,
    ) -> None:
        self.process, self.sensors = process, sensors
        self._start, self._threshold, self._tail, self._reach, self._seed = start, threshold, tail, reach, seed

    def start(self, nodes: Sequence[Node[ParticleState]], index: int) -> ParticleState | None:
        """Particles at the first node that suffices, weighed by its measurements."""
        particles = self._start(nodes, index, np.random.default_rng((self._seed, 0)))
        if particles is None:
            return None
        weights = np.full(len(particles), 1.0 / len(particles))
        state = ParticleState(np.asarray(particles, dtype=float), weights, 1, self.process.angles)
        return self.correct(state, nodes[index].time, nodes[index].measurements)

    def predict(self, state: ParticleState, u: Input, duration: float) -> ParticleState:
        """Particles after `duration` [s]."""
        rng = np.random.default_rng((self._seed, state.key))
        moved = self.process.move(state.particles, u, duration)
        Q = self.process.covariance(state.weights @ state.particles, u, duration)
        values, vectors = np.linalg.eigh(Q)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        moved = moved + rng.standard_normal(moved.shape) @ root.T
        return state._replace(particles=moved, key=state.key + 1, verdicts=())

    def correct(self, state: ParticleState, node_time: float, measurements: Sequence[Measurement]) -> ParticleState:
        """Particles weighed by a node's measurements, and resampled where few of them count.

        Raises:
            NotFiniteError: No particle explains a measurement.
        """
        for measurement in measurements:
            model = model_of(self.sensors, measurement)
            if model is None:
                state = state._replace(verdicts=(*state.verdicts, (measurement, NO_MODEL, math.nan)))
                continue
            R = model.covariance(state.particles[0], measurement)
            shown = model.evaluate_each(state.particles, measurement)
            errors = np.array([model.residual(measurement.value, value) for value in shown])
            squares = np.einsum("km,km->k", errors, np.linalg.solve(R, errors.T).T)
            likelihoods = (1.0 - self._tail) * np.exp(-0.5 * squares) + self._tail / self._reach
            weights = state.weights * likelihoods
            total = weights.sum()
            if not total > 0.0:
                raise NotFiniteError(f"no particle explains {measurement.kind} {measurement.value} at {node_time} s")
            state = state._replace(weights=weights / total, verdicts=(*state.verdicts, (measurement, "", math.nan)))
        return self._kept_effective(state)

    def weigh(self, state: ParticleState, log_likelihoods: Array) -> ParticleState:
        """Particles weighed by log likelihoods (k,) that are at hand, and resampled where few of them count."""
        weights = state.weights * np.exp(log_likelihoods - log_likelihoods.max())
        return self._kept_effective(state._replace(weights=weights / weights.sum()))

    def process_after(self, state: ParticleState) -> ProcessModel:
        """For `smoothing`, of the particles' mean and covariance."""
        return self.process

    def _kept_effective(self, state: ParticleState) -> ParticleState:
        return self._resampled(state) if state.effective < self._threshold * len(state.weights) else state

    def _resampled(self, state: ParticleState) -> ParticleState:
        count = len(state.weights)
        offset = np.random.default_rng((self._seed, state.key)).uniform()
        chosen = np.searchsorted(np.cumsum(state.weights), (np.arange(count) + offset) / count)
        particles = state.particles[np.minimum(chosen, count - 1)]
        return state._replace(particles=particles, weights=np.full(count, 1.0 / count), key=state.key + 1)


def drawn(belief: Gaussian, count: int) -> Callable[[Sequence[Node], int, np.random.Generator], Array]:
    """A start from a known belief, for `ParticleFilter`."""

    def start(nodes: Sequence[Node], index: int, rng: np.random.Generator) -> Array:
        return rng.multivariate_normal(belief.mean, belief.covariance, count)

    return start
