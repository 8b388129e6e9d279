"""Records of planar vehicles whose parameters are known: a test of fits against the truth."""

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.random import Generator

from auvsim.base.errors import InputError
from auvsim.identification.fit import Nuisances
from auvsim.identification.records import MEASURED, Record
from estimators.core.types import Array
from estimators.planar.model import PlanarParameters, PlanarProcess

Kind = Literal["multisine", "zigzag", "turns"]
_FINE = 10  # steps of the truth in one of the record
# Constant errors of the trial's sensors, as its data sheets give them.
SHEETS = Nuisances(
    current=0.2, gyro=math.radians(0.005), compass=math.radians(0.5), misalignment=math.radians(0.3), scale=0.002
)


@dataclass(frozen=True, kw_only=True, slots=True)
class Vessel:
    """A vehicle, the noise that moves it, and its sensors; the defaults are the default trial's sensors."""

    parameters: PlanarParameters
    shaft_speed: float = 62.5  # about which it is driven [rad/s]
    surge: float = 1.0  # at first [m/s]
    rudder: float = math.radians(13.0)  # largest [rad]
    densities: tuple[float, ...] = (0.0,) * 6  # of the process noise, units as Fit.noise
    errors: Nuisances = field(default_factory=lambda: SHEETS)  # from which a record's constant errors are drawn
    deviations: tuple[float, ...] = (
        0.48, 0.48, math.radians(1.0), 0.02, 0.02, math.radians(0.005) * math.sqrt(10.0), 0.01, 0.01,
    )  # fmt: skip
    intervals: tuple[float, ...] = (5.0, 5.0, 0.1, 0.2, 0.2, 0.1, 0.2, 0.2)  # between readings, by MEASURED [s]


@dataclass(frozen=True, kw_only=True, slots=True)
class Simulated:
    """A record and the truth behind it."""

    record: Record
    states: Array  # (n, 8) north, east, heading, u, v, r, current north, east
    nuisances: Array  # (6,)


def simulate(vessel: Vessel, kind: Kind, seed: int, duration: float = 300.0, step: float = 0.1) -> Simulated:
    """Drives a vessel through a manoeuvre.

    Args:
        vessel: What is driven.
        kind: multisine and zigzag with steps of the shaft speed, or turns at a constant one.
        seed: Of the manoeuvre's phases, the constant errors and all noise.
        duration: Of the record [s].
        step: Of its grid [s].

    Raises:
        InputError: There is no such manoeuvre.
    """
    generator = np.random.default_rng(seed)
    times = step * np.arange(round(duration / step), dtype=np.float64)
    inputs = _inputs(vessel, kind, times, generator)
    nuisances = vessel.errors.vector() * generator.standard_normal(6)
    start = np.array([0.0, 0.0, generator.uniform(-math.pi, math.pi), vessel.surge, 0.0, 0.0, *nuisances[:2]])
    spread = np.zeros(8)
    spread[:6] = np.sqrt(np.array(vessel.densities) * step / _FINE)
    increments = spread * generator.standard_normal((len(times) * _FINE, 8))
    process = PlanarProcess(vessel.parameters, np.zeros(8))
    states = process.walk(start, np.repeat(inputs, _FINE, axis=0), step / _FINE, increments)[: len(increments) : _FINE]
    shown = _shown(states, nuisances)
    shown += np.array(vessel.deviations) * generator.standard_normal(shown.shape)
    for channel, interval in enumerate(vessel.intervals):
        every = max(1, round(interval / step))
        shown[np.arange(len(times)) % every != 0, channel] = np.nan
    record = Record(
        name=f"{kind} {seed}", times=times, inputs=inputs, measured=shown, deviations=np.array(vessel.deviations)
    )
    return Simulated(record=record, states=states, nuisances=nuisances)


def _inputs(vessel: Vessel, kind: Kind, times: Array, generator: Generator) -> Array:
    """Rudder and shaft speed (n, 2)."""
    shaft = np.full(len(times), vessel.shaft_speed)
    if kind == "multisine":
        frequencies = np.linspace(0.01, 0.2, 12)
        phases = generator.uniform(0.0, 2.0 * math.pi, len(frequencies))
        rudder = np.sin(2.0 * math.pi * np.outer(times, frequencies) + phases).sum(axis=1)
        rudder *= vessel.rudder / np.abs(rudder).max()
        shaft *= np.array([1.0, 0.7, 1.3, 0.85])[(times // 25.0).astype(int) % 4]
    elif kind == "zigzag":
        period = np.where(times // 100.0 % 2 == 0.0, 20.0, 40.0)
        rudder = vessel.rudder * np.sign(np.sin(2.0 * math.pi * times / period))
        shaft *= np.array([0.75, 1.25])[(times // 37.5).astype(int) % 2]
    elif kind == "turns":
        rudder = vessel.rudder * np.array([0.3, -0.6, 1.0, -1.0])[(times // 30.0).astype(int) % 4]
    else:
        raise InputError(f"no simulated manoeuvre '{kind}'; there are multisine, turns, zigzag")
    return np.column_stack([rudder, shaft])


def _shown(states: Array, nuisances: Array) -> Array:
    """What sensors without noise show (n, 8) of states (n, 8)."""
    gyro, compass, misalignment, scale = nuisances[2:]
    heading = np.exp(1j * states[:, 2])
    water = states[:, 3] + 1j * states[:, 4]
    ground = water + (states[:, 6] + 1j * states[:, 7]) * heading.conj()
    turn = (1.0 + scale) * np.exp(-1j * misalignment)
    water, ground = water * turn, ground * turn
    columns = {
        "north": states[:, 0], "east": states[:, 1], "heading": states[:, 2] + compass,
        "surge": water.real, "sway": water.imag, "yaw_rate": states[:, 5] + gyro,
        "ground_surge": ground.real, "ground_sway": ground.imag,
    }  # fmt: skip
    return np.column_stack([columns[name] for name in MEASURED])
