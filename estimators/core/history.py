"""Measurements out of sequence: nodes in time order are kept, rolled back to, inserted between, and replayed.

The delay buffer of Qiu and Li (2019), sec. 2.3.

Works with any filter of the protocol `Filter`. Whatever the order in which measurements are delivered, the latest state
is, bit for bit, that of the same filter fed in order without delay, as long as nothing is older than the history
reaches.
"""

import math
from collections.abc import Callable, Sequence
from math import isfinite
from typing import Generic, Protocol, TypeVar

import numpy as np

from estimators.core import loops
from estimators.core.errors import NotFiniteError, NotPositiveDefiniteError, ParameterError
from estimators.core.types import Measurement, Outcome, Verdicts

State = TypeVar("State")
Input = tuple[float, ...]

REFUSALS = ("future", "too_old", "not_finite", "not_positive_definite", "duplicate")


_new = tuple.__new__


class Node(Generic[State]):
    """One instant: what was measured then, the input from then to the next node, and the filter's state after it."""

    __slots__ = ("failed", "input", "is_grid", "measurements", "prompt", "revises", "state", "time", "verdicts")

    def __init__(self, time: float, u: Input, measurements: list[Measurement], is_grid: bool) -> None:
        self.time = time  # [s]
        self.input = u
        self.measurements = measurements
        self.prompt = len(measurements)  # how many of them, the first ones, were made at the tick and did not come late
        self.is_grid = is_grid  # a tick of the filter, not a time inserted for a measurement
        self.state: State | None = None  # None before the filter has started
        self.failed = False  # the filter could not go on here and started anew
        self.verdicts: Verdicts = ()  # of its measurements, and those it revised of earlier nodes
        self.revises = False  # whether there are any of earlier nodes


def outcome(measurement: Measurement, reason: str, nis: float = math.nan) -> Outcome:
    """The fate of a measurement that was refused for a `reason`, or used if that is empty."""
    m, sequence = measurement, measurement.sequence
    # Not Outcome(...), which takes twice as long, once at every tick.
    return _new(Outcome, (m.kind, m.source, m.stamp, -1 if sequence is None else sequence, not reason, reason, nis))


class Filter(Protocol[State]):
    """What a history replays. States are immutable and carry all that the next node needs."""

    def start(self, nodes: Sequence[Node[State]], index: int) -> State | None:
        """First state, at a node; None if its measurements do not suffice. Neighbours may be read only."""
        ...

    def predict(self, state: State, u: Input, duration: float) -> State:
        """State after `duration` [s] with the input held."""
        ...

    def correct(self, state: State, node_time: float, measurements: Sequence[Measurement]) -> State:
        """State after a node's measurements, in their order."""
        ...


class History(Generic[State]):
    """The delay buffer: grid nodes at the filter's ticks and inserted nodes at the stamps of late measurements.

    Where the filter cannot go on, because its numbers are not finite or its covariance not positive definite, it starts
    anew at the next node that suffices for it, which is counted as `reinitialised`.

    Args:
        filter: What to run over the nodes.
        step: Nominal time between ticks [s]. A late measurement within a tenth of it of a tick belongs to that tick
            ("yellow" in the paper), else it gets a node of its own ("blue"), which takes the input of the node before
            it.
        keep: Age up to which measurements are accepted [s]; must exceed the longest delay.
        verdicts: Reads from a state what the filter decided about each measurement of the state's node, and what it
            revised there of earlier ones. None: the filter uses all that it is handed.
    """

    def __init__(
        self,
        filter: Filter[State],
        *,
        step: float,
        keep: float = 30.0,
        verdicts: Callable[[State], Verdicts] | None = None,
    ) -> None:
        if not 0.0 < step <= keep:
            raise ParameterError(f"step {step} s and age kept {keep} s must satisfy 0 < step <= keep")
        self._filter, self._verdicts = filter, verdicts
        self._snap = step / 10.0
        self._keep = keep
        self.nodes: list[Node[State]] = []
        self.refused: dict[str, int] = dict.fromkeys(REFUSALS, 0)  # measurements refused so far, by reason
        self.reinitialised = 0  # how often the filter has failed and started anew
        # What was decided up to the last replay and since the one before, in that order. Replayed measurements are
        # here again only if they are refused for another reason than before, or no longer.
        self.outcomes: tuple[Outcome, ...] = ()
        self._decided: list[Outcome] = []
        self._reasons: dict[int, str] = {}  # last one reported of each measurement held, by its id
        self._accepted: dict[tuple, float] = {}  # stamps of measurements taken, by stamp and by number
        self._most_accepted = 256  # from then on those of long ago are forgotten
        self._touched = 0  # first node whose state is out of date

    @property
    def state(self) -> State | None:
        """The state at the latest node; None before the filter has started. Up to date after `replay`."""
        return self.nodes[-1].state if self.nodes else None

    def append(self, time: float, u: Input, measurements: Sequence[Measurement] = ()) -> None:
        """Adds the tick at `time` [s] with the input that held since the last one and the measurements made at it.

        Raises:
            ParameterError: The time is not after that of the last tick, or not a number.
        """
        if not isfinite(time) or (self.nodes and time <= self.nodes[-1].time):
            raise ParameterError(
                f"tick at {time} s must come after that at {self.nodes[-1].time if self.nodes else 0} s"
            )
        if self.nodes:
            self.nodes[-1].input = u
        self.nodes.append(Node(time, u, [m for m in measurements if self._is_sound(m)], is_grid=True))
        # A node leaves by age once nothing that is still accepted can be attached to it: it then only serves as the
        # base of the next.
        oldest = time - self._keep - self._snap
        if self._touched <= 1 < len(self.nodes) and self.nodes[1].time < oldest:
            self._advance()  # the next node's base must be up to date before it can leave
        while len(self.nodes) > 1 and self.nodes[1].time < oldest:
            for measurement in self.nodes.pop(0).measurements:
                self._reasons.pop(id(measurement), None)
            self._touched = max(0, self._touched - 1)

    def insert(self, measurement: Measurement) -> bool:
        """Puts a late measurement where it belongs, for `replay` to act on; or counts why it is refused: False."""
        if not self._is_sound(measurement) or not self._is_timely(measurement) or self._is_duplicate(measurement):
            return False
        index = self._place(measurement.stamp)
        node = self.nodes[index]
        node.measurements.append(measurement)
        # Late measurements of one node stand in stamp order, whichever came first.
        node.measurements[node.prompt :] = sorted(
            node.measurements[node.prompt :], key=lambda m: (m.stamp, m.kind, m.source)
        )
        self._touched = min(self._touched, index)
        return True

    def replay(self) -> State | None:
        """Brings every node from the earliest touched one up to date and returns the latest state.

        What that decided about measurements is then in `outcomes`.
        """
        self._advance()
        self.outcomes = tuple(self._decided)
        self._decided.clear()
        return self.state

    def _advance(self) -> None:
        nodes, filter, verdicts = self.nodes, self._filter, self._verdicts
        first, revised = self._touched, False
        for index in range(first, len(nodes)):
            node = nodes[index]
            before = nodes[index - 1] if index else None
            try:
                if before is None or before.state is None:
                    node.state = filter.start(nodes, index)
                else:
                    state = filter.predict(before.state, before.input, node.time - before.time)
                    node.state = filter.correct(state, node.time, node.measurements) if node.measurements else state
            except (NotFiniteError, NotPositiveDefiniteError):
                self._restart(index)
            if node.measurements:
                state = node.state
                node.verdicts = self._unjudged(node) if state is None or verdicts is None else verdicts(state)
                revises = len(node.verdicts) > len(node.measurements)
                revised = revised or revises or node.revises  # what it said of earlier nodes may no longer hold
                node.revises = revises
        self._touched = len(nodes)
        if revised:
            self._report_revised()
            return
        reasons, decided = self._reasons, self._decided
        for index in range(first, len(nodes)):
            for measurement, reason, nis in nodes[index].verdicts:
                if reasons.get(key := id(measurement)) != reason:
                    reasons[key] = reason
                    decided.append(outcome(measurement, reason, nis))

    def _unjudged(self, node: Node[State]) -> Verdicts:
        """What became of a node's measurements where the filter does not say it."""
        reason = "" if node.state is not None else "failed" if node.failed else "not_started"
        return tuple((measurement, reason, math.nan) for measurement in node.measurements)

    def _report_revised(self) -> None:
        """Notes the outcomes that differ from those last reported, where nodes speak of earlier ones."""
        held = {id(measurement) for node in self.nodes for measurement in node.measurements}
        latest = {id(verdict[0]): verdict for node in self.nodes for verdict in node.verdicts}
        for key, verdict in latest.items():
            if key in held and self._reasons.get(key) != verdict[1]:
                self._reasons[key] = verdict[1]
                self._decided.append(outcome(*verdict))

    def _restart(self, index: int) -> None:
        """Starts the filter at a node where it failed, or leaves that to a later one; counts each such node once."""
        node = self.nodes[index]
        self.reinitialised += not node.failed
        node.failed = True
        try:
            node.state = self._filter.start(self.nodes, index)
        except (NotFiniteError, NotPositiveDefiniteError):
            node.state = None

    def refuse(self, reason: str, measurement: Measurement | None = None) -> bool:
        """Counts a measurement refused and, where it is given, notes its outcome; always False."""
        self.refused[reason] = self.refused.get(reason, 0) + 1
        if measurement is not None:
            self._decided.append(outcome(measurement, reason))
        return False

    def _place(self, stamp: float) -> int:
        """Index of the node that a measurement belongs to, inserted if need be."""
        nodes = self.nodes
        after = len(nodes)
        while after and nodes[after - 1].time > stamp:
            after -= 1
        if after and nodes[after - 1].time == stamp and nodes[after - 1].is_grid:  # the common case, cheaply
            return after - 1
        # Only ticks attract: whether a node was inserted before or after must not matter.
        distance, index = min((abs(nodes[k].time - stamp), k) for k in self._neighbouring_ticks(after))
        if distance < self._snap:
            return index
        if nodes[after - 1].time == stamp:
            return after - 1
        nodes.insert(after, Node(stamp, nodes[after - 1].input, [], is_grid=False))
        self._touched += self._touched > after
        return after

    def _neighbouring_ticks(self, after: int) -> list[int]:
        """Indices of the ticks before and after a place between nodes; the latest node is always a tick."""
        before = next((k for k in range(after - 1, -1, -1) if self.nodes[k].is_grid), None)
        following = next((k for k in range(after, len(self.nodes)) if self.nodes[k].is_grid), None)
        return [k for k in (before, following) if k is not None]

    def _is_sound(self, measurement: Measurement) -> bool:
        """Counts measurements that are not finite or whose covariance is not positive definite."""
        value, covariance = measurement.value, measurement.covariance
        if value.size == 1:  # the common case, cheaply
            variance = covariance.item()
            if not (isfinite(value.item()) and isfinite(variance) and isfinite(measurement.stamp)):
                return self.refuse("not_finite", measurement)
            return variance > 0.0 or self.refuse("not_positive_definite", measurement)
        if not all(map(isfinite, (measurement.stamp, *value.tolist(), *covariance.ravel().tolist()))):
            return self.refuse("not_finite", measurement)
        # The factorisation reads one triangle only.
        asymmetry = np.abs(covariance - covariance.T).max()
        is_symmetric = asymmetry <= 1e-9 * np.abs(covariance).max()
        return (is_symmetric and loops.factor(covariance)[1]) or self.refuse("not_positive_definite", measurement)

    def _is_timely(self, measurement: Measurement) -> bool:
        """Counts measurements from the future and from before the history."""
        if not self.nodes or measurement.stamp > self.nodes[-1].time:
            return self.refuse("future", measurement)
        if measurement.stamp < max(self.nodes[-1].time - self._keep, self.nodes[0].time):
            return self.refuse("too_old", measurement)
        return True

    def _is_duplicate(self, measurement: Measurement) -> bool:
        """Counts measurements that came before: same kind and source, and same sequence number or same stamp."""
        oldest, known = self.nodes[-1].time - self._keep, self._accepted
        source, number = (measurement.kind, measurement.source), measurement.sequence
        by_stamp, by_number = (source, "stamp", measurement.stamp), (source, "number", number)
        if by_stamp in known or (number is not None and known.get(by_number, -math.inf) >= oldest):
            return not self.refuse("duplicate", measurement)
        known[by_stamp] = measurement.stamp
        if number is not None:
            known[by_number] = measurement.stamp
        if len(known) > self._most_accepted:
            self._accepted = known = {key: stamp for key, stamp in known.items() if stamp >= oldest}
            self._most_accepted = max(256, 2 * len(known))
        return False
