"""The columns of a campaign's table, from what the missions of its vehicles declare, and what counts as success.

`python -m auvsim.campaign.columns` prints those of docking.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from auvsim.analysis.estimates import AT_REST
from auvsim.analysis.summary import NO_METRICS
from auvsim.base.errors import InputError
from auvsim.campaign.criterion import Criterion
from auvsim.missions import contract, registry
from auvsim.missions.mission import Metric

Row = dict[str, Any]  # of the table, by column; None where there is no value
Columns = dict[str, Metric]

TRIAL: Columns = {
    "variant": Metric("str", "", "name of the variant"),
    "trial": Metric("int", "1", "number of the trial; the same number is the same draws in each variant"),
    "seed": Metric("int", "1", "seed of the random streams"),
}
VEHICLE = Metric("str", "", "name of the vehicle")
MISSION = Metric("str", "", "kind of its mission")
SUCCESS = "success"  # column where no mission has one that says it
OUTCOME: Columns = {
    "failure": Metric(
        "str", "", "timeout, aborted or diverged; error (it raised), died or hung (its process, twice); else none"
    ),
    "failure_text": Metric("str", "", "what the log or the error says of it"),
    "time": Metric("float", "s", "of the end"),
}
RENAMED = {"failure_reason": "failure"}  # metrics that the table calls otherwise, since it has more to say there
SAID = ("failure", "failure_text")  # of which the table says what it means, whatever the mission says
QUALITIES: Columns = {
    "samples": Metric("int", "1", "estimates, since the first fix"),
    "position_rms": Metric("float", "m", "error of the estimated horizontal position, rms"),
    "heading_rms_deg": Metric("float", "deg", "error of the estimated heading, rms"),
    "velocity_rms": Metric("float", "m/s", "error of the estimated surge and sway together, rms"),
    "current_rms": Metric("float", "m/s", "error of the estimated current, rms"),
    "nees_per_dof": Metric("float", "1", "mean NEES of the horizontal position a degree of freedom; 1 is consistent"),
    "coverage_95": Metric("float", "1", "share of estimates whose 95 % ellipse holds the truth"),
    "relative_rms": Metric("float", "m", "error of the horizontal position as the dock's own axis shows it, rms"),
    "nees_relative": Metric("float", "1", "mean NEES of that a degree of freedom"),
}
FIXES: Columns = {
    "fixes_sent": Metric("int", "1", "position fixes that the dock sent"),
    "fixes_lost": Metric("int", "1", "of these, never arrived"),
    "fixes_outliers": Metric("int", "1", "outliers that arrived"),
    "fixes_refused": Metric("int", "1", "fixes that the estimator refused"),
}
ERROR: Columns = {
    "error_type": Metric("str", "", "class of the error, Died or Hung; none if nothing was raised"),
    "error_message": Metric("str", "", "what it says"),
    "traceback": Metric("str", "", "where it was raised"),
}
TABLES_OWN = TRIAL | {"vehicle": VEHICLE, "mission": MISSION, SUCCESS: VEHICLE} | QUALITIES | FIXES | ERROR
SUCCESSES = ("docked", "finished")  # columns of missions that say it, where the plan does not
COMPARED = ("position_rms", "current_rms", "nees_per_dof")  # between variants, beside what missions measure
TYPES = {"str": str, "bool": bool, "int": int, "float": float}


@dataclass(frozen=True, kw_only=True)
class Layout:
    """The columns of a table and what is made of them."""

    kinds: tuple[str, ...]  # of the missions
    fleet: bool  # whether there are several vehicles, each with a row of its own
    columns: Mapping[str, Metric]  # without those of the scenario
    success: str  # the boolean column that says it
    rates: tuple[str, ...]  # boolean columns, `success` first
    means: tuple[str, ...]  # numbers that variants are compared by
    phases: tuple[str, ...]  # of the missions, for which there are columns of the estimate's quality
    criterion: Criterion | None = None


def layout(kinds: Sequence[str], fleet: bool = False, criterion: Criterion | None = None) -> Layout:
    """The layout of a campaign of missions.

    Raises:
        InputError: a mission cannot be found, or its columns clash; or what counts as success is no column.
    """
    own = _of_missions(kinds)
    phases = tuple(dict.fromkeys(phase for kind in kinds for phase in phases_of(kind)))
    told = {name: OUTCOME[name] if name in SAID else column for name, column in own.items()}
    told |= {name: column for name, column in OUTCOME.items() if name not in own}
    told |= QUALITIES | {
        f"{name}_{phase}": Metric(column.dtype, column.units, f"{column.meaning}; phase {phase}")
        for phase in phases
        for name, column in QUALITIES.items()
    }
    told |= FIXES
    success = _success(kinds, told, criterion)
    columns = TRIAL | ({"vehicle": VEHICLE} if fleet else {}) | ({"mission": MISSION} if len(kinds) > 1 else {})
    columns |= {SUCCESS: Metric("bool", "1", _words(kinds, criterion))} if success == SUCCESS else {}
    booleans = [name for name, column in own.items() if column.dtype == "bool" and name != success]
    numbers = [name for name, column in own.items() if column.dtype == "float"]
    return Layout(
        kinds=tuple(kinds),
        fleet=fleet,
        columns=columns | told | ERROR,
        success=success,
        rates=(success, *booleans),
        means=(*numbers, *COMPARED) if "time" in own else (*numbers, "time", *COMPARED),
        phases=phases,
        criterion=criterion,
    )


@cache
def metrics_of(kind: str) -> Mapping[str, Metric]:
    """What a kind of mission declares, by the names of the table's columns.

    Raises:
        InputError: there is no such mission.
    """
    return {_renamed(name): column for name, column in contract.columns(kind, registry.find(kind)).items()}


@cache
def phases_of(kind: str) -> tuple[str, ...]:
    """Phases of a kind of mission in which its vehicle is under way; none of a mission that has only one."""
    phases = getattr(registry.find(kind), "phases", ())
    if not isinstance(phases, tuple | list) or not all(isinstance(phase, str) for phase in phases):
        raise InputError(f"mission '{kind}': phases is {phases!r}, not a tuple of names")
    return tuple(phase for phase in phases if phase != AT_REST) if len(phases) > 1 else ()


def judged(kind: str, criterion: Criterion | None, values: Mapping[str, Any]) -> bool | None:
    """Whether a vehicle had success; None where its mission has no such column.

    Args:
        kind: of its mission.
        criterion: of the plan; None: `docked` or `finished` of the mission, or else that nothing failed.
        values: its row.
    """
    if criterion is None:
        own = _default_of(kind)
        return values.get("failure") is None if own is None else bool(values.get(own))
    known = metrics_of(kind).keys() | OUTCOME.keys() | QUALITIES.keys() | FIXES.keys()
    of_phases = {f"{name}_{phase}" for phase in phases_of(kind) for name in QUALITIES}
    return criterion.met(values.get(criterion.metric)) if criterion.metric in known | of_phases else None


def values_of(kind: str, summary: Mapping[str, Any] | None, error: Mapping[str, str] | None) -> Row:
    """A vehicle's row from its summary; of a trial that raised, what its mission counts is 0 and no question is true.

    Args:
        kind: of its mission.
        summary: as `analysis.summary.summarise` gives it; None of a trial that raised.
        error: what it raised.
    """
    nothing = {"bool": False, "int": 0}
    values: Row = {name: nothing.get(column.dtype) for name, column in metrics_of(kind).items()}
    if summary is not None:
        found = {_renamed(name): value for name, value in summary.items()}
        values |= {name: found.get(name) for name in (*metrics_of(kind), *OUTCOME, *FIXES)}
        for phase, quality in summary["estimate"].items():
            end = "" if phase == "all" else f"_{phase}"
            values |= {f"{name}{end}": quality.get(name) for name in QUALITIES}
    if error is not None:
        values["failure"] = error["type"].lower() if error["type"] in ("Died", "Hung") else "error"
        values["failure_text"] = error["message"]
        values |= {"error_type": error["type"], "error_message": error["message"], "traceback": error["traceback"]}
    return values


def check(kind: str, summary: Mapping[str, Any]) -> None:
    """Sees that a mission gave every metric that it declares, of the type it declares, or None.

    Raises:
        InputError: One line with the metric that is missing or of another type.
    """
    if NO_METRICS in summary:
        raise InputError(f"mission '{kind}': its metrics cannot be had: {summary[NO_METRICS]}")
    for name, (dtype, *_) in contract.columns(kind, registry.find(kind)).items():
        if name not in summary:
            raise InputError(f"mission '{kind}': its metrics lack '{name}', which it declares")
        fits = (int, float) if dtype == "float" else TYPES[dtype]
        value = summary[name]
        if value is not None and (not isinstance(value, fits) or (isinstance(value, bool) and dtype != "bool")):
            raise InputError(f"mission '{kind}': metric '{name}' is {value!r}, not of the declared type {dtype}")


def markdown(columns: Mapping[str, Metric] | None = None) -> str:
    """Columns as Markdown, for the documentation; those of one vehicle that docks if none are given."""
    lines = ["| column | type | units | meaning |", "| --- | --- | --- | --- |"]
    shown = layout(("docking",)).columns if columns is None else columns
    lines += [f"| {name} | {c.dtype} | {c.units} | {c.meaning} |" for name, c in shown.items()]
    return "\n".join(lines)


def _renamed(name: str) -> str:
    return RENAMED.get(name, name)


def _of_missions(kinds: Sequence[str]) -> Columns:
    """What all missions declare."""
    found: Columns = {}
    for kind in kinds:
        for name, column in metrics_of(kind).items():
            if column.dtype not in TYPES:
                raise InputError(
                    f"mission '{kind}': metric '{name}': no type '{column.dtype}'; there are {', '.join(TYPES)}"
                )
            if name in TABLES_OWN or name in _of_phases(kinds):
                raise InputError(f"mission '{kind}': metric '{name}' is a column of every table; call it otherwise")
            if found.setdefault(name, column).dtype != column.dtype:
                raise InputError(f"mission '{kind}': metric '{name}' is {found[name].dtype} in another mission")
    return found


def _of_phases(kinds: Sequence[str]) -> set[str]:
    return {f"{name}_{phase}" for kind in kinds for phase in phases_of(kind) for name in QUALITIES}


def _success(kinds: Sequence[str], columns: Mapping[str, Metric], criterion: Criterion | None) -> str:
    """The boolean column that says whether a vehicle had success."""
    if criterion is None:
        (first, *others) = dict.fromkeys(map(_default_of, kinds))
        return SUCCESS if others or first is None else first
    wanted = ("int", "float") if criterion.bounded else ("bool",)
    fitting = [name for name, column in columns.items() if column.dtype in wanted]
    if criterion.metric not in fitting:
        what = "no column of numbers" if criterion.bounded else "no column that is true or false"
        shown = (
            f"there are {', '.join(fitting[:12])}"
            if fitting
            else "there is none; give a number with `below` or `above`"
        )
        raise InputError(f"success: {what} '{criterion.metric}'; {shown}")
    return SUCCESS if criterion.bounded else criterion.metric


def _default_of(kind: str) -> str | None:
    """The column of a mission that says its success, where the plan does not."""
    known = metrics_of(kind)
    return next((name for name in SUCCESSES if name in known), None)


def _words(kinds: Sequence[str], criterion: Criterion | None) -> str:
    return "; ".join(_conditions(kinds, criterion))


def _conditions(kinds: Sequence[str], criterion: Criterion | None) -> Iterator[str]:
    if criterion is None:
        for kind in kinds:
            yield f"{kind}: {_default_of(kind) or 'no failure'}"
        return
    bounds = [f"below {criterion.below:g}"] if criterion.below is not None else []
    bounds += [f"above {criterion.above:g}"] if criterion.above is not None else []
    yield f"whether {criterion.metric} is {' and '.join(bounds)}"


if __name__ == "__main__":
    print(markdown())
