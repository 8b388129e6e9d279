"""What filters on the planar model share: noise, the compass and position models, and the start from a first fix."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimators.errors import ParameterError
from estimators.history import Node
from estimators.loops import wrap
from estimators.planar_model import PlanarParameters
from estimators.types import Array, Gaussian, Measurement

COMPASS, USBL = "compass", "usbl"  # kinds of measurement


@dataclass(frozen=True, kw_only=True, slots=True)
class DockingNoise:
    """What a docking filter believes of its noise; process noise as power spectral densities.

    The defaults fit a vehicle whose planar model is a condensed one: accelerations are trusted ten times less than
    those of the reference study, in which truth and filter shared the model.
    """

    position: float = 4e-4  # [m^2/s]
    heading: float = 1e-6  # [rad^2/s]
    surge: float = 1e-4  # [m^2/s^3]
    sway: float = 1e-4  # [m^2/s^3]
    yaw_rate: float = 1e-5  # [rad^2/s^3]
    current: float = 3e-3  # random walk of the current [m^2/s^3]; 1e-5 suits a constant one and fails in turns
    compass: float = math.radians(1.0)  # standard deviation of a sample [rad]
    initial_surge: float = 0.1  # standard deviations at the first fix [m/s]
    initial_sway: float = 0.05  # [m/s]
    initial_yaw_rate: float = 0.05  # [rad/s]
    initial_current: float = 0.5 / math.sqrt(2.0)  # each component [m/s]

    def densities(self) -> Array:
        """Power spectral densities (8,) in the order of the state."""
        velocities = (self.surge, self.sway, self.yaw_rate)
        return np.array([self.position, self.position, self.heading, *velocities, self.current, self.current])


# The reference study's truth (Qiu and Li 2019; calibrated to its Table 1), with a current that hardly changes.
REFERENCE_NOISE = DockingNoise(position=4e-4, heading=1e-7, surge=1e-5, sway=1e-5, yaw_rate=1e-6, current=1e-8)
# For eq. 11's filter, whose covariance does not know the error of the current: position noise covers for it.
PAPER_NOISE = DockingNoise(position=2.5e-3, heading=1e-7, surge=1e-5, sway=1e-5, yaw_rate=1e-6, current=0.0)


class HeadingModel:
    """A compass: y = psi; a MeasurementModel of states of `n` elements with psi third."""

    def __init__(self, n: int = 8) -> None:
        self._H = np.eye(1, n, 2)

    def evaluate(self, x: Array) -> Array:
        return x[2:3]

    def jacobian(self, x: Array) -> Array:
        return self._H

    def covariance(self, x: Array, measurement: Measurement) -> Array:
        return measurement.covariance

    def residual(self, value: Array, expected: Array) -> Array:
        return np.array((wrap(float(value[0]) - float(expected[0])),))


class PositionModel:
    """The horizontal position (north, east) of a point (x, y) [m] of the hull, forward and starboard of its origin."""

    def __init__(self, point: tuple[float, float] = (0.0, 0.0), n: int = 8) -> None:
        self._x, self._y = point
        self._H = np.eye(2, n)

    def evaluate(self, x: Array) -> Array:
        c, s = math.cos(x[2]), math.sin(x[2])
        return np.array((x[0] + c * self._x - s * self._y, x[1] + s * self._x + c * self._y))

    def jacobian(self, x: Array) -> Array:
        c, s = math.cos(x[2]), math.sin(x[2])
        H = self._H.copy()
        H[0, 2] = -s * self._x - c * self._y
        H[1, 2] = c * self._x - s * self._y
        return H

    def covariance(self, x: Array, measurement: Measurement) -> Array:
        return measurement.covariance

    def residual(self, value: Array, expected: Array) -> Array:
        return value - expected


def steady_surge(parameters: PlanarParameters, shaft_speed: float) -> float:
    """Surge [m/s] at which thrust and drag balance on a straight course; 0 if the thrust is astern.

    Raises:
        ParameterError: The parameters have thrust but no drag.
    """
    p, n = parameters, shaft_speed
    a, b, c = p.X_uu, p.X_u + p.X_nu * abs(n), p.X_prop + p.X_nn * n * abs(n)
    if c <= 0.0:
        return 0.0
    if a < 0.0:
        return (-b - math.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)
    if a == 0.0 and b < 0.0:
        return -c / b
    raise ParameterError(f"thrust {c:g} N meets no drag: X_uu {p.X_uu:g} or X_u {p.X_u:g} must be below 0")


def first_belief(
    parameters: PlanarParameters,
    noise: DockingNoise,
    model: PositionModel,
    nodes: Sequence[Node],
    index: int,
    surge: float | None = None,
) -> tuple[Gaussian, Measurement] | None:
    """Belief (8 states) at the node of a first fix, and that fix; None without a fix there or any compass sample.

    Heading by the compass at that time, surge given or steady at the shaft speed then, the rest zero (sec. 7 of the
    paper).
    """
    fix = next((m for m in nodes[index].measurements if m.kind == USBL), None)
    heading = None if fix is None else _heading_at(nodes, index)
    if fix is None or heading is None:
        return None
    if surge is None:
        surge = steady_surge(parameters, nodes[index].input[1])
    mean = np.array([0.0, 0.0, heading, surge, 0.0, 0.0, 0.0, 0.0])
    mean[:2] = fix.value - model.evaluate(mean)
    deviations = (noise.compass, noise.initial_surge, noise.initial_sway, noise.initial_yaw_rate)
    covariance = np.diag(np.square([0.0, 0.0, *deviations, noise.initial_current, noise.initial_current]))
    # The point's offset turns with the heading: the error of the heading goes into the position.
    H = model.jacobian(mean)[:, 2:3]
    J = np.eye(8)
    J[:2, 2:3] = -H
    covariance[:2, :2] = fix.covariance
    return Gaussian(mean=mean, covariance=J @ covariance @ J.T), fix


def _heading_at(nodes: Sequence[Node], index: int) -> float | None:
    """The compass at a node: its own sample, else interpolated between neighbours, else the nearest before or after."""
    before = next((k for k in range(index, -1, -1) if _compass(nodes[k]) is not None), None)
    after = next((k for k in range(index, len(nodes)) if _compass(nodes[k]) is not None), None)
    if before is None or after is None:
        known = before if before is not None else after
        return None if known is None else _compass(nodes[known])
    start, end = _compass(nodes[before]), _compass(nodes[after])
    assert start is not None
    assert end is not None
    duration = nodes[after].time - nodes[before].time
    share = (nodes[index].time - nodes[before].time) / duration if duration else 0.0
    return wrap(start + share * wrap(end - start))


def _compass(node: Node) -> float | None:
    return next((float(m.value[0]) for m in node.measurements if m.kind == COMPASS), None)
