"""Navigation of a vehicle that a dock locates acoustically: Qiu and Li (2019), a USBL-based method for homing.

The dock measures the transponder in its own frame and sends it by modem, with its attitude: every fix is old when it
arrives. Eq. 7 (into the world) is in `usbl`, eq. 11 (the current) in `paper`. World axes are (north, east) throughout.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any, Protocol

import numpy as np

from estimators.core import smoothing
from estimators.core.ekf import Innovation
from estimators.core.errors import ParameterError
from estimators.core.estimator import StateFilter
from estimators.core.history import History, Node
from estimators.core.loops import wrap
from estimators.core.types import Array, Gaussian, Measurement, Outcome
from estimators.docking.augmented import AugmentedFilter
from estimators.docking.interacting import InteractingFilter
from estimators.docking.noise import (
    INTERACTING_NOISE,
    PAPER_NOISE,
    REFERENCE_NOISE,
    REGULAR_NOISE,
    ROBUST_NOISE,
    Bias,
    DockingNoise,
)
from estimators.docking.paper import PaperFilter, estimate_current
from estimators.docking.sensors import COMPASS
from estimators.docking.usbl import UsblFix, UsblModel, horizontal_rotation, raw_fix

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


@dataclass(frozen=True, kw_only=True, slots=True)
class DockingEstimate:
    """What a docking estimator knows at one time; zeros before the first fix."""

    time: float  # [s]
    mean: Array  # (n,) north, east [m], psi [rad], u, v [m/s], r [rad/s], current c_n, c_e [m/s], then biases
    covariance: Array  # (n, n), zeros where nothing is estimated
    current: Array  # (2,) north, east [m/s]
    initialised: bool
    refused: Mapping[str, int]  # measurements refused so far, by reason; "outlier" by the filter's gate
    reinitialised: int = 0  # how often the filter had to start anew, because its numbers were no longer finite
    innovation: Innovation | None = None  # of the latest fix, by stamp, that the filter has seen
    # Fates of measurements decided since the last tick. One whose verdict a replay or a recovery has changed is here
    # again: of several outcomes of a measurement the last one holds.
    outcomes: tuple[Outcome, ...] = ()


class DockingFilter(StateFilter, Protocol):
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
        self.filter = filter
        self._usbl = usbl or UsblModel()
        self._step, self._keep = step, keep
        self._compensate_delay = compensate_delay
        self._compass_covariance = np.array([[filter.noise.compass**2]])
        self.reset()

    def reset(self) -> None:
        """Forgets everything, counts included."""
        self._history: History[Any] = History(
            self.filter, step=self._step, keep=self._keep, verdicts=attrgetter("verdicts")
        )
        self._restarts = 0  # of the filter
        self._outliers_before = self._outliers = 0  # rejected before its last start, and in all

    def smoothed(self) -> list[tuple[float, Gaussian]]:
        """Times [s] and beliefs (all states) of the nodes still kept, given all that arrived since: refined poses.

        Raises:
            ParameterError: The filter cannot be smoothed: its covariance does not hold the error of the current.
        """
        nodes = self._history.nodes
        beliefs = smoothing.smooth(nodes, self.filter.process_after)
        return [(node.time, belief) for node, belief in zip(nodes[len(nodes) - len(beliefs) :], beliefs, strict=True)]

    @property
    def nodes(self) -> Sequence[Node[Any]]:
        """The delay buffer."""
        return self._history.nodes

    def tick(
        self,
        time: float,
        heading: float | None,
        rudder: float,
        shaft_speed: float,
        fixes: Sequence[UsblFix] = (),
        aids: Sequence[Measurement] = (),
    ) -> DockingEstimate:
        """One step of the filter.

        Args:
            time: Now [s]; later than at the last tick.
            heading: Compass sample made now [rad], or None.
            rudder: Mean rudder angle since the last tick [rad], positive to starboard.
            shaft_speed: Mean shaft speed since the last tick [rad/s].
            fixes: Packets that arrived since the last tick, in any order.
            aids: What other sensors measured since then, see `aids.Aids`.

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
        for measurement in (*aids, *measurements):
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
        n = 8 + len(self.filter.noise.bias_names)
        belief = Gaussian(mean=np.zeros(n), covariance=np.zeros((n, n))) if state is None else state.belief
        return DockingEstimate(
            time=time,
            mean=belief.mean,
            covariance=belief.covariance,
            current=belief.mean[6:8],
            initialised=state is not None,
            refused={**history.refused, "outlier": self._outliers},
            reinitialised=history.reinitialised,
            innovation=None if state is None else state.innovation,
            outcomes=history.outcomes,
        )
