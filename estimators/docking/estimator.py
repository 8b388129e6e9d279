"""Navigation of a vehicle that a dock locates acoustically: Qiu and Li (2019), a USBL-based method for homing.

The dock measures the transponder in its own frame and sends it by modem, with its attitude: every fix is old when it
arrives. Eq. 7 (into the world) is in `usbl`, eq. 11 (the current) here. World axes are (north, east) throughout.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any, NamedTuple, Protocol, Unpack

import numpy as np

from estimators.core import ekf, smoothing
from estimators.core.ekf import Innovation
from estimators.core.errors import ParameterError
from estimators.core.history import Filter, History, Input, Node
from estimators.core.loops import wrap
from estimators.core.types import Array, Gaussian, Measurement, Outcome, Verdicts
from estimators.docking.augmented import AugmentedFilter
from estimators.docking.interacting import InteractingFilter
from estimators.docking.models import (
    COMPASS,
    INTERACTING_NOISE,
    PAPER_NOISE,
    REFERENCE_NOISE,
    REGULAR_NOISE,
    ROBUST_NOISE,
    USBL,
    Bias,
    DockingNoise,
    ModelOptions,
    PlanarModels,
    first_verdicts,
)
from estimators.docking.usbl import UsblFix, UsblModel, horizontal_rotation, raw_fix
from estimators.planar.model import PlanarParameters

__all__ = [
    "INTERACTING_NOISE",
    "PAPER_NOISE",
    "REFERENCE_NOISE",
    "REGULAR_NOISE",
    "ROBUST_NOISE",
    "AugmentedFilter",
    "Bias",
    "DockingEstimate",
    "DockingEstimator",
    "DockingNoise",
    "InteractingFilter",
    "PaperFilter",
    "UsblFix",
    "UsblModel",
    "estimate_current",
    "horizontal_rotation",
]


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
    `DockingEstimator`), and its delay-compensated half, if they are.

    Args:
        parameters: The vehicle.
        noise: Noise that it assumes; that of the current is not used.
        weights: a_0 .. a_m of eq. 11; None leaves the current zero.
        **options: See `PlanarModels`; the paper's integrator is "euler" with substeps of 0.5 s.
    """

    def __init__(
        self,
        parameters: PlanarParameters,
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

    def start(self, nodes: Sequence[Node[PaperState]], index: int) -> PaperState | None:
        """State at the first fix, with no current; a second fix at the same node is fused."""
        first = self.models.first(nodes, index)
        if first is None:
            return None
        belief, fix = first
        memory = 0 if self._weights is None else len(self._weights) - 1
        state = PaperState(belief, ((0.0, 0.0),) * memory, fix.stamp)
        others = [m for m in nodes[index].measurements if m.kind == USBL and m is not fix]
        state = self.correct(state, nodes[index].time, others)
        return state._replace(verdicts=first_verdicts(nodes[index], fix) + state.verdicts)

    def predict(self, state: PaperState, u: Input, duration: float) -> PaperState:
        """State after `duration` [s]; eq. 12."""
        belief = ekf.predict(state.belief, self.models.process, u, duration)
        return PaperState(belief, state.currents, state.last_fix, state.innovation)

    def correct(self, state: PaperState, node_time: float, measurements: Sequence[Measurement]) -> PaperState:
        """State after the compass samples and fixes of a node."""
        for measurement in measurements:
            if measurement.kind == COMPASS:
                belief, nis = self.models.fuse_heading(state.belief, measurement)
                verdicts = (*state.verdicts, (measurement, "", nis))
                state = PaperState(belief, state.currents, state.last_fix, state.innovation, 0, verdicts)
            elif measurement.kind == USBL:
                state = self._fuse_fix(state, measurement)
        return state

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


@dataclass(frozen=True, kw_only=True, slots=True)
class DockingEstimate:
    """Estimate of a docking estimator at one time; zeros before the first fix."""

    time: float  # [s]
    mean: Array  # (8,) north, east [m], psi [rad], u, v [m/s], r [rad/s], current c_n, c_e [m/s]
    covariance: Array  # (8, 8), zeros where nothing is estimated
    current: Array  # (2,) north, east [m/s]
    initialised: bool
    refused: Mapping[str, int]  # measurements refused so far, by reason; "outlier" by the filter's gate
    reinitialised: int = 0  # number of restarts after its numbers were no longer finite
    innovation: Innovation | None = None  # of the latest fix, by stamp, that the filter has seen
    # Fates of measurements decided since the last tick. One whose verdict a replay or a recovery has changed is here
    # again: of several outcomes of a measurement the last one holds.
    outcomes: tuple[Outcome, ...] = ()


class DockingFilter(Filter[Any], Protocol):
    """A filter for a `DockingEstimator`.

    Its states have `belief` (eight states and biases), `outliers`, `innovation` and `verdicts`, see `History`.
    """

    noise: DockingNoise


class DockingEstimator:
    """A docking filter behind its delay buffer: measurements in, in whatever order, estimate out.

    Args:
        filter: `AugmentedFilter`, `InteractingFilter`, `PaperFilter`, or one of that form.
        usbl: Model of the dock's USBL.
        step: Nominal time between ticks [s].
        keep: Age up to which fixes are used [s].
        compensate_delay: False takes every fix as made at the tick it arrives at, whatever its stamp or number: the
            paper's regular filter.
    """

    def __init__(
        self,
        filter: DockingFilter,
        usbl: UsblModel | None = None,
        *,
        step: float = 0.5,
        keep: float = 30.0,
        compensate_delay: bool = True,
    ) -> None:
        self._filter = filter
        self._usbl = usbl or UsblModel()
        self._step, self._keep = step, keep
        self._compensate_delay = compensate_delay
        self._compass_covariance = np.array([[filter.noise.compass**2]])
        self.reset()

    def reset(self) -> None:
        """Forgets everything, counts included."""
        self._history: History[Any] = History(
            self._filter, step=self._step, keep=self._keep, verdicts=attrgetter("verdicts")
        )
        self._restarts = 0  # of the filter
        self._outliers_before = self._outliers = 0  # rejected before its last start, and in all

    def smoothed(self) -> list[tuple[float, Gaussian]]:
        """Times [s] and beliefs (all states) of the nodes still kept, given all that arrived since: refined poses.

        Raises:
            ParameterError: The filter cannot be smoothed: its covariance does not hold the error of the current.
        """
        process_after = getattr(self._filter, "process_after", None)
        if process_after is None:
            raise ParameterError(f"a {type(self._filter).__name__} cannot be smoothed; an AugmentedFilter can")
        nodes = self._history.nodes
        beliefs = smoothing.smooth(nodes, process_after)
        return [(node.time, belief) for node, belief in zip(nodes[len(nodes) - len(beliefs) :], beliefs, strict=True)]

    @property
    def nodes(self) -> Sequence[Node[Any]]:
        """The delay buffer."""
        return self._history.nodes

    def tick(
        self, time: float, heading: float | None, rudder: float, shaft_speed: float, fixes: Sequence[UsblFix] = ()
    ) -> DockingEstimate:
        """One step of the filter.

        Args:
            time: Now [s]; later than at the last tick.
            heading: Compass sample made now [rad], or None.
            rudder: Mean rudder angle since the last tick [rad], positive to starboard.
            shaft_speed: Mean shaft speed since the last tick [rad/s].
            fixes: Packets that arrived since the last tick, in any order.

        Raises:
            ParameterError: The time does not advance, or an input is not a number.
        """
        u = (float(rudder), float(shaft_speed))
        if not (math.isfinite(u[0]) and math.isfinite(u[1])):
            raise ParameterError(f"rudder {rudder} rad and shaft speed {shaft_speed} rad/s at {time} s must be finite")
        history = self._history
        prompt = [] if heading is None else [self._compass(time, float(heading))]
        measurements = []
        for fix in fixes:
            if self._usbl.reaches(fix):
                measurements.append(self._usbl.world_fix(fix))
            else:
                history.refuse("implausible", raw_fix(fix))
        if not self._compensate_delay:
            prompt += [replace(m, stamp=time) for m in measurements]
            measurements = []
        history.append(float(time), u, prompt)
        for measurement in measurements:
            history.insert(measurement)
        return self._estimate(time, history.replay())

    def _compass(self, time: float, heading: float) -> Measurement:
        value = np.array((wrap(heading),))
        return Measurement(kind=COMPASS, value=value, covariance=self._compass_covariance, stamp=time, received=time)

    def _estimate(self, time: float, state: Any) -> DockingEstimate:
        history = self._history
        if history.reinitialised > self._restarts:
            self._restarts, self._outliers_before = history.reinitialised, self._outliers
        if state is not None:
            self._outliers = self._outliers_before + state.outliers
        belief = Gaussian(mean=np.zeros(8), covariance=np.zeros((8, 8))) if state is None else state.belief
        return DockingEstimate(
            time=time,
            mean=belief.mean[:8],
            covariance=belief.covariance[:8, :8],
            current=belief.mean[6:8],
            initialised=state is not None,
            refused={**history.refused, "outlier": self._outliers},
            reinitialised=history.reinitialised,
            innovation=None if state is None else state.innovation,
            outcomes=history.outcomes,
        )
