"""Actuation: what a controller may demand of a vehicle, and the actuator channels that carry it out."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import mul
from typing import Any, NamedTuple, Protocol

import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import Array


class Commands(NamedTuple):
    """Demands on a vehicle that is steered by fins and driven by one propeller."""

    rudder: float  # effective rudder, positive to starboard [rad]
    elevator: float  # effective stern plane, positive dives [rad]
    shaft_speed: float  # of the propeller [rad/s]


class Demand(NamedTuple):
    """One quantity that a controller may demand."""

    name: str
    units: str
    long_name: str


class Actuation(Protocol):
    """How the demands on a vehicle are shared among its actuators."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the n actuators, as the MJCF has them, in the order of commands and measurements."""
        ...

    @property
    def limits(self) -> Array:
        """Smallest and largest command of each channel (n, 2)."""
        ...

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the channels."""
        ...

    @property
    def lags(self) -> Array:
        """Time constant of each channel (n,) [s]."""
        ...

    @property
    def demands(self) -> tuple[Demand, ...]:
        """Quantities that may be demanded, in the order of `Commands` or its like."""
        ...

    def allocate(self, demand: Commands) -> list[float]:
        """Commands of the n channels that carry out a demand."""
        ...

    def effective(self, channels: "Sequence[float] | Array") -> Any:
        """Demand to which measured values of the n channels amount."""
        ...


@dataclass(frozen=True, kw_only=True)
class FinsAndShaft:
    """Fins with a linear map from effective rudder and elevator to fin angles, and a propeller shaft.

    Raises:
        InputError: a shape does not fit, the map cannot steer both ways, or a limit is not positive.
    """

    fins: tuple[str, ...]  # m fin actuators, in the order of `matrix`
    matrix: Array  # (m, 2) fin angle per unit of rudder and of elevator
    limits: Array  # (m + 1, 2) smallest and largest fin angles [rad], then shaft speed [rad/s]
    lags: Array  # (m + 1,) time constants of the fin servos and of the shaft, 0 where the model has none [s]

    demands = (
        Demand("rudder", "rad", "effective rudder, positive to starboard"),
        Demand("elevator", "rad", "effective stern plane, positive dives"),
        Demand("shaft_speed", "rad/s", "propeller shaft speed"),
    )

    def __post_init__(self) -> None:
        count = len(self.fins)
        fits = self.matrix.shape == (count, 2) and np.isfinite(self.matrix).all()
        if not fits or np.linalg.matrix_rank(self.matrix) < 2:
            raise InputError(
                f"the allocation of {count} fins must be ({count}, 2) of rank 2, finite, to steer and to dive"
            )
        if self.limits.shape != (count + 1, 2) or self.lags.shape != (count + 1,):
            raise InputError(
                f"{count} fins and a shaft need limits ({count + 1}, 2) and lags ({count + 1},), "
                f"not {self.limits.shape} and {self.lags.shape}"
            )
        for channel, (low, high) in zip(self.channels, self.limits.tolist(), strict=True):
            if not low < 0.0 < high:
                raise InputError(f"the limits of '{channel}' are {low:g} and {high:g}; they must enclose 0")

    @property
    def channels(self) -> tuple[str, ...]:
        """Fin actuators, then `shaft`."""
        return (*self.fins, "shaft")

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the channels."""
        return (*("rad" for _ in self.fins), "rad/s")

    def at_speed(self, shaft_speed: float) -> Commands:
        """Straight ahead with a shaft speed [rad/s]."""
        return Commands(0.0, 0.0, shaft_speed)

    @cached_property
    def fin_limit(self) -> float:
        """Largest angle that every fin reaches to both sides [rad]."""
        return float(np.abs(self.limits[:-1]).min())

    @cached_property
    def shaft_limit(self) -> float:
        """Largest shaft speed that is reached ahead and astern [rad/s]."""
        return float(np.abs(self.limits[-1]).min())

    @cached_property
    def _inverse(self) -> list[list[float]]:
        return np.linalg.pinv(self.matrix).tolist()

    @cached_property
    def _rows(self) -> list[tuple[float, float]]:
        return [tuple(row) for row in self.matrix.tolist()]

    def allocate(self, demand: Commands) -> list[float]:
        """Fin angles [rad], then shaft speed [rad/s], that carry out a demand.

        Where a fin would pass its limit all are scaled together, so that the ratio of rudder to elevator is kept. The
        shaft speed is passed on as it is: its servo keeps to its own limit.
        """
        rudder, elevator, shaft_speed = demand
        angles = [a * rudder + b * elevator for a, b in self._rows]
        excess = max(map(abs, angles)) / self.fin_limit
        if excess > 1.0:
            angles = [angle / excess for angle in angles]
        angles.append(shaft_speed)
        return angles

    def effective(self, channels: "Sequence[float] | Array") -> Commands:
        """Effective rudder and elevator of measured fin angles (least squares where fins disagree), and shaft speed.

        Args:
            channels: (m + 1,) fin angles [rad], then shaft speed [rad/s].
        """
        fins = channels[:-1]
        rudder, elevator = (sum(map(mul, row, fins)) for row in self._inverse)
        return Commands(float(rudder), float(elevator), float(channels[-1]))


class Wrench(NamedTuple):
    """Demands on a vehicle that is driven by thrusters: force and moment about its origin, forward-starboard-down."""

    surge: float  # [N]
    sway: float  # [N]
    heave: float  # [N]
    roll: float  # [N m]
    pitch: float  # [N m]
    yaw: float  # [N m]


@dataclass(frozen=True, kw_only=True)
class Thrusters:
    """Fixed thrusters and a force and moment that they share, by the pseudo-inverse of where they push.

    The least sum of squared thrusts carries a demand out. Beyond a limit all thrusts are scaled together, so that the
    direction of force and moment is kept. The bollard curve and its dead band are undone; inflow is not.

    Raises:
        InputError: a shape does not fit, or the thrusters do not push in all six directions.
    """

    channels: tuple[str, ...]  # n thrusters
    matrix: Array  # (6, n) wrench of each thrust of 1 N ahead
    thrust: Array  # (n, 2) at full command ahead and astern, both positive [N]
    dead_band: Array  # (n,) of the command
    lags: Array  # (n,) time constants [s]

    demands = (
        Demand("surge", "N", "force ahead"),
        Demand("sway", "N", "force to starboard"),
        Demand("heave", "N", "force downward"),
        Demand("roll", "N m", "moment about the axis ahead"),
        Demand("pitch", "N m", "moment about the axis to starboard, nose up"),
        Demand("yaw", "N m", "moment about the axis downward, to starboard"),
    )

    def __post_init__(self) -> None:
        count = len(self.channels)
        shapes = self.matrix.shape, self.thrust.shape, self.dead_band.shape, self.lags.shape
        if shapes != ((6, count), (count, 2), (count,), (count,)):
            raise InputError(f"{count} thrusters need arrays of {count}, not {shapes}")
        if np.linalg.matrix_rank(self.matrix) < 6:
            raise InputError(f"the {count} thrusters do not push and turn in all six directions")

    @property
    def units(self) -> tuple[str, ...]:
        """Commands are shares of full command."""
        return ("1",) * len(self.channels)

    @property
    def limits(self) -> Array:
        """Smallest and largest command (n, 2)."""
        return np.tile([-1.0, 1.0], (len(self.channels), 1))

    @cached_property
    def _inverse(self) -> Array:
        return np.asarray(np.linalg.pinv(self.matrix), dtype=np.float64)

    def shares(self, demand: Sequence[float] | Array) -> Array:
        """Thrusts (n,) that a wrench (6,) asks for, as shares of the largest to that side; above 1 it is too much."""
        thrusts = self._inverse @ np.asarray(demand, dtype=float)
        return np.abs(thrusts) / np.where(thrusts >= 0.0, self.thrust[:, 0], self.thrust[:, 1])

    def allocate(self, demand: Sequence[float]) -> list[float]:
        """Commands of the n thrusters, -1 to 1, that carry out a wrench (6,)."""
        thrusts, shares = self._inverse @ np.asarray(demand, dtype=float), self.shares(demand)
        shares /= max(1.0, float(shares.max()))
        rate = np.sqrt(shares)
        return (np.sign(thrusts) * np.where(rate > 0.0, self.dead_band + (1.0 - self.dead_band) * rate, 0.0)).tolist()

    def effective(self, channels: "Sequence[float] | Array") -> Wrench:
        """Wrench to which commands (n,) amount at the bollard."""
        command = np.clip(np.asarray(channels, dtype=float), -1.0, 1.0)
        rate = np.maximum(np.abs(command) - self.dead_band, 0.0) / (1.0 - self.dead_band)
        full = np.where(command >= 0.0, self.thrust[:, 0], self.thrust[:, 1])
        return Wrench(*(self.matrix @ (np.sign(command) * full * rate**2)).tolist())
