"""Runs of paper 2's planar study: true ways of leader and follower, and what the follower measures and hears.

The paper's x is north here and its y east; headings from +x towards +y are then the field's. Both vehicles drift with
the same current, but the leader knows where it is.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from auvsim.base.randomness import stream
from estimators.core.history import Node
from estimators.core.models.odometry import OdometryNoise
from estimators.core.types import Array, Measurement
from estimators.motion_radius.ranges import leader_range

SPEED = 2.0  # of both vehicles through the water [m/s]
CYCLE = 8  # between packets [s]
CYCLES = 312
DEPTH = 10.0  # of both vehicles [m]
COURSE = math.radians(8.0)
BEGIN = np.array([10.0, -100.0])  # where the follower is said to start [m]
CURRENT = np.array([0.5, 0.5])  # [m/s]
SOUND_SPEED = 1500.0  # assumed [m/s]

Heading = Callable[[Array], Array]


def straight(off_deg: float = 0.0) -> Heading:
    """A constant course, `off_deg` beside the common one."""
    return lambda t: np.full_like(t, COURSE + math.radians(off_deg))


def sine(amplitude_deg: float, period: float, phase_deg: float = 0.0) -> Heading:
    """A weave of the heading about the common course."""
    return lambda t: COURSE + math.radians(amplitude_deg) * np.sin(2.0 * math.pi * t / period + math.radians(phase_deg))


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

    speed: float = 0.0  # ahead, of a sample of 1 s [m/s]
    sway: float = 0.0  # to starboard, which is not measured, as a sample of white noise that filters assume [m/s]
    heading: float = 0.0  # of a sample of 1 s [rad]
    displacement: float = 0.0  # of a cycle's displacement along each axis [m]
    leader: float = 0.0  # of the leader's broadcast place along each axis [m]
    range: float = 0.0  # [m]
    begin: float = 0.0  # of the start along each axis [m]

    @property
    def odometry(self) -> OdometryNoise:
        """The noise of odometry that a filter is to assume."""
        return OdometryNoise(
            forward=self.speed**2,
            starboard=self.sway**2,
            heading=self.heading**2,
            position=self.displacement**2 / CYCLE,
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


class Errors(NamedTuple):
    """What is no white noise: errors that last the whole run."""

    compass_bias: float = 0.0  # [rad]
    speed_scale: float = 0.0  # of the speed log: measured over true, minus 1
    sound_speed: float = 0.0  # true over assumed, minus 1
    clock_drift: float = 0.0  # of the follower's clock against the leader's [s/s]


NO_ERRORS = Errors()


class Motion(NamedTuple):
    """True ways at whole seconds, and the follower's motion through the water in between."""

    follower: Array  # (k + 1, 2) [m]
    current: Array  # (k + 1, 2) [m/s]
    through_water: Array  # (k, 3) speed ahead and to starboard [m/s], heading [rad]
    leader: Array  # (k + 1, 2) [m]
    depth: Array  # (k + 1,) of the follower [m]


@dataclass(frozen=True, kw_only=True, slots=True)
class Run:
    """What happened, at whole seconds."""

    noise: Noise
    truth: Array  # (k + 1, 4) north, east [m], current [m/s] of the follower
    leader: Array  # (k + 1, 2) true place [m]
    inputs: Array  # (k, 3) measured speed ahead and to starboard [m/s], heading [rad]
    packets: dict[int, Measurement]  # by second; those that were not lost

    @property
    def nodes(self) -> list[Node[Any]]:
        """Times, inputs and measurements, for what works on a whole log."""
        inputs = [*map(tuple, self.inputs.tolist()), ()]
        heard = [[self.packets[k]] if k in self.packets else [] for k in range(len(inputs))]
        return [Node(float(k), u, measured, True) for k, (u, measured) in enumerate(zip(inputs, heard, strict=True))]


def planar_motion(conditions: Conditions) -> Motion:
    """The follower from its nominal start, and the leader."""
    tracks = TRACKS[conditions.tracks]
    t = np.arange(float(CYCLES * CYCLE))
    angle = conditions.turn * t / t[-1]
    c, s = np.cos(angle), np.sin(angle)
    current = np.stack((c * CURRENT[0] - s * CURRENT[1], s * CURRENT[0] + c * CURRENT[1]), axis=1)
    heading = tracks.follower_heading(t)
    through_water = np.stack((np.full_like(t, SPEED), np.zeros_like(t), heading), axis=1)
    follower = way(BEGIN, heading, current)
    leader = way(np.array(tracks.leader), tracks.leader_heading(t), current + np.array(conditions.shear))
    current = np.vstack((current, current[-1:]))
    return Motion(follower, current, through_water, leader, np.full(len(follower), DEPTH))


def way(begin: Array, heading: Array, current: Array) -> Array:
    """Places (k + 1, 2) at whole seconds, the heading (k,) constant within each."""
    steps = SPEED * np.stack((np.cos(heading), np.sin(heading)), axis=1) + current
    return begin + np.vstack((np.zeros(2), np.cumsum(steps, axis=0)))


def simulate(conditions: Conditions, seed: int) -> Run:
    """The planar run of a seed. Conditions that differ in one thing share all the draws of the rest."""
    return measured(planar_motion(conditions), NOISES[conditions.noise], seed, loss=conditions.loss)


def measured(motion: Motion, noise: Noise, seed: int, *, loss: float = 0.0, errors: Errors = NO_ERRORS) -> Run:
    """What is measured and heard in a motion, whose start is moved to where the seed has it."""

    def draws(name: str, *shape: int) -> Array:
        return stream(seed, 0, f"paper2/{name}").standard_normal(shape)

    k = len(motion.through_water)
    follower = motion.follower + noise.begin * draws("begin", 2)
    aside = noise.displacement / math.sqrt(CYCLE) * draws("displacement", k, 2)
    ahead = (1.0 + errors.speed_scale) * motion.through_water[:, 0] + noise.speed * draws("speed", k) + aside[:, 0]
    heading = motion.through_water[:, 2] + errors.compass_bias + noise.heading * draws("heading", k)
    when, cycles = np.arange(CYCLES + 1.0) * CYCLE, CYCLES + 1
    told = motion.leader[::CYCLE] + noise.leader * draws("leader", cycles, 2)
    depth = motion.depth[::CYCLE]
    distance = np.hypot(np.hypot(*(follower - motion.leader)[::CYCLE].T), depth - DEPTH)
    ranges = distance / (1.0 + errors.sound_speed) + SOUND_SPEED * errors.clock_drift * when
    ranges += noise.range * draws("range", cycles)
    heard = stream(seed, 0, "paper2/loss").random(cycles) >= loss
    packets = {
        n * CYCLE: leader_range(
            ranges[n], (*told[n], DEPTH), deviation=max(noise.range, 1e-3), leader_deviation=noise.leader,
            stamp=float(n * CYCLE), depth=float(depth[n]), sequence=n,
        )
        for n in np.flatnonzero(heard).tolist()
    }  # fmt: skip
    return Run(
        noise=noise,
        truth=np.hstack((follower, motion.current)),
        leader=motion.leader,
        inputs=np.stack((ahead, aside[:, 1], heading), axis=1),
        packets=packets,
    )
