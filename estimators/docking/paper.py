"""Paper 1's improved filter: the current by eq. 11 beside six states (Qiu and Li 2019, sec. 6 to 10)."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Unpack

import numpy as np

from estimators.core import ekf
from estimators.core.ekf import Innovation
from estimators.core.errors import ParameterError
from estimators.core.history import Input, Node
from estimators.core.types import NO_MODEL, Array, Gaussian, Measurement, ProcessModel, Verdicts
from estimators.docking.models import ModelOptions, PlanarModels
from estimators.docking.noise import PAPER_NOISE, DockingNoise
from estimators.docking.sensors import COMPASS, USBL
from estimators.planar.model import Dynamics


def estimate_current(
    history: Sequence[tuple[float, float]],
    weights: Array,
    gain: Array,
    residual: Array,
    interval: float,
) -> tuple[float, float]:
    """Eq. 11: V_n = a_0 V_(n-m) + ... + a_(m-1) V_(n-1) + a_m (V_(n-1) + K_C (z_n - p_n^-) / (t_n - t_(n-1))).

    Args:
        history: The last m estimates (north, east), oldest first [m/s].
        weights: (m + 1,) a_0 .. a_m, positive, of sum 1.
        gain: K_C (2, 2), the position's gain on the position.
        residual: z_n - p_n^- (2,), fix minus predicted position [m].
        interval: t_n - t_(n-1) between the stamps [s].
    """
    past = np.array((*history, history[-1]))
    north, east = weights @ past + weights[-1] * (gain @ residual) / interval
    return float(north), float(east)


class PaperState(NamedTuple):
    """What a node keeps: the belief, its states 7, 8 the current of eq. 11 without covariance; eq. 11's memory."""

    belief: Gaussian
    currents: tuple[tuple[float, float], ...]  # last m estimates, oldest first [m/s]
    last_fix: float  # stamp of the fix before [s]
    innovation: Innovation | None = None  # of the last fix
    outliers: int = 0  # it has no gate
    verdicts: Verdicts = ()  # on this node's measurements


class PaperFilter:
    """The paper's improved filter: six states, the current by eq. 11 beside them; for a `History`.

    It has no gate: its covariance does not know the current's error, so that a gate would lock it out. For the same
    reason the position noise is inflated, and its covariance is not consistent.

    Without `weights` the current stays zero: the paper's regular filter, if delays are not compensated either (see
    `DockingEstimator`), and its half-measure, if they are.

    Args:
        parameters: The vehicle.
        noise: Noise that it assumes; that of the current is not used.
        weights: a_0 .. a_m of eq. 11; None leaves the current zero.
        **options: See `PlanarModels`; the paper's integrator is "euler" with substeps of 0.5 s.
    """

    def __init__(
        self,
        parameters: Dynamics,
        noise: DockingNoise = PAPER_NOISE,
        *,
        weights: tuple[float, ...] | None = (0.3, 0.3, 0.4),
        **options: Unpack[ModelOptions],
    ) -> None:
        if weights is not None and (len(weights) < 2 or min(weights) <= 0.0 or abs(sum(weights) - 1.0) > 1e-9):
            raise ParameterError(f"weights {weights} of eq. 11 must be two or more, above 0, of sum 1")
        # With no covariance, the augmented model is the six-state one with a given current.
        self.parameters = parameters
        self.noise = replace(noise, current=0.0, initial_current=0.0, biases={})
        self._weights = None if weights is None else np.array(weights)
        self.models = PlanarModels(parameters, self.noise, **options)
        self.sensors = self.models.sensors

    def start(self, nodes: Sequence[Node[PaperState]], index: int) -> PaperState | None:
        """State at the first fix, with no current; a second fix at the same node is fused."""
        found = self.models.start(nodes, index)
        if found is None:
            return None
        belief, used = found
        fix = next(m for m in used if m.kind == USBL)
        memory = 0 if self._weights is None else len(self._weights) - 1
        verdicts = tuple((m, "", math.nan) for m in used)
        state = PaperState(belief, ((0.0, 0.0),) * memory, fix.stamp, verdicts=verdicts)
        others = [m for m in nodes[index].measurements if m.kind == USBL and m is not fix]
        return self.correct(state, nodes[index].time, others)

    def predict(self, state: PaperState, u: Input, duration: float) -> PaperState:
        """State after `duration` [s]; eq. 12."""
        belief = ekf.predict(state.belief, self.models.process, u, duration)
        return PaperState(belief, state.currents, state.last_fix, state.innovation)

    def correct(self, state: PaperState, node_time: float, measurements: Sequence[Measurement]) -> PaperState:
        """State after the compass samples and fixes of a node."""
        for measurement in measurements:
            if measurement.kind == COMPASS:
                belief, nis = ekf.fuse(state.belief, measurement, self.models.heading)
                verdicts = (*state.verdicts, (measurement, "", nis))
                state = PaperState(belief, state.currents, state.last_fix, state.innovation, 0, verdicts)
            elif measurement.kind == USBL:
                state = self._fuse_fix(state, measurement)
            else:
                state = state._replace(verdicts=(*state.verdicts, (measurement, NO_MODEL, math.nan)))
        return state

    def process_after(self, state: PaperState) -> ProcessModel:
        """For `smoothing`, which needs more than this filter knows.

        Raises:
            ParameterError: Always: its covariance does not hold the error of the current.
        """
        raise ParameterError("a PaperFilter cannot be smoothed; an AugmentedFilter can")

    def _fuse_fix(self, state: PaperState, fix: Measurement) -> PaperState:
        belief, innovation = ekf.correct(state.belief, fix, self.models.position)
        interval = fix.stamp - state.last_fix
        verdicts = (*state.verdicts, (fix, "", innovation.nis))
        if self._weights is None or abs(interval) < 1e-6:
            return state._replace(belief=belief, innovation=innovation, verdicts=verdicts)
        gain = innovation.gain[:2, :2]
        current = estimate_current(state.currents, self._weights, gain, innovation.residual, interval)
        belief.mean[6:] = current
        return PaperState(belief, (*state.currents[1:], current), fix.stamp, innovation, 0, verdicts)
