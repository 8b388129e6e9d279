"""The filters of paper 2's study, and how each follows a run."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np

from auvsim.reproduce.paper2.runs import BEGIN, CYCLE, CYCLES, Noise, Run
from estimators.core.history import Filter, Node
from estimators.core.models.odometry import SPACE
from estimators.core.types import Array, Gaussian
from estimators.motion_radius import batch
from estimators.motion_radius.bank import BankFilter
from estimators.motion_radius.paper import PaperFilter
from estimators.motion_radius.reckoning import DeadReckoning

TIMES = CYCLE * np.arange(1.0, CYCLES + 1.0)  # ends of cycles, at which filters are judged [s]


class Followed(NamedTuple):
    """Estimates at `TIMES`."""

    means: Array  # (k, 4) north, east, current
    covariances: Array  # (k, 4, 4)
    state: Any  # the last of the filter


class Method(NamedTuple):
    """A filter of the study."""

    title: str
    make: Callable[[Noise, Mapping[str, float]], Filter[Any]]  # of the noises and the deviations of further states
    smooths: bool = False  # judged are the most probable states given the whole run, from the filter's last


def prior(noise: Noise, extra: Mapping[str, float]) -> Gaussian:
    """What a filter that knows the noises assumes at the start; `extra` deviations of further states by name."""
    known = {"north": noise.begin, "east": noise.begin, "current_north": 1.0, "current_east": 1.0}
    return SPACE.belief({"north": BEGIN[0], "east": BEGIN[1]}, {**known, **extra})


def _bank(noise: Noise, extra: Mapping[str, float], side: int = 7, walk: float = 0.0) -> Filter[Any]:
    walks = SPACE.vector({"current_north": walk, "current_east": walk})
    return BankFilter(prior(noise, extra), noise.odometry, side=side, walks=walks)


def _reckoning(noise: Noise, extra: Mapping[str, float]) -> Filter[Any]:
    begin = Gaussian(mean=np.array([*BEGIN, 0.0, 0.0]), covariance=np.diag([noise.begin**2] * 2 + [0.0] * 2))
    return DeadReckoning(begin, noise.odometry)


def _paper(
    noise: Noise,
    extra: Mapping[str, float],
    reading: Literal["A", "C"] = "A",
    variances: tuple[float, float] = (1e8, 1e7),
    terms: Literal[8, 9] = 8,
) -> Filter[Any]:
    begin = Gaussian(mean=np.array([*BEGIN, 0.0, 0.0]), covariance=np.diag(np.repeat(variances, 2)))
    return PaperFilter(begin, reading=reading, terms=terms)


SWEEP = ((1e8, 1e7), (1e6, 1e5), (1e4, 1e3), (1e3, 10.0), (100.0, 1.0), (10.0, 0.25))  # P1: m^2, (m/s)^2
WALK = 3e-6  # density of the current's random walk: 0.09 m/s in 2500 s [m^2/s^3]
METHODS = {
    "reckoning": Method("dead reckoning", _reckoning),
    "paper": Method("paper, reading A", _paper),
    "paper_c": Method("paper, reading C", partial(_paper, reading="C")),
    "paper_small": Method("paper, small P1", partial(_paper, variances=(100.0, 1.0))),
    "paper_nine": Method("paper, N + 1 terms", partial(_paper, terms=9)),
    "ekf": Method("range EKF", partial(_bank, side=1)),
    "bank": Method("bank of 49", _bank),
    "bank_walk": Method("bank, current walks", partial(_bank, walk=WALK)),
    "batch": Method("batch (smoothed)", _bank, smooths=True),
    **{f"p1_{k}": Method(f"P1 = {p:g}, {u:g}", partial(_paper, variances=(p, u))) for k, (p, u) in enumerate(SWEEP)},
}


def follow(run: Run, method: Method, extra: Mapping[str, float] | None = None) -> Followed:
    """How a filter follows a run, packets without delay; `extra` as of `prior`."""
    extra = extra or {}
    filter_ = method.make(run.noise, extra)
    state: Any = filter_.start([Node(0.0, (), [run.packets[0]] if 0 in run.packets else [], True)], 0)
    means, covariances = [], []
    inputs = run.inputs.tolist()
    for second in range(1, len(run.truth)):
        state = filter_.predict(state, inputs[second - 1], 1.0)
        if second % CYCLE:
            continue
        if (packet := run.packets.get(second)) is not None:
            state = filter_.correct(state, float(second), [packet])
        belief = state.belief
        means.append(belief.mean[:4])
        covariances.append(belief.covariance[:4, :4])
    if not method.smooths:
        return Followed(np.array(means), np.array(covariances), state)
    best = state.modes[0][state.weights.argmax()]
    smoothed = batch.solve(run.nodes, prior(run.noise, extra), run.noise.odometry, best)
    judged = np.isin(smoothed.times, TIMES)
    return Followed(smoothed.means[judged, :4], smoothed.covariances[judged, :4, :4], state)
