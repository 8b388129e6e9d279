"""Runs of paper 2's planar study: true ways of leader and follower, and what the follower measures and hears.

The paper's x is north here and its y east; headings from +x towards +y are then the field's. Both vehicles drift with
the same current, but the leader knows where it is.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from auvsim.base.randomness import stream
from estimators.core.history import Filter, Node
from estimators.core.models.odometry import SPACE, OdometryNoise
from estimators.core.types import Array, Gaussian, Measurement
from estimators.motion_radius.ranges import leader_range

SPEED = 2.0  # of both vehicles through the water [m/s]
CYCLE = 8  # between packets [s]
CYCLES = 312
DEPTH = 10.0  # of both vehicles [m]
COURSE = math.radians(8.0)
BEGIN = np.array([10.0, -100.0])  # where the follower is said to start [m]
CURRENT = np.array([0.5, 0.5])  # [m/s]

Heading = Callable[[Array], Array]


def straight(off_deg: float = 0.0) -> Heading:
    """A constant course, `off_deg` beside the common one."""
    return lambda t: np.full_like(t, COURSE + math.radians(off_deg))


def sine(amplitude_deg: float, period: float, phase_deg: float = 0.0) -> Heading:
    """A weave of the heading about the common course."""
    return lambda t: (
        COURSE + math.radians(amplitude_deg) * np.sin(2.0 * math.pi * t / period + math.radians(phase_deg))
    )


class Tracks(NamedTuple):
    """Where the leader starts, and how both steer."""

    leader: tuple[float, float]  # north, east [m]
    leader_heading: Heading
    follower_heading: Heading
    rank: int  # of the information that ranges give on position and current


def _abeam(distance: float) -> tuple[float, float]:
    return BEGIN[0] - distance * math.sin(COURSE), BEGIN[1] + distance * math.cos(COURSE)


LEADER_WEAVE, FOLLOWER_WEAVE = sine(40.0, 500.0), sine(40.0, 300.0, 90.0)
TRACKS = {
    "weave": Tracks((-100.0, -100.0), LEADER_WEAVE, FOLLOWER_WEAVE, 4),
    "leaderweave": Tracks((-100.0, -100.0), LEADER_WEAVE, straight(), 4),
    "followerweave": Tracks((-100.0, -100.0), straight(), FOLLOWER_WEAVE, 4),
    "close": Tracks(_abeam(60.0), LEADER_WEAVE, FOLLOWER_WEAVE, 4),
    "far": Tracks(_abeam(500.0), LEADER_WEAVE, FOLLOWER_WEAVE, 4),
    "parallel": Tracks((-100.0, -100.0), straight(), straight(), 2),
    "oblique": Tracks((-100.0, -100.0), straight(), straight(10.0), 3),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Noise:
    """Standard deviations; the follower's start is drawn about where it is said to be."""

    speed: float = 0.0  # of a sample of 1 s [m/s]
    heading: float = 0.0  # of a sample of 1 s [rad]
    displacement: float = 0.0  # of a cycle's displacement along each axis [m]
    leader: float = 0.0  # of the leader's broadcast place along each axis [m]
    range: float = 0.0  # [m]
    begin: float = 0.0  # of the start along each axis [m]

    @property
    def odometry(self) -> OdometryNoise:
        """The same as a filter is to assume it."""
        return OdometryNoise(
            forward=self.speed**2, heading=self.heading**2, position=self.displacement**2 / CYCLE
        )


NOISES = {
    "clean": Noise(),
    "nominal": Noise(speed=0.05, heading=math.radians(0.5), leader=1.0, range=1.0, begin=3.0),
    "coarse": Noise(speed=0.1, heading=math.radians(1.0), leader=3.0, range=3.0, begin=10.0),
    "matched": Noise(displacement=2.0, leader=10.0, range=1.0, begin=10.0),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Conditions:
    """What a run is like."""

    tracks: str = "weave"
    noise: str = "nominal"
    loss: float = 0.0  # probability that a packet is lost
    turn: float = 0.0  # by which the current turns, evenly over the run [rad]
    shear: tuple[float, float] = (0.0, 0.0)  # by which the leader's current differs from the follower's [m/s]


@dataclass(frozen=True, kw_only=True, slots=True)
class Run:
    """What happened, at whole seconds."""

    noise: Noise
    truth: Array  # (k, 4) north, east [m], current [m/s] of the follower
    leader: Array  # (k, 2) true place [m]
    inputs: Array  # (k - 1, 3) measured speed ahead and to starboard [m/s], heading [rad]
    packets: dict[int, Measurement]  # by second; those that were not lost


def leader_and_follower(conditions: Conditions) -> tuple[Array, Array, Array, Array]:
    """Without noise: follower (k, 2) from its nominal start, leader (k, 2), current (k - 1, 2), heading (k - 1,)."""
    tracks = TRACKS[conditions.tracks]
    t = np.arange(float(CYCLES * CYCLE))
    angle = conditions.turn * t / t[-1]
    c, s = np.cos(angle), np.sin(angle)
    current = np.stack((c * CURRENT[0] - s * CURRENT[1], s * CURRENT[0] + c * CURRENT[1]), axis=1)
    heading = tracks.follower_heading(t)
    follower = way(BEGIN, heading, current)
    leader = way(np.array(tracks.leader), tracks.leader_heading(t), current + np.array(conditions.shear))
    return follower, leader, current, heading


def way(begin: Array, heading: Array, current: Array) -> Array:
    """Places (k + 1, 2) at whole seconds, the heading (k,) constant within each."""
    steps = SPEED * np.stack((np.cos(heading), np.sin(heading)), axis=1) + current
    return begin + np.vstack((np.zeros(2), np.cumsum(steps, axis=0)))


def simulate(conditions: Conditions, seed: int) -> Run:
    """The run of a seed. Conditions that differ in one thing share all the draws of the rest."""
    noise = NOISES[conditions.noise]
    follower, leader, current, heading = leader_and_follower(conditions)

    def draws(name: str, *shape: int) -> Array:
        return stream(seed, 0, f"paper2/{name}").standard_normal(shape)

    k = len(heading)
    follower = follower + noise.begin * draws("begin", 2)
    inputs = np.zeros((k, 3))
    aside = noise.displacement / math.sqrt(CYCLE) * draws("displacement", k, 2)
    inputs[:, 0] = SPEED + noise.speed * draws("speed", k) + aside[:, 0]
    inputs[:, 1] = aside[:, 1]
    inputs[:, 2] = heading + noise.heading * draws("heading", k)
    told = leader[::CYCLE] + noise.leader * draws("leader", CYCLES + 1, 2)
    ranges = np.hypot(*(follower - leader)[::CYCLE].T) + noise.range * draws("range", CYCLES + 1)
    heard = stream(seed, 0, "paper2/loss").random(CYCLES + 1) >= conditions.loss
    packets = {
        n * CYCLE: leader_range(
            ranges[n], (*told[n], DEPTH), deviation=max(noise.range, 1e-3), leader_deviation=noise.leader,
            stamp=float(n * CYCLE), sequence=n,
        )
        for n in np.flatnonzero(heard).tolist()
    }  # fmt: skip
    current = np.vstack((current, current[-1:]))
    return Run(noise=noise, truth=np.hstack((follower, current)), leader=leader, inputs=inputs, packets=packets)


class Followed(NamedTuple):
    """How a filter follows a run, at the ends of cycles, from the first packet on."""

    times: Array  # (k,) [s]
    means: Array  # (k, 4) north, east, current
    covariances: Array  # (k, 4, 4)
    state: Any  # the last


def follow(run: Run, filter_: Filter[Any]) -> Followed:
    """The estimates of a filter; packets come without delay."""
    first = Node(0.0, (), [run.packets[0]] if 0 in run.packets else [], True)
    state: Any = filter_.start([first], 0)
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
    return Followed(CYCLE * np.arange(1.0, CYCLES + 1.0), np.array(means), np.array(covariances), state)


def prior(noise: Noise, **deviations: float) -> Gaussian:
    """What a filter that knows the noises assumes at the start; `deviations` of further states by name."""
    known = {"north": noise.begin, "east": noise.begin, "current_north": 1.0, "current_east": 1.0}
    return SPACE.belief({"north": BEGIN[0], "east": BEGIN[1]}, known | deviations)


def four(belief: Gaussian) -> Gaussian:
    """Position and current of a belief alone, as the paper's filter has them."""
    return replace(belief, mean=belief.mean[:4], covariance=belief.covariance[:4, :4])
