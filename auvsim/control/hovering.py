"""Position and attitude of a hovering vehicle: PID by its place and heading, level, as a force and a moment."""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from pydantic import Field

from auvsim.base.alpha_beta import AlphaBeta
from auvsim.base.errors import InputError
from auvsim.base.frames import Array, rotation, wrap
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.control.attitude import Attitude
from auvsim.control.controller import ControllerSetup, Setpoints, Station
from auvsim.navigation.estimate import Estimate
from auvsim.vehicles.actuation import Thrusters, Wrench

SWING = 0.5  # error of the heading beyond which the moment does not grow [rad]
Gains = tuple[float, float, float]


class HoveringSettings(Settings):
    """Gains, each for surge, sway, heave or roll, pitch, yaw; of a vehicle of 20 to 30 kg with its added mass."""

    kind: Literal["hovering"] = Field(default="hovering", description="hovering, for vehicles that thrusters drive")
    position: Gains = Field(default=(60.0, 60.0, 80.0), description="force per error of the place [N/m]")
    velocity: Gains = Field(default=(50.0, 50.0, 60.0), description="force per velocity over ground [N s/m]")
    integral: Gains = Field(default=(12.0, 12.0, 15.0), description="force per integrated error [N/(m s)]")
    attitude: Gains = Field(default=(3.0, 3.0, 6.0), description="moment per angle [N m/rad]")
    rate: Gains = Field(default=(1.2, 1.2, 3.0), description="moment per rate [N m s/rad]")
    largest: float = Field(default=60.0, ge=0.0, description="of each component of the integral's force [N]")
    reach: float = Field(
        default=1.0, gt=0.0, description="distance within which the integral grows, and beyond which force does not [m]"
    )


class Hovering:
    """Holds a place and a heading, level, in any steady current: the integral finds what the current takes.

    Args:
        settings: its gains.
        period: between two commands [s].
    """

    def __init__(self, settings: HoveringSettings, period: float) -> None:
        self._s, self._period = settings, period
        self._steady = np.zeros(3)  # force of the integral, NED [N]

    def command(self, error: Array, attitude: Array, nu: Array, heading: float) -> Wrench:
        """The demand now.

        Args:
            error: (3,) place that is wanted less the place, NED [m]; NaN along axes that are not held.
            attitude: (3,) roll, pitch, yaw [rad].
            nu: (6,) body velocity over ground [m/s, rad/s].
            heading: that is wanted [rad].
        """
        s, held = self._s, np.isfinite(error)
        error = np.where(held, error, 0.0)
        self._steady = np.where(held, self._steady, 0.0)
        to_body = rotation(*attitude.tolist()).T
        # The integral stands in NED, as the current does, so that it holds while the vehicle turns.
        distance = math.hypot(*error.tolist())
        if distance < s.reach:
            self._steady = np.clip(self._steady + np.array(s.integral) * error * self._period, -s.largest, s.largest)
        else:  # a far place must not take the thrust that keeps it level
            error = error * (s.reach / distance)
        force = np.array(s.position) * (to_body @ error) - np.array(s.velocity) * nu[:3] + to_body @ self._steady
        roll, pitch, yaw = attitude.tolist()
        angles = np.array((-roll, -pitch, max(-SWING, min(SWING, wrap(heading - yaw)))))
        moment = np.array(s.attitude) * angles - np.array(s.rate) * nu[3:]
        return Wrench(*force.tolist(), *moment.tolist())


class HoveringController:
    """Turns a place, or a speed ahead, with heading and depth into a force and a moment; see `Controller`.

    Place and heading are the estimate's, moved on to now; depth is the gauge's, smoothed; a DVL's vertical velocity
    and a gyro's rates, where these are on board, go with depth and the compass' angles. Without a place to be at, the
    thrust of a speed is held in the open loop.
    """

    Settings = HoveringSettings

    def __init__(self, setup: ControllerSetup) -> None:
        if not isinstance(setup.actuation, Thrusters):
            raise InputError(
                f"control.kind: hovering needs thrusters in all directions, not {', '.join(setup.actuation.channels)}"
            )
        self._actuation, self._ahead, self._period = setup.actuation, setup.ahead, setup.period
        self._law = Hovering(setup.settings, setup.period)
        self._attitude, self._depth = Attitude(), AlphaBeta.of_index(0.004)
        self._now = 0.0
        self._estimate: Estimate | None = None
        self._pressed = 0.0  # time with a demand beyond all thrust [s]

    def observe(self, readings: Sequence[Reading]) -> None:
        """Takes compass, depth, gyro and DVL readings among `readings`."""
        for reading in readings:
            self._now = max(self._now, reading.received)
            if reading.sensor == "compass":
                self._attitude.shown(reading.stamp, reading.value[::-1])  # it has heading, pitch, roll
            elif reading.sensor == "depth":
                self._depth.update(reading.stamp, reading.value.item())
            elif reading.sensor == "gyro":
                self._attitude.turned(reading.stamp, reading.value)
            elif reading.sensor == "dvl" and self._attitude.angles is not None:
                down = float(rotation(*self._attitude.angles.tolist())[2] @ reading.value[:3])
                if math.isfinite(down):
                    self._depth.rate = down  # which the gauge shows late

    def locate(self, estimate: Estimate) -> None:
        """Takes an estimate."""
        self._estimate = estimate if estimate.initialised else None

    @property
    def heading(self) -> float | None:
        """Smoothed compass heading [rad], None before the first reading."""
        return None if self._attitude.angles is None else wrap(float(self._attitude.angles[2]))

    @property
    def depth(self) -> float | None:
        """Smoothed depth [m], None before the first reading."""
        return self._depth.value

    @property
    def warning(self) -> str | None:
        """What the vehicle cannot hold with all its authority; None if there is nothing."""
        return "its thrusters cannot give the force that its place asks for" if self._pressed > 5.0 else None

    def command(self, setpoints: Setpoints | Station) -> Wrench:
        """The demand now."""
        angles, turn, depth = self._attitude.angles, self._attitude.rates, self._depth.value
        if angles is None or depth is None:
            return self._ahead(0.0)
        down, estimate = setpoints.depth - depth, self._estimate
        if isinstance(setpoints, Station) and estimate is not None:
            place, over_ground, yaw = estimate.at(self._now)
            error = np.array((setpoints.place[0] - place[0], setpoints.place[1] - place[1], down))
            level = np.array((*over_ground, self._depth.rate))
            nu = np.concatenate((level @ rotation(float(angles[0]), float(angles[1]), 0.0), turn))
            demand = self._law.command(error, np.array((*angles[:2], yaw)), nu, setpoints.heading)
        else:
            error, nu = np.array((np.nan, np.nan, down)), np.array((0.0, 0.0, self._depth.rate, *turn))
            steered = self._law.command(error, angles, nu, setpoints.heading)
            speed = 0.0 if isinstance(setpoints, Station) else setpoints.speed  # no estimate: it stays as it is
            thrust = math.copysign(self._ahead(abs(speed)).surge, speed) if speed else 0.0
            demand = steered._replace(surge=steered.surge + thrust)
        self._pressed = self._pressed + self._period if self._actuation.shares(demand).max() > 1.0 else 0.0
        return demand
