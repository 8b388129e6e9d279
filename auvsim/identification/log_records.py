"""Trial logs as signals: what the vehicle and its dock measured, never the truth."""

import math
from pathlib import Path

import numpy as np

from auvsim.analysis.estimates import fixes, usbl_dock
from auvsim.base.errors import InputError
from auvsim.data.log import VehicleLog, read
from auvsim.identification.signals import MARGIN, Signal, Signals, steep, stretches
from auvsim.missions.manoeuvres import laws as manoeuvres
from auvsim.missions.manoeuvres.settings import ManoeuvreMissionSettings
from auvsim.simulation import scenario
from auvsim.simulation.scenario_settings import VehicleSettings
from auvsim.vehicles import library, model_files
from auvsim.vehicles.actuation import FinsAndShaft
from estimators.core.types import Array


def signals(path: Path) -> tuple[list[Signals], list[str], str]:
    """The manoeuvre of a trial log as signals, notes, and the vehicle's model.

    Raises:
        InputError: It is no whole log, or has neither fins nor heading in it.
    """
    log = read(path).vehicle()
    name = path.name
    with model_files.given(log.log.models):
        plan = scenario.from_yaml(str(log.log.attributes["scenario"]), f"{path}: scenario").vehicles[log.name]
        vehicle = library.vehicle(plan.model)
    for group, what in (("feedback", "fins and shaft"), ("compass", "heading")):
        if group not in log or len(log[group]["time"]) < 2:
            raise InputError(f"{path}: no readings of {group}; a fit needs {what}, log a trial of some minutes")
    feedback = log["feedback"]
    times = feedback["time"]
    found = {
        "rudder": Signal(times=times, values=_rudder(vehicle.actuation, feedback["value"])),
        "shaft_speed": Signal(times=times, values=feedback["value"][:, -1]),
        "heading": Signal(times=log["compass"]["time"], values=np.unwrap(log["compass"]["value"][:, 0])),
    }
    if "gyro" in log and len(log["gyro"]["time"]):
        found["yaw_rate"] = Signal(times=log["gyro"]["time"], values=log["gyro"]["value"][:, 2])
    tracks = ((0, "ground_surge"), (1, "ground_sway"), (3, "surge"), (4, "sway")) if "dvl" in log else ()
    for column, quantity in tracks:
        values = log["dvl"]["value"][:, column]
        there = np.isfinite(values)
        if there.sum() > 1:
            found[quantity] = Signal(times=log["dvl"]["time"][there], values=values[there])
    found_at, where, _ = places(log, found["heading"], plan.sensors.usbl.transponder)
    if len(where) > 1:
        found |= {axis: Signal(times=where, values=found_at[:, k]) for k, axis in enumerate(("north", "east"))}
    excluded = _excluded(log)
    end = float(times[-1])
    out = sum(min(stop, end) - start for start, stop in excluded)
    notes = [f"{name}: {out:.0f} s left out: pitched, astern, or in the dock"] if excluded else []
    deviations = _deviations(plan, found_at - usbl_dock(log).position[:2] if len(found_at) else found_at)
    made = [
        Signals(
            name=label, kind=kind, signals=found, deviations=deviations,
            excluded=(*excluded, (-math.inf, start), (stop, math.inf)),
        )
        for label, kind, start, stop in parts(plan, name)
    ]  # fmt: skip
    return made, notes, plan.model


def parts(plan: VehicleSettings, name: str) -> list[tuple[str, str, float, float]]:
    """Label, kind, start and end [s] of each manoeuvre of a log."""
    if not isinstance(plan.mission, ManoeuvreMissionSettings):
        return [(name, "docking", -math.inf, math.inf)]
    found = list(manoeuvres.parts(plan.mission.manoeuvre))
    if len(found) == 1:
        return [(name, found[0].settings.kind, -math.inf, math.inf)]
    ends = [*(part.start for part in found[1:]), math.inf]
    return [(f"{name}, {p.settings.kind}", p.settings.kind, p.start, end) for p, end in zip(found, ends, strict=True)]


def _rudder(actuation: FinsAndShaft, channels: Array) -> Array:
    return np.array([actuation.effective(row).rudder for row in channels.tolist()])


def places(log: VehicleLog, heading: Signal, transponder: tuple[float, float, float]) -> tuple[Array, Array, Array]:
    """North and east (n, 2) [m] of the body's origin by fixes that arrived, in order of their stamps (n,) [s].

    The last is when each arrived (n,) [s].
    """
    if "usbl" not in log:
        return np.empty((0, 2)), np.empty(0), np.empty(0)
    arrived = np.isfinite(log["usbl"]["received"])
    stamps, first = np.unique(log["usbl"]["time"][arrived], return_index=True)
    where = fixes(log)[arrived][first]
    psi = np.interp(stamps, heading.times, heading.values)
    forward, starboard, _ = transponder
    arm = (forward + 1j * starboard) * np.exp(1j * psi)
    return where - np.column_stack([arm.real, arm.imag]), stamps, log["usbl"]["received"][arrived][first]


def _deviations(plan: VehicleSettings, places: Array) -> dict[str, float]:
    """Standard deviations of one reading, as the scenario's data sheets say; places are seen from the dock."""
    sensors = plan.sensors
    distance = float(np.median(np.hypot(*places.T))) if len(places) else 1.0
    fix = sensors.usbl.sigma(distance)
    given = {
        "north": fix, "east": fix,
        "heading": math.radians(sensors.compass.heading_noise_deg),
        "surge": sensors.dvl.water_noise[0], "sway": sensors.dvl.water_noise[1],
        "yaw_rate": math.radians(sensors.gyro.noise_density_deg) * math.sqrt(sensors.gyro.rate),
        "ground_surge": sensors.dvl.bottom_noise[0], "ground_sway": sensors.dvl.bottom_noise[1],
    }  # fmt: skip
    return {quantity: deviation for quantity, deviation in given.items() if deviation > 0.0}


def _excluded(log: VehicleLog) -> tuple[tuple[float, float], ...]:
    """Spans in which the vehicle is steep, goes astern, or has come to the dock."""
    compass, feedback, mission = log["compass"], log["feedback"], log["mission"]
    spans = steep(Signal(times=compass["time"], values=compass["value"][:, 1]))
    spans += stretches(feedback["time"], feedback["value"][:, -1] < 0.0)
    docked = mission["phase"] == (log.phases.index("docked") if "docked" in log.phases else -1)
    ends = [mission["time"][docked], log["contact"]["time"]]
    first = min((float(times[0]) for times in ends if len(times)), default=math.inf)
    return (*spans, *([(first - MARGIN, math.inf)] if math.isfinite(first) else []))
