"""Samples that are none: fill values, lone spikes, repeats; and what stamps and places mean that are written oddly."""

import math

import numpy as np
from numpy.typing import NDArray

from estimators.core.types import Array

Flags = NDArray[np.bool_]
LARGEST = {  # beyond these no vehicle's value lies, by kind of quantity [SI; place: deg]
    "angle": 2000.0, "turning": 20.0, "shaft": 3000.0, "speed": 60.0, "length": 1e7, "place": math.inf,
}  # fmt: skip
SPIKE = {"angle": 0.2, "turning": 0.2, "speed": 0.5, "length": 20.0, "place": 2e-4}  # least step of a lone spike
TIMES_NOISE = 20.0  # so many deviations of the usual steps make a spike
# Values that loggers write where there is none (NMEA, ROS, NetCDF and instruments' own).
FILLS = (999.0, 999.9, 999.99, 9999.0, 9999.9, 99999.0, 32767.0, 32768.0, 65535.0)
ALONE = 3.0  # a fill value is this many times as large as all other values
DRIVEN = ("rudder", "rudder_command", "shaft_speed", "shaft_port", "shaft_starboard", "side_thruster")
SPIN = 1.0  # no vehicle turns faster [rad/s]
AGREE = math.radians(30.0)  # of headings before and after what lies between
BLOCK = 3  # least usual length of a run of held values, or of a block of equal stamps
REGULAR = 0.7  # share of runs whose length is the usual one
EPOCHS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))  # seconds since 1970 are 1e9


def clean(times: Array, raw: Array, factor: float, quantity: str, kind: str) -> tuple[Array, Array, list[str]]:
    """Samples [SI] without those that are none, and what was dropped, as texts; longitudes without a jump at 180.

    Args:
        times: (n,) [s].
        raw: (n,) values as they stand in the file.
        factor: from these to SI.
        quantity: its name.
        kind: of the quantity, see `columns.UNITS`.
    """
    said: list[str] = []
    values = raw * factor

    def drop(wrong: Flags, text: str) -> None:
        nonlocal times, values
        if wrong.any():
            said.append(f"{wrong.sum()} of {len(values)} values {text}")
            times, values = times[~wrong], values[~wrong]

    drop(fills(raw) | impossible(values, kind), "that cannot be, taken as missing")
    if quantity == "longitude":
        values = np.unwrap(values, period=360.0)
    if quantity == "heading":
        drop(between_turns(times, values), "between two sides of north, dropped")
    if quantity not in DRIVEN:  # what the vehicle is told may stay, and jump
        drop(held(values), "only repeated until the next sample, dropped")
        if quantity != "heading":
            drop(spikes(values, kind), "alone and far from both neighbours, taken as missing")
    return times, values, said


def impossible(values: Array, kind: str) -> Flags:
    """Which values (n,) are none: not finite, beyond all bounds, or a logger's fill value far from all others.

    Where most values are beyond the bounds it is the unit that is wrong, and nothing is marked.
    """
    there = np.isfinite(values)
    large = there & (np.abs(values) > LARGEST[kind])
    same = len(np.unique(values[large])) <= 2  # a fill value may stand in most rows
    wrong = large if same or large.sum() < 0.2 * there.sum() else np.zeros(len(values), dtype=bool)
    return wrong


def fills(raw: Array) -> Flags:
    """Which values (n,), as they stand in the file, are a logger's fill value."""
    there = np.isfinite(raw)
    size = np.abs(raw)
    marked = there & (np.isin(size, FILLS) | (size > 1e15))
    if not marked.any() or marked.sum() == there.sum():
        return np.zeros(len(raw), dtype=bool)
    return marked & (size > ALONE * float(size[there & ~marked].max()))


def spikes(values: Array, kind: str) -> Flags:
    """Which samples (n,) stand alone, far from those before and after, which agree with each other."""
    wrong = np.zeros(len(values), dtype=bool)
    if kind not in SPIKE or len(values) < 5:
        return wrong
    steps = np.diff(values)
    usual = 1.4826 * float(np.median(np.abs(steps)))
    least = max(SPIKE[kind], TIMES_NOISE * usual)
    before, after = steps[:-1], steps[1:]
    wrong[1:-1] = (before * after < 0.0) & (np.minimum(np.abs(before), np.abs(after)) > least)
    wrong[1:-1] &= np.abs(before + after) < 0.25 * np.minimum(np.abs(before), np.abs(after))
    return wrong


def between_turns(times: Array, heading: Array) -> Flags:
    """Which headings (n,) [rad] lie on a way through half a circle where the vehicle passed north.

    A heading that wraps, interpolated as a plain number, passes through south in no time; before and after it agrees.
    """
    wrong = np.zeros(len(heading), dtype=bool)
    if len(heading) < 3:
        return wrong
    steps = _wrapped(np.diff(heading))
    fast = np.flatnonzero(np.abs(steps) > np.maximum(SPIN * np.diff(times), math.radians(15.0)))
    k = 0
    while k < len(fast):
        first = last = int(fast[k])
        while k + 1 < len(fast) and fast[k + 1] - last <= 1 + (last == first):
            k += 1
            last = int(fast[k])
        k += 1
        turned = abs(float(_wrapped(heading[last + 1] - heading[first])))
        if last > first and turned < max(AGREE, SPIN * float(times[last + 1] - times[first]) * 0.5):
            wrong[first + 1 : last + 1] = True
    return wrong


def held(values: Array) -> Flags:
    """Which samples (n,) repeat the one before, where a slower sensor was written in every row.

    Then runs of equal values are of one length; values that are only rounded repeat by chance.
    """
    repeats = np.concatenate([[False], np.diff(values) == 0.0])[: len(values)]
    starts = np.flatnonzero(~repeats)
    lengths = np.diff(starts)  # the last run may be cut
    if len(lengths) < 10 or len(np.unique(values)) < 0.3 * len(starts):
        return np.zeros(len(values), dtype=bool)
    usual = float(np.median(lengths))
    # A sample that is lost makes a run of twice the length.
    multiple = np.maximum(1.0, np.rint(lengths / max(usual, 1.0)))
    regular = float(np.mean(np.abs(lengths - multiple * usual) <= 1.0))
    return repeats if usual >= BLOCK and regular >= REGULAR else np.zeros(len(values), dtype=bool)


def spread(stamps: Array) -> tuple[Array, int]:
    """Stamps (n,) [s] of which most repeat, as whole seconds at 10 Hz do, spread evenly over the time to the next.

    Returns:
        The stamps, and the usual number of rows of one stamp; 1 where they are as they were.
    """
    there = np.flatnonzero(np.isfinite(stamps))
    given = stamps[there]
    starts = np.flatnonzero(np.concatenate([[True], np.diff(given) != 0.0]))
    counts = np.diff(np.append(starts, len(given)))
    if len(counts) < 3 or np.median(counts) < 2:
        return stamps, 1
    widths = np.diff(given[starts])
    widths = np.append(widths, np.median(widths))
    usual = float(np.median(counts))
    offsets = np.arange(len(given)) - np.repeat(starts, counts)
    # The first and the last block may be cut: their rows lie as far apart as the others', at their own ends.
    shares = np.where(widths > 0.0, widths, 0.0) / np.maximum(counts, 1)
    shares[[0, -1]] = np.minimum(shares[[0, -1]], np.median(widths) / usual)
    result = stamps.copy()
    result[there] = given + offsets * np.repeat(shares, counts)
    late = widths[0] - shares[0] * counts[0]
    if late > 0.0:
        result[there[: counts[0]]] += late
    return result, round(usual)


def epoch_unit(stamps: Array) -> str | None:
    """Unit of stamps (n,) that count since 1970 in less than seconds; None where they do not."""
    size = float(np.nanmedian(np.abs(stamps)))
    return next((unit for least, unit in EPOCHS if size > least), None)


def degrees_and_minutes(values: Array, largest: float) -> Array | None:
    """Degrees of values (n,) written as 4112.34, which is 41 degrees and 12.34 minutes; None where they are no such.

    Args:
        values: of latitudes or longitudes.
        largest: degrees that there are, 90 or 180.
    """
    size = np.abs(values)
    degrees = np.floor(size / 100.0)
    minutes = size - 100.0 * degrees
    there = np.isfinite(values)
    if not there.any() or (minutes[there] >= 60.0).any() or (degrees[there] > largest).any():
        return None
    return np.copysign(degrees + minutes / 60.0, values)


def _wrapped(angles: Array) -> Array:
    return np.angle(np.exp(1j * angles))
