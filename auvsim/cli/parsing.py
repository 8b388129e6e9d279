"""Reads the arguments of a command into its dataclass."""

import contextlib
import io
from collections.abc import Sequence
from itertools import groupby
from typing import Any

import tyro

from auvsim.base.errors import InputError


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


def _message(box: str) -> str:
    """Takes the message out of tyro's box: title, message, rule, advice; without characters for boxes, lines of "-"."""
    _, *lines = [line.strip("│ ") for line in box.splitlines()]
    parts = groupby(lines, key=lambda line: not line.strip("─-╭╮╰╯"))
    return " ".join(next((list(part) for is_rule, part in parts if not is_rule), [])).rstrip(".")
