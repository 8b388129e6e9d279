"""Metrics of a docking: pure functions of a vehicle's log."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from auvsim.base.frames import wrap
from auvsim.data.log import VehicleLog
from auvsim.data.phases import latest, phase_at
from auvsim.missions.docking.dock_frame import in_dock_frame, nose_position
from auvsim.missions.docking.effort import effort
from auvsim.vehicles.library import ALIGNED

FAILURES = ("timeout", "diverged", "aborted")  # kinds of event that end a run without docking
ENTERING = ("approach", "final", "docked")  # phases in which passing the mouth's plane is an entrance


@dataclass(frozen=True, kw_only=True, slots=True)
class Crossing:
    """The nose passes the plane of the dock's mouth, inward."""

    time: float  # [s]
    attempt: int
    phase: str
    miss_distance: float  # of the nose from the dock's axis [m]
    cross_track: float  # its part to starboard [m]
    vertical: float  # its part downward [m]
    heading_error_deg: float  # heading minus the dock's [deg]


def docking_metrics(log: VehicleLog) -> dict[str, Any]:
    """Whether and how the vehicle docked: the values of `Docking.columns`, and every crossing of the mouth's plane.

    Contacts count until the latch holds: the current's push against the dock thereafter is no impact.
    """
    passed = crossings(log)
    last = next((c for c in passed if c.attempt == passed[-1].attempt), None)
    docked_at = _docking_time(log)
    reason, text = (None, None) if docked_at is not None else _failure(log)
    contact = log["contact"]
    entry = slice(None if docked_at is None else int(np.searchsorted(contact["time"], docked_at, side="right")))
    end = end_of(log) if docked_at is None else docked_at
    attempts = int(log["mission"]["attempt"].max(initial=0))
    return {
        "docked": docked_at is not None,
        "docked_first": docked_at is not None and attempts == 1,
        "failure_reason": reason,
        "failure_text": text,
        "attempts": attempts,
        "approaches": _approaches(log),
        "time": end,
        "miss_distance": last.miss_distance if last else None,
        "cross_track": last.cross_track if last else None,
        "vertical": last.vertical if last else None,
        "heading_error_deg": last.heading_error_deg if last else None,
        "contact_impulse": float(contact["impulse"][entry].max(initial=0.0)),
        "peak_contact_force": float(contact["force"][entry].max(initial=0.0)),
        **effort(log, end),
        **_at_rest(log, docked_at),
        "crossings": [dataclasses.asdict(crossing) for crossing in passed],
    }


def _approaches(log: VehicleLog) -> int:
    """How often the vehicle set out from its gate towards the mouth."""
    phase, approach = log["mission"]["phase"], log.phases.index("approach")
    on = np.concatenate(([False], phase == approach))
    return int(np.sum(on[1:] & ~on[:-1]))


def _at_rest(log: VehicleLog, docked_at: float | None) -> dict[str, Any]:
    """Pose in the dock at the end of a trial that docked, and whether the vehicle is aligned with it then."""
    names = ("final_along", "final_cross", "final_down", "final_angle_deg")
    structure = log.structure
    if docked_at is None or structure is None or not len(log["truth"]["time"]):
        return {"docked_aligned": False} | dict.fromkeys(names)
    nose = in_dock_frame(structure, nose_position(log)[-1:])[0].tolist()
    _, pitch, heading = log["truth"]["attitude"][-1].tolist()
    angle = math.acos(min(1.0, max(-1.0, math.cos(pitch) * math.cos(heading - structure.heading))))
    within = structure.number("aligned_within", ALIGNED)
    return {"docked_aligned": angle <= within} | dict(zip(names, (*nose, math.degrees(angle)), strict=True))


def crossings(log: VehicleLog) -> tuple[Crossing, ...]:
    """Every time the nose truly passes the mouth's plane inward on an approach, interpolated between samples."""
    truth, phases = log["truth"], log.phases
    structure = log.structure
    if structure is None:
        return ()
    heading = structure.heading
    nose = in_dock_frame(structure, nose_position(log))
    along = nose[:, 0]
    found = []
    for i in np.flatnonzero((along[:-1] < 0.0) & (along[1:] >= 0.0)):
        fraction = -along[i] / (along[i + 1] - along[i])
        _, cross, down = nose[i] + fraction * (nose[i + 1] - nose[i])
        start, end = truth["attitude"][i : i + 2, 2]
        time = float(truth["time"][i] + fraction * (truth["time"][i + 1] - truth["time"][i]))
        phase, attempt = phase_at(log, np.array([time]))[0], latest(log, "attempt", np.array([time]), 1)[0]
        if phase >= 0 and phases[phase] not in ENTERING:
            continue
        found.append(
            Crossing(
                time=time,
                attempt=int(attempt),
                phase=phases[phase] if phase >= 0 else "",
                miss_distance=math.hypot(cross, down),
                cross_track=float(cross),
                vertical=float(down),
                heading_error_deg=math.degrees(wrap(start + fraction * wrap(end - start) - heading)),
            )
        )
    return tuple(found)


def _docking_time(log: VehicleLog) -> float | None:
    docked = log["event"]["time"][log["event"]["kind"] == "docked"]
    if not len(docked):
        mission = log["mission"]
        docked = mission["time"][mission["phase"] == log.phases.index("docked")]
    return float(docked[0]) if len(docked) else None


def _failure(log: VehicleLog) -> tuple[str, str | None]:
    """Why a trial did not dock: how it ended, else the last event that says so."""
    events = [(k, t) for k, t in zip(log["event"]["kind"], log["event"]["text"], strict=True) if k in FAILURES]
    status = str(log.log.attributes["status"])
    if status != "complete":
        return status, next((text for kind, text in reversed(events) if kind == status), None)
    if events:
        return events[-1]
    aborted = log["mission"]["phase"][-1:].tolist() == [log.phases.index("aborted")]
    return ("aborted" if aborted else "timeout"), None


def end_of(log: VehicleLog) -> float:
    """The last time that anything was logged as it happened [s]."""
    return max(float(log[group]["time"].max(initial=0.0)) for group in ("truth", "mission", "command", "event"))
