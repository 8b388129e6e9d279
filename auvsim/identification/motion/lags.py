"""How much later than positions and heading the sensors of velocity show a motion: constants found without a model."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from auvsim.identification.records import MEASURED, Record
from estimators.core.types import Array

LONGEST = 2.0  # of a lag [s]
SMALL = 0.05  # lags below this are none [s]
WINDOW = 30.0  # over which dead reckoning is compared with positions [s]
CLEAR = 3.0  # deviations by which a lag must differ from none
_PAIRS = (("ground_surge", "ground_sway"), ("surge", "sway"))


@dataclass(frozen=True, kw_only=True, slots=True)
class Lags:
    """Lags of the sensors [s]; positive: they show late."""

    velocity: float = 0.0
    yaw_rate: float = 0.0
    velocity_deviation: float = np.inf
    yaw_rate_deviation: float = np.inf

    @property
    def notes(self) -> list[str]:
        """What is to be said of them."""
        named = (
            ("velocities show", "positions", self.velocity, self.velocity_deviation),
            ("the yaw rate shows", "the heading", self.yaw_rate, self.yaw_rate_deviation),
        )
        return [
            f"{what} {abs(lag):.2f} s {'later' if lag > 0.0 else 'earlier'} than {against} (standard deviation "
            f"{deviation:.2f} s): taken out"
            for what, against, lag, deviation in named
            if lag
        ]


def find(records: Sequence[Record]) -> Lags:
    """Lags common to all records; zero where they do not show clearly."""
    speed, speed_deviation = _lag([_reckoning(record) for record in records])
    rate, rate_deviation = _lag([_turning(record) for record in records])
    return Lags(velocity=speed, velocity_deviation=speed_deviation, yaw_rate=rate, yaw_rate_deviation=rate_deviation)


def without(record: Record, lags: Lags) -> Record:
    """The record with what its sensors show moved to when it was true."""
    measured = record.measured.copy()
    for name, lag in (
        *((name, lags.velocity) for pair in _PAIRS for name in pair), ("yaw_rate", lags.yaw_rate)
    ):  # fmt: skip
        c = MEASURED.index(name)
        seen = np.flatnonzero(np.isfinite(measured[:, c]))
        if not lag or len(seen) < 2:
            continue
        times = record.times[seen] - lag
        if len(seen) > 0.5 * len(record.times):
            inside = (record.times >= times[0]) & (record.times <= times[-1])
            measured[:, c] = np.where(inside, np.interp(record.times, times, measured[seen, c]), np.nan)
        else:  # slow sensors: to the nearest time of the grid, and there by the local slope
            at = np.clip(np.rint((times - record.times[0]) / record.step).astype(int), 0, len(record.times) - 1)
            moved = measured[seen, c] + np.gradient(measured[seen, c], times) * (record.times[at] - times)
            measured[:, c] = np.nan
            measured[at, c] = moved
    return replace(record, measured=measured)


def _lag(residuals: Sequence[Callable[[float], Array] | None]) -> tuple[float, float]:
    """The lag of least squares of residuals (b, w) of it, and its deviation by the jackknife of blocks."""
    there = [residual for residual in residuals if residual is not None]
    tried = np.arange(-LONGEST, LONGEST + 0.01, 0.1)
    if not there:
        return 0.0, np.inf
    costs = np.array([np.concatenate([np.sum(np.abs(of(lag)) ** 2, axis=1) for of in there]) for lag in tried])
    best = _lowest(tried, costs.sum(axis=1))
    count = costs.shape[1]
    if count < 4:
        return 0.0, np.inf
    groups = np.array_split(np.arange(count), min(count, 20))
    others = np.array([_lowest(tried, np.delete(costs, group, axis=1).sum(axis=1)) for group in groups])
    deviation = float(np.sqrt((len(groups) - 1) / len(groups) * np.sum((others - others.mean()) ** 2)))
    clear = SMALL < abs(best) < LONGEST - 0.2 and abs(best) > CLEAR * deviation
    return (best if clear else 0.0), max(deviation, 1e-3)


def _lowest(tried: Array, costs: Array) -> float:
    """The place of the lowest cost, by a parabola through it and its neighbours."""
    k = int(np.clip(np.argmin(costs), 1, len(tried) - 2))
    before, here, after = costs[k - 1 : k + 2]
    curvature = before - 2.0 * here + after
    aside = 0.5 * (before - after) / curvature if curvature > 0.0 else 0.0
    return float(tried[k] + np.clip(aside, -1.0, 1.0) * (tried[1] - tried[0]))


def _reckoning(record: Record) -> Callable[[float], Array] | None:
    """Residuals of positions about dead reckoning and a steady drift, in windows, as a function of velocities' lag."""
    north, east, heading = (record.measured[:, MEASURED.index(name)] for name in ("north", "east", "heading"))
    for pair in _PAIRS:
        surge, sway = (record.measured[:, MEASURED.index(name)] for name in pair)
        if np.isfinite(surge).sum() > 10:
            break
    else:
        return None
    fixes = np.flatnonzero(np.isfinite(north) & np.isfinite(east))
    turned = np.flatnonzero(np.isfinite(heading))
    if len(fixes) < 10 or len(turned) < 10:
        return None
    times, ahead = record.times, np.flatnonzero(np.isfinite(surge))
    aside = np.flatnonzero(np.isfinite(sway))
    turn = np.exp(1j * np.interp(times, times[turned], heading[turned]))
    places = (north + 1j * east)[fixes]
    per = max(4, round(WINDOW / float(np.median(np.diff(times[fixes])))))
    windows = [fixes[k : k + per] for k in range(0, len(fixes) - per + 1, per)]
    if not windows:
        return None
    values = [places[k : k + per] for k in range(0, len(fixes) - per + 1, per)]

    def residuals(lag: float) -> Array:
        u = np.interp(times, times[ahead] - lag, surge[ahead])
        v = np.interp(times, times[aside] - lag, sway[aside]) if len(aside) else 0.0
        velocity = turn * (u + 1j * v)
        way = np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * np.diff(times))])
        found = []
        for at, seen in zip(windows, values, strict=True):
            A = np.column_stack([np.ones(per), times[at] - times[at[0]]])
            off = seen - way[at]
            found.append(off - A @ np.linalg.lstsq(A, off, rcond=None)[0])
        return np.array(found)

    return residuals


def _turning(record: Record) -> Callable[[float], Array] | None:
    """Residuals of the heading about the integrated yaw rate and its steady error, in windows, by the rate's lag."""
    heading, gyro = (record.measured[:, MEASURED.index(name)] for name in ("heading", "yaw_rate"))
    turned, rated = np.flatnonzero(np.isfinite(heading)), np.flatnonzero(np.isfinite(gyro))
    if len(turned) < 20 or len(rated) < 20:
        return None
    times = record.times
    per = max(4, round(WINDOW / float(np.median(np.diff(times[turned])))))
    windows = [turned[k : k + per] for k in range(0, len(turned) - per + 1, per)]
    if not windows:
        return None

    def residuals(lag: float) -> Array:
        rate = np.interp(times, times[rated] - lag, gyro[rated])
        way = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(times))])
        found = []
        for at in windows:
            A = np.column_stack([np.ones(per), times[at] - times[at[0]]])
            off = heading[at] - way[at]
            found.append(off - A @ np.linalg.lstsq(A, off, rcond=None)[0])
        return np.array(found)

    return residuals
