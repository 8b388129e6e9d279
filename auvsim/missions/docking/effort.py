"""What a docking costs: energy of the shaft, way through the water, contacts; from a vehicle's log."""

import math

import numpy as np

from auvsim.base import yaml_text
from auvsim.base.frames import Array
from auvsim.data.log import VehicleLog
from auvsim.missions.docking.dock_frame import to_body
from auvsim.physics.forces import propeller_force
from auvsim.physics.hydrodynamics import SEA_WATER, propeller_of

APART = 0.2  # time without force after which a contact is another one [s]


def effort(log: VehicleLog, end: float) -> dict[str, float | int | None]:
    """Energy, way and contacts until a time [s]: values of `docking.columns`."""
    truth = log["truth"]
    kept = slice(int(np.searchsorted(truth["time"], end, side="right")))
    time = truth["time"][kept]
    through = truth["nu"][kept, :3] - to_body(truth["quaternion"][kept], truth["current"][kept])
    power = _shaft_power(log, through[:, 0], truth["actuators"][kept])
    return {
        "shaft_energy": None if power is None else float(np.trapezoid(power, time)),
        "way": float(np.trapezoid(np.linalg.norm(through, axis=1), time)),
        "contacts": contacts(log["contact"]["time"], end),
    }


def contacts(times: Array, end: float) -> int:
    """Number of separate contacts until a time [s], by the times (n,) [s] at which there was a force."""
    known = times[times <= end]
    return int(np.count_nonzero(np.diff(known, prepend=-math.inf) > APART))


def _shaft_power(log: VehicleLog, ahead: Array, actuators: Array) -> Array | None:
    """Power (n,) [W] that a shaft gives to its propeller, from the speed ahead (n,) [m/s]; None without a propeller.

    The torque is the physics' own, of the model that the log holds. That of waves at the propeller and of a propeller
    out of the water are left out.
    """
    text = log.log.models.get(("vehicle", str(log.attributes.get("model"))))
    channels = log.table("truth")["actuators"].labels
    if not text or "shaft" not in channels:
        return None
    scenario = yaml_text.read(str(log.log.attributes["scenario"]), "scenario of the log").value or {}
    record = propeller_of(text, scenario.get("water", {}).get("density", SEA_WATER))
    if record is None:
        return None
    shaft = actuators[:, channels.index("shaft")].tolist()
    torques = [propeller_force(record, 0, u, n / math.tau)[1] for u, n in zip(ahead.tolist(), shaft, strict=True)]
    return np.abs(np.array(torques) * shaft)
