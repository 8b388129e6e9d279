"""A filter behind its delay buffer, with a screen for each scalar sensor: measurements in, estimate out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Protocol

from estimators.core import smoothing
from estimators.core.history import Filter, History, Node
from estimators.core.screening import Limits, Screen
from estimators.core.types import Gaussian, Measurement, Models, Outcome, ProcessModel


class StateFilter(Filter[Any], Protocol):
    """A filter for an `Estimator`; its states have `belief`, `outliers` and `verdicts`."""

    sensors: Models  # what each kind of measurement shows

    def process_after(self, state: Any) -> ProcessModel:
        """The process by which it went on from a state, for `smoothing`; ParameterError if there is none that fits."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimate:
    """What an estimator knows at one time."""

    time: float  # [s]
    belief: Gaussian | None  # None before the filter has started
    outcomes: tuple[Outcome, ...]  # fates decided since the last tick; of several of one measurement the last holds
    refused: Mapping[str, int]  # measurements refused so far, by reason; "outlier" by the filter
    reinitialised: int  # how often the filter had to start anew, because its numbers were no longer finite


class Estimator:
    """A filter of any model for a vehicle or a log.

    Args:
        filter: `filter.ModelFilter`, `interacting.InteractingModelFilter`, or one of that form.
        step: Nominal time between ticks [s].
        keep: Age up to which measurements are used [s].
        limits: What the scalar sensors of some kinds can show; each source has a screen of its own.
    """

    def __init__(
        self, filter: StateFilter, *, step: float, keep: float = 30.0, limits: Mapping[str, Limits] | None = None
    ) -> None:
        self.filter, self._step, self._keep, self._limits = filter, step, keep, dict(limits or {})
        self.reset()

    def reset(self) -> None:
        """Forgets everything, counts included."""
        self.history: History[Any] = History(
            self.filter, step=self._step, keep=self._keep, verdicts=attrgetter("verdicts")
        )
        self._screens: dict[tuple[str, str], Screen] = {}
        self._restarts = self._outliers_before = self._outliers = 0

    @property
    def nodes(self) -> Sequence[Node[Any]]:
        """The delay buffer."""
        return self.history.nodes

    def tick(self, time: float, u: Sequence[float] = (), measurements: Sequence[Measurement] = ()) -> Estimate:
        """One step of the filter.

        Args:
            time: Now [s]; later than at the last tick.
            u: Input that held since the last tick.
            measurements: What arrived since then, in any order, each with its own stamp.

        Raises:
            ParameterError: The time does not advance.
        """
        history = self.history
        history.append(time, tuple(map(float, u)))
        for measurement in measurements:
            if reason := self._screened(measurement):
                history.refuse(reason, measurement)
            else:
                history.insert(measurement)
        state = history.replay()
        if history.reinitialised > self._restarts:
            self._restarts, self._outliers_before = history.reinitialised, self._outliers
        if state is not None:
            self._outliers = self._outliers_before + state.outliers
        return Estimate(
            time=time,
            belief=None if state is None else state.belief,
            outcomes=history.outcomes,
            refused={**history.refused, "outlier": self._outliers},
            reinitialised=history.reinitialised,
        )

    def smoothed(self) -> list[tuple[float, Gaussian]]:
        """Times [s] and beliefs of the nodes still kept, given all that arrived since: a fixed-lag smoother."""
        nodes = self.history.nodes
        beliefs = smoothing.smooth(nodes, self.filter.process_after)
        return [(node.time, belief) for node, belief in zip(nodes[len(nodes) - len(beliefs) :], beliefs, strict=True)]

    def _screened(self, measurement: Measurement) -> str:
        limits = self._limits.get(measurement.kind)
        if limits is None:
            return ""
        screen = self._screens.setdefault((measurement.kind, measurement.source), Screen(limits))
        return screen.judge(measurement.stamp, measurement.value.item())
