"""The command `auvsim`."""

import logging
import os
import sys
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from auvsim import CACHE_NOTE, RENDERER_NOTE, __version__
from auvsim.base.errors import AuvsimError, DrawingError
from auvsim.base.neighbours import check_estimators
from auvsim.cli.commands import TAKE_NAMES, TAKE_SCENARIO_KEYS, Command
from auvsim.cli.interruption import Interruption
from auvsim.cli.parsing import files_first, parse

_DESCRIPTION = "Closed-loop simulation of autonomous underwater vehicles."


@dataclass(frozen=True, kw_only=True)
class Auvsim:
    """The whole command line."""

    command: tyro.conf.OmitSubcommandPrefixes[tyro.conf.OmitArgPrefixes[Command]]
    version: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Prints the version."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line and returns its exit code."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    if arguments == ["--version"]:
        print(f"auvsim {__version__}")
        return 0
    logging.getLogger("absl").setLevel(logging.ERROR)  # MuJoCo's warnings; what comes of them is said in one line
    if CACHE_NOTE:
        print(f"auvsim: {CACHE_NOTE}", file=sys.stderr)
    with Interruption() as interruption:
        try:
            return _run(arguments)
        except AuvsimError as error:
            more = f"; {RENDERER_NOTE}" if isinstance(error, DrawingError) and RENDERER_NOTE else ""
            print(f"auvsim: {' '.join(str(error).split())}{more}", file=sys.stderr)
            return error.exit_code
        except KeyboardInterrupt:
            pass
        except BrokenPipeError:  # the reader, such as `head`, has what it wanted
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        except OSError as error:  # a full disk, a file that may not be read
            if not interruption.came:
                print(f"auvsim: {_of_a_file(error)}", file=sys.stderr)
                return 2
        except MemoryError as error:
            print(f"auvsim: out of memory: {' '.join(str(error).split())}".rstrip(": "), file=sys.stderr)
            return 1
        except Exception as error:
            folder = _cache_at_fault(error)
            if folder and not interruption.came:
                text = " ".join(str(error).split())[:200]
                print(
                    f"auvsim: compiled code in {folder} cannot be read ({type(error).__name__}: {text}); delete its "
                    ".nbi and .nbc files, or set NUMBA_CACHE_DIR to another folder",
                    file=sys.stderr,
                )
                return 1
            if not interruption.came:
                raise
    print("auvsim: interrupted", file=sys.stderr)
    return 130


def _cache_at_fault(error: BaseException) -> str | None:
    """The folder of compiled code, if that is what an error is about."""
    for frame, _ in traceback.walk_tb(error.__traceback__):
        if Path(frame.f_code.co_filename).parts[-3:] == ("numba", "core", "caching.py"):
            place = getattr(frame.f_locals.get("self"), "_cache_path", None)
            if place is not None:
                return str(place)
    return None


def _of_a_file(error: OSError) -> str:
    """What is wrong with a file, in one line."""
    names = [str(name) for name in (error.filename, error.filename2) if name is not None]
    name = names[-1] if names else type(error).__name__
    shown = name if len(name) <= 200 else f"{name[:197]}..."
    return f"{shown}: {' '.join((error.strerror or str(error)).split())}"


def _run(arguments: list[str]) -> int:
    check_estimators()
    name = arguments[0] if arguments else ""
    if name == "study":  # each study has options of its own
        from auvsim.cli import study

        return study.run(arguments[1:])
    takes_keys, values = TAKE_SCENARIO_KEYS.get(name), {}
    if takes_keys is not None and not {"-h", "--help"} & set(arguments):
        from auvsim.cli import options

        arguments, values = options.split(arguments, takes_keys)
    command: Any = parse(Auvsim, files_first(arguments, TAKE_NAMES.get(name, ())), "auvsim", _DESCRIPTION).command
    return command.run(values) if takes_keys is not None else command.run()
