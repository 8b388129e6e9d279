"""The table of a campaign: one row for each trial of each variant, the same bit for bit from the same plan.

`python -m auvsim.campaign.table` prints its columns.
"""

import csv
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from auvsim.base import yaml_text
from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.campaign.folder import Folder, Record
from auvsim.data.log import PHASES

Row = dict[str, Any]  # by column; None where there is no value


@dataclass(frozen=True, slots=True)
class Column:
    """What a column holds."""

    dtype: str  # str, bool, int or float
    units: str
    meaning: str


QUALITIES = {
    "samples": Column("int", "1", "estimates, since the first fix"),
    "position_rms": Column("float", "m", "error of the estimated horizontal position, rms"),
    "heading_rms_deg": Column("float", "deg", "error of the estimated heading, rms"),
    "velocity_rms": Column("float", "m/s", "error of the estimated surge and sway together, rms"),
    "current_rms": Column("float", "m/s", "error of the estimated current, rms"),
    "nees_per_dof": Column("float", "1", "mean NEES of the horizontal position per degree of freedom; 1 is consistent"),
    "coverage_95": Column("float", "1", "share of estimates whose 95 % ellipse holds the truth"),
}
# Of each phase in which the vehicle is under way to the dock; without a name, of all of them.
UNDER_WAY = tuple(phase for phase in PHASES if phase not in ("docked", "manoeuvre"))
FAILURES = "timeout, aborted or diverged; error (it raised), died or hung (its process, twice); none if docked"

COLUMNS: dict[str, Column] = {
    "variant": Column("str", "", "name of the variant"),
    "trial": Column("int", "1", "number of the trial; the same number is the same draws in each variant"),
    "seed": Column("int", "1", "seed of the random streams"),
    "docked": Column("bool", "1", "whether it docked"),
    "docked_first": Column("bool", "1", "whether it docked on the first attempt"),
    "failure": Column("str", "", FAILURES),
    "failure_text": Column("str", "", "what the log or the error says of it"),
    "attempts": Column("int", "1", "attempts to dock"),
    "time": Column("float", "s", "of docking, or of the end"),
    "miss_distance": Column("float", "m", "of the nose from the dock's axis where it first enters in its last attempt"),
    "cross_track": Column("float", "m", "its part to starboard"),
    "vertical": Column("float", "m", "its part downward"),
    "heading_error_deg": Column("float", "deg", "heading less that of the dock, there"),
    "contact_impulse": Column("float", "N s", "normal contact impulse until the latch held"),
    "peak_contact_force": Column("float", "N", "largest normal contact force of these contacts"),
    **QUALITIES,
    **{
        f"{name}_{phase}": Column(column.dtype, column.units, f"{column.meaning}; phase {phase}")
        for phase in UNDER_WAY
        for name, column in QUALITIES.items()
    },
    "fixes_sent": Column("int", "1", "position fixes that the dock sent"),
    "fixes_lost": Column("int", "1", "of these, never arrived"),
    "fixes_outliers": Column("int", "1", "outliers that arrived"),
    "fixes_refused": Column("int", "1", "fixes that the estimator refused"),
    "error_type": Column("str", "", "class of the error, Died or Hung; none if nothing was raised"),
    "error_message": Column("str", "", "what it says"),
    "traceback": Column("str", "", "where it was raised"),
}
TIMINGS = ("variant", "trial", "wall_time", "cpu_time", "retries", "host")  # may differ from run to run
REPLAYED = ("docking.mp4", "track.png", "trial.nc")  # what a replay is shown by, the best first
TOGETHER = 1000  # rows in memory at a time


def row(record: Record) -> Row:
    """The columns of one trial, then the values of its scenario by their dotted keys."""
    summary, error = record["summary"], record["error"]
    values: Row = dict.fromkeys(COLUMNS)
    values |= {name: record[name] for name in ("variant", "trial", "seed")}
    values |= {"docked": False, "docked_first": False, "attempts": 0}
    if summary is not None:
        values |= {name: summary[name] for name in COLUMNS if name in summary}
        values["docked_first"] = summary["docked"] and summary["attempts"] == 1
        values["failure"] = summary["failure_reason"]
        values |= _entrance(summary)
        for phase, quality in summary["estimate"].items():
            end = "" if phase == "all" else f"_{phase}"
            values |= {f"{name}{end}": quality[name] for name in QUALITIES if f"{name}{end}" in COLUMNS}
    if error is not None:
        values["failure"] = error["type"].lower() if error["type"] in ("Died", "Hung") else "error"
        values["failure_text"] = error["message"]
        values |= {"error_type": error["type"], "error_message": error["message"], "traceback": error["traceback"]}
    return values | {key: _plain(value) for key, value in record["scenario"].items()}


def rows(folder: Folder) -> Iterator[Row]:
    """The rows of all finished trials, with what only this run of the campaign had: times, and where things are."""
    for record in folder.records():
        values, run = row(record), record["run"]
        wall = run.get("wall_time")
        log = folder.log_path(values["variant"], values["trial"])
        values |= {"wall_time": wall, "cpu_time": run.get("cpu_time")}
        values["real_time_factor"] = values["time"] / wall if wall and values["time"] is not None else None
        values["command"] = folder.replay_command(values["variant"], values["trial"])
        values["log"] = str(log.relative_to(folder.path)) if log.is_file() else None
        again = folder.replay_path(values["variant"], values["trial"])
        shown = next((again / name for name in REPLAYED if (again / name).is_file()), None)
        values["replay"] = str(shown.relative_to(folder.path)) if shown else None
        yield values


def write(folder: Folder) -> None:
    """Writes table.parquet and table.csv, and timings.csv with what is not the same in every run.

    Raises:
        InputError: If there is no room for them.
    """
    columns = COLUMNS | scenario_columns(folder)
    try:
        with (
            _csv(folder.path / "table.csv", columns) as table,
            _csv(folder.path / "timings.csv", TIMINGS) as timings,
            _parquet(folder.path / "table.parquet", columns) as parquet,
        ):
            for records in _batches(folder.records()):
                batch = [row(record) for record in records]
                table(batch)
                timings([{**record, **record["run"]} for record in records])
                parquet(batch)
    except OSError as error:
        raise InputError(f"{folder.path}: the table cannot be written: {error.strerror or error}") from None


def scenario_columns(folder: Folder) -> dict[str, Column]:
    """The columns of what differs between trials or variants, typed by what they hold."""
    plan = folder.plan
    found: dict[str, set[type]] = {key: set() for key in (*plan.drawn, *plan.compared)}
    for record in folder.records():
        for key, value in record["scenario"].items():
            found[key].add(type(_plain(value)))
    return {
        key: Column(_dtype(types - {type(None)}), "", "drawn" if key in plan.drawn else "of the variant")
        for key, types in found.items()
    }


def markdown(columns: Mapping[str, Column] = COLUMNS) -> str:
    """The columns as Markdown, for the documentation."""
    lines = ["| column | type | units | meaning |", "| --- | --- | --- | --- |"]
    lines += [f"| {name} | {c.dtype} | {c.units} | {c.meaning} |" for name, c in columns.items()]
    return "\n".join(lines)


@contextmanager
def _csv(path: Path, names: Iterable[str]) -> Iterator[Callable[[list[Row]], None]]:
    """Gives what appends rows to a new CSV file. Numbers have all their digits; nothing stands for what is missing."""
    names = list(names)
    with whole(path) as partial, open(partial, "w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        yield lambda batch: writer.writerows([_text(values.get(name)) for name in names] for values in batch)


@contextmanager
def _parquet(path: Path, columns: Mapping[str, Column]) -> Iterator[Callable[[list[Row]], None]]:
    """Gives what appends rows to a new Parquet file, a row group each time."""
    import pyarrow
    from pyarrow.parquet import ParquetWriter

    types = {"str": pyarrow.string(), "bool": pyarrow.bool_(), "int": pyarrow.int64(), "float": pyarrow.float64()}
    fields = [
        pyarrow.field(name, types[c.dtype], metadata={"units": c.units, "meaning": c.meaning})
        for name, c in columns.items()
    ]
    schema = pyarrow.schema(fields)

    def append(batch: list[Row]) -> None:
        # By columns: from rows as they are, a text where a number belongs would not say in which column.
        arrays = [
            pyarrow.array([_typed(values.get(name), c.dtype) for values in batch], types[c.dtype])
            for name, c in columns.items()
        ]
        writer.write_table(pyarrow.Table.from_arrays(arrays, schema=schema))

    with whole(path) as partial, ParquetWriter(partial, schema) as writer:
        yield append


def _batches(records: Iterator[Record]) -> Iterator[list[Record]]:
    while batch := list(islice(records, TOGETHER)):
        yield batch


def _entrance(summary: Mapping[str, Any]) -> Row:
    """Sideways and downward part of the miss distance."""
    crossings = summary["crossings"]
    last = next((c for c in crossings if c["attempt"] == crossings[-1]["attempt"]), None)
    return {name: last[name] for name in ("cross_track", "vertical")} if last else {}


def _plain(value: Any) -> Any:
    """A value of a scenario that fits in a cell."""
    return yaml_text.dump(value, flow=True) if isinstance(value, dict | list) else value


def _dtype(types: set[type]) -> str:
    if types <= {int, float} and types:
        return "float"  # also where all that were drawn happen to be whole
    return "bool" if types == {bool} else "str"


def _typed(value: Any, dtype: str) -> Any:
    if value is None:
        return None
    return {"float": float, "int": int, "bool": bool, "str": str}[dtype](value)


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


if __name__ == "__main__":
    print(markdown())
