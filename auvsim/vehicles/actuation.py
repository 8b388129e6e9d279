"""Actuation: what a controller may demand of a vehicle, and the actuator channels that carry it out."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import mul
from typing import NamedTuple, Protocol

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

    def effective(self, channels: "Sequence[float] | Array") -> Commands:
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
