"""Writes files whole or not at all: under a temporary name, renamed when done."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def partial_name(path: Path) -> Path:
    """Temporary name beside `path`; it keeps the suffix, from which writers of pictures and videos know the format."""
    return path.with_name(f".{path.stem}.{os.getpid()}.partial{path.suffix}")


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Gives a temporary name beside `path` to write to; renames it on success, removes it on any failure."""
    path = Path(path)
    partial = partial_name(path)
    try:
        yield partial
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
