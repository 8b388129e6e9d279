"""What goes to a worker, and what comes back."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from auvsim.campaign.criterion import Criterion


@dataclass(frozen=True, kw_only=True, slots=True)
class Task:
    """One trial to run."""

    variant: str
    trial: int
    seed: int
    values: Mapping[str, Any]  # of its scenario, all definite
    missions: Mapping[str, str]  # kind of each vehicle's mission, by its name
    criterion: Criterion | None = None  # what counts as success
    keep: str = "none"  # of which trials the log is wanted: none, failures or all


@dataclass(frozen=True, kw_only=True, slots=True)
class Result:
    """What became of it."""

    summary: dict[str, Any] | None  # `analysis.summary`, without what depends on the machine
    error: dict[str, str] | None  # type, message and traceback of what it raised
    run: dict[str, Any]  # what may differ from run to run
    log: bytes | None = None  # NetCDF
