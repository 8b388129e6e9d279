"""Errors of auvsim: one root; a text says what was wrong, where, and what would be right."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

DOTTED = re.compile(r"([a-z]\w*(?:\.[\w-]+)+): ")  # key before the text of an error


class AuvsimError(Exception):
    """Root of all errors that auvsim raises on purpose."""

    exit_code = 2


class InputError(AuvsimError):
    """A scenario, model, log or argument that cannot be used; the process leaves with exit code 2."""


class DivergenceError(AuvsimError):
    """The simulation left the range of finite, physical states; the process leaves with exit code 1."""

    exit_code = 1


class DrawingError(AuvsimError):
    """There is no OpenGL to draw with; everything but video works without."""


@contextmanager
def at_key(key: str) -> Iterator[None]:
    """Puts a dotted key before the text of an InputError, unless one stands there."""
    try:
        yield
    except InputError as error:
        if DOTTED.match(str(error)):
            raise
        raise InputError(f"{key}: {error}") from error


def unknown_name(kind: str, name: str, known: list[str]) -> InputError:
    """An error that lists the names that do exist: `no vehicle 'remus'; there are lauv, remus100`."""
    name = name if len(name) <= 100 else f"{name[:97]}..."
    return InputError(f"no {kind} '{name}'; there are {', '.join(sorted(known)) or 'none'}")
