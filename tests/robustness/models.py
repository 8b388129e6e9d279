"""Spoiled copies of the shipped models, as a user's own files."""

from pathlib import Path

from auvsim.vehicles import model_files


def text(kind: str) -> str:
    """MJCF of the shipped vehicle or structure."""
    return model_files.source(kind, {"vehicle": "remus100", "structure": "dock"}[kind])[1]


def spoiled(folder: Path, kind: str, *changes: tuple[str, str], name: str = "mine") -> str:
    """Path of a copy in which each text is replaced, wherever it stands.

    Args:
        folder: where to write it.
        kind: vehicle or structure.
        changes: old and new text of each change.
        name: of the file.
    """
    found = text(kind)
    for old, new in changes:
        assert old in found, old
        found = found.replace(old, new)
    path = folder / f"{name}.xml"
    path.write_text(found, encoding="utf-8")
    return str(path)
