"""Autopilot: heading, depth (through pitch) and open-loop water speed, from the compass and the depth gauge alone."""

import math
from collections.abc import Sequence
from typing import Literal

from pydantic import Field

from auvsim.base.alpha_beta import AlphaBeta
from auvsim.base.errors import InputError
from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.control.controller import ControllerSetup, Setpoints
from auvsim.control.trim import Trim
from auvsim.vehicles.actuation import Commands, FinsAndShaft


class AutopilotSettings(Settings):
    """Gains of the autopilot of a torpedo: fins and one shaft."""

    kind: Literal["torpedo"] = Field(default="torpedo", description="torpedo, or package.module:Class")
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
    trim: bool = Field(
        default=True, description="whether pitch is trimmed, with speed, once a depth error stays, as of net buoyancy"
    )
    trim_gain: float = Field(
        default=0.006, ge=0, description="pitch per integrated depth error of that trim at 1 m/s [rad/(m s)]"
    )
    pitch_limit_deg: float = Field(default=20.0, gt=0, le=45, description="largest commanded pitch [deg]")


SPEED_TIME_CONSTANT = 5.0  # in which the speed through the water follows a command, roughly [s]


class Autopilot:
    """Turns a heading, a depth and a speed into rudder, stern plane and shaft speed; see `Controller`."""

    Settings = AutopilotSettings

    def __init__(self, setup: ControllerSetup) -> None:
        actuation = setup.actuation
        if not isinstance(actuation, FinsAndShaft):
            raise InputError(
                f"control.kind: torpedo steers by fins and a shaft, not by {', '.join(actuation.channels)}"
            )
        self._settings, self._shaft_for, self._period = setup.settings, setup.shaft_speed, setup.period
        self._fin_limit, self._shaft_limit = actuation.fin_limit, actuation.shaft_limit
        self._pitch_limit = math.radians(self._settings.pitch_limit_deg)
        # Tracking indices of the default sensors.
        self._heading, self._pitch = AlphaBeta.of_index(0.03, angle=True), AlphaBeta.of_index(0.03, angle=True)
        self._depth = AlphaBeta.of_index(0.004)
        self._integral = 0.0
        self._trim = Trim(self._settings.trim_gain, self._pitch_limit, self._period)
        self._speed: float | None = None  # through the water, by dead reckoning from the commands [m/s]
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

    @property
    def warning(self) -> str | None:
        """What the vehicle cannot hold with all its authority; None if there is nothing."""
        if not self._trim.helpless:
            return None
        return f"the largest pitch of {self._settings.pitch_limit_deg:g} deg does not bring it to its depth"

    def command(self, setpoints: Setpoints) -> Commands:
        """The demand now; a rudder among the setpoints is passed on as it is, in place of heading control."""
        heading, depth, speed, rudder = setpoints
        s, shaft_speed = self._settings, self._shaft_speed(speed)
        previous = speed if self._speed is None else self._speed
        self._speed = previous + (speed - previous) * self._period / SPEED_TIME_CONSTANT
        if self._heading.value is None or self._pitch.value is None or self._depth.value is None:
            return Commands(0.0, 0.0, shaft_speed)
        holding = s.heading_gain * wrap(heading - self._heading.value) - s.yaw_rate_gain * self._heading.rate
        error = depth - self._depth.value
        steady = self._trim.pitch(self._speed) if self._trim.begun else s.depth_integral_gain * self._integral
        wanted = -(s.depth_gain * error + steady)
        pitch = max(-self._pitch_limit, min(self._pitch_limit, wanted))
        # Positive stern plane dives. The integral is frozen while pitch is limited or the depth error is large.
        elevator = s.pitch_gain * (self._pitch.value - pitch) + s.pitch_rate_gain * self._pitch.rate
        if abs(error) < 0.5 and pitch == wanted:
            self._integral += error * self._period
        if s.trim:
            self._trim.update(depth, error, self._speed, pitch != wanted, s.depth_integral_gain * self._integral)
        if self._speed < 0.0:  # fins act the other way round when the flow comes from astern
            holding, elevator = -s.astern_factor * holding, -elevator
        rudder = holding if rudder is None else rudder
        limit = self._fin_limit
        return Commands(max(-limit, min(limit, rudder)), max(-limit, min(limit, elevator)), shaft_speed)

    def _shaft_speed(self, speed: float) -> float:
        if speed != self._shaft[0]:
            ahead = self._shaft_for(abs(speed)) if speed else 0.0
            self._shaft = (speed, math.copysign(min(ahead, self._shaft_limit), speed))
        return self._shaft[1]
