"""What engineers read off a manoeuvre: pure functions of a log's truth, relative to the water.

Definitions: IMO MSC.137(76) and MSC/Circ.1053, ITTC 7.5-02-06-01. The track is that through the water, so that a
current, which those trials are corrected for, does not matter.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.data.log import TrialLog
from auvsim.missions.docking.dock_frame import to_body
from auvsim.missions.docking.guidance import Phase
from auvsim.missions.manoeuvres import laws as manoeuvres
from auvsim.missions.manoeuvres.settings import (
    CircleSettings,
    ManoeuvreSettings,
    Simple,
    SpiralSettings,
    StraightSettings,
    ZigzagSettings,
)
from auvsim.simulation import scenario

STEADY = 0.25  # last share of a held rudder or speed over which it counts as steady

# What a number is called in a table, with its unit; `figures` gives those that a manoeuvre has.
LABELS = {
    "duration": "duration after the approach [s]",
    "approach_speed": "speed at the end of the approach [m/s]",
    "rudder_deg": "largest rudder [deg]",
    "mean_speed": "mean surge [m/s]",
    "largest_yaw_rate_deg": "largest yaw rate [deg/s]",
    "largest_drift_deg": "largest drift angle [deg]",
    "largest_depth_error": "largest deviation from the depth [m]",
    "room": "largest distance from the start [m]",
    "switch_deg": "switching angle [deg]",
    "initial_turning_time": "initial turning time [s]",
    "first_overshoot_deg": "first overshoot [deg]",
    "second_overshoot_deg": "second overshoot [deg]",
    "mean_overshoot_deg": "mean overshoot [deg]",
    "period": "period [s]",
    "advance": "advance [m]",
    "transfer": "transfer [m]",
    "tactical_diameter": "tactical diameter [m]",
    "steady_diameter": "steady turning diameter [m]",
    "steady_yaw_rate_deg": "steady yaw rate [deg/s]",
    "steady_drift_deg": "steady drift angle [deg]",
    "speed_loss": "speed loss in the turn [%]",
    "slope": "yaw rate per rudder at zero [1/s]",
    "residual_yaw_rate_deg": "yaw rate at zero rudder [deg/s]",
    "loop_deg": "largest difference between the ways [deg/s]",
    "slowest": "steady surge at the lowest shaft speed [m/s]",
    "fastest": "steady surge at the highest shaft speed [m/s]",
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
    """The numbers of one manoeuvre of a log, by the keys of LABELS; None where it did not get so far."""

    kind: str
    start: float  # end of its approach [s]
    numbers: dict[str, float | None]


def is_manoeuvre(log: TrialLog) -> bool:
    """Whether a log is that of a manoeuvre instead of a docking trial."""
    return bool((log["guidance"]["phase"] == Phase.MANOEUVRE).any())


def settings(log: TrialLog) -> ManoeuvreSettings:
    """What manoeuvre a log is of.

    Raises:
        InputError: it is that of a docking trial.
    """
    found = scenario.from_yaml(str(log.attributes["scenario"]), "the log's scenario").manoeuvre
    if found is None:
        raise InputError("the log is that of a docking trial, not of a manoeuvre")
    return found


def parts(log: TrialLog) -> list[manoeuvres.Part]:
    """The manoeuvres of a log, several for a sequence.

    Raises:
        InputError: it is that of a docking trial.
    """
    return list(manoeuvres.parts(settings(log)))


def summary(log: TrialLog) -> dict[str, Any]:
    """Plain values for strict JSON: how the log ended, and the figures of each manoeuvre in it."""
    found = [{"kind": f.kind, "start": f.start, **f.numbers} for f in figures(log)]
    return {"status": log.attributes["status"], "manoeuvres": found}


def figures(log: TrialLog) -> list[Figures]:
    """What can be read off each manoeuvre of a log.

    Raises:
        InputError: it is that of a docking trial.
    """
    found = []
    for start, part in parts(log):
        moved = motion(log, start + part.approach, start + part.duration)
        if len(moved.time) > 1:
            numbers = _common(moved) | _particular(part, moved)
            found.append(Figures(kind=manoeuvres.name(part), start=start + part.approach, numbers=numbers))
    return found


def motion(log: TrialLog, start: float, end: float) -> Motion:
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


def _course(log: TrialLog, start: float) -> float:
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
            return {"switch_deg": settings.heading_deg, **zigzag(m)}
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


def zigzag(m: Motion) -> dict[str, float | None]:
    """Figures of a zig-zag: an overshoot is what the heading still turns after the rudder has changed sides."""
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
