"""What a command shows while it works and when it is done."""

import math
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from auvsim.analysis.summary import NO_METRICS
from auvsim.base import plugins
from auvsim.base.errors import InputError
from auvsim.missions import contract
from auvsim.missions.manoeuvres.metrics import LABELS, Figures
from auvsim.missions.registry import find

if TYPE_CHECKING:
    from auvsim.identification.excitation import Outcome

WIDTH = 140  # of the widest table [columns]
LINE_PERIOD = 30.0  # the same of lines, where there is no bar [s]
PERIOD = 0.1  # wall-clock time between two updates of a bar [s]; more often would slow the trial


class ProgressState(Protocol):
    """What a running trial says of itself."""

    time: float  # simulated time [s]
    duration: float  # time limit [s]
    phase: str
    range: float  # true distance to the dock's mouth [m]; NaN without one


class _Bar:
    """A bar on standard error that goes away when done; where there is no terminal, a line now and then."""

    def __init__(self, name: str) -> None:
        console = Console(stderr=True)
        columns = (TextColumn(name), BarColumn(), TextColumn("{task.fields[text]}"), TimeElapsedColumn())
        self._progress = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._task = self._progress.add_task(name, total=None, text="")
        self._name, self._lines = name, not console.is_terminal
        self._next = time.monotonic() + LINE_PERIOD if self._lines else 0.0

    def __enter__(self) -> Any:
        self._progress.start()
        return self

    def __exit__(self, *reason: object) -> None:
        self._progress.stop()

    def _show(self, done: float, total: float, text: str) -> None:
        now = time.monotonic()
        if self._lines:
            if now >= self._next:
                self._next = now + LINE_PERIOD
                print(f"{self._name}: {' '.join(text.split())}", file=sys.stderr, flush=True)
        elif now >= self._next or done >= total:
            self._next = now + PERIOD
            self._progress.update(self._task, completed=done, total=total, text=text)


class TrialProgress(_Bar):
    """Bar of a running trial: phase, range, simulated time."""

    def __init__(self, name: str = "docking") -> None:
        super().__init__(name)

    def __call__(self, state: ProgressState) -> None:
        away = "" if math.isnan(state.range) else f"  {state.range:6.1f} m"
        self._show(state.time, state.duration, f"{state.phase}{away}  {state.time:6.1f} s")


class VideoProgress(_Bar):
    """Bar of a video being drawn."""

    def __init__(self) -> None:
        super().__init__("video")

    def __call__(self, done: int, total: int) -> None:
        self._show(done, total, f"{done}/{total} frames")


class StudyProgress(_Bar):
    """Bar of a study of many runs."""

    def __init__(self) -> None:
        super().__init__("study")

    def __call__(self, done: float, total: float) -> None:
        self._show(done, total, f"{done / total:4.0%}")


class DesignProgress(_Bar):
    """Bar of the search for an optimal manoeuvre."""

    def __init__(self) -> None:
        super().__init__("design")

    def __call__(self, done: float, total: float) -> None:
        self._show(done, total, f"{done / total:4.0%}")


class IdentificationProgress(_Bar):
    """Bar of an identification."""

    def __init__(self) -> None:
        super().__init__("identifying")

    def __call__(self, text: str, share: float) -> None:
        self._show(share, 1.0, text)


class CampaignState(Protocol):
    """What a running campaign says of itself."""

    done: int
    total: int  # at most
    successes: int
    errors: int
    rate: float  # trials a second
    remaining: float  # [s]


class CampaignProgress(_Bar):
    """Bar of a campaign; where there is no terminal, a line now and then."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._line = 0.0

    def __call__(self, state: CampaignState) -> None:
        failed = state.done - state.successes
        text = f"{state.done}/{state.total} done  {failed} failed"
        text += f" ({state.errors} by errors)" if state.errors else ""
        text += f"  {state.rate:.2f} a second  {_duration(state.remaining)} to go"
        self._show(state.done, state.total, text)
        if self._progress.disable and (time.monotonic() >= self._line or state.done == state.total):
            self._line = time.monotonic() + LINE_PERIOD
            print(f"auvsim: {text}", file=sys.stderr, flush=True)


def _duration(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}"


@contextmanager
def waiting(text: str) -> Iterator[None]:
    """Says what takes long; always, since nothing else shows that the program is alive."""
    console = Console(stderr=True)
    console.print(text, soft_wrap=True)
    with console.status(text):
        yield


ROWS = {  # key of a summary: what the table calls it; those that a vehicle's summary has are shown
    "docked": "docked",
    "finished": "finished",
    "failure_text": "because",
    "attempts": "attempts",
    "approaches": "approaches begun",
    "waypoints": "waypoints reached",
    "time": "time [s]",
    "miss_distance": "miss distance at the entrance [m]",
    "heading_error_deg": "heading error at the entrance [deg]",
    "cross_track_rms": "distance from the track, rms [m]",
    "contact_impulse": "contact impulse [N s]",
    "peak_contact_force": "largest contact force [N]",
    "contacts": "contacts",
    "shaft_energy": "shaft energy [J]",
    "way": "way through the water [m]",
    "lanes_done": "all lanes done",
    "least_altitude": "least altitude on the lanes [m]",
    "loop_closures": "loop closures believed",
    "turned_rms": "position rms over the lanes, turned about the dive point [m]",
    "fixes_sent": "fixes sent",
    "fixes_lost": "fixes lost",
    "fixes_refused": "fixes refused",
    "real_time_factor": "simulated over wall-clock time",
}


def show(summary: Mapping[str, Any]) -> None:
    """Prints the summary of a run as one table, a column a vehicle: the verdict, then the errors of the estimate."""
    several = summary.get("vehicles")
    vehicles: Mapping[str, Mapping[str, Any]] = several or {"": summary}
    missions = {str(values["mission"]) for values in vehicles.values()}
    rows = {key: label for kind in sorted(missions) for key, label in _of_its_own(kind).items()} | ROWS
    title = f"{missions.pop().rpartition(':')[2]} trial" if len(missions) == 1 else "run"
    table = Table("", *vehicles, title=title, show_header=bool(several))
    if any(NO_METRICS in values for values in vehicles.values()):
        rows[NO_METRICS] = "no metrics of the mission"
    for key, label in rows.items():
        if any(values.get(key) is not None for values in vehicles.values()):
            table.add_row(label, *(_text(values.get(key)) for values in vehicles.values()))
    if any("bad_frames" in values for values in vehicles.values()):
        table.add_row(
            "bad frames of the sonar", *(_counts(values.get("bad_frames", {})) for values in vehicles.values())
        )
    phases = dict.fromkeys(phase for values in vehicles.values() for phase in values["estimate"])
    for phase in phases:
        where = "all phases" if phase == "all" else phase.replace("_", " ")
        cells = (_errors(values["estimate"].get(phase)) for values in vehicles.values())
        table.add_row(f"position rms [m], NEES per degree of freedom, {where}", *cells)
    for other in dict.fromkeys(name for values in vehicles.values() for name in values.get("relative_to", ())):
        cells = (values.get("relative_to", {}).get(other, "") for values in vehicles.values())
        table.add_row(f"position rms relative to {other}, as it knows its own [m]", *map(_text, cells))
    Console(markup=False).print(table)  # units stand in brackets


def _of_its_own(kind: str) -> dict[str, str]:
    """Labels of the metrics that a mission of the user's own declares, by their keys; of a shipped one none."""
    if not plugins.is_own(kind):
        return {}
    try:
        columns = contract.columns(kind, find(kind))
    except InputError:  # its class is not here any more, or declares nothing that can be used
        return {}
    return {key: f"{m.meaning} [{m.units}]" if m.units not in ("", "1") else m.meaning for key, m in columns.items()}


def _counts(numbers: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {what.replace('_', ' ')}" for what, count in numbers.items())


def _errors(quality: Mapping[str, Any] | None) -> str:
    return f"{_text(quality['position_rms'])}, {_text(quality['nees_per_dof'])}" if quality else ""


def manoeuvres(found: Sequence[Figures]) -> None:
    """Prints the figures of manoeuvres as one table, a column each."""
    table = Table("", title="manoeuvres")
    for figures in found:
        table.add_column(figures.kind, justify="right")
    for key, label in LABELS.items():
        if any(key in figures.numbers for figures in found):
            table.add_row(label, *(_text(figures.numbers.get(key)) for figures in found))
    Console(markup=False).print(table)  # units stand in brackets
    for figures in found:
        if figures.warning:
            print(f"{figures.kind}: {figures.warning}", file=sys.stderr)


def information(parameters: Sequence[str], outcomes: "Mapping[str, Outcome]", room: float) -> None:
    """Prints the information of manoeuvres of one duration on the parameters as one table, a column each."""
    table = Table("", title="expected standard deviation of each parameter [% of its value]")
    for name in outcomes:
        table.add_column(name, justify="right")
    for index, parameter in enumerate(parameters):
        deviations = (_text(100.0 * found.deviations[index]) for found in outcomes.values())
        table.add_row(parameter, *deviations, end_section=index == len(parameters) - 1)
    best = max(found.log_det for found in outcomes.values())
    efficiencies = [math.exp((found.log_det - best) / len(parameters)) for found in outcomes.values()]
    table.add_row("log det of the information", *(_text(found.log_det) for found in outcomes.values()))
    table.add_row("information a parameter, of the best [-]", *map(_text, efficiencies))
    table.add_row(f"room taken, {room:g} allowed [m]", *(_text(found.reach) for found in outcomes.values()))
    # A narrow terminal breaks lines, where rich would break numbers.
    Console(markup=False, width=max(WIDTH, Console().width)).print(table)


def _text(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 999.5 or not math.isfinite(value) else f"{value:.0f}"
    return str(value)
