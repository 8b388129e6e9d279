"""Metrics of a track: pure functions of its log."""

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import ValidationError

from auvsim.base import schema, yaml_text
from auvsim.base.errors import InputError
from auvsim.base.settings import Settings
from auvsim.data.log import VehicleLog
from auvsim.missions.track import patterns


class _Settings(Settings):
    """What of a track's settings its metrics need."""

    pattern: patterns.Pattern


def track_metrics(log: VehicleLog) -> dict[str, Any]:
    """Whether the track was finished, how many waypoints were reached, and the true distance from its legs, rms.

    The transit to the first waypoint is not a leg of the track and does not count.
    """
    mission, truth = log["mission"], log["truth"]
    way = _pattern(log)
    if isinstance(way, patterns.Weave | patterns.Circle):
        return {"finished": bool((mission["phase"] == 2).any()), "waypoints": 0, "cross_track_rms": None}
    points = patterns.points(way)
    reached = int((log["event"]["kind"] == "waypoint").sum())
    under_way = np.flatnonzero(mission["phase"] == 1)
    squares = []
    if len(under_way):
        ahead = np.interp(truth["time"], mission["time"][under_way], mission["waypoint"][under_way]).round().astype(int)
        first, last = mission["time"][under_way[[0, -1]]]
        for leg in range(1, len(points)):
            part = (ahead == leg) & (truth["time"] >= first) & (truth["time"] <= last)
            begin, along = points[leg - 1], points[leg] - points[leg - 1]
            if not along.any():
                continue  # a waypoint given twice is no leg
            off = truth["position"][part, :2] - begin
            squares.append(((along[0] * off[:, 1] - along[1] * off[:, 0]) / math.hypot(*along)) ** 2)
    all_squares = np.concatenate(squares) if squares else np.empty(0)
    return {
        "finished": reached == len(points),
        "waypoints": reached,
        "cross_track_rms": float(np.sqrt(all_squares.mean())) if len(all_squares) else None,
    }


def _pattern(log: VehicleLog) -> patterns.Waypoints | patterns.LawnMower | patterns.Law:
    """The track that a log says its vehicle had.

    Raises:
        InputError: it does not, or what it says cannot be read.
    """
    if "mission_settings" not in log.attributes:
        raise InputError(f"the log of '{log.name}' lacks 'mission_settings', which says what its track is")
    where = f"log, mission_settings of '{log.name}'"
    found = yaml_text.read(str(log.attributes["mission_settings"]), where).value
    values = {"pattern": found.get("pattern") if isinstance(found, Mapping) else None}
    try:
        return _Settings.model_validate_json(json.dumps(values, default=str), strict=True).pattern
    except ValidationError as error:
        raise schema.explain(error, _Settings, values, {"": where}) from None
