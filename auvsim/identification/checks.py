"""What cannot be right in data, each with what would make it right."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid

from auvsim.base.errors import InputError
from auvsim.identification import velocity_checks
from auvsim.identification.columns import Meaning
from auvsim.identification.records import MEASURED, Record
from auvsim.identification.signals import Signals
from estimators.core.errors import ParameterError
from estimators.core.types import Array
from estimators.planar.model import MAX_SUBSTEP, PlanarParameters, PlanarProcess

LEAST = 20.0  # of data in all: the vehicle's surge alone takes some 10 s to settle [s]
SPIN = 1.0  # a turn this fast is none of a vehicle's [rad/s]
STILL = math.radians(0.3)  # a rudder that moves less than this excites nothing [rad]
SLOWEST = 10.0  # from one sample of the rudder to the next: most vehicles' yaw has settled by then [s]
CONSTANT = 3  # samples that stand for a constant of a map
DEGREE = math.pi / 180.0
RUDDER = math.radians(45.0)  # largest of vehicles of which nothing is known [rad]


def not_empty(values: Array, quantity: str, column: str, path: Path) -> None:
    """Refuses a column without a number.

    Raises:
        InputError: There is none.
    """
    if quantity != "manoeuvre" and not np.isfinite(values).any():
        raise InputError(
            f"{path}: column '{column}' ({quantity.replace('_', ' ')}) holds no number at all; fill it, "
            "take it out, or give another with --columns"
        )


def heading_unit(times: Array, heading: Array, meaning: Meaning, path: Path) -> None:
    """Refuses a heading whose unit is not that which was given: by the size of its jumps at north and of its rates.

    Raises:
        InputError: It turns too fast, or wraps at the turn of another unit.
    """
    steps = np.diff(heading)
    jumps = np.abs(steps[np.abs(steps) > 0.5 * np.abs(steps).max()]) if len(steps) else steps
    wraps = float(np.median(jumps)) if len(jumps) else 0.0
    rates = np.abs(np.angle(np.exp(1j * steps))) / np.diff(times)
    span = float(np.ptp(heading))
    where = f"{path}: column '{meaning.column}' (heading)"
    # In degrees taken for radians each turn of the vehicle is 57 turns: the rate, wrapped, is anything.
    if abs(wraps - 360.0) < 20.0 or (span > 4.0 * math.pi and float(np.median(rates)) > SPIN):
        raise InputError(f"{where} ranges over {span:.0f} rad: these are degrees; name it `heading [deg]`")
    if abs(wraps - 360.0 * DEGREE**2) < 0.03 * 360.0 * DEGREE**2 and span < 1.03 * 360.0 * DEGREE**2:
        raise InputError(f"{where} wraps after {wraps / DEGREE:.2f} deg: these are radians; name it `heading [rad]`")


def signals(found: Sequence[Signals], rudder_limit: float = RUDDER, shaft_limit: float | None = None) -> list[str]:
    """Refuses signals that no manoeuvre of the vehicle can be; notes on what is doubtful.

    Args:
        found: All that was read.
        rudder_limit: Largest effective rudder of the vehicle [rad].
        shaft_limit: Largest shaft speed [rad/s]; None: of the shaft nothing is known.

    Raises:
        InputError: Too little, nothing that moves, or a unit that cannot be.
    """
    if not found:
        raise InputError("no manoeuvre was found; each needs rudder and shaft speed together for some minutes")
    notes = []
    for one in found:
        _inputs(one, rudder_limit, shaft_limit)
        _heading_and_gyro(one)
        _speeds_and_positions(one)
        notes += velocity_checks.check(one)
    return notes


def _inputs(one: Signals, rudder_limit: float, shaft_limit: float | None) -> None:
    times = one.signals["rudder"].times
    usual = float(np.median(np.diff(times)))
    if len(times) > CONSTANT and usual > SLOWEST:
        raise InputError(
            f"{one.name}: the rudder comes every {usual:.3g} s, too seldom to learn how the vehicle answers it: is the "
            f"time in another unit, such as `time [ms]`? If not, log it once a second, at least every {SLOWEST:g} s"
        )
    rudder, shaft = one.signals["rudder"].values, one.signals["shaft_speed"].values
    largest = float(np.abs(rudder).max())
    if largest > 1.0 and largest > 3.0 * rudder_limit:
        raise InputError(
            f"{one.name}: the rudder reaches {largest:.3g} rad, a vehicle's {rudder_limit:.2g} rad: "
            "these are degrees; name the column `rudder [deg]`"
        )
    if shaft_limit is None:
        return
    fastest = float(np.abs(shaft).max())
    if fastest > 1.5 * shaft_limit:
        raise InputError(
            f"{one.name}: the shaft reaches {fastest:.4g} rad/s, the vehicle's {shaft_limit:.4g} rad/s: "
            "are these revolutions per minute? name the column `n [rpm]`"
        )
    if not np.any(shaft):
        raise InputError(
            f"{one.name}: the shaft stands still throughout; log its speed, or give a constant by --columns"
        )


def _heading_and_gyro(one: Signals) -> None:
    """The rate of the heading against the yaw rate: a factor of 57 or a sign."""
    if not {"heading", "yaw_rate"} <= one.signals.keys():
        return
    heading, gyro = one.signals["heading"], one.signals["yaw_rate"]
    times = np.arange(max(heading.times[0], gyro.times[0]), min(heading.times[-1], gyro.times[-1]), 2.0)
    if len(times) < 5:
        return
    turned = np.diff(np.interp(times, heading.times, heading.values))
    integrated = np.diff(_integrated(gyro.times, gyro.values, times))
    # What is common to both, by the larger of the two regressions: noise on either makes one too small.
    product = float(turned @ integrated)
    correlation = product / math.sqrt(float(turned @ turned) * float(integrated @ integrated) + 1e-300)
    if abs(correlation) < 0.7:
        return
    ratio = math.copysign(math.sqrt(float(integrated @ integrated) / float(turned @ turned)), product)
    if ratio < 0.0:
        raise InputError(
            f"{one.name}: heading and yaw rate turn opposite ways; both must be clockwise seen from above: "
            "turn one round with `sign: -1` in --columns"
        )
    for wrong, said in (
        (1.0 / DEGREE, "yaw rate in degrees or heading in"),
        (DEGREE, "heading in degrees or yaw rate in"),
    ):
        if 0.6 < ratio / wrong < 1.6:
            raise InputError(
                f"{one.name}: the yaw rate is {ratio:.3g} times the heading's rate: {said} radians, against what "
                "their headers say; name them as they are, such as `heading [deg]` and `r [deg/s]`"
            )


def _speeds_and_positions(one: Signals) -> None:
    """The way by positions against that by the log over ground, and this against that through the water."""
    if {"north", "east", "ground_surge"} <= one.signals.keys():
        north, east, log = (one.signals[name] for name in ("north", "east", "ground_surge"))
        times = np.arange(max(north.times[0], log.times[0]), min(north.times[-1], log.times[-1]), 10.0)
        if len(times) >= 5:
            legs = np.hypot(
                np.diff(np.interp(times, north.times, north.values)), np.diff(np.interp(times, east.times, east.values))
            )
            run = np.diff(_integrated(log.times, np.abs(log.values), times))
            straight = np.ones(len(run), dtype=bool)
            if (heading := one.signals.get("heading")) is not None:  # a turn's way is longer than from place to place
                course = np.exp(1j * np.interp(log.times, heading.times, heading.values))
                straight = np.abs(np.diff(_integrated(log.times, np.abs(log.values) * course, times))) > 0.9 * run
            if straight.sum() >= 5:
                ratio = float(np.median(run[straight] / np.maximum(legs[straight], 1e-3)))
                _speed_unit(f"{one.name}: the log's speed is {ratio:.3g} times that of the positions", ratio, 1.1)
    if {"surge", "ground_surge"} <= one.signals.keys():
        ratio, sharp = _water_by_ground(one)
        _speed_unit(
            f"{one.name}: surge through the water is {ratio:.3g} times that over ground", ratio, 1.2 if sharp else 1.33
        )


def _integrated(times: Array, values: Array, at: Array) -> Array:
    """Integrals by the trapezoidal rule from the first of the times to each of others."""
    return np.interp(at, times, cumulative_trapezoid(values, times, initial=0.0))


def _water_by_ground(one: Signals) -> tuple[float, bool]:
    """Ratio of the log's two surges; and whether headings enough tell the current from it."""
    water, ground, heading = (one.signals.get(name) for name in ("surge", "ground_surge", "heading"))
    assert water is not None
    assert ground is not None
    over = np.interp(water.times, ground.times, ground.values)
    if heading is not None:
        turn = np.exp(1j * np.interp(water.times, heading.times, heading.values))
        if abs(turn.mean()) < 0.95:
            share = np.linalg.lstsq(np.column_stack([water.values, turn.real, turn.imag]), over, rcond=None)[0][0]
            return 1.0 / max(float(share), 1e-6), True
    return float(np.median(np.abs(water.values))) / max(float(np.median(np.abs(over))), 1e-3), False


def _speed_unit(said: str, ratio: float, spread: float) -> None:
    """Refuses a ratio of speeds that is nearly that of two units.

    Raises:
        InputError: It is; with that unit.
    """
    for factor, unit in ((3600.0 / 1852.0, "kn"), (100.0, "cm/s"), (1000.0, "mm/s"), (3.6, "km/h")):
        if factor < 2.0 and spread > 1.3:
            continue  # knots and a current are not told apart
        if 1.0 / spread < ratio / factor < spread:
            raise InputError(f"{said}: is it in {unit}? name its unit in the column, such as `u [{unit}]`")
        if 1.0 / spread < ratio * factor < spread:
            raise InputError(f"{said}: is it in m/s, not in {unit}? name its unit in the column, such as `u [m/s]`")


def records(found: Sequence[Record], start: PlanarParameters) -> None:
    """Refuses records from which nothing can be learnt, or whose yaw does not answer as any vehicle's would.

    Args:
        found: All that will be used.
        start: A model whose yaw at least turns the right way.

    Raises:
        InputError: Too short, a rudder that does not move, reversed, or in another unit.
    """
    total = sum(record.duration for record in found)
    if total < LEAST:
        raise InputError(
            f"{total:.0f} s of data in spans of 10 s or more; a fit needs {LEAST:g} s at the very least, two "
            "manoeuvres of two minutes each are better"
        )
    _answer(found, start)
    _headway(found, start)
    moved = max(float(np.std(record.inputs[:, 0])) for record in found)
    if moved < STILL:
        at = np.degrees(np.mean(np.concatenate([record.inputs[:, 0] for record in found])))
        raise InputError(
            f"the rudder stays at {at:.1f} deg throughout: nothing in sway and yaw can be learnt; "
            "log a zig-zag, turns to both sides, or a multisine"
        )


def _headway(found: Sequence[Record], start: PlanarParameters) -> None:
    """Speed measured against that which the start's shaft gives: factors of 10 and more."""
    for name in ("surge", "ground_surge"):
        speeds = np.concatenate([record.measured[:, MEASURED.index(name)] for record in found])
        if not np.isfinite(speeds).any():
            continue
        try:
            expected = start.steady_surge(float(np.median(np.concatenate([r.inputs[:, 1] for r in found]))))
        except ParameterError:  # a start without drag
            return
        ratio = float(np.nanmedian(np.abs(speeds))) / max(expected, 1e-3)
        if ratio > 5.0 or ratio < 0.2:
            raise InputError(
                f"the {name.replace('_', ' ')} is {ratio:.3g} times what this shaft speed gives a vehicle of its kind: "
                "one of the two is in other units than its header says; name both as they are: `n [rpm]`, `u [m/s]`"
            )


def _answer(found: Sequence[Record], start: PlanarParameters) -> None:
    """Yaw rate measured against that of the start: the sign of the rudder, and factors of 57."""
    measured, modelled = (np.concatenate(parts) for parts in zip(*(_yaw_rates(r, start) for r in found), strict=True))
    power = float(measured @ measured), float(modelled @ modelled)
    correlation = float(measured @ modelled) / math.sqrt(power[0] * power[1] + 1e-300)
    if correlation < -0.5:
        raise InputError(
            "the vehicle turns against its rudder: a positive rudder must turn to starboard (heading clockwise from "
            "north); turn it round with `rudder: {column: ..., sign: -1}` in --columns"
        )
    ratio = math.sqrt(power[0] / (power[1] + 1e-300))
    if correlation > 0.5 and (ratio > 15.0 or ratio < 1.0 / 15.0):
        raise InputError(
            f"the yaw rate is {ratio:.3g} times what this rudder gives a vehicle of its kind: rudder or heading is in "
            "other units than its header says; name both as they are, such as `rudder [deg]`, `heading [deg]`"
        )


def _yaw_rates(record: Record, start: PlanarParameters) -> tuple[Array, Array]:
    """Yaw rates over two seconds [rad/s] about their means: by gyro or heading, and of the start's model."""
    gyro, heading = (record.measured[:, MEASURED.index(name)] for name in ("yaw_rate", "heading"))
    every = max(1, round(2.0 / record.step))
    parts = max(1, math.ceil(record.step / MAX_SUBSTEP - 1e-9))
    speed = np.nanmedian(record.measured[:, 3]) if np.isfinite(record.measured[:, 3]).any() else 1.0
    inputs = np.repeat(np.nan_to_num(record.inputs), parts, axis=0)
    first = np.array([0.0, 0.0, 0.0, speed, 0.0, 0.0])
    process = PlanarProcess(start, np.zeros(6))
    walked = process.walk(first, inputs, record.step / parts, np.zeros((len(inputs), 6)))[:-1:parts]
    if np.isfinite(gyro).sum() > 10:
        there = np.isfinite(gyro)
        rate = np.interp(record.times, record.times[there], gyro[there])
        turned = np.concatenate([[0.0], np.cumsum(rate[:-1] * record.step)])
    elif np.isfinite(heading).sum() > 10:
        there = np.isfinite(heading)
        turned = np.interp(record.times, record.times[there], heading[there])
    else:
        return np.zeros(0), np.zeros(0)
    measured, modelled = (np.diff(angle[::every]) / (every * record.step) for angle in (turned, walked[:, 2]))
    return measured - measured.mean(), modelled - modelled.mean()
