"""`python -m tests.golden.compare A B` lists what is not bit-equal in two folders of logs; `record DIR` makes one."""

import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from auvsim.data.log import read

from . import names

Contents = dict[str, NDArray[Any]]  # arrays and attributes by path, see `names`
VERSION = "@format_version"
USAGE = "usage: python -m tests.golden.compare {DIR_A DIR_B | record DIR}"


def load(path: Path) -> Contents:
    """Every array of every group of a log, and the attributes of the groups; of earlier formats as they are read."""
    log = read(path)
    found = {f"{group}/{name}": values for group, columns in log.groups.items() for name, values in columns.items()}
    for group, attributes in ({"": log.attributes} | log.group_attributes).items():
        found |= {f"{group}@{name}": np.asarray(value) for name, value in attributes.items()}
    with h5py.File(path, "r") as file:
        found[VERSION] = np.asarray(file.attrs["format_version"])
    return found


def differences(a: Contents, b: Contents) -> list[str]:
    """A line for each array or attribute of two logs that is not the same bit for bit."""
    ignored = set(names.FREE)
    if a[VERSION] != b[VERSION]:
        ignored |= {*names.NEW, *names.CHANGED}
    first, second = (
        {path: value for path, value in log.items() if not any(names.below(path, name) for name in ignored)}
        for log in (a, b)
    )
    # A sensor that the vehicle lacks had an empty group once.
    found = [f"{path}: only in the first" for path in first if path not in second and first[path].size]
    found += [f"{path}: only in the second" for path in second if path not in first and second[path].size]
    common = [path for path in first if path in second and not _same(first[path], second[path])]
    return found + [f"{path}: {_how(first[path], second[path])}" for path in common]


def folders(a: Path, b: Path) -> dict[str, list[str]]:
    """The differences of the logs of two folders, by file.

    Raises:
        FileNotFoundError: If there is no log in either.
    """
    files = sorted({path.relative_to(folder) for folder in (a, b) for path in folder.rglob("*.nc")})
    if not files:
        raise FileNotFoundError(f"no .nc file in {a} or {b}")
    return {str(file): _file_differences(a / file, b / file) for file in files}


def main(arguments: list[str]) -> int:
    """Runs the command line and returns its exit code: 1 if anything differs."""
    if len(arguments) != 2:
        print(USAGE, file=sys.stderr)
        return 2
    if arguments[0] == "record":
        _record(Path(arguments[1]))
        return 0
    found = folders(Path(arguments[0]), Path(arguments[1]))
    for file, lines in found.items():
        print(f"{file}: {'equal' if not lines else ''}")
        print("".join(f"  {line}\n" for line in lines), end="")
    return int(any(found.values()))


def _record(folder: Path) -> None:
    from .cases import CASES, run

    folder.mkdir(parents=True, exist_ok=True)
    for name, case in CASES.items():
        run(case, folder / f"{name}.nc")
        print(folder / f"{name}.nc")


def _file_differences(a: Path, b: Path) -> list[str]:
    missing = [path for path in (a, b) if not path.is_file()]
    return [f"there is no {path}" for path in missing] or differences(load(a), load(b))


def _same(a: NDArray[Any], b: NDArray[Any]) -> bool:
    if a.shape != b.shape or a.dtype != b.dtype:
        return False
    return a.tolist() == b.tolist() if a.dtype == object else a.tobytes() == b.tobytes()


def _how(a: NDArray[Any], b: NDArray[Any]) -> str:
    """In what two arrays differ, in words."""
    if a.shape != b.shape or a.dtype != b.dtype:
        return f"{a.dtype} of shape {a.shape}, then {b.dtype} of shape {b.shape}"
    if not a.ndim:
        return f"{str(a)[:60]!r}, then {str(b)[:60]!r}"
    unequal = [i for i in range(len(a)) if not _same(a[i : i + 1], b[i : i + 1])]
    text = f"{len(unequal)} of {len(a)} rows differ, from row {unequal[0]}"
    if a.dtype.kind == "f":
        text += f"; by {np.nanmax(np.abs(a - b), initial=0.0):.3g} at most"
    return text


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
