"""Current fields: velocity of the water, its time derivative and its gradient at any time and place, in NED.

A current is where the water flows TO. Every field is continuous; its derivative and gradient are exact, so that the
material acceleration of the water, which pushes on a body, is right.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.random import Generator
from scipy.interpolate import PchipInterpolator

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.base.interpolation import cubic_hermite
from auvsim.water.settings import (
    ApproachTurnSettings,
    CurrentSettings,
    GustSettings,
    NoneSettings,
    ShearSettings,
    SumSettings,
    TurningSettings,
    UniformSettings,
)


@dataclass(frozen=True, kw_only=True, slots=True)
class Water:
    """The water at one time and place. Fields may share arrays: read them, do not write them."""

    velocity: Array  # (3,) NED [m/s]
    derivative: Array  # (3,) partial derivative of the velocity in time [m/s^2]
    gradient: Array  # (3, 3) dv_i / dx_j [1/s]


class CurrentField(Protocol):
    """Water velocity as a function of time and place."""

    @property
    def steady_uniform(self) -> bool:
        """True if one evaluation holds for all times and places."""
        ...

    def evaluate(self, time: float, position: Array) -> Water:
        """The water at a time [s] and a position (3,) in NED [m]."""
        ...

    def approach(self, attempt: int, distance: float, time: float) -> None:
        """Tells that the vehicle, on the approach of an attempt, is that far [m] from the dock; most do not care."""
        ...


class _Indifferent:
    """A field that does not depend on what the vehicle does."""

    def approach(self, attempt: int, distance: float, time: float) -> None:
        """Changes nothing."""


_ZERO, _ZERO_GRADIENT = np.zeros(3), np.zeros((3, 3))
_ZERO.setflags(write=False)
_ZERO_GRADIENT.setflags(write=False)


class Uniform(_Indifferent):
    """The same water at all times and places."""

    steady_uniform = True

    def __init__(self, velocity: Sequence[float]) -> None:
        array = np.array(velocity, dtype=float)
        array.setflags(write=False)  # one array serves every caller
        self._water = Water(velocity=array, derivative=_ZERO, gradient=_ZERO_GRADIENT)

    def evaluate(self, time: float, position: Array) -> Water:
        """The water, whatever the time and position."""
        return self._water


class Turning(_Indifferent):
    """A uniform current that turns at a constant rate during an interval.

    The derivative jumps at both ends of the turn; there it is the one that follows.
    """

    steady_uniform = False

    def __init__(self, settings: TurningSettings) -> None:
        self._speed = settings.speed
        self._direction = math.radians(settings.direction_deg)
        self._start, self._end = settings.start, settings.end
        self._rate = math.radians(settings.angle_deg) / (settings.end - settings.start)

    def evaluate(self, time: float, position: Array) -> Water:
        """The water at a time [s], the same everywhere."""
        elapsed = min(max(time - self._start, 0.0), self._end - self._start)
        direction = self._direction + self._rate * elapsed
        north, east = self._speed * math.cos(direction), self._speed * math.sin(direction)
        rate = self._rate if self._start <= time < self._end else 0.0
        derivative = np.array((-rate * east, rate * north, 0.0))
        return Water(velocity=np.array((north, east, 0.0)), derivative=derivative, gradient=_ZERO_GRADIENT)


_MOST_TURNS = 20  # attempts for which turns are drawn


class ApproachTurn:
    """A uniform current that starts to turn at a drawn share of the length of an attempt's approach."""

    steady_uniform = False

    def __init__(self, settings: ApproachTurnSettings, generator: Generator) -> None:
        self._speed, self._duration = settings.speed, settings.duration
        self._direction = math.radians(settings.direction_deg)
        self._shares = generator.uniform(0.0, 1.0, _MOST_TURNS).tolist()
        signs = generator.choice([-1.0, 1.0], _MOST_TURNS).tolist()
        self._rates = [sign * math.radians(settings.angle_deg) / settings.duration for sign in signs]
        self._lengths: dict[int, float] = {}  # distance at which an attempt's approach began [m]
        self._turns: dict[int, tuple[float, float]] = {}  # start [s] and rate [rad/s] of the turn of an attempt

    def approach(self, attempt: int, distance: float, time: float) -> None:
        """Starts the turn of an attempt (from 1) when it is due."""
        length = self._lengths.setdefault(attempt, distance)
        index = (attempt - 1) % _MOST_TURNS
        if attempt not in self._turns and distance <= self._shares[index] * length:
            self._turns[attempt] = (time, self._rates[index])

    def evaluate(self, time: float, position: Array) -> Water:
        """The water at a time [s], the same everywhere."""
        direction, rate = self._direction, 0.0
        for start, turn in self._turns.values():
            elapsed = min(max(time - start, 0.0), self._duration)
            direction += turn * elapsed
            rate += turn if 0.0 <= time - start < self._duration else 0.0
        north, east = self._speed * math.cos(direction), self._speed * math.sin(direction)
        derivative = np.array((-rate * east, rate * north, 0.0))
        return Water(velocity=np.array((north, east, 0.0)), derivative=derivative, gradient=_ZERO_GRADIENT)


class Shear(_Indifferent):
    """A steady current interpolated in depth."""

    steady_uniform = False

    def __init__(self, settings: ShearSettings) -> None:
        self._linear = settings.profile == "linear"
        self._depths = [point.depth for point in settings.points]
        velocities = np.array([_horizontal(point.speed, point.direction_deg) for point in settings.points])
        slopes = PchipInterpolator(self._depths, velocities).derivative()(self._depths)
        if not self._linear:
            slopes[[0, -1]] = 0.0  # joins the constant current beyond the ends without a kink; still monotone
        self._knots: list[list[float]] = np.hstack([velocities, slopes]).tolist()

    def evaluate(self, time: float, position: Array) -> Water:
        """The water at the depth of a position (3,) in NED [m], at all times the same."""
        depths = self._depths
        depth = float(position[2])
        if not self._linear:
            depth = min(max(depth, depths[0]), depths[-1])
        index = min(max(bisect_right(depths, depth) - 1, 0), len(depths) - 2)
        width = depths[index + 1] - depths[index]
        fraction = (depth - depths[index]) / width
        (n0, e0, dn0, de0), (n1, e1, dn1, de1) = self._knots[index], self._knots[index + 1]
        north, north_slope = cubic_hermite(n0, n1, dn0, dn1, width, fraction)
        east, east_slope = cubic_hermite(e0, e1, de0, de1, width, fraction)
        gradient = np.array(((0.0, 0.0, north_slope), (0.0, 0.0, east_slope), (0.0, 0.0, 0.0)))
        return Water(velocity=np.array((north, east, 0.0)), derivative=_ZERO, gradient=gradient)


# (1 + x) exp(-x) = 1/e: the correlation time of the process in units of 1 / beta (Gelb 1974, table 2.2-1).
GUST_CORRELATION = 2.146193220620583
# Knot spacing in units of 1 / beta. The variance that the cubic between knots lacks, 4 x^3 / 192, is then 2e-5.
_GUST_STEP = 0.1


class Gust(_Indifferent):
    """One realisation of the second-order Gauss-Markov process, drawn for a whole trial.

    x'' + 2 beta x' + beta^2 x = 2 sigma beta^(3/2) w, with autocorrelation sigma^2 (1 + beta |t|) exp(-beta |t|)
    (Gelb 1974, table 2.2-1). Velocity and derivative follow the exact discrete process on the knots; between them the
    cubic through both is, to the order of the spacing, the conditional mean. A longer duration starts the same way.
    """

    steady_uniform = False

    def __init__(self, settings: GustSettings, generator: Generator, duration: float) -> None:
        beta = GUST_CORRELATION / settings.correlation_time
        self._step = _GUST_STEP / beta
        count = math.floor(duration / self._step) + 3  # covers a step more than the duration: rounding of the time
        self._end = (count - 1) * self._step
        draws = generator.standard_normal((count, 2, 2))  # knot, axis, state
        decay = math.exp(-_GUST_STEP)
        transition = decay * np.array([[1.0 + _GUST_STEP, _GUST_STEP], [-_GUST_STEP, 1.0 - _GUST_STEP]])
        spread = np.linalg.cholesky(np.eye(2) - transition @ transition.T)
        states = np.empty((count, 2, 2))  # x / sigma and x' / (sigma beta): its stationary covariance is the identity
        states[0] = draws[0]
        for index in range(1, count):
            states[index] = states[index - 1] @ transition.T + draws[index] @ spread.T
        scaled = states * (settings.intensity * np.array([1.0, beta]))
        self._knots: list[list[float]] = scaled.reshape(count, 4).tolist()

    def evaluate(self, time: float, position: Array) -> Water:
        """The water at a time [s], the same everywhere.

        Raises:
            InputError: If the time is outside the duration for which the gust was drawn.
        """
        if not 0.0 <= time < self._end:
            raise InputError(f"time {time} s: the gust was drawn for 0 to {self._end:g} s, build it for longer")
        index = min(int(time / self._step), len(self._knots) - 2)
        fraction = time / self._step - index
        (n0, dn0, e0, de0), (n1, dn1, e1, de1) = self._knots[index], self._knots[index + 1]
        north, north_slope = cubic_hermite(n0, n1, dn0, dn1, self._step, fraction)
        east, east_slope = cubic_hermite(e0, e1, de0, de1, self._step, fraction)
        derivative = np.array((north_slope, east_slope, 0.0))
        return Water(velocity=np.array((north, east, 0.0)), derivative=derivative, gradient=_ZERO_GRADIENT)


class Sum:
    """The sum of current fields."""

    def __init__(self, terms: Sequence[CurrentField]) -> None:
        self._terms = tuple(terms)
        self.steady_uniform = all(term.steady_uniform for term in terms)

    def approach(self, attempt: int, distance: float, time: float) -> None:
        """Tells every term."""
        for term in self._terms:
            term.approach(attempt, distance, time)

    def evaluate(self, time: float, position: Array) -> Water:
        """The sum of the terms at a time [s] and a position (3,) in NED [m]."""
        velocity, derivative, gradient = _ZERO, _ZERO, _ZERO_GRADIENT
        for term in self._terms:
            water = term.evaluate(time, position)
            velocity = velocity + water.velocity
            derivative = derivative + water.derivative
            gradient = gradient + water.gradient
        return Water(velocity=velocity, derivative=derivative, gradient=gradient)


def build_current(settings: CurrentSettings, generator: Generator, duration: float) -> CurrentField:
    """The current field that the settings describe.

    Args:
        settings: One of the current kinds.
        generator: Source of everything random in it; each term of a sum gets a child of its own.
        duration: Time until which the field will be evaluated [s].
    """
    match settings:
        case UniformSettings():
            return Uniform([*_horizontal(settings.speed, settings.direction_deg), settings.down])
        case TurningSettings():
            return Turning(settings)
        case ApproachTurnSettings():
            return ApproachTurn(settings, generator)
        case ShearSettings():
            return Shear(settings)
        case GustSettings():
            return Gust(settings, generator, duration)
        case SumSettings():
            children = generator.spawn(len(settings.terms))
            return Sum([build_current(*pair, duration) for pair in zip(settings.terms, children, strict=True)])
        case NoneSettings():
            return Uniform([0.0, 0.0, 0.0])


def _horizontal(speed: float, direction_deg: float) -> tuple[float, float]:
    direction = math.radians(direction_deg)
    return speed * math.cos(direction), speed * math.sin(direction)


def listeners(field: CurrentField) -> tuple[CurrentField, ...]:
    """The fields that want to be told of approaches."""
    return () if field.steady_uniform else (field,)
