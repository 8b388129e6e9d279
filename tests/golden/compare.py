"""`python -m tests.golden.compare A B` lists what is not bit-equal in two folders of logs; `record DIR` makes one."""

import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from . import names

Contents = dict[str, NDArray[Any]]  # arrays and attributes by path, see `names`
VERSION, OLD = "@format_version", 2
USAGE = "usage: python -m tests.golden.compare {DIR_A DIR_B | record DIR}"
BARE = b"This is a netCDF dimension but not a netCDF variable"


def load(path: Path) -> Contents:
    """Every array of every group of a NetCDF-4 file, at any depth, and the attributes of the groups."""
    found: Contents = {}

    def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
        if isinstance(item, h5py.Group):
            found.update({f"{name}@{key}": np.asarray(value) for key, value in item.attrs.items()})
        elif not bytes(item.attrs.get("NAME", b"")).startswith(BARE):
            found[name] = np.asarray((item.asstr() if h5py.check_string_dtype(item.dtype) else item)[...])

    with h5py.File(path, "r") as file:
        visit("", file)
        file.visititems(visit)
    return found


def old_form(contents: Contents) -> Contents:
    """A log under the names of format 2, whichever it has; what only newer ones hold keeps its own."""
    if contents[VERSION] <= OLD:
        return contents
    left, found = dict(contents), {}
    for old, new in names.RENAMED.items():
        if isinstance(new, tuple):
            found[old] = np.stack([left.pop(path) for path in new], axis=-1)
            continue
        moved = [path for path in left if names.below(path, new)]
        found |= {old + path[len(new) :]: left.pop(path) for path in moved}
    return left | found


def differences(a: Contents, b: Contents) -> list[str]:
    """A line for each array or attribute of two logs that is not the same bit for bit, under the names of format 2."""
    ignored = set(names.FREE)
    if a[VERSION] != b[VERSION]:
        ignored |= {*names.NEW, *names.CHANGED}
    first, second = (
        {path: value for path, value in old_form(log).items() if not any(names.below(path, name) for name in ignored)}
        for log in (a, b)
    )
    found = [f"{path}: only in the first" for path in first if path not in second]
    found += [f"{path}: only in the second" for path in second if path not in first]
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
