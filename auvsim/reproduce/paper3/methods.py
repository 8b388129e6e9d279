"""The methods of the study of paper 3, by name, each made for a run."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from auvsim.reproduce.paper3 import yardsticks
from auvsim.reproduce.paper3.follow import Track
from auvsim.reproduce.paper3.truths import DETECTION, SOUND, Run
from estimators.path_prediction.choosing import ChoosingFilter
from estimators.path_prediction.cloning import CloningFilter
from estimators.path_prediction.delay_ignoring import DelayIgnoringFilter
from estimators.path_prediction.delayed import DelayedFilter
from estimators.path_prediction.follower import DeadReckoning, Follower
from estimators.path_prediction.iiru import IncoordinateIntervalFilter
from estimators.path_prediction.real_time import RealTimeFilter


def dead_reckoning(run: Run) -> Follower:
    """Of the follower's odometry."""
    return DeadReckoning(run.start, run.noise.follower, bends=True)


@dataclass(frozen=True, kw_only=True, slots=True)
class Method:
    """One column of the study: a follower, or what makes a track of the whole run by itself."""

    title: str
    make: Callable[[Run], Follower] = dead_reckoning  # not of a yardstick
    prompt: bool = False  # follows the run without delay
    track: Callable[[Run], Track] | None = None  # of a yardstick


def delay_ignoring(run: Run, **options: Any) -> Follower:
    """E1 to E3."""
    return DelayIgnoringFilter(run.start, run.noise.follower, **options)


def delayed(run: Run) -> Follower:
    """DEKF."""
    return DelayedFilter(run.start, run.noise.follower)


def iiru(run: Run, **options: Any) -> Follower:
    """The paper's."""
    return IncoordinateIntervalFilter(
        run.start, run.noise.follower, run.noise.leader, period=run.conditions.period, **options
    )


def waiting(run: Run) -> int:
    """Periods that a packet may take, and three more for what is lost or late."""
    c = run.conditions
    return max(8, math.ceil((c.delay + 4.0 * c.delay_deviation) / c.period) + 3)


def cloning(run: Run, **options: Any) -> CloningFilter:
    """SC-EKF, with as many clones as the delay asks for."""
    return CloningFilter(run.start, run.noise.follower, clones=waiting(run), **options)


def real_time(run: Run) -> RealTimeFilter:
    """SC-RT, with as many slots as the delay asks for."""
    return RealTimeFilter(
        run.start, run.noise.follower, run.noise.leader, period=run.conditions.period, slots=waiting(run) + 2
    )


def choosing(run: Run) -> Follower:
    """Between the two."""
    return ChoosingFilter(cloning(run), real_time(run))


METHODS = {
    "dr": Method(title="DR", make=dead_reckoning),
    "ekf_e1": Method(title="EKF E1", make=lambda run: delay_ignoring(run, pairing="pulse")),
    "ekf": Method(title="EKF E2", make=delay_ignoring),
    "ekf_e3": Method(title="EKF E3", make=lambda run: delay_ignoring(run, range_offset=SOUND * DETECTION)),
    "dekf": Method(title="DEKF", make=delayed),
    "iiru": Method(title="IIRU", make=iiru),
    "iiru_full": Method(title="IIRU, full S", make=lambda run: iiru(run, full_gain=True)),
    "iiru_reduced": Method(title="IIRU reduced", make=lambda run: iiru(run, coupled=False)),
    "iiru_speed": Method(title="IIRU, speed", make=lambda run: iiru(run, varying_speed=True)),
    "sc": Method(title="SC-EKF", make=cloning),
    "sc_plain": Method(title="SC-EKF, own packets only", make=lambda run: cloning(run, interpolated=False)),
    "rt": Method(title="SC-RT", make=real_time),
    "choosing": Method(title="choosing", make=choosing),
    "oracle": Method(title="oracle", make=cloning, prompt=True),
    "map": Method(title="batch MAP", track=yardsticks.most_probable),
    "particle": Method(title="particle filter", track=yardsticks.particle),
}
