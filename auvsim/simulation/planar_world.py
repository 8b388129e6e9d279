"""A world whose vehicle moves exactly by the planar model of the filters, with process noise."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.random import Generator

from auvsim.base.frames import Array, euler_to_quaternion, rotation, wrap
from auvsim.physics.truth import Truth
from auvsim.vehicles.actuation import FinsAndShaft
from auvsim.water.currents import CurrentField
from auvsim.water.terrain import FlatFloor
from estimators.planar.model import PlanarParameters, PlanarProcess


class PlanarWorld:
    """One vehicle that moves as `PlanarProcess`, level and at constant depth, as a world without structures.

    Fins and shaft are at once where they are commanded to be. There is no dock to touch.

    Args:
        name: of the vehicle.
        parameters: of the vehicle.
        actuation: its fins and shaft.
        current: what the water does; a change of it carries the vehicle along, as in Qiu & Li (2019).
        rate: steps a second [Hz]; each is one step of the midpoint rule, which wants 6 or more.
        densities: (8,) power spectral densities of the process noise, see `PlanarProcess`.
        generator: of that noise, 8 normals a step.
    """

    def __init__(
        self,
        name: str,
        parameters: PlanarParameters,
        actuation: FinsAndShaft,
        current: CurrentField,
        rate: float,
        densities: Array,
        generator: Generator,
    ) -> None:
        self._process = PlanarProcess(parameters, densities)
        self.vehicles, self.current = (name,), current
        self.structures: dict[str, Any] = {}
        self.terrain = FlatFloor(math.inf)
        self._actuation = actuation
        self._rate, self._generator = rate, generator
        self._ticks = 0
        self.place(name, np.zeros(3), 0.0, 0.0, actuation.allocate(actuation.at_speed(0.0)))

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return self._ticks / self._rate

    def reset(self) -> None:
        """Back to time zero; the noise goes on."""
        self._ticks = 0

    def place(self, vehicle: str, position: Array, heading: float, speed: float, channels: Sequence[float]) -> None:
        """Resets to time zero with the vehicle at a place, moving ahead through the water; the noise goes on.

        Args:
            vehicle: its name.
            position: (3,) NED [m].
            heading: [rad].
            speed: through the water [m/s].
            channels: commands of its actuators.
        """
        north, east, self._depth = np.asarray(position, dtype=float).tolist()
        self._ticks = 0
        self._state = np.array((north, east, heading, speed, 0.0, 0.0, 0.0, 0.0))
        self._water = self._imposed(0)
        self._state[6:] = self._water
        self.command(vehicle, channels)

    def command(self, vehicle: str, channels: Sequence[float]) -> None:
        """Sets the commands of the actuators: fin angles [rad], then shaft speed [rad/s]."""
        self._channels = np.array(channels, dtype=float)
        rudder, _, shaft_speed = self._actuation.effective(list(channels))
        self._input = (rudder, shaft_speed)

    def contacts(self, vehicle: str) -> list[Any]:
        """None: there is nothing to touch."""
        return []

    def surfaced(self, vehicle: str) -> bool:
        """False: the vehicle stays at its depth."""
        return False

    def grounded(self, vehicle: str, since: float) -> bool:
        """False: there is no floor."""
        return False

    def latched(self, vehicle: str) -> str | None:
        """None: there is no latch."""
        return None

    def advance(self, ticks: int) -> None:
        """Steps the vehicle, in the current that flows where it is now."""
        step = 1.0 / self._rate
        water = np.empty((ticks + 1, 2))
        water[:] = self._water
        if not self.current.steady_uniform:
            water[1:] = [self._imposed(tick) for tick in range(self._ticks + 1, self._ticks + ticks + 1)]
        noise = process_noise_increments(self._generator, self._process.noise, step, water)
        self._state = self._process.walk(self._state, np.full((ticks, 2), self._input), step, noise)[-1]
        self._ticks += ticks
        self._water = water[-1]

    def rays(self, place: Array, directions: Array, reach: float) -> None:
        """Nothing: there is nothing to meet."""
        return

    def truth(self, vehicle: str) -> Truth:
        """The true state now, in NED and forward-starboard-down."""
        north, east, psi, u, v, r, c_north, c_east = self._state.tolist()
        current = np.array((c_north, c_east, 0.0))
        drift = rotation(0.0, 0.0, psi).T @ current
        return Truth(
            time=self.time,
            position=np.array((north, east, self._depth)),
            quaternion=euler_to_quaternion(0.0, 0.0, psi),
            attitude=np.array((0.0, 0.0, wrap(psi))),
            nu=np.array((u + drift[0], v + drift[1], 0.0, 0.0, 0.0, r)),
            current=current,
            actuators=self._channels,
        )

    def _imposed(self, tick: int) -> Array:
        """Horizontal velocity (2,) of the water [m/s] at the time of a tick, where the vehicle is now."""
        place = np.array((*self._state[:2], self._depth))
        return self.current.evaluate(tick / self._rate, place).velocity[:2]


def process_noise_increments(generator: Generator, densities: Array, step: float, current: Array) -> Array:
    """Increments of the planar state after each step of `PlanarProcess.walk`: process noise, changes of current.

    Args:
        generator: gives 8 normals a step.
        densities: (8,) power spectral densities, see `PlanarProcess`.
        step: length of a step [s].
        current: (k + 1, 2) north, east, imposed before the first step and after each [m/s].

    Returns:
        (k, 8).
    """
    drawn = generator.standard_normal((len(current) - 1, 8)) * np.sqrt(densities * step)
    drawn[:, 6:8] += np.diff(current, axis=0)
    return drawn


def planar_state(truth: Truth) -> Array:
    """North, east, heading, surge, sway through the water, yaw rate, current north, east (8,) of a true state."""
    through_water = truth.nu[:3] - rotation(*truth.attitude).T @ truth.current
    return np.array((*truth.position[:2], truth.attitude[2], *through_water[:2], truth.nu[5], *truth.current[:2]))
