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
UNREADABLE = (OSError, RuntimeError, LookupError, ValueError, TypeError, AttributeError, ArithmeticError, MemoryError)
CHUNK = 1024  # rows of a chunk of a file that grows
# Attributes by which HDF5 and NetCDF keep their books, and the mark of types that NetCDF does not have.
_BOOKS = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "_Netcdf4Dimid", "_Netcdf4Coordinates"}
_MARK = "dtype"  # of booleans (xarray knows it) and of categories


@dataclass(frozen=True, slots=True)
class Field:
    """A variable: its named dimensions, its values (bool, integer, float or str objects) and what describes them.

    The first dimension may grow; the variable of its name is its coordinate. The texts of a `coded` field become
    integers in the file, with the texts in the attribute `categories`.
    """

    dimensions: tuple[str, ...]
    values: NDArray[Any]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    coded: bool = False


Fields = Mapping[str, Field]


@dataclass(frozen=True, slots=True)
class Content:
    """What a file holds: fields by the path of their group, and attributes by path, "" for the file itself."""

    groups: Mapping[str, Fields]
    attributes: Mapping[str, Mapping[str, Any]]


def save(path: str | os.PathLike[str], content: Content) -> None:
    """Writes a file; on any failure nothing stands at `path` that did not stand there before.

    Raises:
        InputError: if the file cannot be written.
    """
    path = Path(path)
    packed = pack(content)
    try:
        with whole(path) as partial, open(partial, "wb") as stream:
            stream.write(packed)
            stream.flush()
            os.fsync(stream.fileno())
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error


def pack(content: Content) -> bytes:
    """The bytes of the file."""
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", track_order=True) as file:
        writers = create(file, content.groups)
        for writer in writers.values():
            writer.finish()
        describe(file, content.attributes)
    return buffer.getvalue()


def create(file: h5py.File, groups: Mapping[str, Fields], chunk: int | None = None) -> "dict[str, GroupWriter]":
    """Creates groups with their fields in an open file; a writer for each by its path."""
    identifiers = count()
    return {path: GroupWriter(_group(file, path), fields, identifiers, chunk) for path, fields in groups.items()}


def describe(file: h5py.File, attributes: Mapping[str, Mapping[str, Any]]) -> None:
    """Writes attributes by the path of their group, "" for the file itself."""
    for path, values in attributes.items():
        (_group(file, path) if path else file).attrs.update(values)


def _group(file: h5py.File, path: str) -> h5py.Group:
    """The group of a path; those that do not exist are made, each with its order of creation, as NetCDF wants it."""
    group: h5py.Group = file
    for name in path.split("/"):
        found = group.get(name)
        group = found if isinstance(found, h5py.Group) else group.create_group(name, track_order=True)
    return group


class GroupWriter:
    """The fields of a group in an open file."""

    def __init__(self, group: h5py.Group, fields: Fields, identifiers: Iterator[int], chunk: int | None) -> None:
        """Writes the fields, then gives each axis the scale of its dimension.

        Args:
            group: Of the open file.
            fields: Dimensions, first values and descriptions.
            identifiers: Give the dimensions of a file their numbers.
            chunk: Rows of a chunk, for a group that grows; None makes all rows one chunk, as logs are read whole.
        """
        self._codes: dict[str, dict[str, int]] = {name: {} for name, item in fields.items() if item.coded}
        self._datasets = {name: self._save(group, name, item, chunk) for name, item in fields.items()}
        self.rows = len(next(iter(fields.values())).values) if fields else 0
        scales = {name: self._datasets[name] for name, item in fields.items() if item.dimensions == (name,)}
        for name, dataset in scales.items():
            _make_scale(dataset, name, identifiers)
        for name, item in fields.items():
            self._datasets[name].attrs.update(item.attributes)
            for axis, dimension in enumerate(item.dimensions):
                if dimension not in scales:
                    scales[dimension] = _bare_scale(group, dimension, item.values.shape[axis], identifiers)
                if dimension != name:
                    self._datasets[name].dims[axis].attach_scale(scales[dimension])

    def append(self, columns: Mapping[str, NDArray[Any]]) -> None:
        """Appends rows to every field."""
        end = self.rows + len(next(iter(columns.values())))
        for name, values in columns.items():
            dataset = self._datasets[name]
            dataset.resize(end, axis=0)
            dataset[self.rows :] = self._stored(name, values)
        self.rows = end

    def finish(self) -> None:
        """Writes the texts of the categories, also as flags of the CF conventions, section 3.5."""
        for name, codes in self._codes.items():
            if codes:
                attributes = self._datasets[name].attrs
                attributes.create("categories", list(codes), dtype=h5py.string_dtype())
                attributes["flag_values"] = np.arange(len(codes), dtype=np.int16)
                attributes["flag_meanings"] = " ".join("_".join(text.split()) or "none" for text in codes)

    def _stored(self, name: str, values: NDArray[Any]) -> NDArray[Any]:
        """Values as the file holds them: codes for categories, int8 for booleans."""
        if name in self._codes:
            codes = self._codes[name]
            return np.array([codes.setdefault(text, len(codes)) for text in values.tolist()], dtype=np.int16)
        return values.astype(np.int8) if values.dtype == bool else values

    def _save(self, group: h5py.Group, name: str, item: Field, chunk: int | None) -> h5py.Dataset:
        stored = self._stored(name, item.values)
        sizes = (len(stored) if chunk is None else chunk, *stored.shape[1:])
        options: dict[str, Any] = {"maxshape": (None, *stored.shape[1:]), "track_order": True}
        options["chunks"] = tuple(max(size, 1) for size in sizes)
        if stored.dtype == object:
            return group.create_dataset(name, data=stored, dtype=h5py.string_dtype(), **options)
        images = stored.ndim == 3 and stored.dtype == np.int8
        if stored.ndim == 1 or images:  # also held commands; of vectors and covariances gzip only takes 15 %, slowly
            options |= {"compression": "gzip", "compression_opts": 1, "shuffle": True}
        dataset = group.create_dataset(name, data=stored, **options)
        if item.coded or item.values.dtype == bool:
            dataset.attrs[_MARK] = "category" if item.coded else "bool"
        return dataset


def _bare_scale(group: h5py.Group, dimension: str, size: int, identifiers: Iterator[int]) -> h5py.Dataset:
    """A dimension without coordinate, with the words by which the NetCDF library knows it."""
    bare = group.create_dataset(dimension, (size,), ">f4")
    return _make_scale(bare, f"This is a netCDF dimension but not a netCDF variable.{size:10}", identifiers)


def _make_scale(dataset: h5py.Dataset, name: str, identifiers: Iterator[int]) -> h5py.Dataset:
    dataset.make_scale(name)
    dataset.attrs["_Netcdf4Dimid"] = np.int32(next(identifiers))
    return dataset


def load(path: str | os.PathLike[str]) -> Content:
    """What a file holds; dimensions without coordinate are left out.

    Raises:
        InputError: if there is no such file, or it is not a whole NetCDF-4 file.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    groups: dict[str, Fields] = {}
    attributes: dict[str, Mapping[str, Any]] = {}
    try:
        with h5py.File(path, "r") as file:
            _load_group(file, "", groups, attributes)
    except UNREADABLE as error:
        raise InputError(f"{path}: not a whole NetCDF-4 file: {first_line(error)}") from error
    return Content(groups, attributes)


def first_line(error: BaseException) -> str:
    """First line of an error's text, or its kind where it has none."""
    return next(iter(str(error).splitlines()), type(error).__name__)


def _load_group(
    group: h5py.Group, path: str, groups: dict[str, Fields], attributes: dict[str, Mapping[str, Any]]
) -> None:
    """Adds the fields and attributes of a group and of those below it."""
    if found := _attributes(group):
        attributes[path] = found
    datasets = {}
    for name, item in group.items():
        if isinstance(item, h5py.Group):
            _load_group(item, f"{path}/{name}".lstrip("/"), groups, attributes)
        elif isinstance(item, h5py.Dataset):
            datasets[name] = item
    names = {_address(dataset.id): name for name, dataset in datasets.items()}
    bare = np.dtype(">f4")  # the type of a dimension without coordinate, as `create` writes it
    fields = {name: _load_field(item, names) for name, item in datasets.items() if item.dtype != bare}
    if fields:
        groups[path] = fields


def _load_field(dataset: h5py.Dataset, names: Mapping[int, str]) -> Field:
    values = np.asarray((dataset.asstr() if h5py.check_string_dtype(dataset.dtype) else dataset)[...])
    found = _attributes(dataset)
    mark = found.pop(_MARK, None)
    if mark == "bool":
        values = values.astype(bool)
    if mark == "category":
        texts = np.array([*found.pop("categories", ())], dtype=object)
        found = {key: value for key, value in found.items() if not key.startswith("flag_")}
        if values.size and (values.min() < 0 or values.max() >= len(texts)):
            raise ValueError(f"'{dataset.name}' has a code without category")
        values = texts[values] if values.size else np.empty(values.shape, dtype=object)
    return Field(_dimensions(dataset, names), values, found, coded=mark == "category")


def _dimensions(dataset: h5py.Dataset, names: Mapping[int, str]) -> tuple[str, ...]:
    """Names of the dimensions, by those of the group's datasets: the scales of each axis, or a coordinate itself."""
    if "DIMENSION_LIST" not in dataset.attrs:
        return (names[_address(dataset.id)],)
    axes: Any = dataset.attrs["DIMENSION_LIST"]
    # By addresses, since HDF5 searches the whole file for the name of what a reference points to.
    return tuple(names[_address(h5py.h5r.dereference(axis[0], dataset.id))] for axis in axes)


def _address(item: Any) -> int:
    return h5py.h5o.get_info(item).addr


def _attributes(item: h5py.Group | h5py.Dataset) -> dict[str, Any]:
    """Attributes as Python's own numbers and texts, without the books of HDF5 and NetCDF."""
    values = {name: item.attrs[name] for name in item.attrs if name not in _BOOKS}
    return {
        name: value.item() if isinstance(value, np.generic | np.ndarray) and value.ndim == 0 else value
        for name, value in values.items()
    }
