"""Autopilot: heading, depth (through pitch) and open-loop water speed, from the compass and the depth gauge alone."""

import math
from collections.abc import Callable, Sequence

from pydantic import Field

from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.navigation.navigator import Commands


class ControlSettings(Settings):
    """Gains of the autopilot."""

    heading_gain: float = Field(default=2.0, gt=0, description="rudder per heading error [rad/rad]")
    yaw_rate_gain: float = Field(default=2.5, ge=0, description="rudder per yaw rate [s]")
    pitch_gain: float = Field(default=2.5, gt=0, description="stern plane per pitch error [rad/rad]")
    pitch_rate_gain: float = Field(default=2.0, ge=0, description="stern plane per pitch rate [s]")
    astern_factor: float = Field(
        default=5.0,
        gt=0,
        description="factor on the rudder's gains astern, where a hull with its fins ahead is unstable [-]",
    )
    depth_gain: float = Field(default=0.12, gt=0, description="pitch per depth error [rad/m]")
    depth_integral_gain: float = Field(default=0.003, ge=0, description="pitch per integrated depth error [rad/(m s)]")
    pitch_limit_deg: float = Field(default=20.0, gt=0, le=45, description="largest commanded pitch [deg]")


WAY = 5.0  # time in which the speed through the water follows a command, roughly [s]


class _Smoother:
    """Alpha-beta filter of a sampled quantity and its rate (Bar-Shalom 2001, sec. 6.5)."""

    def __init__(self, tracking_index: float, angle: bool) -> None:
        damping = (4 + tracking_index - math.sqrt(8 * tracking_index + tracking_index**2)) / 4
        self._alpha = 1 - damping**2
        self._beta = 2 * (2 - self._alpha) - 4 * math.sqrt(1 - self._alpha)
        self._angle = angle
        self.value: float | None = None
        self.rate = 0.0
        self._stamp = 0.0

    def update(self, stamp: float, measured: float) -> None:
        if self.value is None:
            self.value, self._stamp = measured, stamp
            return
        dt = stamp - self._stamp
        if dt <= 0.0:
            return
        innovation = measured - self.value - self.rate * dt
        if self._angle:
            innovation = wrap(innovation)
        self.value += self.rate * dt + self._alpha * innovation
        self.rate += self._beta * innovation / dt
        self._stamp = stamp


class Autopilot:
    """Turns commanded heading, depth and speed into rudder, stern plane and shaft speed.

    Args:
        settings: gains.
        shaft_speed: the shaft speed [rad/s] that holds a speed through the water >= 0 [m/s].
        fin_limit: largest effective rudder and stern plane [rad].
        shaft_limit: largest shaft speed [rad/s].
        period: time between calls [s].
    """

    def __init__(
        self,
        settings: ControlSettings,
        shaft_speed: Callable[[float], float],
        fin_limit: float,
        shaft_limit: float,
        period: float,
    ) -> None:
        self._settings, self._shaft_for = settings, shaft_speed
        self._fin_limit, self._shaft_limit, self._period = fin_limit, shaft_limit, period
        self._pitch_limit = math.radians(settings.pitch_limit_deg)
        # Tracking indices (acceleration noise x period^2 / measurement noise) of the default sensors.
        self._heading, self._pitch = _Smoother(0.03, True), _Smoother(0.03, True)
        self._depth = _Smoother(0.004, False)
        self._integral = 0.0
        self._way: float | None = None  # speed through the water, by dead reckoning from the commands [m/s]
        self._shaft: tuple[float, float] = (math.nan, 0.0)  # the last speed and its shaft speed

    def observe(self, readings: Sequence[Reading]) -> None:
        """Takes the compass and depth readings among `readings`."""
        for reading in readings:
            if reading.sensor == "compass":
                heading, pitch, _ = reading.value.tolist()
                self._heading.update(reading.stamp, heading)
                self._pitch.update(reading.stamp, pitch)
            elif reading.sensor == "depth":
                self._depth.update(reading.stamp, reading.value.item())

    @property
    def heading(self) -> float | None:
        """Smoothed compass heading [rad], None before the first reading."""
        return self._heading.value

    @property
    def depth(self) -> float | None:
        """Smoothed depth [m], None before the first reading."""
        return self._depth.value

    def command(self, heading: float, depth: float, speed: float, rudder: float | None = None) -> Commands:
        """Actuator commands for a heading [rad], a depth [m] and a speed through the water [m/s], negative astern.

        A `rudder` [rad] that is given is taken as it is, and the heading left alone.
        """
        s, shaft_speed = self._settings, self._shaft_speed(speed)
        self._way = speed if self._way is None else self._way + (speed - self._way) * self._period / WAY
        if self._heading.value is None or self._pitch.value is None or self._depth.value is None:
            return Commands(0.0, 0.0, shaft_speed)
        holding = s.heading_gain * wrap(heading - self._heading.value) - s.yaw_rate_gain * self._heading.rate
        error = depth - self._depth.value
        wanted = -(s.depth_gain * error + s.depth_integral_gain * self._integral)
        pitch = max(-self._pitch_limit, min(self._pitch_limit, wanted))
        # Positive stern plane dives. The integral stands still while pitch is limited or the vehicle is far off.
        elevator = s.pitch_gain * (self._pitch.value - pitch) + s.pitch_rate_gain * self._pitch.rate
        if abs(error) < 0.5 and pitch == wanted:
            self._integral += error * self._period
        if self._way < 0.0:  # fins act the other way round when the flow comes from astern
            holding, elevator = -s.astern_factor * holding, -elevator
        rudder = holding if rudder is None else rudder
        limit = self._fin_limit
        return Commands(max(-limit, min(limit, rudder)), max(-limit, min(limit, elevator)), shaft_speed)

    def _shaft_speed(self, speed: float) -> float:
        if speed != self._shaft[0]:
            ahead = self._shaft_for(abs(speed)) if speed else 0.0
            self._shaft = (speed, math.copysign(min(ahead, self._shaft_limit), speed))
        return self._shaft[1]
