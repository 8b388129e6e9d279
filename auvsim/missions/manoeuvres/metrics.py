"""Metrics of manoeuvres (ITTC, IMO): pure functions of a log's truth, relative to the water.

Definitions: IMO MSC.137(76) and MSC/Circ.1053, ITTC 7.5-02-06-01. The track is that through the water, so that a
current, which those trials are corrected for, does not matter.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from auvsim.base import schema, yaml_text
from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.data.log import VehicleLog
from auvsim.missions.docking.dock_frame import to_body
from auvsim.missions.manoeuvres import laws
from auvsim.missions.manoeuvres.settings import (
    CircleSettings,
    ManoeuvreMissionSettings,
    ManoeuvreSettings,
    Simple,
    SpiralSettings,
    StraightSettings,
    ZigzagSettings,
)
from auvsim.missions.mission import Metric

STRAIGHT = 0.25  # of its switching angle, by which a zig-zag may begin off its course
STEADY = 0.25  # last share of a held rudder or speed over which it counts as steady

NUMBERS: Mapping[str, Metric] = {  # what `figures` may give of a manoeuvre
    "duration": Metric("float", "s", "duration after the approach"),
    "approach_speed": Metric("float", "m/s", "speed at the end of the approach"),
    "rudder_deg": Metric("float", "deg", "largest rudder"),
    "mean_speed": Metric("float", "m/s", "mean surge"),
    "largest_yaw_rate_deg": Metric("float", "deg/s", "largest yaw rate"),
    "largest_drift_deg": Metric("float", "deg", "largest drift angle"),
    "largest_depth_error": Metric("float", "m", "largest deviation from the depth"),
    "room": Metric("float", "m", "largest distance from the start"),
    "switch_deg": Metric("float", "deg", "switching angle"),
    "initial_turning_time": Metric("float", "s", "initial turning time"),
    "first_overshoot_deg": Metric("float", "deg", "first overshoot"),
    "second_overshoot_deg": Metric("float", "deg", "second overshoot"),
    "mean_overshoot_deg": Metric("float", "deg", "mean overshoot"),
    "period": Metric("float", "s", "period"),
    "advance": Metric("float", "m", "advance"),
    "transfer": Metric("float", "m", "transfer"),
    "tactical_diameter": Metric("float", "m", "tactical diameter"),
    "steady_diameter": Metric("float", "m", "steady turning diameter"),
    "steady_yaw_rate_deg": Metric("float", "deg/s", "steady yaw rate"),
    "steady_drift_deg": Metric("float", "deg", "steady drift angle"),
    "speed_loss": Metric("float", "%", "speed loss in the turn"),
    "slope": Metric("float", "1/s", "yaw rate per rudder at zero"),
    "residual_yaw_rate_deg": Metric("float", "deg/s", "yaw rate at zero rudder"),
    "loop_deg": Metric("float", "deg/s", "largest difference between the ways"),
    "slowest": Metric("float", "m/s", "steady surge at the lowest shaft speed"),
    "fastest": Metric("float", "m/s", "steady surge at the highest shaft speed"),
}
LABELS = {key: f"{number.meaning} [{number.units}]" for key, number in NUMBERS.items()}
COLUMNS: Mapping[str, Metric] = {  # of `manoeuvre_metrics`
    "finished": Metric("bool", "1", "whether it went on to its end"),
    **NUMBERS,
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Motion:
    """A manoeuvre through the water, from the end of its approach on."""

    time: Array  # (n,) since the end of the approach [s]
    track: Array  # (n, 2) ahead and to starboard of the course of the approach, through the water [m]
    heading: Array  # (n,) change since the approach, not wrapped [rad]
    velocity: Array  # (n, 3) surge, sway [m/s], yaw rate [rad/s] through the water
    depth: Array  # (n,) [m]
    rudder: Array  # (n,) commanded, positive to starboard [rad]
    shaft_speed: Array  # (n,) commanded [rad/s]


@dataclass(frozen=True, kw_only=True, slots=True)
class Figures:
    """The numbers of one manoeuvre of a log, by the keys of NUMBERS; None where it did not get so far."""

    kind: str
    start: float  # end of its approach [s]
    numbers: dict[str, float | None]
    warning: str = ""  # why some of them are None


def is_manoeuvre(log: VehicleLog) -> bool:
    """Whether a vehicle performed a manoeuvre."""
    return log.mission == "manoeuvre"


def settings(log: VehicleLog) -> ManoeuvreSettings:
    """The manoeuvre that a vehicle performed.

    Logs of formats 1 and 2 say it in their scenario alone, which was of one vehicle.

    Raises:
        InputError: it did something else, or what the log says of it cannot be read.
    """
    if not is_manoeuvre(log):
        raise InputError(f"the mission of '{log.name}' is {log.mission}, not a manoeuvre")
    where = f"log, mission of '{log.name}'"
    name = "mission_settings" if "mission_settings" in log.attributes else "scenario"
    found = yaml_text.read(str({**log.log.attributes, **log.attributes}[name]), where).value
    values = found.get("manoeuvre") if isinstance(found, Mapping) else None
    try:
        return ManoeuvreMissionSettings.model_validate_json(json.dumps({"manoeuvre": values}), strict=True).manoeuvre
    except ValidationError as error:
        raise schema.explain(error, ManoeuvreMissionSettings, {"manoeuvre": values}, {"": where}) from None


def parts(log: VehicleLog) -> list[laws.Part]:
    """The manoeuvres of a log, several for a sequence.

    Raises:
        InputError: the vehicle did something else.
    """
    return list(laws.parts(settings(log)))


def manoeuvre_metrics(log: VehicleLog) -> dict[str, Any]:
    """Values of COLUMNS, each from the first manoeuvre of a sequence that has it, and the figures of every one."""
    found = figures(log)
    numbers = {key: next((f.numbers[key] for f in found if key in f.numbers), None) for key in NUMBERS}
    end = float(log["mission"]["time"].max(initial=0.0))
    return {
        "finished": end >= settings(log).duration - 1e-6,
        **numbers,
        "manoeuvres": [{"kind": f.kind, "start": f.start, **f.numbers} for f in found],
    }


def figures(log: VehicleLog) -> list[Figures]:
    """Figures of each manoeuvre of a log.

    Raises:
        InputError: the vehicle did something else.
    """
    found = []
    for start, part in parts(log):
        moved = motion(log, start + part.approach, start + part.duration)
        if len(moved.time) > 1:
            numbers = _common(moved) | _particular(part, moved)
            warning = _warning(part, moved)
            found.append(Figures(kind=laws.name(part), start=start + part.approach, numbers=numbers, warning=warning))
    return found


def _warning(part: Simple, moved: Motion) -> str:
    if not (isinstance(part, ZigzagSettings) and oscillates(moved, part.heading_deg)):
        return ""
    off = math.degrees(abs(moved.heading[0]))
    return (
        f"the vehicle oscillates by itself: when the zig-zag began it was {off:.1f} deg off its course, so overshoots "
        "and times are not given; lower control.heading_gain, or give a longer approach"
    )


def motion(log: VehicleLog, start: float, end: float) -> Motion:
    """The motion between two times [s], relative to place and heading at the first."""
    truth = log["truth"]
    part = (truth["time"] >= start - 1e-6) & (truth["time"] <= end + 1e-6)
    time = truth["time"][part]
    heading = np.unwrap(truth["attitude"][part, 2])
    velocity = truth["nu"][part][:, [0, 1, 5]]
    velocity[:, :2] -= to_body(truth["quaternion"][part], truth["current"][part])[:, :2]
    drift = truth["current"][part, :2]
    steps = 0.5 * (drift[1:] + drift[:-1]) * np.diff(time)[:, None]
    carried = np.concatenate([np.zeros((min(len(time), 1), 2)), np.cumsum(steps, axis=0)])
    place = truth["position"][part, :2] - truth["position"][part, :2][:1] - carried
    course = _course(log, start)
    turn = np.array([[math.cos(course), -math.sin(course)], [math.sin(course), math.cos(course)]])
    command = log["command"]
    at = np.clip(np.searchsorted(command["time"], time, side="right") - 1, 0, None)
    return Motion(
        time=time - start,
        track=place @ turn,
        heading=heading - course - 2 * math.pi * np.round((heading[:1] - course) / (2 * math.pi)),
        velocity=velocity,
        depth=truth["position"][part, 2],
        rudder=command["rudder"][at],
        shaft_speed=command["shaft_speed"][at],
    )


def _course(log: VehicleLog, start: float) -> float:
    """Heading of the approach [rad]: the mean of its last 5 s, which its autopilot spends near the course."""
    truth = log["truth"]
    before = (truth["time"] > start - 5.0) & (truth["time"] <= start + 1e-6)
    headings = np.unwrap(truth["attitude"][before, 2])
    return float(headings.mean()) if len(headings) else 0.0


def _common(m: Motion) -> dict[str, float | None]:
    surge, sway, yaw_rate = m.velocity.T
    return {
        "duration": float(m.time[-1] - m.time[0]),
        "approach_speed": float(math.hypot(surge[0], sway[0])),
        "rudder_deg": math.degrees(np.abs(m.rudder).max()),
        "mean_speed": float(surge.mean()),
        "largest_yaw_rate_deg": math.degrees(np.abs(yaw_rate).max()),
        "largest_drift_deg": math.degrees(np.abs(np.arctan2(sway, surge)).max()),
        "largest_depth_error": float(np.abs(m.depth - m.depth[0]).max()),
        "room": float(np.hypot(*m.track.T).max()),
    }


def _particular(settings: Simple, m: Motion) -> dict[str, float | None]:
    match settings:
        case ZigzagSettings():
            return {"switch_deg": settings.heading_deg, **zigzag(m, settings.heading_deg)}
        case CircleSettings():
            return circle(m)
        case SpiralSettings():
            return spiral(settings, m)
        case StraightSettings() if settings.speed_steps:
            steady = steady_speeds(settings.step_time, m)
            return {"slowest": float(steady[:, 1].min()), "fastest": float(steady[:, 1].max())}
        case _:
            return {}


def switches(m: Motion) -> NDArray[np.intp]:
    """Where the rudder changes sides: the first samples (k,) of its new side."""
    side = np.sign(m.rudder)
    return np.flatnonzero(side[1:] * side[:-1] < 0.0) + 1


def oscillates(m: Motion, switch_deg: float) -> bool:
    """Whether a zig-zag began off its course by more than a share of its switching angle, as of a vehicle that swings.

    Its first figures then tell of where in its swing the vehicle was, not of the rudder.
    """
    return bool(math.degrees(abs(m.heading[0])) > STRAIGHT * switch_deg)


def zigzag(m: Motion, switch_deg: float) -> dict[str, float | None]:
    """Figures of a zig-zag: an overshoot is what the heading still turns after the rudder has changed sides.

    There are none of the first turns where the vehicle oscillated before.
    """
    if oscillates(m, switch_deg):
        names = ("initial_turning_time", "first_overshoot_deg", "second_overshoot_deg", "mean_overshoot_deg", "period")
        return dict.fromkeys(names)
    at = switches(m)
    overshoots = []
    for begin, end in zip(at, [*at[1:], len(m.time)], strict=True):
        side = np.sign(m.rudder[begin - 1])
        turned = side * (m.heading[begin:end] - m.heading[begin])
        if turned.argmax() < len(turned) - 1:  # the heading has come back from its largest
            overshoots.append(math.degrees(turned.max()))
    cycles = m.time[at[2:]] - m.time[at[:-2]]
    return {
        "initial_turning_time": float(m.time[at[0]]) if len(at) else None,
        "first_overshoot_deg": overshoots[0] if overshoots else None,
        "second_overshoot_deg": overshoots[1] if len(overshoots) > 1 else None,
        "mean_overshoot_deg": float(np.mean(overshoots)) if overshoots else None,
        "period": float(cycles.mean()) if len(cycles) else None,
    }


def circle(m: Motion) -> dict[str, float | None]:
    """Figures of a turning circle: advance and transfer at 90 deg, tactical diameter at 180, steady after 360."""
    side = 1.0 if m.heading[-1] >= 0.0 else -1.0
    turned = side * m.heading

    def at(angle_deg: float, axis: int) -> float | None:
        angle = math.radians(angle_deg)
        if turned[-1] < angle:
            return None
        k = int(np.argmax(turned >= angle))
        share = 0.0 if k == 0 else (angle - turned[k - 1]) / (turned[k] - turned[k - 1])
        return float((m.track[max(k - 1, 0)] + share * (m.track[k] - m.track[max(k - 1, 0)]))[axis])

    transfer, tactical = at(90.0, 1), at(180.0, 1)
    found: dict[str, float | None] = {
        "advance": at(90.0, 0),
        "transfer": None if transfer is None else side * transfer,
        "tactical_diameter": None if tactical is None else side * tactical,
    }
    steady = turned > 2.0 * math.pi
    if not steady.any():
        return {**found, "steady_diameter": None, "steady_yaw_rate_deg": None, "steady_drift_deg": None}
    surge, sway, yaw_rate = m.velocity[steady].mean(axis=0).tolist()
    speed, before = math.hypot(surge, sway), float(np.hypot(*m.velocity[0, :2]))
    return {
        **found,
        "steady_diameter": 2.0 * speed / abs(yaw_rate),
        "steady_yaw_rate_deg": math.degrees(yaw_rate),
        "steady_drift_deg": math.degrees(math.atan2(-sway, surge)),
        "speed_loss": 100.0 * (1.0 - speed / before),
    }


def spiral_curve(settings: SpiralSettings, m: Motion) -> Array:
    """Rudder [rad] and steady yaw rate [rad/s] (k, 2) of each step of a spiral that was done to its end."""
    curve = []
    for index, rudder in enumerate(settings.rudders_deg):
        end = (index + 1) * settings.hold
        steady = (m.time > end - STEADY * settings.hold) & (m.time <= end + 1e-6)
        if steady.any() and m.time[-1] >= end - 0.11:  # the last order ends a control period before
            curve.append((math.radians(rudder), float(m.velocity[steady, 2].mean())))
    return np.array(curve, dtype=float).reshape(-1, 2)


def spiral(settings: SpiralSettings, m: Motion) -> dict[str, float | None]:
    """Figures of a spiral: without a loop between the two ways the vehicle is stable on a straight course."""
    curve = spiral_curve(settings, m)
    found: dict[str, float | None] = {"slope": None, "residual_yaw_rate_deg": None, "loop_deg": None}
    middle = len(settings.rudders_deg) // 2
    if len(curve) > middle:
        down = curve[: middle + 1][::-1]  # by increasing rudder
        step = math.radians(settings.step_deg)
        found["residual_yaw_rate_deg"] = math.degrees(np.interp(0.0, *down.T))
        found["slope"] = float(np.interp(step, *down.T) - np.interp(-step, *down.T)) / (2.0 * step)
    if len(curve) == len(settings.rudders_deg):
        found["loop_deg"] = math.degrees(np.abs(curve[: middle + 1, 1] - curve[middle:, 1][::-1]).max())
    return found


def steady_speeds(step_time: float, m: Motion) -> Array:
    """Shaft speed [rad/s] and surge [m/s] (k, 2) at the end of each speed step."""
    rows = []
    for end in np.arange(step_time, m.time[-1] + 0.11, step_time):
        steady = (m.time > end - STEADY * step_time) & (m.time <= end - 0.05)
        rows.append((float(m.shaft_speed[steady].mean()), float(m.velocity[steady, 0].mean())))
    return np.array(rows, dtype=float).reshape(-1, 2)
