"""A vehicle's run in a few numbers, as plain values for strict JSON."""

import dataclasses
import math
from typing import Any

import numpy as np

from auvsim.analysis.bad_frames import bad_frames
from auvsim.analysis.estimates import estimate_errors, estimate_quality
from auvsim.analysis.heard import heard_vehicles, relative_to
from auvsim.analysis.sonar_path import turned_errors
from auvsim.base import plugins
from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.data.attributes import WALL_TIME
from auvsim.data.log import Log, VehicleLog
from auvsim.missions import contract
from auvsim.missions.docking.metrics import end_of
from auvsim.missions.registry import MISSIONS, find

NO_METRICS = "metrics_error"  # key of why a mission of the user's own has no metrics


def summarise(log: VehicleLog) -> dict[str, Any]:
    """Status, what the mission is judged by, quality of the estimate, fates of fixes, speed of the run.

    What is not a finite number is None.
    """
    errors = estimate_errors(log)
    values = {"status": str(log.log.attributes["status"]), "mission": log.mission, "time": end_of(log)}
    values |= find(log.mission).metrics(log) if log.mission in MISSIONS else _of_its_own(log)
    values["estimate"] = {
        phase: dataclasses.asdict(quality) for phase, quality in estimate_quality(errors, log.phases).items()
    }
    if heard := heard_vehicles(log):
        values["relative_to"] = {name: _root_mean_square(relative_to(log, name).error) for name in heard}
    if "usbl" in log:
        usbl = log["usbl"]
        values |= {
            "fixes_sent": len(usbl["time"]),
            "fixes_lost": int(usbl["lost"].sum()),
            "fixes_outliers": int((usbl["outlier"] & ~usbl["lost"]).sum()),
        }
    if "matching" in log:
        turned = turned_errors(log)
        values |= {
            "loop_closures": int(log["matching"]["closures"].max(initial=0)),
            "turned_rms": None if turned is None else turned.rms,
        }
    values["fixes_refused"] = int(log["estimate"]["refused"].max(initial=0))
    if bad := bad_frames(log):
        values["bad_frames"] = bad
    end, wall = end_of(log), float(log.log.attributes.get(WALL_TIME, math.nan))
    values["real_time_factor"] = end / wall if wall > 0.0 else None
    return _plain(values)


def summarise_all(log: Log) -> dict[str, Any]:
    """The summary of the only vehicle; of several, by name."""
    if len(log.vehicles) == 1:
        return summarise(log.vehicle())
    return {"status": str(log.attributes["status"]), "vehicles": {n: summarise(log.vehicle(n)) for n in log.vehicles}}


def _of_its_own(log: VehicleLog) -> dict[str, Any]:
    """Metrics of a mission of the user's own; where there are none, why: its class may be missing, or fail."""
    try:
        mission: Any = find(log.mission)
        return contract.metrics(mission.metrics(log))
    except (Exception, SystemExit) as error:
        text = plugins.same_each_time(" ".join(str(error).split()))[:300]
        return {NO_METRICS: text if isinstance(error, InputError) else f"{type(error).__name__}: {text}"}


def _root_mean_square(errors: Array) -> float:
    """Of vectors (k, 2); NaN of none."""
    return math.sqrt(float(np.square(errors).sum(axis=1).mean())) if len(errors) else math.nan


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
