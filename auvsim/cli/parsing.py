"""Reads the arguments of a command into its dataclass."""

import contextlib
import io
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import tyro

from auvsim.base.errors import InputError

FILES = {".nc", ".csv", ".txt", ".tsv", ".dat", ".xml", ".yaml", ".yml", ".mcap", ".bag", ".db3", ".parquet"}


def parse(kind: Any, arguments: Sequence[str], prog: str, description: str) -> Any:
    """Returns an instance of a dataclass, or of one of a union's as subcommands, made from arguments.

    Args:
        kind: Dataclass or union of them, with tyro's annotations.
        arguments: Arguments of the command line, without the program's name.
        prog: Name of the command in its help.
        description: First line of its help.

    Raises:
        InputError: One line that says what is wrong with them.
    """
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            return tyro.cli(kind, prog=prog, args=arguments, description=description)
    except SystemExit as leave:
        if not leave.code:
            raise
        raise InputError(f"{_message(complaint.getvalue())}; see {prog} --help") from None


def files_first(arguments: Sequence[str], options: Sequence[str]) -> list[str]:
    """Arguments with the files among the values of options that take several names, which are no names, before them.

    `identify --steps segments turn.nc` is `identify turn.nc --steps segments`.

    Args:
        arguments: the command, then its arguments.
        options: that take several names, such as `--steps`.
    """
    files: list[str] = []
    rest: list[str] = []
    within = False
    for token in arguments:
        if token.startswith("-"):
            within = token.split("=", 1)[0] in options
        is_file = within and ":" not in token and Path(token).suffix.lower() in FILES
        (files if is_file else rest).append(token)
    return [*rest[:1], *files, *rest[1:]]


def _message(box: str) -> str:
    """Takes the message out of tyro's box: title, message, rule, advice; without characters for boxes, lines of "-"."""
    _, *lines = [line.strip("│ ") for line in box.splitlines()]
    parts = groupby(lines, key=lambda line: not line.strip("─-╭╮╰╯"))
    return " ".join(next((list(part) for is_rule, part in parts if not is_rule), [])).rstrip(".")
