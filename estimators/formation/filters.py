"""Filters of a follower on ranges to leaders, by name, for a `History` or an `Estimator`.

Each tick hands in the speed and heading that held since the last one; measurements are those of `ranges_measured`, and
for the filter of smooth kinematics also `SmoothKinematics.measured`, since speed and heading are no inputs of it.
"""

from collections.abc import Callable, Mapping
from typing import Any

from estimators.core.filter import ModelFilter
from estimators.core.particle import ParticleFilter, drawn
from estimators.core.types import Gaussian
from estimators.formation.models import KIND, AugmentedDeadReckoning, DeadReckoning, InputNoise, Ranges
from estimators.formation.smooth import VELOCITY, SmoothKinematics, Velocity
from estimators.formation.window import WindowFilter

SENSORS = {KIND: Ranges()}
PARTICLES = 2000


def ekf(start: Gaussian, noise: InputNoise, **options: Any) -> ModelFilter:
    """Extended: the paper's."""
    return ModelFilter(DeadReckoning(noise), SENSORS, start, **options)


def iterated(start: Gaussian, noise: InputNoise, **options: Any) -> ModelFilter:
    """Iterated: on the leaders' line worse than the extended, it takes either side for certain."""
    return ModelFilter(DeadReckoning(noise), SENSORS, start, transform="iterated", **options)


def second_order(start: Gaussian, noise: InputNoise, **options: Any) -> ModelFilter:
    """Second-order: knows that a range is longer across the line."""
    return ModelFilter(DeadReckoning(noise), SENSORS, start, transform="second_order", **options)


def unscented(start: Gaussian, noise: InputNoise, **options: Any) -> ModelFilter:
    """Unscented, noise added."""
    return ModelFilter(DeadReckoning(noise), SENSORS, start, transform="unscented", **options)


def unscented_augmented(start: Gaussian, noise: InputNoise, **options: Any) -> ModelFilter:
    """Unscented, noise through sigma points; see `AugmentedDeadReckoning` for when that is worse."""
    return ModelFilter(AugmentedDeadReckoning(noise), SENSORS, start, transform="unscented", **options)


def smooth(start: Gaussian, noise: InputNoise, **options: Any) -> ModelFilter:
    """Second-order of four states; `start` is that of `SmoothKinematics.start`."""
    process = SmoothKinematics(noise)
    return ModelFilter(process, {**SENSORS, VELOCITY: Velocity(process)}, start, transform="second_order", **options)


def window(start: Gaussian, noise: InputNoise, **options: Any) -> WindowFilter:
    """Maximum a posteriori over a sliding window."""
    return WindowFilter(DeadReckoning(noise), SENSORS, start, **options)


def particle(start: Gaussian, noise: InputNoise, *, count: int = PARTICLES, **options: Any) -> ParticleFilter:
    """Particles: keeps both sides of a line until something tells them apart."""
    return ParticleFilter(DeadReckoning(noise), SENSORS, drawn(start, count), **options)


FILTERS: Mapping[str, Callable[..., Any]] = {
    "ekf": ekf,
    "iterated": iterated,
    "second_order": second_order,
    "ukf": unscented,
    "ukf_augmented": unscented_augmented,
    "smooth": smooth,
    "window": window,
    "particle": particle,
}
