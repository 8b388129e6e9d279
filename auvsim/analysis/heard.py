"""Whom a vehicle heard in a run, and its error relative to each of them beside its absolute one."""

from typing import NamedTuple

import numpy as np

from auvsim.analysis.estimates import estimate_errors
from auvsim.base.frames import Array
from auvsim.data.log import VehicleLog
from auvsim.data.phases import interpolate


class Relative(NamedTuple):
    """Error of a vehicle's position as seen from another: what matters to those that keep together."""

    time: Array  # (k,) [s]
    error: Array  # (k, 2) the own error less the other's, north and east [m]


def heard_vehicles(log: VehicleLog) -> tuple[str, ...]:
    """Vehicles of the run whose messages a vehicle received, in their order in the log; none without a modem."""
    if "received" not in log:
        return ()
    sources = {*log["received"]["source"].tolist()}
    return tuple(name for name in log.log.vehicles if name in sources)


def relative_to(log: VehicleLog, other: str) -> Relative:
    """The error of a vehicle's estimated position less that of another's own, where both had one.

    Errors that both share, as of a leader that is off, drop out.

    Args:
        log: Of the vehicle.
        other: Name of the other vehicle.
    """
    own, its = estimate_errors(log), estimate_errors(log.log.vehicle(other))
    seen = its.initialised & np.isfinite(its.position).all(axis=1)
    if not seen.any():
        return Relative(np.empty(0), np.empty((0, 2)))
    within = (own.time >= its.time[seen][0]) & (own.time <= its.time[seen][-1])
    both = own.initialised & within & np.isfinite(own.position).all(axis=1)
    there = interpolate(own.time[both], its.time[seen], its.position[seen, :2])
    return Relative(own.time[both], own.position[both, :2] - there)
