"""A user's CSV or NetCDF file, with the columns that identification reads, as recordings."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from auvsim.acoustics.usbl import UsblSettings
from auvsim.base.errors import InputError
from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.identification import table_records
from auvsim.identification.columns import read_map
from auvsim.identification.signals import Signal, Signals
from auvsim.navigation.navigator import NavigatorSetup
from auvsim.navigation.settings import ReckoningSettings
from auvsim.physics import motion_models
from auvsim.replay.recording import Arrival, Recording
from auvsim.sensors.compass import CompassSettings
from auvsim.sensors.dvl import DvlSettings
from auvsim.sensors.fix import FixSettings
from auvsim.sensors.gyro import GyroSettings
from auvsim.simulation.setups import model_speed
from auvsim.vehicles import library
from auvsim.vehicles.actuation import Commands
from estimators.core.types import Array

STEP = 0.5  # time between two updates [s]
TRACKS = ("ground_surge", "ground_sway", "surge", "sway")


def recordings(
    path: Path, *, columns: Path | None = None, vehicle: str = "remus100"
) -> tuple[list[Recording], list[str]]:
    """The manoeuvres of a file as recordings, and notes on what was assumed, dropped or not understood.

    Args:
        path: Of the file.
        columns: A mapping file for its columns.
        vehicle: Name in models/, or the path of an MJCF file, for estimators that assume a model of it.

    Raises:
        InputError: It cannot be read, lacks a column, or holds what cannot be right.
    """
    found, notes = table_records.signals(path, {} if columns is None else read_map(columns), inputs=False)
    return [_recording(one, vehicle) for one in found], notes


def _recording(signals: Signals, vehicle: str) -> Recording:
    given = signals.signals
    start = min(float(s.times[0]) for s in given.values())
    end = max(float(s.times[-1]) for s in given.values())
    times = start + STEP * np.arange(math.floor((end - start) / STEP + 1e-6) + 1, dtype=np.float64)
    if len(times) < 2:
        raise InputError(f"{signals.name}: lasts {end - start:g} s; an estimator takes steps of {STEP:g} s")
    actuation, settings = library.vehicle(vehicle).actuation, _settings(signals)

    def setup(estimator: Any) -> NavigatorSetup:
        assumed = ReckoningSettings() if estimator is None else estimator
        return NavigatorSetup(
            vehicle=signals.name,
            settings=assumed,
            parameters=motion_models.assumed(getattr(assumed, "model", "condense"), vehicle, model_speed(assumed)),
            actuation=actuation,
            period=STEP,
            rates={name: own.rate for name, own in settings.items() if hasattr(own, "rate")},
            usbl=UsblSettings(),
            sensors=settings,
        )

    rudder, shaft = (_held(given.get(name), times) for name in ("rudder", "shaft_speed"))
    return Recording(
        name=signals.name,
        times=times,
        clock=times,
        commands=[Commands(r, 0.0, n) for r, n in zip(rudder, shaft, strict=True)],
        arrivals=list(_arrivals(signals)),
        setup=setup,
        own=ReckoningSettings(),
    )


def _settings(signals: Signals) -> dict[str, Any]:
    """What the file says, or its samples show, of each sensor; of what it does not say the usual."""
    given = signals.signals
    found: dict[str, Any] = {}
    if "heading" in given:
        noise = math.degrees(signals.deviation("heading"))
        found["compass"] = CompassSettings(rate=_rate(given["heading"]), heading_noise_deg=noise)
    if "yaw_rate" in given:
        rate = _rate(given["yaw_rate"])
        density = math.degrees(signals.deviation("yaw_rate")) / math.sqrt(rate)
        found["gyro"] = GyroSettings(enabled=True, rate=rate, noise_density_deg=density)
    tracks = [name for name in TRACKS if name in given]
    if tracks:
        u, v, through, across = (signals.deviation(name) for name in TRACKS)
        found["dvl"] = DvlSettings(
            enabled=True, rate=_rate(given[tracks[0]]), bottom_noise=(u, v, v), water_noise=(through, across, across)
        )
    if {"north", "east"} <= given.keys():
        found["fix"] = FixSettings(noise=signals.deviation("north"))
    return found


def _arrivals(signals: Signals) -> Iterator[Arrival]:
    given = signals.signals
    headings, rates = given.get("heading"), given.get("yaw_rate")
    if headings is not None:
        for k, (t, psi) in enumerate(zip(headings.times.tolist(), headings.values.tolist(), strict=True)):
            yield Arrival(Reading("compass", t, t, np.array((wrap(psi), 0.0, 0.0)), k), 0)
    for k, (t, values) in enumerate(_joined(given, TRACKS)):
        level = np.where(np.isnan(values[1::2]), math.nan, 0.0)  # no table says how fast it sinks
        value = np.array((*values[:2], level[0], *values[2:], level[1]))
        yield Arrival(Reading("dvl", t, t, value, k), 1)
    if rates is not None:
        for k, (t, r) in enumerate(zip(rates.times.tolist(), rates.values.tolist(), strict=True)):
            yield Arrival(Reading("gyro", t, t, np.array((0.0, 0.0, r)), k), 2)
    for k, (t, values) in enumerate(_joined(given, ("north", "east"))):
        if np.isfinite(values).all():
            yield Arrival(Reading("fix", t, t, values, k), 3)


def _joined(given: Any, names: tuple[str, ...]) -> Iterator[tuple[float, Array]]:
    """Times and values side by side, NaN where one has none then."""
    there = [given[name] for name in names if name in given]
    if not there:
        return
    times = np.unique(np.concatenate([s.times for s in there]))
    table = np.full((len(times), len(names)), math.nan)
    for column, name in enumerate(names):
        if name in given:
            table[np.searchsorted(times, given[name].times), column] = given[name].values
    yield from zip(times.tolist(), table, strict=True)


def _held(signal: Signal | None, times: Array) -> list[float]:
    if signal is None:
        return [0.0] * len(times)
    return signal.values[np.clip(np.searchsorted(signal.times, times, side="right") - 1, 0, None)].tolist()


def _rate(signal: Signal) -> float:
    return float(1.0 / np.median(np.diff(signal.times)))
