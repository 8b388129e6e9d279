"""Models that the docking filters share: noise, compass, position, and the start from a first fix."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypedDict

import numpy as np

from estimators.core.errors import ParameterError
from estimators.core.history import Node
from estimators.core.loops import wrap
from estimators.core.types import Array, Gaussian, Measurement, MeasurementModel
from estimators.docking import range_start
from estimators.docking.aids import RANGE, Aids
from estimators.planar.model import BIASES, MAX_SUBSTEP, Biases, Integrator, PlanarParameters, PlanarProcess

COMPASS, USBL = "compass", "usbl"  # kinds of measurement
AIDED = ("gyro", "dvl_surge", "dvl_sway", "range_")  # how the errors of `aids` are called


@dataclass(frozen=True, slots=True)
class Bias:
    """Prior of a constant error before it is estimated; units as in `planar_model.BIASES`."""

    deviation: float  # standard deviation of its first value
    density: float = 0.0  # of its random walk [its unit squared per second]


@dataclass(frozen=True, kw_only=True, slots=True)
class DockingNoise:
    """Noise that a docking filter assumes; process noise as power spectral densities.

    The defaults suit a planar model that was fitted to a vehicle: the process noise of its accelerations is ten times
    that of the reference study, in which truth and filter shared the model.
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
    biases: Mapping[str, Bias] = field(default_factory=dict)  # estimated besides, by the names of BIASES

    def __post_init__(self) -> None:
        unknown = [name for name in self.biases if name not in BIASES and not name.startswith(AIDED)]
        if unknown:
            raise ParameterError(f"no bias {', '.join(unknown)}; there are {', '.join((*BIASES, *AIDED))}")

    @property
    def bias_names(self) -> Biases:
        """The biases in the state, in their order there: those of BIASES, then those of `aids`."""
        first = [name for name in BIASES if name in self.biases]
        return (*first, *(name for name in self.biases if name not in BIASES))

    def densities(self) -> Array:
        """Power spectral densities (8,) in the order of the state, then one of each bias."""
        velocities = (self.surge, self.sway, self.yaw_rate)
        biases = [self.biases[name].density for name in self.bias_names]
        return np.array([self.position, self.position, self.heading, *velocities, self.current, self.current, *biases])


# The reference study's truth (Qiu and Li 2019; calibrated to its Table 1), with a current that hardly changes.
REFERENCE_NOISE = DockingNoise(position=4e-4, heading=1e-7, surge=1e-5, sway=1e-5, yaw_rate=1e-6, current=1e-8)
# For eq. 11's filter, whose covariance does not know the error of the current: position noise covers for it.
PAPER_NOISE = DockingNoise(position=2.5e-3, heading=1e-7, surge=1e-5, sway=1e-5, yaw_rate=1e-6, current=0.0)

# Errors of the model that are fixed to the vehicle and not to the world, and so are no current: thrust or drag by some
# tenth (3e-3 m/s^2 shift the REMUS-100's surge by 5 % at 0.8 m/s), and the compass.
BIASES_OF_VEHICLE = {"surge": Bias(3e-3), "compass": Bias(0.02)}
# For interacting modes, which bring the current's noise themselves: without and with these errors in the state.
INTERACTING_NOISE = replace(REFERENCE_NOISE, current=0.0)
ROBUST_NOISE = replace(INTERACTING_NOISE, biases=BIASES_OF_VEHICLE)
REGULAR_NOISE = replace(PAPER_NOISE, position=1.0)  # the best for a filter that knows neither current nor delay


class HeadingModel(MeasurementModel):
    """A compass: y = psi, plus the state `bias` if given; a MeasurementModel of `n` states, psi the third."""

    is_linear = is_angle = True

    def __init__(self, n: int = 8, bias: int | None = None) -> None:
        self._bias = bias
        self._H = np.eye(1, n, 2)
        if bias is not None:
            self._H[0, bias] = 1.0

    def evaluate(self, x: Array, measurement: Measurement | None = None) -> Array:
        return x[2:3] if self._bias is None else x[2:3] + x[self._bias]

    def jacobian(self, x: Array, measurement: Measurement | None = None) -> Array:
        return self._H

    def residual(self, value: Array, expected: Array) -> Array:
        return np.array((wrap(float(value[0]) - float(expected[0])),))


class PositionModel(MeasurementModel):
    """The horizontal position (north, east) of a point (x, y) [m] of the hull, forward and starboard of its origin.

    As the dock reports it: turned about the dock by the error of its compass, the state `dock_heading`, and taken later
    than its stamp says by the state `clock`, to first order; None where that is no state. States have `n` elements.
    """

    def __init__(
        self,
        point: tuple[float, float] = (0.0, 0.0),
        n: int = 8,
        *,
        dock_heading: int | None = None,
        clock: int | None = None,
    ) -> None:
        self._x, self._y = point
        self._H = np.eye(2, n)
        self._dock_heading, self._clock = dock_heading, clock
        self.is_linear = dock_heading is None and clock is None and point == (0.0, 0.0)

    def evaluate(self, x: Array, measurement: Measurement | None = None) -> Array:
        return self.shown(x)[0]

    def jacobian(self, x: Array, measurement: Measurement | None = None) -> Array:
        return self.shown(x)[1]

    def shown(self, x: Array, measurement: Measurement | None = None) -> tuple[Array, Array]:
        c, s = math.cos(x[2]), math.sin(x[2])
        H = self._H.copy()
        north, east = c * self._x - s * self._y, s * self._x + c * self._y
        H[0, 2], H[1, 2] = -east, north
        if self._clock is not None:
            delay = x[self._clock]
            ahead, abeam = c * x[3] - s * x[4], s * x[3] + c * x[4]  # velocity through the water, north and east
            north += delay * (ahead + x[6])
            east += delay * (abeam + x[7])
            H[0, 2] -= delay * abeam
            H[1, 2] += delay * ahead
            H[:, 3:5] = delay * np.array(((c, -s), (s, c)))
            H[0, 6] = H[1, 7] = delay
            H[:, self._clock] = ahead + x[6], abeam + x[7]
        value = np.array((x[0] + north, x[1] + east))
        if self._dock_heading is not None:
            # The dock's heading is measured too large, and with it the bearing of all that the dock measures.
            c, s = math.cos(x[self._dock_heading]), math.sin(x[self._dock_heading])
            R = np.array(((c, -s), (s, c)))
            value, H = R @ value, R @ H
            H[:, self._dock_heading] = -value[1], value[0]
        return value, H


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


class ModelOptions(TypedDict, total=False):
    """What filters on the planar model pass on to their `PlanarModels`, which explains it and has the defaults."""

    transponder: tuple[float, float]
    initial_surge: float | None
    aids: Aids
    integrator: Integrator
    max_substep: float


class PlanarModels:
    """Process and measurement models of a docking filter, made from its assumptions; and its start.

    Args:
        parameters: The vehicle.
        noise: Noise that the filter assumes, and the biases in its state.
        transponder: Place of the acoustic transponder on the hull, (x, y) forward and starboard of the origin [m].
        initial_surge: Surge at the first fix [m/s]; None: steady at the shaft speed then.
        aids: Sensors besides.
        integrator: "midpoint" or "euler".
        max_substep: Longest substep of the prediction [s].
    """

    def __init__(
        self,
        parameters: PlanarParameters,
        noise: DockingNoise,
        *,
        transponder: tuple[float, float] = (0.0, 0.0),
        initial_surge: float | None = None,
        aids: Aids = Aids(),  # noqa: B008 - immutable
        integrator: Integrator = "midpoint",
        max_substep: float = MAX_SUBSTEP,
    ) -> None:
        self.parameters, self.noise = parameters, noise
        self._initial_surge = initial_surge
        self._numerics = {"integrator": integrator, "max_substep": max_substep, "biases": noise.bias_names}
        self.process = self.process_with(noise)
        places = {name: 8 + k for k, name in enumerate(noise.bias_names)}
        n = 8 + len(places)
        self.aids = aids.models(noise.bias_names)
        self.heading = HeadingModel(n, places.get("compass"))
        self.position = PositionModel(
            transponder, n, dock_heading=places.get("dock_heading"), clock=places.get("clock")
        )

    def process_with(self, noise: DockingNoise) -> PlanarProcess:
        """The same vehicle with other densities of the process noise."""
        return PlanarProcess(self.parameters, noise.densities(), **self._numerics)

    @property
    def sensors(self) -> dict[str | tuple[str, str], MeasurementModel]:
        """The measurement models by kind."""
        return {COMPASS: self.heading, USBL: self.position, **self.aids}

    def start(self, nodes: Sequence[Node], index: int) -> tuple[Gaussian, list[Measurement]] | None:
        """`first`, and the measurements that are in it: the fix and the compass, not further fixes.

        Without a fix, where ranges are heard: the place that those up to the node explain.
        """
        found = self.first(nodes, index)
        if found is not None:
            belief, fix = found
            return belief, [m for m in nodes[index].measurements if m is fix or m.kind == COMPASS]
        now = [m for m in nodes[index].measurements if m.kind in (COMPASS, RANGE)]
        if not any(m.kind == RANGE for m in now):
            return None
        belief = self._by_ranges(nodes, index)
        return None if belief is None else (belief, now)

    def first(self, nodes: Sequence[Node], index: int) -> tuple[Gaussian, Measurement] | None:
        """Belief at the node of a first fix, and that fix; None without a fix there or any compass sample.

        Heading by the compass at that time, surge given or steady at the shaft speed then, the rest zero (sec. 7 of the
        paper).
        """
        fix = next((m for m in nodes[index].measurements if m.kind == USBL), None)
        heading = None if fix is None else _heading_at(nodes, index)
        if fix is None or heading is None:
            return None
        mean = self._mean(heading, nodes[index])
        mean[:2] = fix.value - self.position.evaluate(mean)
        # The fix is given, so that the position takes the errors of all other states in it.
        onto = np.eye(mean.size)
        onto[:2, 2:] = -self.position.jacobian(mean)[:, 2:]
        return self._belief(mean, fix.covariance, onto), fix

    def _by_ranges(self, nodes: Sequence[Node], index: int) -> Gaussian | None:
        """Belief by the ranges so far; None where they leave the place open."""
        heading = _heading_at(nodes, index)
        if heading is None:
            return None
        mean = self._mean(heading, nodes[index])
        velocity = mean[3] * np.array((math.cos(heading), math.sin(heading)))
        ranges = range_start.heard(nodes[: index + 1], velocity, RANGE)
        found = range_start.place(ranges, max(self.noise.initial_current, 1e-3))
        if found is None:
            return None
        mean[:2] = found.position
        # What a range shows too much has moved the place.
        onto, names = np.eye(mean.size), self.noise.bias_names
        for column, one in zip(found.gain.T, ranges, strict=True):
            for name, factor in ((f"range_{one.source}", 1.0), (f"range_scale_{one.source}", one.value)):
                if name in names:
                    onto[:2, 8 + names.index(name)] -= factor * column
        return self._belief(mean, found.covariance, onto)

    def _mean(self, heading: float, node: Node) -> Array:
        """The state at a start with its place still open."""
        surge = self._initial_surge
        if surge is None:
            surge = steady_surge(self.parameters, node.input[1])
        return np.array([0.0, 0.0, heading, surge, 0.0, 0.0, 0.0, 0.0, *(0.0 for _ in self.noise.bias_names)])

    def _belief(self, mean: Array, place: Array, onto: Array) -> Gaussian:
        """What is known of a state whose place has a covariance (2, 2), and takes on other errors by `onto` (n, n)."""
        noise, names = self.noise, self.noise.bias_names
        deviations = (noise.compass, noise.initial_surge, noise.initial_sway, noise.initial_yaw_rate)
        currents = (noise.initial_current, noise.initial_current)
        biases = [noise.biases[name].deviation for name in names]
        covariance = np.diag(np.square([0.0, 0.0, *deviations, *currents, *biases]))
        covariance[:2, :2] = place
        # A compass bias is an error of the initial heading.
        J = np.eye(mean.size)
        if "compass" in names:
            J[2, 8 + names.index("compass")] = -1.0
        J = onto @ J
        return Gaussian(mean=mean, covariance=J @ covariance @ J.T)


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
