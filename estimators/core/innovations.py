"""What each measurement of a delay buffer said that the filter did not know: its innovation, in order of stamps."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from estimators.core import ekf
from estimators.core.estimator import StateFilter
from estimators.core.history import Node
from estimators.core.types import Array, Measurement, model_of


class Innovated(NamedTuple):
    """A measurement against the belief of all that was true before it."""

    measurement: Measurement
    residual: Array  # (m,)
    covariance: Array  # (m, m) of the residual
    accepted: bool


def innovations(nodes: Sequence[Node[Any]], filter: StateFilter) -> Iterator[Innovated]:
    """Innovations at nodes that are up to date; none at the first of them, nor where the filter starts.

    They are linearised about the prediction, also those of filters that take sigma points or weigh several modes.

    Raises:
        ParameterError: The filter cannot say how it went on from a state.
    """
    for before, node in pairwise(nodes):
        if before.state is None or node.state is None or node.failed or not node.measurements:
            continue
        process = filter.process_after(before.state)
        belief = ekf.predict(before.state.belief, process, before.input, node.time - before.time)
        refused = {id(m) for m, reason, _ in node.verdicts if reason}
        for measurement in node.measurements:
            model = model_of(filter.sensors, measurement)
            if model is None:
                continue
            after, found = ekf.correct(belief, measurement, model)
            accepted = id(measurement) not in refused
            yield Innovated(measurement, found.residual, found.covariance, accepted)
            if accepted:
                belief = after
