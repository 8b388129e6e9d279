"""The folder of a campaign, which is its checkpoint: one whole file for each trial that is finished."""

import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.campaign import plan as plans
from auvsim.campaign.plan import Plan

TOGETHER = 1000  # trials in one subfolder: file systems slow down with folders of very many files
LOCK, PLAN, STATE = ".lock", "plan.yaml", "campaign.json"

Record = dict[str, Any]  # one trial as its file has it, see `trials.record`


@dataclass(frozen=True)
class Folder:
    """A campaign on disk."""

    path: Path
    plan: Plan
    state: dict[str, Any] = field(default_factory=dict)  # what campaign.json says

    def record_path(self, variant: str, trial: int) -> Path:
        """Where the file of a finished trial is."""
        return self.path / "trials" / variant / f"{trial // TOGETHER:03d}" / f"{trial:06d}.json"

    def log_path(self, variant: str, trial: int) -> Path:
        """Where its log is, if the plan keeps it."""
        return self.path / "logs" / variant / f"{trial:06d}.nc"

    def replay_path(self, variant: str, trial: int) -> Path:
        """The folder of a trial that was run again with `replay_command`."""
        return self.path / "replays" / f"{variant}-{trial}"

    def replay_command(self, variant: str, trial: int) -> str:
        """What runs one trial again, alone and with a video."""
        only = f" --variant {variant}" if len(self.plan.variants) > 1 else ""
        return f"auvsim campaign {self.path} --trial {trial}{only}"

    def save(self, record: Record, log: bytes | None) -> None:
        """Keeps a finished trial: its log first, so that a record says that all of it is there.

        Raises:
            InputError: If there is no room, or the folder cannot be written to.
        """
        variant, trial = record["variant"], record["trial"]
        if log is not None:
            write(self.log_path(variant, trial), log)
        write(self.record_path(variant, trial), as_json(record))

    def save_plan(self) -> None:
        """Writes plan.yaml, by which, with campaign.json, the folder becomes a campaign's; may raise as `save`."""
        write(self.path / PLAN, self.plan.to_yaml().encode())

    def save_state(self) -> None:
        """Writes campaign.json; may raise as `save`."""
        write(self.path / STATE, as_json(self.state))

    def read(self, variant: str, trial: int) -> Record | None:
        """A finished trial; None if it is not, or if a power cut left less than the whole file."""
        try:
            record = json.loads(self.record_path(variant, trial).read_bytes())
        except (FileNotFoundError, ValueError):
            return None
        complete = isinstance(record, dict) and (record.get("variant"), record.get("trial")) == (variant, trial)
        return record if complete else None

    def records(self) -> Iterator[Record]:
        """The finished trials, variant by variant in the plan's order, one at a time."""
        last = self.state.get("stopped") or self.plan.settings.trials
        for variant in self.plan.variants:
            for trial in range(last):
                record = self.read(variant, trial)
                if record is not None:
                    yield record


def write(path: Path, content: bytes) -> None:
    """Writes a file of a campaign, whole and synced.

    Raises:
        InputError: If there is no room, or the folder cannot be written to.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as partial, open(partial, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(
            f"{path}: cannot be written: {reason}; what is finished is kept, the same command goes on from there"
        ) from None


def open_folder(path: Path) -> Folder:
    """The campaign in a folder, to read.

    Raises:
        InputError: If there is none.
    """
    for name in (PLAN, STATE):
        if not (path / name).is_file():
            raise InputError(f"{path}: no campaign; there is no {name} in it")
    return Folder(path, plans.load(str(path)), _state(path))


def open_begun(path: Path) -> Folder:
    """The campaign in a folder, to read, of which some trial is done.

    Raises:
        InputError: If there is none.
    """
    found = open_folder(path)
    if next(found.records(), None) is None:
        raise InputError(f"{path}: no trial of this campaign is done; `auvsim campaign {path}` runs them")
    return found


@contextmanager
def claimed(path: Path, plan: Plan, versions: Mapping[str, str]) -> Iterator[Folder]:
    """The folder of a campaign that is to run or to go on, for this process alone.

    Raises:
        InputError: If it holds something else, another plan or results of other versions, if another process runs in
            it, or if it cannot be written to.
    """
    old = (path / PLAN).is_file() and (path / STATE).is_file()
    # A run that was killed as it began leaves no plan; without campaign.json the plan is one of the user's own.
    names = [entry.name for entry in path.iterdir()] if path.is_dir() else []
    if not old and any(name not in (LOCK, STATE) and ".partial" not in name for name in names):
        raise InputError(f"{path}: holds something else than a campaign; give another folder with --out")
    folder = Folder(path, plan, _state(path) if old else {})
    if old:
        _check_same(path, plans.load(str(path)), plan)
        check_versions(path, folder.state.get("versions", versions), versions)
    with locked(path):
        for partial in [*path.glob(".*.partial*"), *path.glob("*/**/.*.partial*")]:  # of a run that was killed
            partial.unlink(missing_ok=True)
        yield folder


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Makes the folder and keeps other processes out of it; a new one that stays empty goes again.

    Raises:
        InputError: If another process runs in it, or it cannot be written to.
    """
    new = [folder for folder in (path, *path.parents) if not folder.exists()]
    try:
        path.mkdir(parents=True, exist_ok=True)
        lock = os.open(path / LOCK, os.O_CREAT | os.O_RDWR)
    except OSError as error:
        reason = "it is a file, not a folder" if path.is_file() else (error.strerror or str(error)).lower()
        raise InputError(f"{path}: cannot be written to: {reason}; give another folder with --out") from None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)  # goes with the process, however that ends
    except BlockingIOError:
        os.close(lock)
        raise InputError(f"{path}: another process runs this campaign") from None
    try:
        yield
    finally:
        if new and [entry.name for entry in path.iterdir()] == [LOCK]:
            (path / LOCK).unlink()
            for folder in new:
                folder.rmdir()
        os.close(lock)


def _check_same(path: Path, old: Plan, new: Plan) -> None:
    key = _difference(old.identity(), new.identity())
    if key is not None:
        raise InputError(f"{path}: holds another plan ({key} differs); give another folder with --out")


def check_versions(path: Path, old: Mapping[str, str], new: Mapping[str, str]) -> None:
    """Refuses to go on in a folder of results of other versions (InputError)."""
    for package, version in new.items():
        if old.get(package) != version:
            text = f"was begun with {package} {old.get(package)}, and this is {version}"
            raise InputError(f"{path}: {text}: results would not be of one kind; give another folder with --out")


def _difference(a: Any, b: Any, path: str = "") -> str | None:
    """The first dotted key in which two nested values differ."""
    if not isinstance(a, Mapping) or not isinstance(b, Mapping):
        return None if a == b else path
    keys = dict.fromkeys([*a, *b])
    below = (_difference(a.get(key), b.get(key), f"{path}.{key}" if path else key) for key in keys)
    return next((key for key in below if key is not None), None if list(a) == list(b) else path)


def _state(path: Path) -> dict[str, Any]:
    try:
        return json.loads((path / STATE).read_bytes())
    except (FileNotFoundError, ValueError):
        return {}


def as_json(values: Mapping) -> bytes:
    """Values as the text of a file."""
    return (json.dumps(values, indent=1, allow_nan=False) + "\n").encode()
