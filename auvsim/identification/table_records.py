"""A user's CSV, NetCDF, MCAP or rosbag2 as signals: several rates, gaps, rows of NaN, several manoeuvres."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from auvsim.base.errors import InputError
from auvsim.identification import bag_columns, checks, cleaning, places, stamps
from auvsim.identification.columns import QUANTITIES, ColumnSettings, Meaning, factor, plain, understand
from auvsim.identification.records import MEASURED
from auvsim.identification.signals import Signal, Signals, noise, steep
from auvsim.identification.table_files import load
from auvsim.identification.table_text import Column
from auvsim.ros import bags
from estimators.core.types import Array

NEEDED = ("time", "rudder", "shaft_speed")
NAMING = {"vehicle", "vehicle_id", "vehicle_name", "auv", "robot", "platform", "hull"}  # columns that name vehicles
TWO = {"shaft_port", "shaft_starboard"}
_EXAMPLES = {
    "time": "time [s]", "rudder": "rudder [deg]", "shaft_speed": "n [rpm]", "heading or yaw_rate": "heading [deg]",
}  # fmt: skip


class _Piece(NamedTuple):
    """Rows of one manoeuvre in the columns as long as the time."""

    rows: slice
    start: float
    stop: float
    kind: str


class _Table(NamedTuple):
    """A file's columns and what they mean."""

    path: Path
    columns: Mapping[str, Column]
    meanings: Mapping[str, Meaning]  # by quantity
    constants: Mapping[str, float]  # by quantity [SI]
    time: Array  # of the rows [s]
    origin: float  # of that in the file's own time [s]


def signals(
    path: Path, mapping: Mapping[str, ColumnSettings], *, shaft: bool = True, inputs: bool = True
) -> tuple[list[Signals], list[str]]:
    """The manoeuvres of a file as signals, and notes on what was assumed, dropped or not understood.

    Args:
        path: CSV, NetCDF, MCAP, or the folder of a rosbag2.
        mapping: What columns mean, where their names do not say it.
        shaft: Whether the shaft speed must be there; else its thrust counts as constant.
        inputs: Whether rudder and shaft speed must be there at all.

    Raises:
        InputError: It cannot be read, lacks a column, or holds what cannot be right; the text says what would be.
    """
    columns, mapping, read, described = _loaded(path, mapping)
    headers = {name: column.unit for name, column in columns.items()}
    meanings, unknown = understand(headers, mapping, str(path))
    by_quantity = {meaning.quantity: meaning for meaning in meanings}
    constants = {
        name: s.constant * s.sign * (factor(s.unit, name, str(path)) if s.unit else 1.0)
        for name, s in mapping.items()
        if s.constant is not None
    }
    if not shaft and inputs and "shaft_speed" not in by_quantity:
        constants.setdefault("shaft_speed", 0.0)
    there = by_quantity.keys() | constants.keys()
    twin = there >= TWO
    if twin and "shaft_speed" not in by_quantity:
        constants.pop("shaft_speed", None)
        there |= {"shaft_speed"}
    steered = bool({"rudder", "rudder_command"} & there)
    _require(path, there | ({"rudder"} if twin else set()), described, NEEDED if inputs else NEEDED[:1])
    time, said = stamps.seconds(columns, by_quantity["time"], path)
    for quantity, meaning in by_quantity.items():
        checks.not_empty(columns[meaning.column].values, quantity, meaning.column, path)
    columns, placed = places.degrees(columns, by_quantity, path)
    table = _Table(path, columns, by_quantity, constants, time - np.nanmin(time), float(np.nanmin(time)))
    notes = [*read, *said, *placed, *_assumptions(table, unknown)]
    if inputs and twin and not steered:
        notes.append(f"{path.name}: no rudder: its two shafts steer")
    if inputs and not twin and "shaft_speed" not in by_quantity and not constants["shaft_speed"]:
        notes.append(f"{path.name}: no shaft speed: its thrust counts as constant")
    _one_vehicle(path, columns, unknown)
    found = []
    pieces = list(_pieces(table))
    if not pieces:
        raise InputError(f"{path}: the time never goes on from one row to the next; sort the rows by time, or give the "
                         "right column with --columns")  # fmt: skip
    for number, piece in enumerate(pieces, start=1):
        label = path.name if len(pieces) == 1 else f"{path.name}, {piece.kind or f'part {number}'}"
        one, more = _signals(table, piece, label, inputs)
        found += [one] if one is not None else []
        notes += more
    return found, notes


def _one_vehicle(path: Path, columns: Mapping[str, Column], unknown: Sequence[str]) -> None:
    """Refuses a table whose rows are of several vehicles.

    Raises:
        InputError: A column that names vehicles names more than one.
    """
    for name in unknown:
        column = columns[name]
        if plain(name) not in NAMING:
            continue
        texts = column.texts if column.texts is not None else column.values[np.isfinite(column.values)]
        named = sorted({str(value) for value in texts if str(value)})
        if 1 < len(named) < 0.1 * len(texts):
            shown = ", ".join(named[:3]) + (", ..." if len(named) > 3 else "")
            raise InputError(f"{path}: column '{name}' names {len(named)} vehicles, {shown}; give a file for each")


def _loaded(path: Path, mapping: Mapping[str, ColumnSettings]) -> bag_columns.Chosen:
    """The columns of any file, what a map says of them, notes, and what there is, for errors."""
    if bags.is_bag(path):
        return bag_columns.load(path, mapping)
    columns, notes = load(path)
    return bag_columns.Chosen(columns, dict(mapping), notes, list(columns))


def _require(path: Path, there: set[str], columns: Sequence[str], needed: Sequence[str]) -> None:
    there = there | ({"rudder"} if "rudder_command" in there else set())
    missing = [quantity for quantity in needed if quantity not in there]
    if not {"heading", "yaw_rate"} & there:
        missing.append("heading or yaw_rate")
    if missing:
        named = ", no column the ".join(quantity.replace("_", " ") for quantity in missing)
        examples = ", ".join(f"`{_EXAMPLES[quantity]}`" for quantity in missing)
        one = "name one" if len(missing) == 1 else "name them"
        if bags.is_bag(path):
            raise InputError(
                f"{path}: no topic gives the {named.replace('column', 'topic')}; there are {', '.join(columns)}; say "
                f"which with --columns, such as `{missing[-1].split()[0]}: {{column: /TOPIC.FIELD, unit: ...}}`"
            )
        raise InputError(
            f"{path}: no column is the {named}; there are {', '.join(columns)}; "
            f"{one} {examples} or say which with --columns"
        )


def _assumptions(table: _Table, unknown: Sequence[str]) -> Iterator[str]:
    name = table.path.name
    assumed = [f"{m.column} in {m.assumed}" for m in table.meanings.values() if m.assumed]
    if assumed:
        yield f"{name}: no unit given, taken as SI: {', '.join(assumed)}"
    if unknown:
        yield f"{name}: columns not used: {', '.join(unknown)}"
    for quantity, meaning in table.meanings.items():
        column = table.columns[meaning.column]
        if column.texts is not None and quantity != "manoeuvre":
            words = sum(bool(cell) for cell in column.texts[np.isnan(column.values)])
            yield f"{name}: {words} cells of '{meaning.column}' are no numbers, taken as missing"
    if "rudder" not in table.meanings and "rudder_command" in table.meanings:
        yield f"{name}: only the rudder's command is there: the lag of its servo counts as the vehicle's"


def _pieces(table: _Table) -> Iterator[_Piece]:
    """Rows of each manoeuvre: a column may name them, and a clock that starts again begins another."""
    time = table.time
    known = np.flatnonzero(np.isfinite(time))
    starts = {0}
    first = float(time[known[0]])
    for before, after in pairwise(known.tolist()):
        if time[after] < time[before]:
            if time[after] > first + 1.0:
                raise InputError(
                    f"{table.path}: row {after + 1}: time goes back from {time[before]:g} to {time[after]:g} s; "
                    "sort the rows by time, or give the right column with --columns"
                )
            starts.add(after)
            first = float(time[after])
    kinds = np.full(len(time), "", dtype=object)
    if "manoeuvre" in table.meanings:
        column = table.columns[table.meanings["manoeuvre"].column]
        kinds = column.texts if column.texts is not None else np.array([f"{v:g}" for v in column.values], dtype=object)
        starts |= {k for k in range(1, len(kinds)) if kinds[k] != kinds[k - 1]}
    edges = [*sorted(starts), len(time)]
    for start, stop in pairwise(edges):
        inside = time[start:stop][np.isfinite(time[start:stop])]
        if len(inside) > 1 and inside.max() > inside.min():
            kind = str(kinds[start]).strip()
            yield _Piece(slice(start, stop), float(inside.min()), float(inside.max()), kind)


def _signals(table: _Table, piece: _Piece, label: str, inputs: bool) -> tuple[Signals | None, list[str]]:
    found: dict[str, Signal] = {}
    deviations: dict[str, float] = {}
    notes: list[str] = []
    for quantity, meaning in table.meanings.items():
        if QUANTITIES[quantity].kind in ("time", "text"):
            continue
        times, raw, missing, repeated = _samples(table, piece, meaning)
        times, values, dropped = cleaning.clean(times, raw, meaning.factor, quantity, QUANTITIES[quantity].kind)
        values = values + meaning.offset
        notes += [f"{label}: {meaning.column}: {text}" for text in dropped]
        if missing or repeated:
            parts = [f"{missing} missing"] * bool(missing) + [f"{repeated} with repeated stamps dropped"] * bool(
                repeated
            )
            notes.append(f"{label}: {meaning.column}: of {len(raw) + missing + repeated} samples {', '.join(parts)}")
        if len(times) < 2:
            continue
        if quantity == "heading":
            checks.heading_unit(times, values, meaning, table.path)
            values = np.unwrap(values)
        found[quantity] = Signal(times=times, values=values, held=quantity == "rudder_command")
        stated = table.columns[meaning.column].deviation
        if meaning.deviation is not None:
            deviations[quantity] = meaning.deviation
        elif stated is not None:
            deviations[quantity], told = _believed(stated * abs(meaning.factor), found[quantity], quantity)
            notes += [f"{label}: {meaning.column}: {text}" for text in told]
    for quantity, value in table.constants.items():
        ends = np.array([piece.start, 0.5 * (piece.start + piece.stop), piece.stop])
        found[quantity] = Signal(times=ends, values=np.full(3, value))
    _combine(found)
    if {"latitude", "longitude"} & deviations.keys():
        narrowing = math.cos(math.radians(float(found["latitude"].values[0])))
        for axis, angle, reach in (("north", "latitude", 1.0), ("east", "longitude", narrowing)):
            if angle in deviations:
                deviations.setdefault(axis, places.DEGREE * reach * deviations.pop(angle))
    _wind(found)
    lacking = [quantity for quantity in NEEDED[1:] if quantity not in found] if inputs else []
    if lacking:
        return None, [*notes, f"{label}: left out: no {' and no '.join(lacking)} in it"]
    for quantity in set(MEASURED) & found.keys() - {"north", "east"}:
        deviations.setdefault(quantity, noise(found[quantity], quantity))
    result = Signals(
        name=label, kind=piece.kind, signals=found, deviations=deviations, current=_current(found),
        excluded=tuple(steep(found["pitch"])) if "pitch" in found else (),
    )  # fmt: skip
    return result, notes


def _samples(table: _Table, piece: _Piece, meaning: Meaning) -> tuple[Array, Array, int, int]:
    """Stamps [s] of a column in a manoeuvre, values as in the file; how many are missing, how many stamps repeated."""
    column = table.columns[meaning.column]
    values, time = column.values, table.time
    own = meaning.time or (column.time if column.time in table.columns else None)
    if own is not None and own != table.meanings["time"].column:
        time, _ = stamps.seconds(table.columns, replace(table.meanings["time"], column=own), table.path)
        time = time - table.origin
        chosen = (time >= piece.start) & (time <= piece.stop)
        time, values = time[chosen], values[chosen]
    elif len(values) == len(time):
        time, values = time[piece.rows], values[piece.rows]
    else:
        raise InputError(
            f"{table.path}: '{meaning.column}' has {len(values)} values, the time {len(time)}, and none of its own"
        )
    there = np.isfinite(values) & np.isfinite(time)
    # Rows of NaN between samples of a slower sensor are none that are missing.
    count, missing = int(there.sum()), 0
    if count > 1:
        usual = float(np.median(np.diff(np.flatnonzero(there))))
        missing = max(0, round((np.flatnonzero(there)[-1] - np.flatnonzero(there)[0]) / usual) + 1 - count)
    time, values = time[there], values[there]
    if (np.diff(time) < 0.0).any():
        k = int(np.flatnonzero(np.diff(time) < 0.0)[0])
        raise InputError(
            f"{table.path}: '{own or meaning.column}': time goes back from {time[k]:g} to {time[k + 1]:g} s; sort it"
        )
    new = np.concatenate([[True], np.diff(time) > 0.0])[: len(time)]
    return time[new], values[new], missing, int(len(time) - new.sum())


def _believed(stated: float, signal: Signal, quantity: str) -> tuple[float, list[str]]:
    """The deviation of a sample that the file states, unless its samples scatter by more; and what is said of that."""
    scatter = noise(signal, quantity) if quantity in MEASURED[2:] else stated
    if stated >= 0.5 * scatter:
        return max(stated, scatter), []
    return scatter, [f"its samples scatter by {scatter:.2g}, its covariance says {stated:.2g} (SI): the former counts"]


def _combine(found: dict[str, Signal]) -> None:
    """Puts what goes by other names under those of a record."""
    if "rudder" not in found and "rudder_command" in found:
        found["rudder"] = found["rudder_command"]
    if found.keys() >= TWO:
        port, starboard = found["shaft_port"], found["shaft_starboard"]
        other = np.interp(port.times, starboard.times, starboard.values)
        found["shaft_speed"] = replace(port, values=0.5 * (port.values + other))
        found["shaft_difference"] = replace(port, values=0.5 * (port.values - other))
        found.setdefault("rudder", replace(port, values=0.0 * port.values))
    if {"velocity_north", "velocity_east", "heading"} <= found.keys() and "ground_surge" not in found:
        north, east, heading = (found[name] for name in ("velocity_north", "velocity_east", "heading"))
        across = np.interp(north.times, east.times, east.values)
        turn = np.exp(-1j * np.interp(north.times, heading.times, heading.values))
        body = (north.values + 1j * across) * turn
        found["ground_surge"] = Signal(times=north.times, values=body.real)
        found["ground_sway"] = Signal(times=north.times, values=body.imag)
    if {"latitude", "longitude"} <= found.keys() and "north" not in found:
        lat, lon = found["latitude"], found["longitude"]
        across = np.interp(lat.times, lon.times, lon.values) - lon.values[0]
        found["north"] = Signal(times=lat.times, values=places.DEGREE * (lat.values - lat.values[0]))
        narrowing = math.cos(math.radians(float(lat.values[0])))
        found["east"] = Signal(times=lat.times, values=places.DEGREE * narrowing * across)


def _wind(found: dict[str, Signal]) -> None:
    """Turns speed and direction of the apparent wind, as an anemometer gives them, into its two components."""
    if {"wind_speed", "wind_from"} <= found.keys():
        speed, angle = found["wind_speed"], found["wind_from"]
        turn = np.interp(speed.times, angle.times, np.unwrap(angle.values))
        found["wind_forward"] = Signal(times=speed.times, values=-speed.values * np.cos(turn))
        found["wind_starboard"] = Signal(times=speed.times, values=-speed.values * np.sin(turn))
    if not {"wind_forward", "wind_starboard"} <= found.keys():
        found.pop("wind_forward", None)
        found.pop("wind_starboard", None)


def _current(found: Mapping[str, Signal]) -> Array | None:
    if not {"current_north", "current_east"} <= found.keys():
        return None
    return np.array([found[f"current_{axis}"].values.mean() for axis in ("north", "east")])
