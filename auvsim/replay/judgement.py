"""How well an estimator did on a recording: errors and NEES where there is truth, NIS and whiteness by sensor."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvsim.analysis.estimates import EstimateErrors, EstimateQuality, estimate_errors, estimate_quality
from auvsim.base.errors import InputError
from auvsim.data import log as logs
from auvsim.data.log import Log
from auvsim.data.variables import ESTIMATE, MEASUREMENTS, Variable
from auvsim.replay.run import Replayed
from estimators.core.consistency import interval, ljung_box, whiten
from estimators.core.innovations import Innovated
from estimators.core.types import Outcome

LAGS = 10  # of the test of whiteness


@dataclass(frozen=True, kw_only=True, slots=True)
class SensorQuality:
    """What the innovations of one sensor, or one source of a kind, say of the filter."""

    sensor: str
    readings: int  # decided
    refused: int
    residual_rms: tuple[float, ...]  # of those accepted, by component [their units]; empty where it is not known
    nis: float  # mean of those accepted per degree of freedom; NaN where none is known
    nis_interval: tuple[float, float]  # 95 %, of a consistent filter
    whiteness: float  # probability of autocorrelations as large, of white ones (Ljung-Box); NaN where not known


@dataclass(frozen=True, kw_only=True, slots=True)
class Judgement:
    """An estimator on a recording."""

    replayed: Replayed
    errors: EstimateErrors | None  # where there is truth
    quality: EstimateQuality | None
    sensors: tuple[SensorQuality, ...]


def judge(replayed: Replayed) -> Judgement:
    """Judges an estimator."""
    errors = quality = None
    if replayed.recording.vehicle is not None:
        vehicle = as_log(replayed).vehicle(replayed.recording.vehicle.name)
        errors = estimate_errors(vehicle)
        quality = estimate_quality(errors, vehicle.phases)["all"]
    return Judgement(replayed=replayed, errors=errors, quality=quality, sensors=tuple(_sensors(replayed)))


def by_sensor(innovations: list[Innovated]) -> dict[str, list[Innovated]]:
    """Innovations by source or, where a kind has one source, by kind."""
    found: dict[str, list[Innovated]] = {}
    for one in innovations:
        found.setdefault(one.measurement.source or one.measurement.kind, []).append(one)
    return found


def outcomes(replayed: Replayed) -> dict[str, list[Outcome]]:
    """The last word on each measurement, by source or kind."""
    last = {
        (o.kind, o.source, o.stamp, o.sequence, o.reason == "duplicate"): o
        for e in replayed.estimates
        for o in e.outcomes
    }
    found: dict[str, list[Outcome]] = {}
    for o in last.values():
        found.setdefault(o.source or o.kind, []).append(o)
    return found


def _sensors(replayed: Replayed) -> Iterator[SensorQuality]:
    innovated = by_sensor(replayed.innovations)
    for name, decided in sorted(outcomes(replayed).items()):
        refused = sum(not o.accepted for o in decided)
        used = [one for one in innovated.get(name, []) if one.accepted]
        if used:
            residuals = np.array([one.residual for one in used])
            white = whiten(residuals, np.array([one.covariance for one in used]))
            rms = tuple(np.sqrt(np.mean(residuals**2, axis=0)).tolist())
            values, size = np.sum(white**2, axis=1), white.shape[1]
            whiteness = ljung_box(white, LAGS).probability if len(white) >= 2 * LAGS else math.nan
        else:
            values = np.array([o.nis for o in decided if o.accepted and math.isfinite(o.nis)])
            rms, size, whiteness = (), 2 if name in ("usbl", "fix") else 1, math.nan
        bounds = interval(size, len(values)) if len(values) else (math.nan, math.nan)
        yield SensorQuality(
            sensor=name, readings=len(decided), refused=refused, residual_rms=rms,
            nis=float(values.mean()) / size if len(values) else math.nan,
            nis_interval=(bounds[0] / size, bounds[1] / size), whiteness=whiteness,
        )  # fmt: skip


def as_log(replayed: Replayed) -> Log:
    """The trial's log with the estimates of this estimator in place of its own.

    Raises:
        InputError: It is no trial's log.
    """
    vehicle = replayed.recording.vehicle
    if vehicle is None:
        raise InputError(f"{replayed.recording.name}: only a trial's log can hold other estimates")
    log, at = vehicle.log, f"vehicles/{vehicle.name}"
    labels = tuple(replayed.states)
    table = dict(ESTIMATE) | {
        "mean": replace(ESTIMATE["mean"], labels=labels, units=", ".join(replayed.states.values())),
        "covariance": replace(ESTIMATE["covariance"], labels=labels),
    }
    groups = {f"{at}/estimate": (table, estimate_columns(replayed)), f"{at}/measurements": _measurements(replayed)}
    attributes = log.group_attributes[at] | {"estimator": replayed.estimator}
    return Log(
        log.groups | {path: columns for path, (_, columns) in groups.items()},
        log.tables | {path: dict(table) for path, (table, _) in groups.items()},
        log.attributes,
        log.group_attributes | {at: attributes},
    )


def estimate_columns(replayed: Replayed) -> dict[str, NDArray[Any]]:
    """The columns of the log's group of estimates."""
    e, n = replayed.estimates, len(replayed.states)
    return {
        "time": np.array([x.time for x in e], dtype=float),
        "mean": np.array([x.state for x in e], dtype=float).reshape(-1, n),
        "covariance": np.array([x.covariance for x in e], dtype=float).reshape(-1, n, n),
        "position": np.array([x.position for x in e], dtype=float).reshape(-1, 3),
        "heading": np.array([x.heading for x in e], dtype=float),
        "velocity": np.array([x.velocity for x in e], dtype=float).reshape(-1, 3),
        "current": np.array([x.current for x in e], dtype=float).reshape(-1, 2),
        "initialised": np.array([x.initialised for x in e], dtype=bool),
        "refused": np.array([x.refused for x in e], dtype=np.int32),
    }


def _measurements(replayed: Replayed) -> tuple[Mapping[str, Variable], dict[str, Any]]:
    rows = [
        (e.time, o.source or o.kind, o.stamp, o.sequence, o.accepted, o.reason, o.nis)
        for e in replayed.estimates
        for o in e.outcomes
    ]
    names = zip(MEASUREMENTS, zip(*rows, strict=True) if rows else [()] * len(MEASUREMENTS), strict=True)
    return MEASUREMENTS, {name: np.array(values, dtype=MEASUREMENTS[name].array_type) for name, values in names}


def same(replayed: Replayed) -> list[str]:
    """What of the estimates is not, bit for bit, what the trial's log says."""
    vehicle = replayed.recording.vehicle
    assert vehicle is not None
    return logs.differences(vehicle.log, as_log(replayed))
