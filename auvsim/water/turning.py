"""Uniform currents that turn: at given times, or somewhere on each docking approach."""

import math

import numpy as np
from numpy.random import Generator

from auvsim.base.frames import Array
from auvsim.water.field import ZERO_GRADIENT, Water
from auvsim.water.settings import ApproachTurnSettings, TurningSettings


class Turning:
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
        return Water(velocity=np.array((north, east, 0.0)), derivative=derivative, gradient=ZERO_GRADIENT)


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
        return Water(velocity=np.array((north, east, 0.0)), derivative=derivative, gradient=ZERO_GRADIENT)
