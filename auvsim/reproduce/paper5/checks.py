"""What paper 5's study shows beside runs: the bias of single matches, and how errors grow without any sonar."""

from collections.abc import Sequence

import numpy as np

from auvsim.base.randomness import stream
from auvsim.reproduce.paper5.methods import frame_model
from auvsim.reproduce.paper5.scenes import GRID, Conditions, simulate
from estimators.core.types import Array
from estimators.map_path.likelihood import Matcher
from estimators.map_path.matching import Match, Search, match
from estimators.map_path.poses import between

PRIOR = np.diag(np.square((0.2, 0.2, 0.03)))  # about the truth, of the search [m, m, rad]
ACCELEROMETER = 9.81e-4  # bias of 0.1 mg, one standard deviation [m/s^2]
SPEED_BIAS = 0.02  # of a Doppler log, one standard deviation [m/s]
DRAWS = 400


def match_bias(conditions: Conditions, seeds: Sequence[int]) -> tuple[Array, Array]:
    """Mean error of matches of each frame with the one before, forward and starboard (2,) [m], and its deviation."""
    offsets = []
    for seed in seeds:
        run = simulate(conditions, seed)
        matcher = Matcher(GRID, frame_model(conditions))
        ready = [matcher.prepare(frame.intensity) for frame in run.frames]
        for k, relative in enumerate(between(run.poses[:-1], run.poses[1:])):
            found = match(matcher, ready[k + 1], [ready[k]], relative[None], PRIOR, Search())
            if isinstance(found, Match):
                offsets.append(found.offset[:2])
    errors = np.array(offsets)
    return errors.mean(axis=0), errors.std(axis=0) / np.sqrt(len(errors))


def inertial_growth(duration: int, seed: int) -> Array:
    """Rms error (duration + 1,) [m] of an acceleration with a constant bias, integrated twice second by second."""
    bias = ACCELEROMETER * stream(seed, 0, "paper5/accelerometer").standard_normal(DRAWS)
    speed = np.cumsum(np.repeat(bias[:, None], duration, axis=1), axis=1)
    place = np.cumsum(speed, axis=1) - 0.5 * speed  # trapezoidal
    return np.concatenate(([0.0], np.sqrt(np.mean(place**2, axis=0))))


def speed_log_growth(duration: int, seed: int) -> Array:
    """Rms error (duration + 1,) [m] of a speed over ground with a constant bias, the heading known."""
    bias = SPEED_BIAS * stream(seed, 0, "paper5/speed_log").standard_normal(DRAWS)
    return np.sqrt(np.mean((bias[:, None] * np.arange(duration + 1.0)) ** 2, axis=0))


def growth_exponent(errors: Array, first: int = 30) -> float:
    """Exponent p of errors ~ t^p (k,) by least squares over the logarithms from `first` [s] on."""
    times = np.arange(first, len(errors))
    return float(np.polyfit(np.log(times), np.log(errors[first:]), 1)[0])
