"""Runs of paper 5: a true path, odometry with its errors, and synthetic frames of a floor of point features."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from auvsim.base.randomness import stream
from auvsim.reproduce.paper5.floors import floor_frames
from estimators.core.types import Array
from estimators.map_path.beamforming import LineArray
from estimators.map_path.frames import SectorGrid, SonarFrame, to_sector
from estimators.map_path.poses import Input, compose, increments

REACH = 3.0  # features up to this far outside the frame still shine into it [m]
SATURATION = 50.0  # value at which the receiver saturates
LATENESS = 1.5  # of late frames [s]
GRID = SectorGrid()
# Of ray-cast frames, fine as their sonar; nearer there is no beam and farther no echo that would show the floor.
FLOOR_GRID = SectorGrid(cell=0.25, shape=(68, 136), ranges=(4.0, 17.0))
ARRAY = LineArray()


@dataclass(frozen=True, kw_only=True, slots=True)
class Conditions:
    """What a run is made of. Uniform errors are named by their largest value."""

    duration: int = 60  # [s]; a frame each second
    speed: float = 1.5  # [m/s]
    turn_rate: float = 0.0  # [rad/s]
    snr: float = 0.0  # of a feature in the middle of its cell, or beam [dB]
    density: float = 0.1  # of features or rocks [1/m^2]
    # Gaussian point spread in white noise, the 32-element array, or the ray-cast sonar over a rough floor with rocks
    frames: Literal["point", "array", "floor"] = "point"
    speed_bias: float = 0.2  # of odometry [m/s]
    speed_noise: float = 0.1
    turn_rate_bias: float = math.radians(0.7)  # [rad/s]
    turn_rate_noise: float = math.radians(0.3)
    bad_frames: float = 0.0  # share of frames that are empty, not finite, saturated, of a wrong size, missing or late


@dataclass(frozen=True, kw_only=True, slots=True)
class Run:
    """One run: a frame for each pose but the missing ones, and one interval of odometry less."""

    conditions: Conditions
    poses: Array  # (k, 3) true north, east [m], heading [rad]
    inputs: tuple[Input, ...]  # what odometry showed
    frames: tuple[SonarFrame, ...]

    @property
    def grid(self) -> SectorGrid:
        """Of the frames."""
        return FLOOR_GRID if self.conditions.frames == "floor" else GRID

    @property
    def dead_reckoning(self) -> Array:
        """Poses (k, 3) by odometry alone."""
        return dead_reckoned(self.poses[0], self.inputs)


def dead_reckoned(start: Array, inputs: tuple[Input, ...]) -> Array:
    """Poses (k + 1, 3) from a start by k intervals of odometry."""
    poses = [np.asarray(start, dtype=float)]
    for each in inputs:
        poses.append(compose(poses[-1], increments([each], np.zeros((1, 2)))[0]))
    return np.array(poses)


def simulate(conditions: Conditions, seed: int, motion: tuple[Input, ...] | None = None) -> Run:
    """The run of a seed; features, noise and odometry have streams of their own, so that runs are paired.

    Args:
        conditions: What it is made of.
        seed: Of every random number.
        motion: The true motion in steps of 1 s, instead of the conditions' straight course or arc.
    """
    place, noise, odometry = (stream(seed, 0, f"paper5/{name}") for name in ("features", "noise", "odometry"))
    heading = place.uniform(-math.pi, math.pi)
    motion = motion or (Input(conditions.speed, conditions.turn_rate, 1.0),) * conditions.duration
    poses = dead_reckoned(np.array([0.0, 0.0, heading]), motion)
    low, high = poses[:, :2].min(axis=0) - 25.0, poses[:, :2].max(axis=0) + 25.0
    features = place.uniform(low, high, (place.poisson(conditions.density * np.prod(high - low)), 2))
    if conditions.frames == "floor":
        frames = floor_frames(
            poses, FLOOR_GRID, rocks=conditions.density, snr=conditions.snr, seed=seed, generator=noise
        )
    else:
        render = _array_frame if conditions.frames == "array" else point_frame
        frames = tuple(
            SonarFrame(
                stamp=float(k), intensity=render(features, pose, conditions.snr, noise), geometry=GRID, sequence=k
            )
            for k, pose in enumerate(poses)
        )
    if conditions.bad_frames:
        frames = _spoiled(frames, conditions.bad_frames, stream(seed, 0, "paper5/bad_frames"))
    bias = odometry.uniform(-1.0, 1.0, 2) * (conditions.speed_bias, conditions.turn_rate_bias)
    white = odometry.uniform(-1.0, 1.0, (len(motion), 2)) * (conditions.speed_noise, conditions.turn_rate_noise)
    shown = np.array(motion)[:, :2] + bias + white
    inputs = tuple(Input(speed, turn_rate, 1.0) for speed, turn_rate in shown.tolist())
    return Run(conditions=conditions, poses=poses, inputs=inputs, frames=frames)


def _spoiled(frames: tuple[SonarFrame, ...], share: float, rng: np.random.Generator) -> tuple[SonarFrame, ...]:
    """The frames, each but the first with a probability of being bad in one of six ways."""
    kept = [frames[0]]
    for frame in frames[1:]:
        draw, kind = rng.random(), int(rng.integers(6))
        z = frame.intensity
        if draw >= share:
            kept.append(frame)
        elif kind < 4:
            spoiled = (np.zeros_like(z), np.full_like(z, np.nan), np.full_like(z, SATURATION) + 0.1 * z, z[:-1])[kind]
            kept.append(replace(frame, intensity=spoiled))
        elif kind == 4:
            kept.append(replace(frame, received=frame.stamp + LATENESS))
    return tuple(kept)


def point_frame(features: Array, pose: Array, snr: float, rng: np.random.Generator, spread: float = 0.5) -> Array:
    """A frame of features (n, 2) north, east: amplitude 1, Gaussian point spread [m], white noise; 0 outside."""
    seen = _in_body_axes(features, pose)
    axes = GRID.centres[:, 0, 0], GRID.centres[0, :, 1]
    forward, starboard = (np.exp(-0.5 * ((a[:, None] - seen[:, k]) / spread) ** 2) for k, a in enumerate(axes))
    noise = 10.0 ** (-snr / 20.0) * rng.standard_normal(GRID.shape)
    return np.where(GRID.seen, forward @ starboard.T + noise, 0.0)


def _array_frame(features: Array, pose: Array, snr: float, rng: np.random.Generator) -> Array:
    """A frame by the line array: each feature of a random phase in each ping; of mean 0 and variance 1."""
    seen = _in_body_axes(features, pose)
    distance, bearing = np.hypot(seen[:, 0], seen[:, 1]), np.arctan2(seen[:, 1], seen[:, 0])
    phases = np.exp(2j * math.pi * rng.random(len(seen)))
    ranges = np.array(ARRAY.ranges)
    pulses = np.exp(-0.5 * ((ranges[None, :] - distance[:, None]) / 0.5) ** 2)
    signals = ARRAY.steering(bearing) * phases @ pulses
    deviation = 10.0 ** (-snr / 20.0) / math.sqrt(2.0 * float(ARRAY.shading @ ARRAY.shading))
    draws = rng.standard_normal((2, ARRAY.elements, ranges.size))
    envelope = ARRAY.beamform(signals + deviation * (draws[0] + 1j * draws[1]))
    image = to_sector(envelope, ARRAY.grid, GRID)
    inside = image[GRID.seen]
    return np.where(GRID.seen, (image - inside.mean()) / inside.std(), 0.0)


def _in_body_axes(features: Array, pose: Array) -> Array:
    """Forward and starboard (n, 2) of the features that shine into the frame at a pose."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    offsets = features - pose[:2]
    seen = np.column_stack((c * offsets[:, 0] + s * offsets[:, 1], -s * offsets[:, 0] + c * offsets[:, 1]))
    far = GRID.ranges[1] + REACH
    return seen[(seen[:, 0] > -REACH) & (np.hypot(seen[:, 0], seen[:, 1]) < far)]


def arc(conditions: Conditions) -> Conditions:
    """The scene on an arc of 1.5 degrees a second."""
    return replace(conditions, turn_rate=math.radians(1.5))
