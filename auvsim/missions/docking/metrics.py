"""What a trial came to: pure functions of its log."""

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvsim.base.frames import Array, wrap
from auvsim.data.log import PHASES, WALL_TIME, TrialLog
from auvsim.missions.docking.dock_frame import in_dock_frame, nose_position, to_body
from auvsim.missions.docking.guidance import Phase
from estimators.core.consistency import chi_square, interval, normalised_square
from estimators.docking.usbl import UsblFix, UsblModel

FAILURES = ("timeout", "diverged", "aborted")  # kinds of event that end a trial without docking
ENTERING = ("approach", "final", "docked")  # phases in which passing the mouth's plane is an entrance
NEES_INTERVAL = interval(2)  # 95 % of the NEES of a horizontal position


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


@dataclass(frozen=True, kw_only=True, slots=True)
class EstimateErrors:
    """Estimate minus truth at each estimate, and what the filter claims."""

    time: Array  # (n,) [s]
    phase: NDArray[np.int64]  # (n,) index into PHASES, -1 before the first
    initialised: NDArray[np.bool_]  # (n,)
    position: Array  # (n, 3) north, east, down [m]
    heading: Array  # (n,) wrapped [rad]
    velocity: Array  # (n, 3) u, v through the water [m/s], r [rad/s]
    current: Array  # (n, 2) north, east [m/s]
    sigma: Array  # (n, 8) claimed standard deviations of north, east, heading, u, v, r, current; 0 where not estimated
    nees: Array  # (n,) of the horizontal position, 2 degrees of freedom; NaN where the covariance is singular


@dataclass(frozen=True, kw_only=True, slots=True)
class EstimateQuality:
    """Estimate errors over some part of a trial; None where there is nothing to average."""

    samples: int
    position_rms: float | None  # horizontal [m]
    heading_rms_deg: float | None  # [deg]
    velocity_rms: float | None  # of u and v together [m/s]
    current_rms: float | None  # horizontal [m/s]
    nees_per_dof: float | None  # of the horizontal position; 1 is expected
    coverage_95: float | None  # share of truths inside the 95 % ellipse of the horizontal position


@dataclass(frozen=True, kw_only=True, slots=True)
class Summary:
    """A trial in a few numbers."""

    status: str
    docked: bool
    failure_reason: str | None  # timeout, diverged, aborted or interrupted; None when docked
    failure_text: str | None  # what the log says of it
    attempts: int
    time: float  # of docking, or of the end [s]
    miss_distance: float | None  # first crossing of the last attempt that has one [m]
    heading_error_deg: float | None  # at that crossing [deg]
    crossings: tuple[Crossing, ...]
    contact_impulse: float  # until the latch held; what the current then presses against the dock is no impact [N s]
    peak_contact_force: float  # of the same contacts [N]
    estimate: dict[str, EstimateQuality]  # "all" before docking, and each phase that has estimates; once initialised
    fixes_sent: int
    fixes_lost: int
    fixes_outliers: int  # that arrived
    fixes_refused: int  # by the estimator
    real_time_factor: float | None  # simulated over wall-clock time

    def to_dict(self) -> dict[str, Any]:
        """Plain values for strict JSON: what is not a finite number is None."""
        return _plain(dataclasses.asdict(self))


def summarise(log: TrialLog) -> Summary:
    """The summary of a trial."""
    passed = crossings(log)
    last = next((c for c in passed if c.attempt == passed[-1].attempt), None)
    docked_at = _docking_time(log)
    reason, text = (None, None) if docked_at is not None else _failure(log)
    usbl, contact = log["usbl"], log["contact"]
    entry = slice(None if docked_at is None else int(np.searchsorted(contact["time"], docked_at, side="right")))
    end, wall = _end(log), log.number(WALL_TIME)
    return Summary(
        status=str(log.attributes["status"]),
        docked=docked_at is not None,
        failure_reason=reason,
        failure_text=text,
        attempts=int(log["guidance"]["attempt"].max(initial=0)),
        time=end if docked_at is None else docked_at,
        miss_distance=last.miss_distance if last else None,
        heading_error_deg=last.heading_error_deg if last else None,
        crossings=passed,
        contact_impulse=float(contact["impulse"][entry].max(initial=0.0)),
        peak_contact_force=float(contact["force"][entry].max(initial=0.0)),
        estimate=estimate_quality(estimate_errors(log)),
        fixes_sent=len(usbl["time"]),
        fixes_lost=int(usbl["lost"].sum()),
        fixes_outliers=int((usbl["outlier"] & ~usbl["lost"]).sum()),
        fixes_refused=int(log["estimate"]["refused"].max(initial=0)),
        real_time_factor=end / wall if wall > 0.0 else None,
    )


def crossings(log: TrialLog) -> tuple[Crossing, ...]:
    """Every time the nose truly passes the mouth's plane inward on an approach, interpolated between samples."""
    truth, heading = log["truth"], log.number("dock_heading")
    nose = in_dock_frame(log, nose_position(log))
    along = nose[:, 0]
    found = []
    for i in np.flatnonzero((along[:-1] < 0.0) & (along[1:] >= 0.0)):
        fraction = -along[i] / (along[i + 1] - along[i])
        _, cross, down = nose[i] + fraction * (nose[i + 1] - nose[i])
        start, end = truth["attitude"][i : i + 2, 2]
        time = float(truth["time"][i] + fraction * (truth["time"][i + 1] - truth["time"][i]))
        phase, attempt = phase_at(log, np.array([time]))[0], _latest(log, "attempt", np.array([time]), 1)[0]
        if phase >= 0 and PHASES[phase] not in ENTERING:
            continue
        found.append(
            Crossing(
                time=time,
                attempt=int(attempt),
                phase=PHASES[phase] if phase >= 0 else "",
                miss_distance=math.hypot(cross, down),
                cross_track=float(cross),
                vertical=float(down),
                heading_error_deg=math.degrees(wrap(start + fraction * wrap(end - start) - heading)),
            )
        )
    return tuple(found)


def estimate_errors(log: TrialLog) -> EstimateErrors:
    """Estimates against the truth interpolated to their times; the velocities through the water."""
    estimate, truth = log["estimate"], log["truth"]
    time, covariance = estimate["time"], estimate["covariance"]
    through_water = truth["nu"][:, [0, 1, 5]]
    through_water[:, :2] -= to_body(truth["quaternion"], truth["current"])[:, :2]
    position = estimate["position"] - _interpolate(time, truth["time"], truth["position"])
    heading = _interpolate(time, truth["time"], np.unwrap(truth["attitude"][:, 2]))
    nees = np.full(len(time), math.nan)
    horizontal = covariance[:, :2, :2]
    finite = np.isfinite(position[:, :2].sum(axis=1) + horizontal.sum(axis=(1, 2)))
    regular = finite & (np.linalg.det(np.where(finite[:, None, None], horizontal, 0.0)) > 0.0)
    nees[regular] = normalised_square(position[regular, :2], horizontal[regular])
    return EstimateErrors(
        time=time,
        phase=phase_at(log, time),
        initialised=estimate["initialised"],
        position=position,
        heading=np.array([wrap(error) for error in (estimate["heading"] - heading).tolist()]),
        velocity=estimate["velocity"] - _interpolate(time, truth["time"], through_water),
        current=estimate["current"] - _interpolate(time, truth["time"], truth["current"][:, :2]),
        sigma=np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0)),
        nees=nees,
    )


def estimate_quality(errors: EstimateErrors) -> dict[str, EstimateQuality]:
    """Root-mean-square errors and consistency, phase by phase and over all initialised estimates before docking.

    Once the latch holds it, the vehicle no longer moves as any model of free motion says; "all" leaves that out.
    """
    parts = {"all": errors.initialised & (errors.phase != Phase.DOCKED)}
    parts |= {name: errors.initialised & (errors.phase == index) for index, name in enumerate(PHASES)}
    limit = chi_square(0.95, 2)
    qualities = {}
    for name, part in parts.items():
        if name != "all" and not part.any():
            continue
        nees = errors.nees[part & np.isfinite(errors.nees)]
        qualities[name] = EstimateQuality(
            samples=int(part.sum()),
            position_rms=_rms(errors.position[part, :2]),
            heading_rms_deg=_rms(np.degrees(errors.heading[part, None])),
            velocity_rms=_rms(errors.velocity[part, :2]),
            current_rms=_rms(errors.current[part]),
            nees_per_dof=float(nees.mean() / 2.0) if len(nees) else None,
            coverage_95=float((nees <= limit).mean()) if len(nees) else None,
        )
    return qualities


def fixes(log: TrialLog) -> Array:
    """Horizontal NED positions (n, 2) [m] of the transponder that the USBL packets say, lost ones included."""
    forward, starboard, down = (log.number(f"transceiver_{axis}") for axis in ("forward", "starboard", "down"))
    model, packets = UsblModel(transceiver=(forward, starboard, down)), log["usbl"]["value"]
    found = [UsblFix(stamp=0.0, received=0.0, position=p[:3], heading=p[3], pitch=p[4], roll=p[5]) for p in packets]
    return np.array([model.world_fix(fix).value for fix in found], dtype=float).reshape(len(packets), 2)


def phase_at(log: TrialLog, times: Array) -> NDArray[np.int64]:
    """Index into PHASES of the phase at each time; -1 before the first."""
    return _latest(log, "phase", times, -1)


def phase_stretches(phases: NDArray[Any]) -> Iterator[tuple[int, int, int]]:
    """Phase, first index and index of the next stretch's first (the last index at the end) of each run of phases."""
    if not len(phases):
        return
    starts = np.concatenate([[0], np.flatnonzero(np.diff(phases)) + 1, [len(phases) - 1]])
    for start, stop in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        if stop > start:
            yield int(phases[start]), start, stop


def _latest(log: TrialLog, name: str, times: Array, before: int) -> NDArray[np.int64]:
    """The last value of a guidance variable at or before each time."""
    values = np.concatenate([[before], log["guidance"][name].astype(int)])
    return values[np.searchsorted(log["guidance"]["time"], times, side="right")]


def _docking_time(log: TrialLog) -> float | None:
    docked = log["event"]["time"][log["event"]["kind"] == "docked"]
    if not len(docked):
        docked = log["guidance"]["time"][log["guidance"]["phase"] == Phase.DOCKED]
    return float(docked[0]) if len(docked) else None


def _failure(log: TrialLog) -> tuple[str, str | None]:
    """Why a trial did not dock: how it ended, else the last event that says so."""
    events = [(k, t) for k, t in zip(log["event"]["kind"], log["event"]["text"], strict=True) if k in FAILURES]
    status = str(log.attributes["status"])
    if status != "complete":
        return status, next((text for kind, text in reversed(events) if kind == status), None)
    if events:
        return events[-1]
    aborted = log["guidance"]["phase"][-1:].tolist() == [Phase.ABORTED]
    return ("aborted" if aborted else "timeout"), None


def _end(log: TrialLog) -> float:
    """The last time that anything was logged as it happened [s]."""
    return max(float(log[group]["time"].max(initial=0.0)) for group in ("truth", "guidance", "command", "event"))


def _interpolate(times: Array, known: Array, values: Array) -> Array:
    """Columns of values (n, ...) at other times, linearly; NaN without values."""
    if not len(known):
        return np.full((len(times), *values.shape[1:]), math.nan)
    if values.ndim == 1:
        return np.interp(times, known, values)
    return np.stack([np.interp(times, known, column) for column in values.T], axis=-1)


def _rms(errors: Array) -> float | None:
    """Root of the mean squared length of error vectors (n, k); those that are not finite do not count."""
    squares = np.square(errors[np.isfinite(errors).all(axis=1)]).sum(axis=1)
    return float(np.sqrt(squares.mean())) if len(squares) else None


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
