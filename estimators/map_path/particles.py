"""A particle filter over paths: each particle carries the poses at which it saw the window's frames (FastSLAM's idea).

Each weighs a frame against the earlier ones at its own relative poses, tempered: frames share their noise.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimators.core.history import Input, Node
from estimators.core.particle import ParticleFilter, ParticleState
from estimators.core.types import NO_MODEL, Array, Gaussian, Measurement, Models, ProcessModel, Verdicts
from estimators.map_path.frames import KIND, fault
from estimators.map_path.likelihood import Matcher, Prepared
from estimators.map_path.matching import LEAST_CELLS, NO_OVERLAP
from estimators.map_path.odometry import OdometryNoise
from estimators.map_path.poses import between

KEPT = 12  # frames whose poses a particle carries
# A particle's biases must walk more than a vehicle's, or all that survive have the same ones.
ROUGHENED = OdometryNoise(speed_walk=0.02, turn_rate_walk=np.radians(0.06))


class _WithHistory(ProcessModel):
    """The process of the five states, with poses of before beside them that stay what they were."""

    def __init__(self, noise: OdometryNoise) -> None:
        self.process = noise.process()
        self.angles = (*self.process.angles, *range(7, 5 + 3 * KEPT, 3))

    def evaluate(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """State after `dt` [s]."""
        return self.move(x[None], u, dt)[0]

    def jacobian(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """Derivative of `evaluate`."""
        F = np.eye(x.size)
        F[:5, :5] = self.process.jacobian(x[:5], u, dt)
        return F

    def covariance(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """Of the five states only."""
        Q = np.zeros((x.size, x.size))
        Q[:5, :5] = self.process.covariance(x[:5], u, dt)
        return Q

    def move(self, points: Array, u: Sequence[float], dt: float) -> Array:
        """Particles after `dt` [s]."""
        return np.hstack((self.process.move(points[:, :5], u, dt), points[:, 5:]))


class ParticlePathState(NamedTuple):
    """What a node keeps."""

    inner: ParticleState  # particles (k, 5 + 3 * 12), the latest frame's pose last
    frames: tuple[Prepared, ...] = ()
    outliers: int = 0
    verdicts: Verdicts = ()

    @property
    def belief(self) -> Gaussian:
        """Of the five states; see `odometry`."""
        inner = self.inner
        return inner._replace(particles=inner.particles[:, :5], angles=(2,)).belief


class ParticlePathFilter:
    """Particle filter with a history of poses, for a `History`; inputs are speed [m/s] and turn rate [rad/s].

    Args:
        matcher: Compares two frames.
        start: Belief of the pose (3) at the first node.
        noise: How odometry errs.
        count: Particles.
        lags: Frames that a frame is weighed against, counted from the latest of the last 12.
        tempering: Power of the likelihood.
        saturation: Value at which the receiver saturates.
        seed: Of the particles.
    """

    def __init__(
        self,
        matcher: Matcher,
        start: Gaussian,
        *,
        noise: OdometryNoise = ROUGHENED,
        count: int = 200,
        lags: tuple[int, ...] = (1, 3, 6, 11),
        tempering: float = 0.5,
        saturation: float = np.inf,
        seed: int = 0,
    ) -> None:
        self.matcher, self._count, self._lags, self._tempering = matcher, count, lags, tempering
        self._first, self._saturation = noise.start(start), saturation
        self._particles = ParticleFilter(_WithHistory(noise), {}, self._drawn, seed=seed)
        self._process = noise.process()
        self.sensors: Models = {}

    def start(self, nodes: Sequence[Node[ParticlePathState]], index: int) -> ParticlePathState:
        """Particles about the known start, with the node's frame as the first."""
        node: Node[ParticleState] = Node(nodes[index].time, (), [], True)
        inner = self._particles.start([node], 0)
        assert inner is not None
        return self.correct(ParticlePathState(inner), nodes[index].time, nodes[index].measurements)

    def predict(self, state: ParticlePathState, u: Input, duration: float) -> ParticlePathState:
        """Particles after `duration` [s]."""
        return state._replace(inner=self._particles.predict(state.inner, u, duration), verdicts=())

    def correct(
        self, state: ParticlePathState, node_time: float, measurements: Sequence[Measurement]
    ) -> ParticlePathState:
        """Particles weighed by a node's frames; those that cannot be used are refused by name."""
        for measurement in measurements:
            reason = NO_MODEL
            if measurement.kind == KIND:
                reason = fault(measurement.value, self.matcher.grid.seen.size, self._saturation)
            if not reason:
                frame = self.matcher.prepare(measurement.value)
                if state.frames:
                    state, reason = self._weighed(state, frame)
                state = _with(state, frame)
            state = state._replace(verdicts=(*state.verdicts, (measurement, reason, np.nan)))
        return state

    def process_after(self, state: ParticlePathState) -> ProcessModel:
        """For `smoothing`."""
        return self._process

    def _drawn(self, nodes: Sequence[Node], index: int, rng: np.random.Generator) -> Array:
        first = rng.multivariate_normal(self._first.mean, self._first.covariance, self._count)
        return np.hstack((first, np.zeros((self._count, 3 * KEPT))))

    def _weighed(self, state: ParticlePathState, frame: Prepared) -> tuple[ParticlePathState, str]:
        particles, count = state.inner.particles, len(state.frames)
        best = int(np.argmax(state.inner.weights))
        total, used = np.zeros(len(particles)), 0
        for lag in self._lags:
            if lag > count:
                continue
            place = particles.shape[1] - 3 * lag
            relatives = between(particles[:, place : place + 3], particles[:, :3])
            cells = self.matcher.shared_cells(relatives[best])
            if np.count_nonzero(cells) >= LEAST_CELLS:
                total += self.matcher.log_likelihood(frame, state.frames[-lag], relatives, cells)
                used += 1
        if not used:
            return state, NO_OVERLAP
        return state._replace(inner=self._particles.weigh(state.inner, self._tempering * total)), ""


def _with(state: ParticlePathState, frame: Prepared) -> ParticlePathState:
    """State with a frame seen from where the particles are."""
    particles = state.inner.particles
    particles = np.hstack((particles[:, :5], particles[:, 8:], particles[:, :3]))
    return state._replace(inner=state.inner._replace(particles=particles), frames=(*state.frames, frame)[-KEPT:])
