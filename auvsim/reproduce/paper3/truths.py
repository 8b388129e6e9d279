"""Planar truth of leader and follower, and what the follower hears of it when (Yao et al. 2011, sec. 1 and 5)."""

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.randomness import stream
from estimators.core.types import Array, Gaussian
from estimators.path_prediction.kinematics import transport
from estimators.path_prediction.messages import Noise, Packet, Pulse

KNOT = 1852.0 / 3600.0  # [m/s]
SPEED = 6.0 * KNOT
SOUND = 1500.0  # [m/s]
STEP = 1.0  # of odometry [s]
DETECTION = 2.0  # mean delay of detection, taken out of the range [s]
START = np.diag([1.0, 1.0, math.radians(0.5) ** 2])  # of both estimates
SCENES = ("straight", "curve", "inline", "weave", "lweave")
Scene = Literal["straight", "curve", "inline", "weave", "lweave", "accelerating"]
Mode = Literal["sensor", "process"]
Event = Pulse | Packet


def odometry_noise(speed: float, yaw_rate: float) -> Noise:
    """Densities of samples of one step with standard deviations in knots and degrees per second."""
    return Noise((speed * KNOT) ** 2 * STEP, math.radians(yaw_rate) ** 2 * STEP)


@dataclass(frozen=True, kw_only=True, slots=True)
class NoiseSet:
    """How well both know their motion."""

    leader: Noise
    follower: Noise


NOISES = {
    "paper": NoiseSet(leader=odometry_noise(0.3, 0.5), follower=odometry_noise(0.6, 2.0)),
    "fine": NoiseSet(leader=odometry_noise(0.05, 0.01), follower=odometry_noise(0.3, 0.1)),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Conditions:
    """What a run is like."""

    scene: Scene = "weave"
    mode: Mode = "process"  # process: the truth is noisy, odometry the command; sensor: the other way round
    carried: bool = False  # by MuJoCo, instead of as commanded; for the mode sensor
    noise: str = "fine"  # which of NOISES
    duration: float = 1000.0  # [s]
    period: float = 10.0  # of the pulses [s]
    detection_deviation: float = 0.01  # of the delay of detection [s]
    delay: float = 15.0  # mean delay of a packet besides the way of the sound [s]
    delay_deviation: float = 1.0  # [s]
    loss: float = 0.0  # probability that a packet is lost
    pulse_loss: float = 0.0  # probability that a pulse is lost
    bearing: float = math.nan  # standard deviation of a bearing with each pulse [rad]; NaN: there is none
    ranged: bool = True  # whether pulses have ranges

    @property
    def range_variance(self) -> float:
        """That a filter assumes: the jitter of the detection, and 1 m^2."""
        return (SOUND * self.detection_deviation) ** 2 + 1.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Run:
    """A run: truth, odometry and what arrived."""

    conditions: Conditions
    leader: Array  # (k + 1, 3) true poses, one each step
    follower: Array  # (k + 1, 3)
    leader_own: Array  # (k + 1, 3) the leader's dead reckoning
    odometry: Array  # (k, 2) of the follower: speed [m/s], yaw rate [rad/s]
    start: Gaussian  # of the follower
    events: tuple[Event, ...]  # in order of arrival; packets first at the same time
    prompt: tuple[Event, ...] = field(repr=False)  # the same without any delay or loss

    @property
    def noise(self) -> NoiseSet:
        """Of the run."""
        return NOISES[self.conditions.noise]


def commands(scene: Scene, steps: int) -> tuple[Array, Array, Array, Array]:
    """Commanded first pose (3,) and motion (k, 2) of the leader, then of the follower.

    Raises:
        InputError: There is no such scene.
    """
    t = STEP * np.arange(steps + 1)
    steady = np.full(steps + 1, math.radians(45.0))
    weave = np.radians(45.0 + 40.0 * np.cos(2.0 * math.pi * t / 300.0))
    turning = math.radians(45.0) + math.radians(0.09) * t
    abeam, astern = math.radians(135.0), math.radians(225.0)
    scenes = {
        "straight": (steady, steady, 500.0, abeam),
        "curve": (turning, turning, 500.0, abeam),
        "inline": (steady, steady, 500.0, astern),
        "weave": (steady, weave, 300.0, abeam),
        "lweave": (weave, steady, 300.0, abeam),
        "accelerating": (steady, weave, 300.0, abeam),
    }
    if scene not in scenes:
        raise InputError(f"no scene '{scene}'; there are {', '.join(scenes)}")
    leader, follower, distance, bearing = scenes[scene]
    speeds = np.full(steps, SPEED)
    if scene == "accelerating":
        speeds = SPEED * (1.0 + 0.4 * np.sin(2.0 * math.pi * t[:-1] / 150.0))
    first = np.array([0.0, 0.0, leader[0]])
    second = np.array([distance * math.cos(bearing), distance * math.sin(bearing), follower[0]])
    motions = [
        np.column_stack((v, np.diff(h) / STEP)) for v, h in ((speeds, leader), (np.full(steps, SPEED), follower))
    ]
    return first, motions[0], second, motions[1]


def integrate(start: Array, motion: Array) -> Array:
    """Poses (k + 1, 3) by the kinematics of the paper, of speeds and yaw rates (k, 2)."""
    heading = start[2] + STEP * np.concatenate(([0.0], np.cumsum(motion[:, 1])))
    steps = STEP * motion[:, 0] * np.array([np.cos(heading[:-1]), np.sin(heading[:-1])])
    places = start[:2, None] + np.concatenate((np.zeros((2, 1)), np.cumsum(steps, axis=1)), axis=1)
    return np.column_stack((*places, heading))


def simulate(conditions: Conditions, seed: int, number: int) -> Run:
    """One run; the same number has the same noise of odometry and arrival in all conditions."""
    steps = round(conditions.duration / STEP)
    noise = NOISES[conditions.noise]
    poses, owns, odometry = [], [], []
    first_l, motion_l, first_f, motion_f = commands(conditions.scene, steps)
    if conditions.carried:
        from auvsim.reproduce.paper3.physical import carried  # MuJoCo is loaded where it is needed

        first_l, motion_l, first_f, motion_f = carried(conditions.scene, steps, seed, number)
    for name, first, motion, q in (
        ("leader", first_l, motion_l, noise.leader),
        ("follower", first_f, motion_f, noise.follower),
    ):
        draws = stream(seed, number, f"{name}/odometry")
        drawn = draws.standard_normal((steps, 2)) * np.sqrt(np.array(q) / STEP)
        own_first = first + np.sqrt(np.diagonal(START)) * draws.standard_normal(3)
        measured = motion + drawn if conditions.mode == "sensor" else motion
        moved = motion if conditions.mode == "sensor" else motion + drawn
        poses.append(integrate(first, moved))
        owns.append(integrate(own_first, measured))
        odometry.append(measured)
    events, prompt = _arrivals(conditions, seed, number, poses[0], poses[1], owns[0], odometry[0])
    return Run(
        conditions=conditions,
        leader=poses[0],
        follower=poses[1],
        leader_own=owns[0],
        odometry=odometry[1],
        start=Gaussian(mean=owns[1][0], covariance=START.copy()),
        events=events,
        prompt=prompt,
    )


def at(poses: Array, time: float) -> Array:
    """Pose (3,) between the steps, linear."""
    k = min(int(time / STEP), len(poses) - 2)
    return poses[k] + (time / STEP - k) * (poses[k + 1] - poses[k])


def _arrivals(
    c: Conditions, seed: int, number: int, leader: Array, follower: Array, own: Array, motion: Array
) -> tuple[tuple[Event, ...], tuple[Event, ...]]:
    """What arrives, and what would without delay and loss; the pulse of time 0 is the first."""
    detection, link = stream(seed, number, "detection"), stream(seed, number, "link")
    noise = NOISES[c.noise]
    known = START.copy()
    end = (len(leader) - 1) * STEP
    late: list[tuple[float, int, Event]] = []
    prompt: list[Event] = []
    for l in range(int(end // c.period) + 1):
        t, k = l * c.period, round(l * c.period / STEP)
        jitter, bearing_noise = detection.standard_normal(2)
        packet_jitter = link.standard_normal()
        packet_lost, pulse_lost = link.random(2) < (c.loss, c.pulse_loss)
        if l:
            known = _grown(known, own[k - round(c.period / STEP) : k + 1], noise.leader)
        kept = min(k, len(motion) - 1)
        packet = Packet(l, t, t, own[k], known, float(motion[kept, 0]), float(motion[kept, 1]))
        wait = DETECTION + c.detection_deviation * jitter
        detected = t + wait
        for _ in range(5):
            distance = math.hypot(*(leader[k, :2] - at(follower, min(detected, end))[:2]))
            detected = t + distance / SOUND + wait
        sound = _pulse(c, l, t, detected, leader[k], at(follower, min(detected, end)), jitter, bearing_noise)
        if not pulse_lost and detected <= end:
            late.append((detected, 1, sound))
        arrival = t + distance / SOUND + max(0.5, c.delay + c.delay_deviation * packet_jitter)
        if not packet_lost and arrival <= end:
            late.append((arrival, 0, packet._replace(received=arrival)))
        prompt += [_pulse(c, l, t, t, leader[k], follower[k], jitter, bearing_noise), packet]
    return tuple(event for _, _, event in sorted(late, key=lambda e: e[:2])), tuple(prompt)


def _pulse(
    c: Conditions, l: int, t: float, detected: float, leader: Array, follower: Array, jitter: float, noise: float
) -> Pulse:
    north, east = leader[:2] - follower[:2]
    pulse = Pulse(l, t, detected)
    if c.ranged:
        measured = math.hypot(north, east) + SOUND * c.detection_deviation * jitter
        pulse = pulse._replace(range=measured, range_variance=c.range_variance)
    if math.isfinite(c.bearing):
        bearing = math.atan2(east, north) - follower[2] + c.bearing * noise
        pulse = pulse._replace(bearing=math.remainder(bearing, 2.0 * math.pi), bearing_variance=c.bearing**2)
    return pulse


def _grown(known: Array, own: Array, q: Noise) -> Array:
    """The leader's own covariance, moved on along its dead reckoning."""
    P = known.copy()
    for before, after in pairwise(own):
        transport(P, 0, *(after - before)[:2])
        c, s = math.cos(before[2]), math.sin(before[2])
        P[:2, :2] += STEP * q.speed * np.array([[c * c, c * s], [c * s, s * s]])
        P[2, 2] += STEP * q.yaw_rate
    return P


def undelayed(run: Run) -> Run:
    """The run with everything heard at once: what the oracle follows."""
    return replace(run, events=run.prompt)
