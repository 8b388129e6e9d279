"""Dead reckoning: what is left of a follower that hears nothing and knows of no current."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimators.core.history import Input, Node
from estimators.core.models.odometry import Displacement, OdometryNoise
from estimators.core.types import NO_MODEL, Gaussian, Measurement, Verdicts


class ReckonedState(NamedTuple):
    """What a node keeps."""

    begin: Gaussian
    since: Displacement = Displacement()
    verdicts: Verdicts = ()

    @property
    def belief(self) -> Gaussian:
        """Start and displacement; the current stays what it was believed at the start."""
        d = self.since
        F = np.eye(self.begin.mean.size)
        F[0, 2] = F[1, 3] = d.duration
        mean, P = F @ self.begin.mean, F @ self.begin.covariance @ F.T
        mean[:2] += d.north, d.east
        P[:2, :2] += ((d.north_north, d.north_east), (d.north_east, d.east_east))
        return Gaussian(mean=mean, covariance=P)


class DeadReckoning:
    """Dead reckoning from a start (north, east, current, ...), for a `History`; it refuses all measurements."""

    def __init__(self, start: Gaussian, noise: OdometryNoise) -> None:
        self._start, self._noise = start, noise

    def start(self, nodes: Sequence[Node[ReckonedState]], index: int) -> ReckonedState:
        """State at the first node."""
        return self.correct(ReckonedState(self._start), nodes[index].time, nodes[index].measurements)

    def predict(self, state: ReckonedState, u: Input, duration: float) -> ReckonedState:
        """State after `duration` [s]."""
        since = state.since.extended(u[0], u[1], u[2], duration, self._noise)
        return ReckonedState(state.begin, since)

    def correct(self, state: ReckonedState, node_time: float, measurements: Sequence[Measurement]) -> ReckonedState:
        """Returns the state unchanged, since dead reckoning uses no measurement."""
        refused = tuple((m, NO_MODEL, math.nan) for m in measurements)
        return state._replace(verdicts=(*state.verdicts, *refused))
