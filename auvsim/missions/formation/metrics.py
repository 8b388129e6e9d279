"""Metrics of a formation: pure functions of a vehicle's log."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvsim.base.frames import Array
from auvsim.data.log import VehicleLog

SETTLED = 60.0  # after the start and after each new station, time that does not count [s]
SEARCH, ON_STATION, ALONE = range(3)


def formation_metrics(log: VehicleLog) -> dict[str, Any]:
    """Whether it lasted, and the true distance from the station, rms and largest."""
    mission = log["mission"]
    times, errors = station_errors(log)
    distances = np.hypot(errors[:, 0], errors[:, 1])
    is_settled = settled(log, times)
    counted = distances[is_settled]
    return {
        "finished": bool((mission["phase"] == 4).any()),
        "station_rms": float(np.sqrt((counted**2).mean())) if counted.size else None,
        "station_max": float(counted.max()) if counted.size else None,
    }


def station_errors(log: VehicleLog) -> tuple[Array, Array]:
    """Times (k,) [s] while it keeps a station, and the true position less it (k, 2), north and east [m]."""
    mission, truth = log["mission"], log["truth"]
    kept = np.isin(mission["phase"], (ON_STATION, ALONE)) & np.isfinite(mission["target"]).all(axis=1)
    times = mission["time"][kept]
    places = [np.interp(times, truth["time"], truth["position"][:, axis]) for axis in range(2)]
    return times, np.column_stack(places) - mission["target"][kept]


def settled(log: VehicleLog, times: Array) -> NDArray[np.bool_]:
    """Which times are later than SETTLED after the start and after each new station."""
    mission = log["mission"]
    station = np.column_stack((mission["ahead"], mission["starboard"]))
    changes = np.flatnonzero((np.diff(station, axis=0) != 0.0).any(axis=1)) + 1
    since = np.full(len(times), np.inf)
    for begin in (mission["time"][0], *mission["time"][changes]) if len(mission["time"]) else ():
        since = np.where(times >= begin, np.minimum(since, times - begin), since)
    return np.asarray(since >= SETTLED)
