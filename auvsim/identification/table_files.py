"""CSV and NetCDF files of a user's vehicle as named columns of numbers and texts."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.io import netcdf_file

from auvsim.base.errors import InputError
from auvsim.identification import table_text
from auvsim.identification.table_text import Column
from estimators.core.types import Array


def load(path: Path) -> tuple[dict[str, Column], list[str]]:
    """The columns of a text file (see `table_text`) or of a NetCDF file, and notes on how it was understood.

    Raises:
        InputError: If it cannot be read as either.
    """
    try:
        with path.open("rb") as stream:
            head = stream.read(8)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    if head.startswith(b"\x89HDF"):
        return _from_hdf(path), []
    if head.startswith(b"CDF"):
        return _from_classic(path), []
    return table_text.read(path)


def _from_hdf(path: Path) -> dict[str, Column]:
    found: dict[str, Column] = {}

    def visit(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or item.ndim != 1 or item.dtype.kind not in "fiubOS":
            return
        if "but not a netCDF" in str(item.attrs.get("NAME", "")):
            return  # a dimension without values
        scales = [str(scale.name).strip("/") for scale in item.dims[0].values()]
        own = scales[0] if scales and scales[0] != name else None
        text = item.dtype.kind in "OS"
        raw = np.asarray((item.asstr() if text else item)[...])
        found[name] = Column(
            values=np.full(len(raw), np.nan) if text else _filled(raw, item.attrs.get("_FillValue")),
            texts=raw if text else None,
            unit=_text(item.attrs.get("units")),
            time=own,
        )

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        raise InputError(f"{path}: not a whole NetCDF-4 file: {str(error).splitlines()[0]}") from None
    return found


def _from_classic(path: Path) -> dict[str, Column]:
    try:
        with netcdf_file(path, "r", mmap=False) as file:
            return {
                name: Column(
                    values=_filled(np.array(variable[:]), getattr(variable, "_FillValue", None)),
                    unit=_text(getattr(variable, "units", None)),
                    time=variable.dimensions[0] if variable.dimensions[0] != name else None,
                )
                for name, variable in file.variables.items()
                if len(variable.dimensions) == 1 and np.array(variable[:]).dtype.kind in "fiu"
            }
    except (OSError, ValueError, TypeError, AssertionError, IndexError) as error:
        raise InputError(f"{path}: not a whole NetCDF file: {str(error) or type(error).__name__}") from None


def _filled(values: NDArray[Any], fill: Any) -> Array:
    numbers = np.asarray(values, dtype=float)
    missing = ~np.isfinite(numbers)
    if fill is not None:
        missing |= numbers == float(np.ravel(fill)[0])
    return np.where(missing, np.nan, numbers)


def _text(value: Any) -> str | None:
    if value is None:
        return None
    return value.decode() if isinstance(value, bytes) else str(value)
