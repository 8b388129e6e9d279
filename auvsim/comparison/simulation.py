"""A record's rudder and shaft through MuJoCo, and through a planar model: velocities that they give in still water.

A steady current changes nothing of the motion through the water, so the whole record is sailed once; what is made of
it starts wherever a judge likes.
"""

import math

import numpy as np

from auvsim.base.errors import InputError
from auvsim.control.controller import Setpoints
from auvsim.identification.records import Record
from auvsim.simulation.sea_trials import DEPTH, PERIOD, Bench, Pilot
from auvsim.vehicles import library
from auvsim.vehicles.actuation import Commands, FinsAndShaft
from estimators.core.types import Array
from estimators.planar.model import PlanarParameters, PlanarProcess


def in_mujoco(vehicle: str, record: Record, surge: float, *, measured: bool = True) -> Array:
    """Surge, sway and yaw rate (n, 3) [m/s, rad/s] along a record, at a depth that the vehicle's autopilot holds.

    Args:
        vehicle: Name in models/, or the path of an MJCF file.
        record: Its inputs drive.
        surge: At the start [m/s].
        measured: Whether the rudder is measured: then the lag of the model's own servo is taken out first.

    Raises:
        InputError: The vehicle is not steered by fins.
    """
    actuation = library.vehicle(vehicle).actuation
    if not isinstance(actuation, FinsAndShaft):
        raise InputError(f"'{vehicle}' has no rudder: the sheet compares vehicles that fins steer and a shaft drives")
    times = PERIOD * np.arange(math.floor((record.times[-1] - record.times[0]) / PERIOD + 1e-6) + 1, dtype=np.float64)
    since = record.times - record.times[0]
    rudder, shaft = (np.interp(times, since, column) for column in record.inputs.T)
    if measured:
        rudder, shaft = (
            _ahead(values, lag) for values, lag in ((rudder, actuation.lags[0]), (shaft, actuation.lags[-1]))
        )
        rudder = np.clip(rudder, -actuation.fin_limit, actuation.fin_limit)
    bench, pilot = Bench(vehicle), Pilot(vehicle, actuation)

    def demand(time: float, truth) -> Commands:
        k = min(round(time / PERIOD), len(times) - 1)
        setpoints = Setpoints(math.nan, DEPTH, max(surge, 0.1), float(rudder[k]))
        return pilot.demand(truth, setpoints, float(shaft[k]))._replace(rudder=float(rudder[k]))

    start = Commands(float(rudder[0]), 0.0, float(shaft[0]))
    truths = bench.sail(demand, PERIOD * (len(times) - 1), start=start, speed=surge)
    velocities = np.array([truth.nu[[0, 1, 5]] for truth in truths])
    return np.column_stack([np.interp(since, times, column) for column in velocities.T])


def in_planar(parameters: PlanarParameters, record: Record, surge: float) -> Array:
    """The record's motion as a planar model predicts it, open loop; NaN from where it leaves all bounds."""
    process = PlanarProcess(parameters, np.zeros(8))
    inputs = np.ascontiguousarray(record.inputs, dtype=float)
    parts = max(1, math.ceil(record.step / 0.05 - 1e-9))
    start = np.array([0.0, 0.0, 0.0, surge, 0.0, 0.0, 0.0, 0.0])
    fine = np.repeat(inputs[:-1], parts, axis=0)
    states = process.walk(start, fine, record.step / parts, np.zeros((len(fine), 8)))[::parts, 3:6]
    return np.where(np.isfinite(states).all(axis=1, keepdims=True) & (np.abs(states) < 1e3), states, np.nan)


def _ahead(values: Array, lag: float) -> Array:
    """What commands a first-order lag [s] turns into these values at every period."""
    if lag <= 0.0:
        return values
    share = 1.0 - math.exp(-PERIOD / lag)
    return values + np.append(np.diff(values), 0.0) / share
