"""What sensors show of a `Motion`'s states, each with bias, scale and lag where the motion has such states.

    ranges = range_to(motion, beacon=(40.0, 0.0, 0.0), bias="bias_a")

A sensor whose beacon moves takes its place from the measurement's `parameters`. Errors are states of the motion, see
`motion.with_error`: what is shown is (1 + scale) g(x) + bias, at a time `lag` [s] later than the stamp says.
"""

from collections.abc import Callable, Mapping, Sequence

import casadi as ca
import numpy as np

from estimators.core.errors import NotFiniteError, ParameterError
from estimators.core.kernels import sensor_function
from estimators.core.loops import wrap
from estimators.core.models.motion import Motion
from estimators.core.models.process import derivative, symbols
from estimators.core.types import Array, Measurement, MeasurementModel

Show = Callable[[Mapping[str, ca.SX], ca.SX], Sequence[ca.SX | float]]  # (states by name, parameters) -> each component
Place = tuple[float, float, float]  # north, east, depth [m]


class Sensor(MeasurementModel):
    """A sensor written in CasADi, with its derivative, at hand.

    Args:
        motion: Whose states it shows.
        name: What it is called in messages.
        show: The components, of the states by name and the measurement's parameters.
        parameters: How many parameters a measurement must bring.
        angles: Which components are angles.
        bias: States that are added, one a component; None where there is none. One name stands for all components.
        scale: State that multiplies, as 1 + scale.
        lag: State by which the value was taken later than its stamp says [s], to first order.

    Raises:
        ParameterError: There is no state of a name, or a lag is asked for whose motion depends on inputs.
    """

    def __init__(
        self,
        motion: Motion,
        name: str,
        show: Show,
        *,
        parameters: int = 0,
        angles: tuple[int, ...] = (),
        bias: str | Sequence[str | None] | None = None,
        scale: str | None = None,
        lag: str | None = None,
    ) -> None:
        self.space, self._parameters, self._angles = motion.space, parameters, angles
        x, states, u, inputs = symbols(motion)
        z = ca.SX.sym("z", parameters)
        seen = states if lag is None else _later(motion, x, states, u, inputs, lag)
        values = ca.vertcat(*show(_Named(seen), z))
        if scale is not None:
            values *= 1.0 + _Named(states)[scale]
        biases = [bias] * values.numel() if bias is None or isinstance(bias, str) else list(bias)
        values += ca.vertcat(*(0.0 if b is None else _Named(states)[b] for b in biases))
        H = ca.jacobian(values, x)
        self.size = values.numel()
        zero = ca.substitute(values, x, ca.SX.zeros(x.numel()))
        self.is_linear = not ca.depends_on(H, x) and not ca.depends_on(H, z)
        self.is_angle = self.is_linear and angles == (0,) and self.size == 1 and bool(ca.simplify(zero).is_zero())
        self._show = sensor_function(ca.Function(name, [x, z], ca.cse([values, H])))

    def evaluate(self, x: Array, measurement: Measurement) -> Array:
        """Value (m,) expected."""
        return self.shown(x, measurement)[0]

    def jacobian(self, x: Array, measurement: Measurement) -> Array:
        """Its derivative (m, n)."""
        return self.shown(x, measurement)[1]

    def shown(self, x: Array, measurement: Measurement) -> tuple[Array, Array]:
        """Both.

        Raises:
            ParameterError: The measurement has other components or parameters than the sensor.
            NotFiniteError: The sensor has no value or no derivative there, as a range at its beacon.
        """
        z = measurement.parameters
        if len(z) != self._parameters or measurement.value.size != self.size:
            raise ParameterError(
                f"{measurement.kind} of {measurement.source or 'one source'} at {measurement.stamp} s has "
                f"{measurement.value.size} values and {len(z)} parameters; its model has {self.size} "
                f"and {self._parameters}"
            )
        value, H = [0.0] * self.size, np.zeros((self.size, x.size))
        try:
            self._show(x.tolist(), z, value, H)
        except (ArithmeticError, ValueError):
            raise NotFiniteError(f"{measurement.kind} at {measurement.stamp} s shows nothing finite of {x}") from None
        return np.array(value), H

    def residual(self, value: Array, expected: Array) -> Array:
        """`value - expected`, angles the short way round."""
        difference = value - expected
        for index in self._angles:
            difference[index] = wrap(difference[index])
        return difference


class _Named(dict[str, ca.SX]):
    """States by name, that say which there are."""

    def __missing__(self, name: str) -> ca.SX:
        raise ParameterError(f"no state '{name}'; there are {', '.join(self)}")


def _later(
    motion: Motion, x: ca.SX, states: Mapping[str, ca.SX], u: ca.SX, inputs: Mapping[str, ca.SX], lag: str
) -> dict[str, ca.SX]:
    rates = derivative(motion, states, inputs)
    shift = _Named(states)[lag] * rates
    moving = {name: shift[k] for k, name in enumerate(motion.space.names)}
    # What depends on inputs is not known of a state alone; the heading's turn in so short a time is left out.
    still = {name for name in moving if ca.depends_on(moving[name], u)} if u.numel() else set()
    if "north" in still or "east" in still:
        raise ParameterError(f"a lag needs the velocity among the states; {motion.name} has it as an input")
    return {name: states[name] + (0 if name in still else moving[name]) for name in states}


def _relative(x: Mapping[str, ca.SX], place: Sequence, point: tuple[float, float]) -> tuple[ca.SX, ca.SX]:
    """From a point of the hull to a place, north and east."""
    north, east = _point(x, point)
    return place[0] - north, place[1] - east


def _point(x: Mapping[str, ca.SX], point: tuple[float, float]) -> tuple[ca.SX, ca.SX]:
    if point == (0.0, 0.0):
        return x["north"], x["east"]
    c, s = ca.cos(x["heading"]), ca.sin(x["heading"])
    return x["north"] + c * point[0] - s * point[1], x["east"] + s * point[0] + c * point[1]


def fix(motion: Motion, *, point: tuple[float, float] = (0.0, 0.0), **errors) -> Sensor:
    """North and east [m] of a point (forward, starboard) of the hull, as of GPS, LBL or a USBL in the world's frame."""
    return Sensor(motion, "fix", lambda x, z: _point(x, point), **errors)


def range_to(
    motion: Motion, beacon: Place | None = None, *, depth: float | str = 0.0, point=(0.0, 0.0), **errors
) -> Sensor:
    """Slant range [m] to a beacon; without one here, the measurement's parameters say where it was.

    `depth` is that of the vehicle, or the state that holds it.
    """

    def show(x: Mapping[str, ca.SX], z: ca.SX) -> list[ca.SX]:
        place = beacon or (z[0], z[1], z[2])
        north, east = _relative(x, place, point)
        down = place[2] - (x[depth] if isinstance(depth, str) else depth)
        return [ca.sqrt(north**2 + east**2 + down**2)]

    return Sensor(motion, "range", show, parameters=0 if beacon else 3, **errors)


def bearing_to(
    motion: Motion, beacon: Place | None = None, *, relative: bool = True, point=(0.0, 0.0), **errors
) -> Sensor:
    """Bearing [rad] of a beacon, relative to the heading or from north; see `range_to`."""

    def show(x: Mapping[str, ca.SX], z: ca.SX) -> list[ca.SX]:
        north, east = _relative(x, beacon or (z[0], z[1]), point)
        return [ca.atan2(east, north) - (x["heading"] if relative else 0.0)]

    return Sensor(motion, "bearing", show, parameters=0 if beacon else 3, angles=(0,), **errors)


def range_and_bearing(motion: Motion, beacon: Place | None = None, *, point=(0.0, 0.0), **errors) -> Sensor:
    """Horizontal range [m] and bearing relative to the heading [rad] of a landmark or another vehicle."""

    def show(x: Mapping[str, ca.SX], z: ca.SX) -> list[ca.SX]:
        north, east = _relative(x, beacon or (z[0], z[1]), point)
        return [ca.sqrt(north**2 + east**2), ca.atan2(east, north) - x["heading"]]

    return Sensor(motion, "range_bearing", show, parameters=0 if beacon else 3, angles=(1,), **errors)


def dvl(motion: Motion, *, track: str = "bottom", **errors) -> Sensor:
    """Forward and starboard velocity [m/s] of a DVL, over the bottom or through the water.

    Of a motion with surge and sway through the water, and its current if it has one; or with velocities over ground
    and a heading, of which only the bottom is tracked.

    Raises:
        ParameterError: The motion has no such velocities, or `track` is neither bottom nor water.
    """
    names = motion.space.names
    if track not in ("bottom", "water") or ("surge" not in names and (track == "water" or "heading" not in names)):
        raise ParameterError(f"no DVL {track} track of the states {', '.join(names)}; tracks are bottom, water")

    def show(x: Mapping[str, ca.SX], z: ca.SX) -> Sequence[ca.SX | float]:
        own = [x["surge"], x["sway"]] if "surge" in names else [0.0, 0.0]
        if track == "water" or ("surge" in names and "current_north" not in names):
            return own
        ground = ("current_north", "current_east") if "surge" in names else ("velocity_north", "velocity_east")
        c, s, north, east = ca.cos(x["heading"]), ca.sin(x["heading"]), x[ground[0]], x[ground[1]]
        return [own[0] + c * north + s * east, own[1] - s * north + c * east]

    return Sensor(motion, f"dvl_{track}", show, **errors)


def compass(motion: Motion, **errors) -> Sensor:
    """Heading [rad]."""
    return Sensor(motion, "compass", lambda x, z: [x["heading"]], angles=(0,), **errors)


def state(motion: Motion, name: str, **errors) -> Sensor:
    """One state as it is: depth gauge (depth), gyro (yaw_rate), speed log (surge)."""
    return Sensor(motion, name, lambda x, z: [x[name]], **errors)


def depth(motion: Motion, **errors) -> Sensor:
    """Depth [m] of a pressure gauge."""
    return state(motion, "depth", **errors)


def altitude(motion: Motion, floor: float | str, **errors) -> Sensor:
    """Height [m] above a floor whose depth is given, or a state."""
    return Sensor(
        motion, "altitude", lambda x, z: [(x[floor] if isinstance(floor, str) else floor) - x["depth"]], **errors
    )


def gyro(motion: Motion, **errors) -> Sensor:
    """Yaw rate [rad/s]."""
    return state(motion, "yaw_rate", **errors)


def speed_log(motion: Motion, **errors) -> Sensor:
    """Speed ahead through the water [m/s]."""
    return state(motion, "surge", **errors)
