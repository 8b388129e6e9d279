"""A NetCDF-4 log that grows during a run and gets its name only when it is complete."""

import contextlib
import io
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
from numpy.typing import NDArray

from auvsim.base.errors import InputError
from auvsim.base.files import partial_name
from auvsim.data import netcdf
from auvsim.data.fields import empty
from auvsim.data.variables import Group


class Stream:
    """The partial file of a growing log: rows are appended, it is closed, and then gets its name.

    Every method raises InputError if the file cannot be written; the partial file is then gone.
    """

    def __init__(self, path: Path, tables: Mapping[str, Group]) -> None:
        """Creates the file beside `path`, with empty groups."""
        self.path = path
        self.partial = partial_name(path)
        try:
            self._sink = _Sink(self.partial)
        except OSError as error:
            raise _failure(path, error) from error
        self._file = h5py.File(self._sink, "w", track_order=True)
        groups = {name: empty(group) for name, group in tables.items()}
        self._groups = netcdf.create(self._file, groups, chunk=netcdf.CHUNK)
        self._raise_failure()

    def append(self, group: str, columns: Mapping[str, NDArray[Any]]) -> None:
        """Appends rows to a group."""
        self._groups[group].append(columns)
        self._raise_failure()

    def close(self, attributes: Mapping[str, Mapping[str, Any]]) -> None:
        """Writes the attributes by path, and all that is not on the disk yet."""
        for group in self._groups.values():
            group.finish()
        netcdf.describe(self._file, attributes)
        self._file.close()
        self._sink.sync()
        self._raise_failure()
        self._sink.close()

    def rename(self) -> None:
        """Gives the closed file its name."""
        try:
            self.partial.replace(self.path)
        except OSError as error:
            self.discard()
            raise _failure(self.path, error) from error

    def discard(self) -> None:
        """Removes the partial file."""
        with contextlib.suppress(*netcdf.UNREADABLE):
            self._sink.error = self._sink.error or OSError("discarded")  # what HDF5 still holds need not be written
            self._file.close()
        self._sink.close()
        self.partial.unlink(missing_ok=True)

    def _raise_failure(self) -> None:
        if error := self._sink.error:
            self.discard()
            raise _failure(self.path, error) from error


def _failure(path: Path, error: OSError) -> InputError:
    return InputError(f"{path}: cannot be written: {error.strerror}")


class _Sink(io.FileIO):
    """A file that keeps its first failure for later and then swallows what is written.

    HDF5 cannot close a file of which it cannot write a part: it tries again until the interpreter ends.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+")
        self.error: OSError | None = None

    def write(self, data: Any) -> int:
        """Writes all of the data, unless a write failed before."""
        view = memoryview(data).cast("B")
        size = len(view)
        try:
            while len(view) and self.error is None:
                view = view[super().write(view) :]
        except OSError as error:
            self.error = error
        return size

    def truncate(self, size: int | None = None) -> int:
        """Changes the size of the file, unless a write failed before."""
        try:
            if self.error is None:
                return super().truncate(size)
        except OSError as error:
            self.error = error
        return size or 0

    def sync(self) -> None:
        """Waits until the file is on the disk."""
        try:
            os.fsync(self.fileno())
        except OSError as error:
            self.error = self.error or error
