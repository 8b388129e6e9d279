"""Groups of arrays to and from one NetCDF-4 file, whole or absent.

Any NetCDF reader opens the files. They are laid out with h5py by the NetCDF-4 conventions (dimension scales, order of
creation); h5netcdf writes the same, but its bookkeeping costs 190 ms for 72 variables where this takes 25 ms, which
counts beside a trial that runs in half a second.
"""

import io
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import InputError
from auvsim.base.files import whole

Attribute = str | int | float
# Any file that HDF5 cannot make sense of ends in one of these, by where the damage is.
_UNREADABLE = (OSError, RuntimeError, KeyError, ValueError, TypeError)


@dataclass(frozen=True, slots=True)
class Field:
    """A variable: its named dimensions, its values (bool, integer, float or str objects) and what describes them."""

    dimensions: tuple[str, ...]  # the first may grow; the variable of that name is its coordinate
    values: NDArray[Any]
    attributes: Mapping[str, str | NDArray[Any]] = field(default_factory=dict)


def save(
    path: str | os.PathLike[str], groups: Mapping[str, Mapping[str, Field]], attributes: Mapping[str, Attribute]
) -> None:
    """Writes groups of fields; on any failure nothing stands at `path` that did not stand there before.

    Raises:
        InputError: if the file cannot be written.
    """
    path = Path(path)
    content = pack(groups, attributes)
    try:
        with whole(path) as partial, open(partial, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error


def pack(groups: Mapping[str, Mapping[str, Field]], attributes: Mapping[str, Attribute]) -> bytes:
    """What the file of groups of fields holds."""
    content = io.BytesIO()
    with h5py.File(content, "w", track_order=True) as file:
        file.attrs.update(attributes)
        identifiers = count()
        for name, fields in groups.items():
            _save_group(file.create_group(name, track_order=True), fields, identifiers)
    return content.getvalue()


def _save_group(group: h5py.Group, fields: Mapping[str, Field], identifiers: Iterator[int]) -> None:
    """Writes the fields, then gives each axis the scale of its dimension."""
    datasets = {name: _save_values(group, name, item.values) for name, item in fields.items()}
    scales: dict[str, h5py.Dataset] = {}
    for name, item in fields.items():
        datasets[name].attrs.update(item.attributes)
        if item.dimensions == (name,):
            scales[name] = _scale(datasets[name], name, identifiers)
    for name, item in fields.items():
        for axis, dimension in enumerate(item.dimensions):
            if dimension not in scales:
                size = item.values.shape[axis]
                bare = group.create_dataset(dimension, (size,), ">f4")
                # The words by which the NetCDF library knows a dimension that has no coordinate.
                words = f"This is a netCDF dimension but not a netCDF variable.{size:10}"
                scales[dimension] = _scale(bare, words, identifiers)
            if dimension != name:
                datasets[name].dims[axis].attach_scale(scales[dimension])


def _scale(dataset: h5py.Dataset, name: str, identifiers: Iterator[int]) -> h5py.Dataset:
    dataset.make_scale(name)
    dataset.attrs["_Netcdf4Dimid"] = np.int32(next(identifiers))
    return dataset


def _save_values(group: h5py.Group, name: str, values: NDArray[Any]) -> h5py.Dataset:
    shape, limits = values.shape, (None, *values.shape[1:])
    chunks = tuple(max(size, 1) for size in shape)  # one chunk: logs are read whole
    options: dict[str, Any] = {"shape": shape, "maxshape": limits, "chunks": chunks, "track_order": True}
    if values.dtype == object:
        return group.create_dataset(name, data=values, dtype=h5py.string_dtype(), **options)
    if values.ndim == 1:  # times, counts, held commands; of vectors and covariances gzip only takes 15 %, slowly
        options |= {"compression": "gzip", "compression_opts": 1, "shuffle": True}
    if values.dtype != bool:
        return group.create_dataset(name, data=values, **options)
    dataset = group.create_dataset(name, data=values.astype(np.int8), **options)
    dataset.attrs["dtype"] = "bool"  # NetCDF has no booleans; xarray reads this mark too
    return dataset


def load(path: str | os.PathLike[str]) -> tuple[dict[str, dict[str, NDArray[Any]]], dict[str, Attribute]]:
    """The groups of arrays and the attributes of a file; dimensions without coordinate are left out.

    Raises:
        InputError: if there is no such file, or it is not a whole NetCDF-4 file.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        with h5py.File(path, "r") as file:
            groups = {name: _load_group(group) for name, group in file.items() if isinstance(group, h5py.Group)}
            attributes = {name: getattr(value, "item", lambda v=value: v)() for name, value in file.attrs.items()}
    except _UNREADABLE as error:
        raise InputError(f"{path}: not a whole NetCDF-4 file: {str(error).splitlines()[0]}") from error
    return groups, attributes


def _load_group(group: h5py.Group) -> dict[str, NDArray[Any]]:
    arrays = {}
    for name, dataset in group.items():
        if not isinstance(dataset, h5py.Dataset) or dataset.dtype == np.dtype(">f4"):
            continue
        values = np.asarray((dataset.asstr() if h5py.check_string_dtype(dataset.dtype) else dataset)[...])
        arrays[name] = values.astype(bool) if dataset.attrs.get("dtype") == "bool" else values
    return arrays
