"""Signals as they were sampled, each at its own times, and the way from them to records on a grid."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import InputError
from auvsim.identification.reckoning import outliers
from auvsim.identification.records import MEASURED, Record
from estimators.core.types import Array

INPUTS = ("rudder", "shaft_speed")
WIND = ("wind_forward", "wind_starboard")
THRUSTERS = ("shaft_difference", "side_thruster")
SHORTEST = 10.0  # spans shorter than this hold less than the vehicle's own time constants [s]
MOST_STEPS = 1e7  # of a record; a hundred times those of a day at 1 Hz
GAP = 1.0  # missing inputs this long split a record; more slowly sampled ones at three of their intervals [s]
STEPS = (0.05, 0.5)  # shortest and longest of a grid: a vehicle's yaw takes about a second [s]
STEEP = math.radians(8.0)  # beyond this pitch a planar model does not hold
MARGIN = 1.0  # round what bars a span [s]
_SMOOTHING = 1.0  # of pitch, so that its noise does not count [s]
# Standard deviation of one sample where neither the file nor a mapping says: those of common small sensors.
DEVIATIONS = {
    "north": 0.5, "east": 0.5, "heading": math.radians(1.0), "surge": 0.02, "sway": 0.02,
    "yaw_rate": math.radians(0.1), "ground_surge": 0.01, "ground_sway": 0.01,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class Signal:
    """One quantity [SI] at the times when it was true, without NaN."""

    times: Array  # (n,) strictly increasing [s]
    values: Array  # (n,)
    held: bool = False  # stays as it is until the next sample, as a command does; else linear between samples


@dataclass(frozen=True, kw_only=True, slots=True)
class Signals:
    """What one file says of one manoeuvre."""

    name: str
    kind: str = ""  # of the manoeuvre
    signals: Mapping[str, Signal]  # by INPUTS and MEASURED
    deviations: Mapping[str, float] = field(default_factory=dict)  # of one sample, by MEASURED; else DEVIATIONS
    current: Array | None = None  # (2,) north, east [m/s]
    excluded: tuple[tuple[float, float], ...] = ()  # spans of time in which the vehicle was no planar one [s]

    def deviation(self, quantity: str) -> float:
        """Standard deviation of one sample."""
        return self.deviations.get(quantity, DEVIATIONS[quantity])


def records(signals: Signals, step: float | None = None) -> tuple[list[Record], list[str]]:
    """The uninterrupted spans of a manoeuvre as records, and notes on all that was left out.

    Args:
        signals: With both inputs.
        step: Of the grid [s]; the rudder's own if None.
    """
    signals, notes = _without_strays(signals)
    step = step or _usual_step(signals.signals["rudder"])
    found, short = [], 0.0
    spans = list(_spans(signals))
    for start, stop in spans:
        if stop - start < SHORTEST:
            short += stop - start
        else:
            name = signals.name if len(spans) == 1 else f"{signals.name}, {start:.0f} to {stop:.0f} s"
            found.append(_gridded(signals, start, stop, step, name))
    if short > 0.0:
        notes.append(f"{signals.name}: {short:.0f} s in spans shorter than {SHORTEST:g} s dropped")
    if len(spans) > 1:
        notes.append(f"{signals.name}: split into {len(found)} records where inputs are missing or not planar")
    return [record for record in found if np.isfinite(record.measured).any()], notes


def steep(pitch: Signal) -> list[tuple[float, float]]:
    """Spans of time in which a vehicle is pitched too far to be planar [s]."""
    width = max(1, round(_SMOOTHING / float(np.median(np.diff(pitch.times)))))
    smooth = np.convolve(pitch.values, np.ones(width) / width, mode="same")
    return stretches(pitch.times, np.abs(smooth) > STEEP)


def stretches(times: Array, wrong: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """First and last time of each stretch that is wrong, with a margin [s]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wrong, [False]]).astype(int)))
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(float(times[first]) - MARGIN, float(times[last - 1]) + MARGIN) for first, last in pairs]


def noise(signal: Signal, quantity: str) -> float:
    """Standard deviation of a sample's white noise by its third differences, to which a smooth motion adds little.

    Kept within a tenth and five times of DEVIATIONS: what is rounded coarsely shows no noise, what is sampled slowly
    too much.
    """
    usual = DEVIATIONS[quantity]
    if len(signal.values) < 20:
        return usual
    rough = 1.4826 * float(np.median(np.abs(np.diff(signal.values, 3)))) / math.sqrt(20.0)
    return min(max(rough, 0.1 * usual), 5.0 * usual)


def _usual_step(signal: Signal) -> float:
    return float(np.clip(round(float(np.median(np.diff(signal.times))), 4), *STEPS))


def _without_strays(signals: Signals) -> tuple[Signals, list[str]]:
    """The same without positions that no motion explains."""
    given = signals.signals
    if not {"north", "east"} <= given.keys():
        return signals, []
    wrong = outliers({name: (s.times, s.values) for name, s in given.items()}, signals.deviation("north"))
    if not wrong.any():
        return signals, []
    kept = {
        name: Signal(times=given[name].times[~wrong], values=given[name].values[~wrong]) for name in ("north", "east")
    }
    note = f"{signals.name}: {wrong.sum()} of {len(wrong)} positions dropped, far from where the others put the vehicle"
    changed = Signals(
        name=signals.name, kind=signals.kind, signals={**given, **kept}, deviations=signals.deviations,
        current=signals.current, excluded=signals.excluded,
    )  # fmt: skip
    return changed, [note]


def _spans(signals: Signals) -> Iterator[tuple[float, float]]:
    """Where both inputs are there without a gap and nothing bars them."""
    closed = [(low, high) for low, high in signals.excluded if high > low]
    start, stop = -math.inf, math.inf
    for name in INPUTS:
        times = signals.signals[name].times
        start, stop = max(start, float(times[0])), min(stop, float(times[-1]))
        widths = np.diff(times)
        longest = max(GAP, 3.0 * float(np.median(widths)))
        closed += [(float(times[k]), float(times[k + 1])) for k in np.flatnonzero(widths > longest)]
    for low, high in sorted(closed):
        if low > start:
            yield start, min(low, stop)
        start = max(start, high)
        if start >= stop:
            return
    if start < stop:
        yield start, stop


def _gridded(signals: Signals, start: float, stop: float, step: float, name: str) -> Record:
    if (stop - start) / step > MOST_STEPS:
        raise InputError(
            f"{name}: lasts {stop - start:g} s without a gap, more than {MOST_STEPS:g} steps of {step:g} s; is a time "
            "stamp wrong?"
        )
    times = start + step * np.arange(math.floor((stop - start) / step + 1e-6) + 1, dtype=np.float64)
    given = signals.signals
    inputs = np.column_stack([_means(given[quantity], times, step) for quantity in INPUTS])
    measured, deviations = np.full((len(times), len(MEASURED)), np.nan), np.ones(len(MEASURED))
    for c, quantity in enumerate(MEASURED):
        if quantity in given:
            measured[:, c], count = _moved(given[quantity], times, step)
            deviations[c] = signals.deviation(quantity) / math.sqrt(count)
    wind = np.column_stack([_means(given[axis], times, step) for axis in WIND]) if WIND[0] in given else None
    thrusters = None
    if set(THRUSTERS) & given.keys():
        still = np.zeros(len(times))
        thrusters = np.column_stack([_means(given[t], times, step) if t in given else still for t in THRUSTERS])
    return Record(
        name=name, times=times, inputs=inputs, measured=measured, deviations=deviations,
        current=signals.current, kind=signals.kind, wind=wind, thrusters=thrusters,
    )  # fmt: skip


def _means(signal: Signal, times: Array, step: float) -> Array:
    """Mean of an input from each time to the next: its integral is exact between samples."""
    t, x = signal.times, signal.values
    slopes = np.zeros(len(t) - 1) if signal.held else np.diff(x) / np.diff(t)
    widths = np.diff(t)
    areas = np.concatenate([[0.0], np.cumsum(widths * (x[:-1] + 0.5 * slopes * widths))])
    ends = np.clip(np.append(times, times[-1] + step), t[0], t[-1])
    at = np.clip(np.searchsorted(t, ends, side="right") - 1, 0, len(slopes) - 1)
    since = ends - t[at]
    integral = areas[at] + since * (x[at] + 0.5 * slopes[at] * since)
    lasting = np.diff(ends)
    beyond = np.interp(times, t, x)  # the last sample drives nothing
    return np.where(lasting > 0.5 * step, np.diff(integral) / np.where(lasting > 0.0, lasting, 1.0), beyond)


def _moved(signal: Signal, times: Array, step: float) -> tuple[Array, float]:
    """Samples moved to the nearest time of the grid by the local slope, and how many are averaged there."""
    values = np.full(len(times), np.nan)
    if len(signal.times) < 2:
        return values, 1.0
    at: NDArray[np.int64] = np.rint((signal.times - times[0]) / step).astype(np.int64)
    inside = (at >= 0) & (at < len(times))
    shifts = times[np.clip(at, 0, len(times) - 1)] - signal.times
    at, moved = at[inside], (signal.values + np.gradient(signal.values, signal.times) * shifts)[inside]
    counts = np.bincount(at, minlength=len(times))
    sums = np.bincount(at, weights=moved, minlength=len(times))
    there = counts > 0
    values[there] = sums[there] / counts[there]
    return values, max(1.0, float(np.median(counts[there]))) if there.any() else 1.0
