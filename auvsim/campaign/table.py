"""The table of a campaign: a row for each trial of each variant, and of several vehicles one for each.

It is the same bit for bit from the same plan. Its columns are in `columns`.
"""

import csv
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

from auvsim.base import yaml_text
from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.campaign import trials
from auvsim.campaign.columns import SUCCESS, TYPES, Layout, Row, judged, values_of
from auvsim.campaign.folder import Folder, Record
from auvsim.missions.mission import Metric

EARLIER = {"estimator.factory": "estimator.kind"}  # keys of scenarios in records of before
TIMINGS = ("variant", "trial", "wall_time", "cpu_time", "retries", "host")  # may differ from run to run
REPLAYED = ("docking.mp4", "track.png", "trial.nc")  # what a replay is shown by, the best first
TOGETHER = 1000  # rows in memory at a time


def rows_of(record: Record, layout: Layout) -> list[Row]:
    """The columns of each vehicle of one trial, then the values of its scenario by their dotted keys."""
    missions, summary, error = parts(record)
    scenario = {key: _plain(value) for key, value in _drawn(record).items()}
    found = []
    for name, kind in missions.items():
        values = values_of(kind, None if summary is None else trials.vehicle_summary(summary, name), error)
        values |= {"vehicle": name, "mission": kind} | {key: record[key] for key in ("variant", "trial", "seed")}
        if layout.success == SUCCESS:
            values[SUCCESS] = judged(kind, layout.criterion, values)
        found.append({column: values.get(column) for column in layout.columns} | scenario)
    return found


def parts(record: Record) -> tuple[dict[str, str], Mapping[str, Any] | None, Mapping[str, str] | None]:
    """The missions by vehicle, the summary and the error of a trial, also of a record of before there were several."""
    summary = record["summary"]
    if "missions" in record or summary is None:
        return record.get("missions", {"": "docking"}), summary, record["error"]
    found = {"docked_first": summary["docked"] and summary["attempts"] == 1, "cross_track": None, "vertical": None}
    crossings = summary["crossings"]
    first = next((c for c in crossings if c["attempt"] == crossings[-1]["attempt"]), {})
    found |= {name: first[name] for name in ("cross_track", "vertical") if name in first}
    return {"": "docking"}, found | summary, record["error"]


def rows(folder: Folder) -> Iterator[Row]:
    """The rows of all finished trials, with what only this run of the campaign had: times, and where things are."""
    layout = folder.plan.layout
    for record in folder.records():
        variant, trial, run = record["variant"], record["trial"], record["run"]
        wall = run.get("wall_time")
        log, again = folder.log_path(variant, trial), folder.replay_path(variant, trial)
        shown = next((again / name for name in REPLAYED if (again / name).is_file()), None)
        for values in rows_of(record, layout):
            values |= {"wall_time": wall, "cpu_time": run.get("cpu_time")}
            values["real_time_factor"] = values["time"] / wall if wall and values["time"] is not None else None
            values["command"] = folder.replay_command(variant, trial)
            values["log"] = str(log.relative_to(folder.path)) if log.is_file() else None
            values["replay"] = str(shown.relative_to(folder.path)) if shown else None
            yield values


def write(folder: Folder) -> None:
    """Writes table.parquet and table.csv, and timings.csv with what is not the same in every run.

    Raises:
        InputError: If there is no room for them.
    """
    layout = folder.plan.layout
    columns = {**layout.columns, **scenario_columns(folder)}
    try:
        with (
            _csv(folder.path / "table.csv", columns) as table,
            _csv(folder.path / "timings.csv", TIMINGS) as timings,
            _parquet(folder.path / "table.parquet", columns) as parquet,
        ):
            for records in _batches(folder.records()):
                batch = [row for record in records for row in rows_of(record, layout)]
                table(batch)
                timings([{**record, **record["run"]} for record in records])
                parquet(batch)
    except OSError as error:
        raise InputError(f"{folder.path}: the table cannot be written: {error.strerror or error}") from None


def scenario_columns(folder: Folder) -> dict[str, Metric]:
    """The columns of what differs between trials or variants, typed by what they hold."""
    plan = folder.plan
    found: dict[str, set[type]] = {key: set() for key in (*plan.drawn, *plan.compared)}
    for record in folder.records():
        for key in found:
            found[key].add(type(_plain(_drawn(record).get(key))))
    return {
        key: Metric(_dtype(types - {type(None)}), "", "drawn" if key in plan.drawn else "of the variant")
        for key, types in found.items()
    }


@contextmanager
def _csv(path: Path, names: Iterable[str]) -> Iterator[Callable[[list[Row]], None]]:
    """Gives what appends rows to a new CSV file. Numbers have all their digits; nothing stands for what is missing."""
    names = list(names)
    with whole(path) as partial, open(partial, "w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        yield lambda batch: writer.writerows([_text(values.get(name)) for name in names] for values in batch)


@contextmanager
def _parquet(path: Path, columns: Mapping[str, Metric]) -> Iterator[Callable[[list[Row]], None]]:
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


def _drawn(record: Record) -> dict[str, Any]:
    """What is worth a column of a trial's scenario, by today's keys."""
    scenario: dict[str, Any] = record["scenario"]
    return {EARLIER.get(key, key): value for key, value in scenario.items()}


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
    return TYPES[dtype](value)


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)
