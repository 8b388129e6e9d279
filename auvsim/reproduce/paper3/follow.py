"""A method that follows a run: odometry each step, pulses and packets between the steps as they arrive."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from auvsim.reproduce.paper3.truths import STEP, Event, Run, at
from estimators.core.consistency import normalised_square
from estimators.core.types import Array
from estimators.path_prediction.follower import Follower
from estimators.path_prediction.messages import Packet

SAMPLE = 10.0  # time between recorded errors [s]


class Track(NamedTuple):
    """What a method knew along a run, sampled."""

    times: Array  # (k,) [s]
    errors: Array  # (k, 2) of the position, north and east [m]
    nees: Array  # (k,) of the position, per degree of freedom
    relative: Array  # (k, 2) the error less that of the leader's place which the method uses [m]; NaN before that
    leader: Array  # (k, 2) that error of the leader's place


def follow(method: Follower, run: Run) -> Track:
    """Runs a method over a run."""
    rows = list(_rows(method, run))
    times, errors, covariances, leader = (np.array(column) for column in zip(*rows, strict=True))
    return Track(times, errors, normalised_square(errors, covariances) / 2.0, errors - leader, leader)


def _rows(method: Follower, run: Run) -> Iterator[tuple[float, Array, Array, Array]]:
    every, events, n = round(SAMPLE / STEP), run.events, 0
    for k, (speed, yaw_rate) in enumerate(run.odometry.tolist()):
        end = (k + 1) * STEP
        while n < len(events) and _arrival(events[n]) <= end:
            method.advance(max(method.time, _arrival(events[n])), speed, yaw_rate)
            deliver(method, events[n])
            n += 1
        method.advance(end, speed, yaw_rate)
        if (k + 1) % every == 0:
            lead = np.full(2, np.nan)
            if (leader := method.leader) is not None:
                lead = leader[1] - at(run.leader, leader[0])[:2]
            known = method.belief
            yield end, known.mean[:2] - run.follower[k + 1, :2], known.covariance[:2, :2], lead


def deliver(method: Follower, event: Event) -> None:
    """Hands a pulse or a packet on."""
    if isinstance(event, Packet):
        method.receive(event)
    else:
        method.hear(event)


def _arrival(event: Event) -> float:
    return event.received if isinstance(event, Packet) else event.detected
