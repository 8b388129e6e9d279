"""Where the vehicle is as the dock sees it: all of the estimate in one frame, the dock's own."""

import math
from typing import NamedTuple

from auvsim.base.frames import wrap
from auvsim.navigation.estimate import COMPASS_BIAS, DEPTH_BIAS, DOCK_HEADING_BIAS, Estimate

SMOOTHING = 10.0  # time constant of a current that is the difference of two velocities [s]
MEMORY = 20.0  # time constant of the smoothed deviation of the current [s]
RESPONSE = 5.0  # time in which the speed through the water follows a command, roughly [s]

_new = tuple.__new__  # of a named tuple, in half the time


class Relative(NamedTuple):
    """The vehicle against the dock; lengths of the nose from the centre of the mouth."""

    heading: float  # from north, without the compass' estimated error [rad]
    axis: float  # course of a vehicle that enters, without the estimated error of the dock's compass [rad]
    north: float  # [m]
    east: float  # [m]
    along: float  # on the axis, negative before the mouth [m]
    cross: float  # to starboard of the axis [m]
    below: float  # below the axis [m]
    velocity: tuple[float, float]  # over ground: north, east [m/s]
    current: tuple[float, float]  # north, east [m/s]
    cross_deviation: float  # standard deviation of `cross` [m]
    below_deviation: float  # of `below` [m]
    unsteadiness: float  # standard deviation of the current, smoothed: large where it changes [m/s]
    compass_bias: float  # what is to be added to a heading for the compass to show it [rad]
    depth_bias: float  # what is to be added to a depth for the gauge to show it [m]

    @property
    def off(self) -> float:
        """Heading from the axis [rad]."""
        return wrap(self.heading - self.axis)


class _Held(NamedTuple):
    """What an estimate says until the next one, as plain numbers."""

    position: tuple[float, float]  # north, east [m]
    velocity: tuple[float, float]  # surge and sway through the water [m/s]
    current: tuple[float, float]  # north, east [m/s]
    knows_current: bool
    compass_bias: float  # [rad]
    dock_heading_bias: float  # [rad]
    depth_bias: float  # [m]

    @classmethod
    def of(cls, estimate: Estimate) -> "_Held":
        """The numbers of an estimate."""
        (north, east, _), (surge, sway, _) = estimate.position.tolist(), estimate.velocity.tolist()
        biases = (estimate.value(name) for name in (COMPASS_BIAS, DOCK_HEADING_BIAS, DEPTH_BIAS))
        current = float(estimate.current[0]), float(estimate.current[1])
        return cls((north, east), (surge, sway), current, "current_north" in estimate.names, *biases)


class Locator:
    """Carries the last estimate on to now and puts it into the dock's frame.

    An estimate that knows of no current has velocities over ground: the current is then what they differ by from the
    speed through the water that was commanded.

    Args:
        mouth: North, east of the centre of the mouth [m].
        nose: Of the vehicle, forward of its origin [m].
        period: Between two calls [s].
    """

    def __init__(self, mouth: tuple[float, float], nose: float, period: float) -> None:
        self._mouth, self._nose, self._period = mouth, nose, period
        self._speed: float | None = None  # through the water, by the commands [m/s]
        self._unsteadiness: float | None = None
        self._judged = (-math.inf, 0.0, 0.0)  # time of the last estimate and deviations of `cross` and `below` then
        self._drift: tuple[float, float] | None = None  # the current where the estimate has none [m/s]
        self._last: tuple[Estimate, _Held] | None = None  # the last estimate, and what it says

    def commanded(self, speed: float) -> None:
        """Takes the speed through the water that is commanded [m/s]."""
        before = speed if self._speed is None else self._speed
        self._speed = before + (speed - before) * self._period / RESPONSE

    def locate(
        self, time: float, estimate: Estimate, compass: float, gauge: float, axis: float, depth: float
    ) -> Relative:
        """The vehicle now.

        Args:
            time: Now [s].
            estimate: The last one.
            compass: Smoothed heading that the compass shows [rad].
            gauge: Smoothed depth that the gauge shows [m].
            axis: As the dock reports it [rad].
            depth: Of the mouth, likewise [m].
        """
        if self._last is None or self._last[0] is not estimate:
            self._last = estimate, _Held.of(estimate)
        position, (u, v), current, knows_current, compass_bias, turned, depth_bias = self._last[1]
        heading, axis = wrap(compass - compass_bias), wrap(axis - turned)
        cos, sin = math.cos(heading), math.sin(heading)
        velocity = (u * cos - v * sin + current[0], u * sin + v * cos + current[1])
        if not knows_current:
            current = self._drifting(velocity, cos, sin)
        dt = time - estimate.time
        north = position[0] + velocity[0] * dt + self._nose * cos - self._mouth[0]
        east = position[1] + velocity[1] * dt + self._nose * sin - self._mouth[1]
        ca, sa = math.cos(axis), math.sin(axis)
        along, cross = north * ca + east * sa, east * ca - north * sa
        if estimate.time > self._judged[0]:  # covariances do not change between estimates
            # The axis turns by as much as the dock's compass is off, and with it what is to starboard of it.
            slopes = {"north": -sa, "east": ca, DOCK_HEADING_BIAS: along, COMPASS_BIAS: -self._nose}
            self._smooth(estimate)
            self._judged = estimate.time, estimate.deviation(slopes), estimate.deviation({DEPTH_BIAS: 1.0})
        return _new(Relative, (
            heading, axis, north, east, along, cross, gauge - depth_bias - depth, velocity, current,
            self._judged[1], self._judged[2], self._unsteadiness or 0.0, compass_bias, depth_bias,
        ))  # fmt: skip

    def _smooth(self, estimate: Estimate) -> None:
        if "current_north" in estimate.names:
            k = estimate.names.index("current_north")
            now = math.sqrt(max(0.5 * float(estimate.covariance[k, k] + estimate.covariance[k + 1, k + 1]), 0.0))
            before = now if self._unsteadiness is None else self._unsteadiness
            share = min((estimate.time - self._judged[0]) / MEMORY, 1.0)
            self._unsteadiness = before + share * (now - before)

    def _drifting(self, velocity: tuple[float, float], cos: float, sin: float) -> tuple[float, float]:
        speed = self._speed or 0.0
        now = (velocity[0] - speed * cos, velocity[1] - speed * sin)
        before = self._drift or now
        share = self._period / SMOOTHING
        self._drift = (before[0] + share * (now[0] - before[0]), before[1] + share * (now[1] - before[1]))
        return self._drift
