"""Frames of imaging sonars that could not be used, by what was wrong with them."""

import numpy as np

from auvsim.data.log import VehicleLog
from auvsim.sensors.imaging_sonar import ImagingSonar
from estimators.map_path.frames import EMPTY, NOT_FINITE, SATURATED, WRONG_SIZE

SPOILED = (EMPTY, NOT_FINITE, SATURATED, WRONG_SIZE)  # reasons for which none is ever used
MISSING, LATE, TOO_OLD = "missing", "late", "too_old"


def bad_frames(log: VehicleLog) -> dict[str, int]:
    """Number of bad frames of all imaging sonars by what was wrong, those with none left out; empty without any.

    Missing are numbers of the sequence that never came; late ones came after their time, and those of them that were
    too old to be used count as such, too.
    """
    found = dict.fromkeys((*SPOILED, MISSING, LATE, TOO_OLD), 0)
    measurements = log["measurements"]
    refused = ~measurements["accepted"].astype(bool)
    for path in _sonars(log):
        sensor, own = path.removeprefix("sensors/"), log[path]
        mine = refused & (measurements["sensor"].astype(str) == sensor)
        reasons = measurements["reason"].astype(str)
        for reason in SPOILED:
            found[reason] += int((mine & (reasons == reason)).sum())
        if len(own["sequence"]):
            found[MISSING] += int(np.max(own["sequence"])) + 1 - len(own["sequence"])
        late = own["received"] > own["time"]
        found[LATE] += int(late.sum())
        old = refused & (reasons == TOO_OLD) & np.isin(measurements["stamp"], own["time"][late])
        found[TOO_OLD] += int(old.sum())
    return {reason: count for reason, count in found.items() if count}


def _sonars(log: VehicleLog) -> list[str]:
    """Groups of imaging sonars, by what they log."""
    logged = (ImagingSonar.value.dimensions, ("beam", "bin"))
    return [
        path for path in log.groups if path.startswith("sensors/") and log.table(path)["value"].dimensions in logged
    ]
