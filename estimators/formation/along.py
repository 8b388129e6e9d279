"""The posterior bound along a track, through `core.bounds`: leaders that err together or report late, unknown currents.

What is unknown besides the place is a state: two errors of each leader's reported place, correlated in time, and the
current. So the bound knows that a leader's error does not average out, which a wider range noise would pretend.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from estimators.core.bounds import PosteriorBound
from estimators.core.history import History
from estimators.core.models.motion import Motion, dead_reckoning, with_current, with_error
from estimators.core.models.process import MotionProcess
from estimators.core.models.sensors import Sensor
from estimators.core.types import Array, Measurement
from estimators.formation.models import InputNoise

RANGE = "range"  # kind of a measurement of one range; its source is the leader's number
STILL = 1e-9  # power spectral density of a current that is constant [m^2/s^3]; the bound needs some


class LeaderError(NamedTuple):
    """How wrong a leader's reported place is on each axis."""

    deviation: float  # [m]
    time_constant: float  # in which it changes [s]


class Unknowns(NamedTuple):
    """What a follower does not know besides its place."""

    leaders: LeaderError | None = None
    current: float | None = None  # deviation of each component before the first range [m/s]; None: it is known
    delay: float = 0.0  # after which a range arrives [s]


class BoundAlong(NamedTuple):
    """The bound of the place at each step, of what has arrived."""

    times: Array  # (s,) [s]
    covariance: Array  # (s, 2, 2) [m^2]

    @property
    def rms(self) -> Array:
        """Least rms error (s,) [m]."""
        return np.sqrt(np.trace(self.covariance, axis1=1, axis2=2))


def bound_along(
    places: Array,
    leaders: Array,
    inputs: Array,
    *,
    step: float,
    deviations: Sequence[float],
    noise: InputNoise = InputNoise(),  # noqa: B008 - immutable
    unknown: Unknowns = Unknowns(),  # noqa: B008 - immutable
    start: float = 1.0,
    heard: Callable[[int, int], bool] = lambda k, leader: True,
) -> BoundAlong:
    """The conditional posterior Cramér-Rao bound of a follower's place.

    Args:
        places: Of the follower (s, 2) [m].
        leaders: Their places (s, n, 2) [m].
        inputs: Speed through the water and heading (s, 2), that of row k from k - 1 to k.
        step: Time between rows [s].
        deviations: Of each range (n,) [m].
        noise: Of the inputs.
        unknown: What is not known besides.
        start: Deviation of the place on each axis at the first row, which has no ranges [m].
        heard: (row, leader) -> whether its range of that row ever arrives.
    """
    count = leaders.shape[1]
    motion = follower_motion(count, unknown)
    process = follower_process(motion, noise, step, count, unknown)
    deviation = {"north": start, "east": start}
    if unknown.current is not None:
        deviation |= dict.fromkeys(("current_north", "current_east"), unknown.current)
    if unknown.leaders is not None:
        deviation |= {name: unknown.leaders.deviation for i in range(count) for name in error_names(i)}
    P = motion.space.belief({}, deviation).covariance
    truths = np.zeros((len(places), len(motion.space)))
    truths[:, :2] = places
    sensors = {(RANGE, str(i)): leader_range(motion, i, unknown) for i in range(count)}
    first = lambda nodes, index: P if nodes[index].time == 0.0 else None  # noqa: E731
    bound = PosteriorBound(process, sensors, lambda time: truths[[round(time / step)]], first)
    history = History(bound, step=step, keep=max(30.0, 2.0 * unknown.delay, 2.0 * step))
    found, lag = [], round(unknown.delay / step)
    for k in range(len(places)):
        speed, heading = inputs[k]
        history.append(step * k, (speed, 0.0, heading))
        if k > lag:
            for i in (i for i in range(count) if heard(k - lag, i)):
                history.insert(_range(k - lag, step, i, leaders, deviations))
        state = history.replay()
        assert state is not None
        found.append(state.belief.covariance[:2, :2])
    return BoundAlong(np.arange(0.0, len(places)) * step, np.array(found))


def follower_motion(leaders: int, unknown: Unknowns) -> Motion:
    """Dead reckoning by speed and heading, with what is unknown as states."""
    motion = dead_reckoning("given")
    if unknown.current is not None:
        motion = with_current(motion)
    if unknown.leaders is not None:
        for name in (name for i in range(leaders) for name in error_names(i)):
            motion = with_error(motion, name, "m", unknown.leaders.time_constant)
    return motion


def follower_process(motion: Motion, noise: InputNoise, step: float, leaders: int, unknown: Unknowns) -> MotionProcess:
    """Its process model: input noise is white from step to step, of variance times `step` as a density."""
    densities: dict[str, float] = {}
    if unknown.current is not None:
        densities |= dict.fromkeys(("current_north", "current_east"), STILL)
    if unknown.leaders is not None:
        steady = 2.0 * unknown.leaders.deviation**2 / unknown.leaders.time_constant
        densities |= {name: steady for i in range(leaders) for name in error_names(i)}
    inputs = {"forward": noise.speed**2 * step, "heading": noise.heading**2 * step}
    return MotionProcess(motion, densities, input_noise=inputs, max_substep=step)


def leader_range(motion: Motion, leader: int, unknown: Unknowns) -> Sensor:
    """The range to a leader whose reported place the measurement's two parameters give."""
    errs = unknown.leaders is not None
    names = error_names(leader)

    def show(x, z) -> list[ca.SX]:
        north, east = (x[name] for name in names) if errs else (0.0, 0.0)
        away = (x["north"] - z[0] - north, x["east"] - z[1] - east)
        return [ca.sqrt(away[0] ** 2 + away[1] ** 2)]

    return Sensor(motion, "range", show, parameters=2)


def error_names(leader: int) -> tuple[str, str]:
    """States that hold the error of a leader's reported place."""
    return f"leader_{leader}_north", f"leader_{leader}_east"


def _range(row: int, step: float, leader: int, leaders: Array, deviations: Sequence[float]) -> Measurement:
    R = np.array([[deviations[leader] ** 2]])
    place = tuple(map(float, leaders[row, leader]))
    return Measurement(
        kind=RANGE, source=str(leader), value=np.zeros(1), covariance=R, stamp=step * row, received=step * row,
        parameters=place,
    )  # fmt: skip
