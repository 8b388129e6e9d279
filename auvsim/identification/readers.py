"""Reads logs, whosever they are, into records."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

import h5py

from auvsim.base.errors import InputError
from auvsim.data import log
from auvsim.identification import checks, log_records, signals, table_records
from auvsim.identification.columns import ColumnSettings, read_map
from auvsim.identification.records import Readings
from auvsim.physics.planar_sets import Source
from auvsim.vehicles import library


def read(
    paths: Sequence[Path], *, vehicle: str | None = None, columns: Path | None = None, step: float | None = None
) -> Readings:
    """Reads trial logs and users' tables into records.

    Args:
        paths: NetCDF logs of auvsim, or CSV and NetCDF files with named columns.
        vehicle: Name in models/, or the path of an MJCF file; a trial log's must be the same. Its limits are known.
            None: any; then a table may lack the shaft speed.
        columns: A mapping file for the users' tables.
        step: Of the records' grid [s]; each rudder's own if None.

    Raises:
        InputError: One line with the file and what is wrong in it, and what would be right.
    """
    mapping = {} if columns is None else read_map(columns)
    limits = None if vehicle is None else library.vehicle(vehicle)
    found, notes, sources = [], [], []
    for path in paths:
        sources.append(Source(file=path.name, sha256=_hash(path)))
        ones, more = _signals(path, mapping, vehicle)
        known = () if limits is None else (limits.actuation.fin_limit, limits.actuation.shaft_limit)
        more += checks.signals(ones, *known)
        notes += more
        for one in ones:
            records, more = signals.records(one, step)
            found += records
            notes += more
    return Readings(records=tuple(found), sources=tuple(sources), notes=tuple(notes))


def _signals(
    path: Path, mapping: dict[str, ColumnSettings], vehicle: str | None
) -> tuple[list[signals.Signals], list[str]]:
    if not is_trial_log(path):
        return table_records.signals(path, mapping, shaft=vehicle is not None)
    found, notes, model = log_records.signals(path)
    if vehicle is not None and model != vehicle:
        raise InputError(f"{path}: a log of '{model}', not of '{vehicle}'; give --vehicle {model}")
    return found, notes


def models(paths: Sequence[Path]) -> set[str]:
    """Vehicles of those of the files that are trial logs."""
    return {log_records.signals(path)[2] for path in paths if is_trial_log(path)}


def texts(paths: Sequence[Path]) -> dict[tuple[str, str], str]:
    """MJCF texts that those of the files hold that are trial logs, as `model_files.given` takes them.

    Raises:
        InputError: Two logs hold different texts of one vehicle.
    """
    found: dict[tuple[str, str], str] = {}
    for path in filter(is_trial_log, paths):
        for (kind, model), text in log.read(path).models.items():
            if kind == "vehicle" and found.setdefault((kind, model), text) != text:
                raise InputError(f"{path}: '{model}' is not as in the other logs, its file has changed in between")
    return found


def is_trial_log(path: Path) -> bool:
    """Whether a file is a log of auvsim's, whole or not."""
    try:
        with h5py.File(path, "r") as file:
            return "format_version" in file.attrs and "scenario" in file.attrs
    except OSError:
        return False


def _hash(path: Path) -> str:
    try:
        files = sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]
        return hashlib.sha256(b"".join(p.read_bytes() for p in files)).hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
