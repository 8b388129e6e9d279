"""Waves of a random sea: their orbital velocity and the surface that they move."""

import math

import numpy as np
from numpy.random import Generator

from auvsim.base.frames import Array
from auvsim.water.field import Water, horizontal
from auvsim.water.settings import WavesSettings
from auvsim.water.surface import Surface

GRAVITY = 9.81
_RANGE = 0.5, 6.0  # frequencies in units of the peak's, outside which less than 0.1 % of the energy lies
_CELLS = 4000


def jonswap(ratio: Array, peakedness: float) -> Array:
    """Shape of the JONSWAP spectrum over frequencies (n,) in units of the peak's (Hasselmann et al. 1973), unscaled."""
    width = np.where(ratio <= 1.0, 0.07, 0.09)
    return ratio**-5.0 * np.exp(-1.25 * ratio**-4.0) * peakedness ** np.exp(-0.5 * ((ratio - 1.0) / width) ** 2)


def wave_number(frequency: float, floor: float) -> float:
    """k [1/m] of linear waves, omega^2 = g k tanh(k h), at a frequency [rad/s] over a depth h [m]."""
    from scipy.optimize import brentq

    deep, shallow = frequency**2 / GRAVITY, frequency / math.sqrt(GRAVITY * floor)
    low, high = 0.999 * max(deep, shallow), 1.001 * (deep + shallow)

    def mismatch(k: float) -> float:
        return GRAVITY * k * math.tanh(k * floor) - frequency**2

    k = brentq(mismatch, low, high, xtol=1e-14 * high)
    return float(k)  # pyright: ignore[reportArgumentType] (the root alone)


class Waves:
    """A sea of regular waves of equal energy, whose frequencies and phases are drawn from the spectrum.

    With theta = k x - omega t + phase along the direction of the waves, elevation a cos(theta): velocity
    `a omega cosh(k (h - z)) / sinh(k h) cos(theta)` along and `a omega sinh(k (h - z)) / sinh(k h) sin(theta)` upward
    (Faltinsen 1990, table 2.1). Above the mean surface it goes on as a straight line in z. Irrotational, and without
    divergence.
    """

    steady_uniform = False

    def __init__(self, settings: WavesSettings, generator: Generator) -> None:
        count = settings.components
        self._along = np.array([*horizontal(1.0, settings.direction_deg), 0.0])
        edges = np.linspace(*_RANGE, _CELLS + 1)
        energy = np.concatenate([[0.0], np.cumsum(jonswap(0.5 * (edges[1:] + edges[:-1]), settings.peakedness))])
        # One frequency out of each of `count` parts of equal energy: the sea does not repeat itself.
        shares = (np.arange(count) + generator.uniform(size=count)) / count
        self.frequencies = np.interp(shares * energy[-1], energy, edges) * 2.0 * math.pi / settings.period  # [rad/s]
        self._phases = generator.uniform(0.0, 2.0 * math.pi, count)
        self.amplitude = settings.height / 4.0 * math.sqrt(2.0 / count)  # of each [m]: variance (H / 4)^2 in all
        self.wave_numbers = np.array([wave_number(w, settings.floor) for w in self.frequencies.tolist()])
        self._orbital = self.amplitude * self.frequencies
        self._floor = settings.floor
        self._reach = 1.0 / -np.expm1(-2.0 * self.wave_numbers * settings.floor)

    def _angles(self, time: float, position: Array) -> Array:
        distance = float(self._along @ position)
        return self.wave_numbers * distance - self.frequencies * time + self._phases

    def evaluate(self, time: float, position: Array) -> Water:
        """The water at a time [s] and a position (3,) in NED [m]; below the floor as on it."""
        depth = min(max(float(position[2]), 0.0), self._floor)
        k, w, theta = self.wave_numbers, self.frequencies, self._angles(time, position)
        down, up = np.exp(-k * depth), np.exp(-k * (2.0 * self._floor - depth))  # cosh and sinh without overflow
        along, across = self._orbital * self._reach * (down + up), self._orbital * self._reach * (down - up)
        c, s = np.cos(theta), np.sin(theta)
        above = min(float(position[2]), 0.0)  # a straight line above the mean surface
        a, b = along - k * above * across, across - k * above * along  # factors of cos (along) and sin (upward)
        a_z, b_z = -k * across, -k * along
        inside = float(position[2]) <= self._floor
        north, east, _ = self._along.tolist()
        u, v = float(a @ c), -float(b @ s)
        u_t, v_t = float((a * w) @ s), float((b * w) @ c)
        u_x, v_x = -float((a * k) @ s), -float((b * k) @ c)
        u_z, v_z = (float(a_z @ c), -float(b_z @ s)) if inside else (0.0, 0.0)
        return Water(
            velocity=np.array((u * north, u * east, v)),
            derivative=np.array((u_t * north, u_t * east, v_t)),
            gradient=np.array(
                (
                    (u_x * north * north, u_x * north * east, u_z * north),
                    (u_x * north * east, u_x * east * east, u_z * east),
                    (v_x * north, v_x * east, v_z),
                )
            ),
        )

    def surface(self, time: float, position: Array) -> Surface:
        """The surface above a position (3,) in NED [m] at a time [s]."""
        theta = self._angles(time, position)
        c, s = np.cos(theta), np.sin(theta)
        steep = -self.amplitude * float(self.wave_numbers @ s)
        return Surface(
            elevation=self.amplitude * float(c.sum()),
            rate=self.amplitude * float(self.frequencies @ s),
            north_slope=steep * float(self._along[0]),
            east_slope=steep * float(self._along[1]),
        )
