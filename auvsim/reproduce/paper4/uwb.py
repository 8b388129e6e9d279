"""The paper's experiment with cars and ultra-wide-band ranges, simulated (Li et al. 2023, sec. 6, fig. 12 to 14).

Two leaders and a follower drive east through a hall of 7.20 m by 6.64 m. Speed, duration and noise are not printed:
0.3 m/s for 15 s, ten ranges a second of 5 cm, a heading of 2 deg and a bias, a scale error of the speed of 5 %.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from auvsim.base.frames import Array
from auvsim.base.randomness import stream
from auvsim.reproduce.paper4.runs import extended
from estimators.formation import batched
from estimators.formation.batched import Beliefs
from estimators.formation.models import DeadReckoning, InputNoise, Ranges

BIASES = (0.0, 5.0, 10.0, 20.0)  # of the heading, to either side from run to run [deg]
SPEED, DURATION, STEP = 0.3, 15.0, 0.1  # [m/s], [s], [s]
RANGE, HEADING, SPEED_NOISE, SCALE = 0.05, math.radians(2.0), 0.02, 0.05  # deviations [m], [rad], [m/s], [1]
ASSUMED = InputNoise(math.hypot(SPEED_NOISE, SCALE * SPEED), HEADING)  # by the filter, which knows no bias
HALL = (6.64, 7.20)  # north, east [m]
PLACES: Mapping[str, tuple[tuple[float, float], ...]] = {  # follower, leaders: north, east [m]
    "worst 1": ((2.67, 0.0), (2.67, 1.35), (2.67, 2.70)),
    "worst 2": ((3.27, 0.0), (5.27, 0.0), (1.27, 0.0)),
    "right angle": ((2.67, 0.0), (2.67, 2.0), (4.67, 0.0)),  # not the paper's: what an ideal formation would have done
}
PAPER = {"worst 1": 1.2177, "worst 2": 0.7129}  # A_RMS [m]


class Cars(NamedTuple):
    """One formation."""

    a_rms: Array  # (k,) of each run [m]
    truth: Array  # (s, 2) of the follower [m]
    first: Array  # (s, 2) the estimate of the first run [m]


class Experiment(NamedTuple):
    """All formations at one bias, on the same noise."""

    cars: Mapping[str, Cars]

    @property
    def gain(self) -> float:
        """Share by which the mean error of worst 2 is below that of worst 1."""
        first, second = (float(self.cars[name].a_rms.mean()) for name in ("worst 1", "worst 2"))
        return 1.0 - second / first

    @property
    def probability(self) -> float:
        """That worst 2 has the smaller error in one run."""
        return float((self.cars["worst 2"].a_rms < self.cars["worst 1"].a_rms).mean())


def experiment(bias_deg: float, seed: int, count: int) -> Experiment:
    """All formations, over the same noise."""
    return Experiment({name: drive(places, math.radians(bias_deg), seed, count) for name, places in PLACES.items()})


def drive(places: tuple[tuple[float, float], ...], bias: float, seed: int, count: int) -> Cars:
    """Runs of one formation with a heading bias of a size [rad] and either sign."""
    steps, process, ranges = round(DURATION / STEP), DeadReckoning(ASSUMED), Ranges()
    n = len(places) - 1
    draws = [stream(seed, k, "uwb").standard_normal(2 + steps * (2 + n)) for k in range(count)]
    first, rest = np.array([d[:2] for d in draws]), np.array([d[2:].reshape(steps, 2 + n) for d in draws])
    scales, signs = 1.0 + SCALE * first[:, 0], np.where(first[:, 1] < 0.0, -1.0, 1.0)
    start, leaders = np.array(places[0]), np.array(places[1:])
    beliefs = Beliefs(np.tile(start, (count, 1)), np.broadcast_to(RANGE**2 * np.eye(2), (count, 2, 2)))
    truth, found = np.empty((steps, 2)), np.empty((steps, count, 2))
    for k in range(steps):
        ahead = np.array([0.0, SPEED * STEP * (k + 1)])
        truth[k] = start + ahead
        speed = scales * SPEED + SPEED_NOISE * rest[:, k, 0]
        heading = math.pi / 2.0 + signs * bias + HEADING * rest[:, k, 1]
        u = np.column_stack((speed, heading))
        z = ranges.evaluate_at(truth[k], leaders + ahead) + RANGE * rest[:, k, 2:]
        moved = batched.predict(beliefs, np.eye(2), process.increment(u, STEP), process.covariance(start, u, STEP))
        beliefs = extended(moved, z, RANGE**2 * np.eye(n), leaders + ahead)
        found[k] = beliefs.mean
    errors = found - truth[:, None]
    return Cars(np.sqrt((errors**2).sum(axis=-1).mean(axis=0)), truth, found[:, 0])
