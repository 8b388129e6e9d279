"""Runs of a rigid formation, many at once, and every filter of a follower over the same noise."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from auvsim.base.frames import Array
from auvsim.base.randomness import stream
from estimators.formation import batched
from estimators.formation.batched import Beliefs
from estimators.formation.manoeuvres import Manoeuvre
from estimators.formation.models import AugmentedDeadReckoning, DeadReckoning, InputNoise, Ranges
from estimators.formation.smooth import SmoothKinematics

NOISE = InputNoise()
FILTERS = ("ekf", "iterated", "second_order", "ukf", "ukf_augmented", "smooth")
START = 1.0  # standard deviation of the first belief on each axis [m]; its mean is the truth


@dataclass(frozen=True, kw_only=True, slots=True)
class Case:
    """A formation on its way north."""

    leaders: Array  # (n, 2) from the follower, north and east [m]
    speed: float  # [m/s]
    variance: float  # of each range [m^2]
    step: float = 1.0  # [s]
    duration: float = 1000.0  # [s]
    wanders: bool = False  # the truth moves with the noisy input (eq. 2 read literally), not the clean one

    @property
    def steps(self) -> int:
        """Number of steps."""
        return round(self.duration / self.step)


class Runs(NamedTuple):
    """What happened in k runs: noise alone, so that cases share it."""

    inputs: Array  # (s, k, 2) errors of speed [m/s] and heading [rad]
    ranges: Array  # (s, k, n) errors in standard deviations


class Tracks(NamedTuple):
    """What a filter made of k runs."""

    errors: Array  # (s, k, 2) estimate minus truth, north and east [m]
    nees: Array  # (s, k) of the position, over 2
    variances: Array  # (s, k) that the filter claims, of both axes together [m^2]


def noise(seed: int, count: int, steps: int, leaders: int, of: InputNoise = NOISE) -> Runs:
    """The noise of some runs; each run has a stream of its own, so that run k is the same in any number of runs."""
    inputs, ranges = np.empty((steps, count, 2)), np.empty((steps, count, leaders))
    for k in range(count):
        inputs[:, k] = stream(seed, k, "formation inputs").standard_normal((steps, 2)) * np.array(of)
        ranges[:, k] = stream(seed, k, "formation ranges").standard_normal((steps, leaders))
    return Runs(inputs, ranges)


def follow(
    case: Case,
    runs: Runs,
    name: str,
    *,
    process: DeadReckoning | None = None,
    manoeuvre: Manoeuvre | None = None,
    start_errors: Array | None = None,
) -> Tracks:
    """A filter of FILTERS over runs of a case.

    Args:
        case: The formation and its noise.
        runs: Noise of at least as many steps.
        name: Of the filter.
        process: Dead reckoning that the filter assumes; None: that which is true.
        manoeuvre: Of the leaders; None: they keep their places.
        start_errors: Of the first belief (k, 2) [m]; None: it is the truth.
    """
    process = process or (AugmentedDeadReckoning(NOISE) if name == "ukf_augmented" else DeadReckoning(NOISE))
    clean = np.array([case.speed, 0.0])
    count = runs.inputs.shape[1]
    truth, centre = np.zeros((count, 2)), np.zeros(2)
    step = STEPS[name](case, process)
    beliefs = step.start(count)
    if start_errors is not None:
        beliefs.mean[:, :2] += start_errors
    errors, nees, variances = (
        np.empty((case.steps, count, 2)),
        np.empty((case.steps, count)),
        np.empty((case.steps, count)),
    )
    for k in range(case.steps):
        measured = clean + runs.inputs[k]
        centre = centre + process_truth(clean, case.step)
        truth = truth + process_truth(measured, case.step) if case.wanders else np.broadcast_to(centre, truth.shape)
        u = np.broadcast_to(clean, measured.shape) if case.wanders else measured
        leaders = (case.leaders if manoeuvre is None else manoeuvre(case.step * (k + 1))) + centre
        z = RANGES.evaluate_at(truth, leaders) + np.sqrt(case.variance) * runs.ranges[k]
        beliefs = step.advance(beliefs, u, z, leaders)
        error = beliefs.mean[:, :2] - truth
        errors[k] = error
        P = beliefs.covariance[:, :2, :2]
        nees[k] = np.einsum("ki,ki->k", error, np.linalg.solve(P, error[..., None])[..., 0])
        variances[k] = np.trace(P, axis1=1, axis2=2)
    return Tracks(errors, nees / 2.0, variances)


RANGES = Ranges()
process_truth = DeadReckoning(NOISE).increment


class _Positions:
    """Filters of two states: dead reckoning, then a correction of one kind."""

    def __init__(self, correct: Callable, case: Case, process: DeadReckoning) -> None:
        self._correct, self._case, self._process = correct, case, process
        self._R = case.variance * np.eye(len(case.leaders))

    def start(self, count: int) -> Beliefs:
        return Beliefs(np.zeros((count, 2)), np.broadcast_to(START**2 * np.eye(2), (count, 2, 2)))

    def advance(self, beliefs: Beliefs, u: Array, z: Array, leaders: Array) -> Beliefs:
        shift, Q = (
            self._process.increment(u, self._case.step),
            self._process.covariance(beliefs.mean, u, self._case.step),
        )
        return self._correct(batched.predict(beliefs, np.eye(2), shift, Q), z, self._R, leaders)


class _Smooth:
    """The filter of four states, whose velocity is smooth; the inputs are measurements of it."""

    def __init__(self, case: Case, process: DeadReckoning) -> None:
        self._case, self._kinematics = case, SmoothKinematics(process.noise)
        self._F, self._Q = self._kinematics.transition(case.step)
        self._R = case.variance * np.eye(len(case.leaders))

    def start(self, count: int) -> Beliefs:
        P = np.zeros((count, 4, 4))
        P[:, :2, :2] = START**2 * np.eye(2)
        self._is_first = True
        return Beliefs(np.zeros((count, 4)), P)

    def advance(self, beliefs: Beliefs, u: Array, z: Array, leaders: Array) -> Beliefs:
        # The input held over the step: the velocity is corrected by it before the position moves.
        velocity = self._kinematics.velocity(u)
        if self._is_first:
            self._is_first = False
            beliefs.mean[:, 2:], beliefs.covariance[:, 2:, 2:] = (
                velocity,
                self._kinematics.velocity_covariance(velocity),
            )
        else:
            H = np.broadcast_to(np.eye(2, 4, 2), (len(u), 2, 4))
            R = self._kinematics.velocity_covariance(beliefs.mean[:, 2:])
            beliefs = batched.correct(beliefs, velocity - beliefs.mean[:, 2:], H, R)
        moved = batched.predict(beliefs, self._F, np.zeros_like(beliefs.mean), self._Q)
        return second_order(moved, z, self._R, leaders)


def extended(beliefs: Beliefs, z: Array, R: Array, leaders: Array) -> Beliefs:
    """`batched.extended` by ranges."""
    return batched.extended(beliefs, z, R, lambda x: RANGES.shown_at(x, leaders))


def iterated(beliefs: Beliefs, z: Array, R: Array, leaders: Array) -> Beliefs:
    """`batched.iterated` by ranges."""
    return batched.iterated(beliefs, z, R, lambda x: RANGES.shown_at(x, leaders))


def second_order(beliefs: Beliefs, z: Array, R: Array, leaders: Array) -> Beliefs:
    """`batched.second_order` by ranges."""
    return batched.second_order(
        beliefs, z, R, lambda x: RANGES.shown_at(x, leaders), lambda x: RANGES.curvature_at(x, leaders)
    )


def unscented(beliefs: Beliefs, z: Array, R: Array, leaders: Array) -> Beliefs:
    """`batched.unscented` by ranges."""
    return batched.unscented(beliefs, z, R, lambda x: RANGES.evaluate_at(x, leaders))


STEPS: Mapping[str, Callable] = {
    "ekf": lambda case, process: _Positions(extended, case, process),
    "iterated": lambda case, process: _Positions(iterated, case, process),
    "second_order": lambda case, process: _Positions(second_order, case, process),
    "ukf": lambda case, process: _Positions(unscented, case, process),
    "ukf_augmented": lambda case, process: _Positions(unscented, case, process),
    "smooth": _Smooth,
}


def a_rms(tracks: Tracks) -> Array:
    """A_RMS (k,) of each run [m] (eq. 30)."""
    return np.sqrt((tracks.errors**2).sum(axis=-1).mean(axis=0))


def interval(values: Sequence[float] | Array) -> tuple[float, float]:
    """Mean and half its 95 % interval."""
    values = np.asarray(values)
    return float(values.mean()), 1.96 * float(values.std(ddof=1)) / len(values) ** 0.5 if len(values) > 1 else np.nan
