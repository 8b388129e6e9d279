"""What a model is judged by: a manoeuvre that it was not fitted to, predicted open loop from many starts."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from auvsim.base.errors import InputError
from auvsim.identification.checks import STILL
from auvsim.identification.fit import Nuisances
from auvsim.identification.prediction import Prediction, predict
from auvsim.identification.records import Record
from auvsim.identification.states import smoothed
from estimators.core.types import Array
from estimators.planar.model import PlanarParameters

HORIZON = 120.0  # of a prediction [s]
LEAD = 60.0  # of the first; what a filter on the judged model needs to find the current and its sensors' biases [s]
EVERY = 15.0  # from one start to the next [s]
LEAST = 40.0  # a hold-out shorter than this tells nothing [s]
PART = 0.3  # of a single record that is held out
MARGIN = 0.05  # what two errors must differ by to be told apart
_NUISANCES = Nuisances()


@dataclass(frozen=True, kw_only=True, slots=True)
class HoldoutResult:
    """One held-out record, predicted by the start and by the fit."""

    record: Record
    measured: Array  # (n, 12) states along it by what was measured, without hydrodynamics (see `states`)
    seconds: float  # length of each prediction [s]
    firsts: tuple[int, ...]  # samples at which they begin
    start: tuple[Prediction, ...]  # of each start, by the parameters the fit started from
    fit: tuple[Prediction, ...]  # the same by the fitted

    @property
    def share(self) -> float:
        """Position error of the fit at the end by the distance run, rms over the starts."""
        return _share(self.fit, self.seconds)

    @property
    def start_share(self) -> float:
        """Position error of the start's parameters at the end by the distance run, rms over the starts."""
        return _share(self.start, self.seconds)

    @property
    def ratio(self) -> float:
        """Error of the fit by that of its start; below 1 it is better."""
        return self.share / self.start_share if self.start_share > 0.0 else np.inf


def _share(predictions: Sequence[Prediction], seconds: float) -> float:
    return float(np.sqrt(np.mean([p.share_at(seconds) ** 2 for p in predictions])))


def choose(records: Sequence[Record]) -> tuple[list[Record], list[Record], str]:
    """What to fit, what to hold out, and why.

    Of several kinds of manoeuvre the one from which the least can be learnt, that whose rudder goes the shortest way;
    else the last record; else the last part of the only one.

    Raises:
        InputError: There is too little to hold anything out.
    """
    kinds = {kind: [r for r in records if r.kind == kind] for kind in dict.fromkeys(r.kind for r in records)}
    for kind in sorted(kinds, key=lambda kind: sum(_travel(r) for r in kinds[kind])):
        rest = [r for r in records if r.kind != kind]
        if _moves(rest) and _moves(kinds[kind]) and max(r.duration for r in kinds[kind]) >= LEAST:
            return rest, kinds[kind], f"held out: {kind or 'what has no name'}, all of it"
    for last in reversed(records):
        rest = [r for r in records if r is not last]
        if _moves(rest) and _moves([last]) and last.duration >= LEAST:
            return rest, [last], f"held out: {last.name}, a manoeuvre of the same kind: another kind would say more"
    longest = max(records, key=lambda r: (_moves([r]), r.duration))
    first = round(len(longest.times) * (1.0 - PART))
    if longest.duration * PART < LEAST:
        raise InputError(
            f"{longest.name}: {longest.duration:.0f} s leave too little to hold out {LEAST:g} s of them; log at least "
            f"{LEAST / PART:.0f} s, or better two manoeuvres of different kinds"
        )
    early, late = part(longest, 0, first + 1), part(longest, first, len(longest.times))
    said = f"held out: the last {late.duration:.0f} s of {longest.name}: another manoeuvre would say more"
    return [early if r is longest else r for r in records], [late], said


def _travel(record: Record) -> float:
    """Way of the rudder [rad]."""
    return float(np.abs(np.diff(record.inputs[:, 0])).sum())


def _moves(records: Sequence[Record]) -> bool:
    return max((float(np.std(r.inputs[:, 0])) for r in records), default=0.0) >= STILL


def part(record: Record, first: int, stop: int) -> Record:
    """Samples `first` to `stop` of a record."""
    times, rows = record.times[first:stop], slice(first, stop)
    name = f"{record.name}, {times[0]:.0f} to {times[-1]:.0f} s"
    wind, thrusters = (None if values is None else values[rows] for values in (record.wind, record.thrusters))
    return replace(
        record, name=name, times=times, inputs=record.inputs[rows], measured=record.measured[rows], wind=wind,
        thrusters=thrusters,
    )  # fmt: skip


def judge(record: Record, start: PlanarParameters, fit: PlanarParameters) -> HoldoutResult:
    """Predicts a held-out record from every few seconds of it, each for the same time.

    Until a prediction begins, a filter on the judged model takes what is measured: so its state, the current and the
    sensors' biases are what a vehicle with that model would have. It is judged against what was measured afterwards:
    dead reckoning and fixes, smoothed without hydrodynamics.

    Raises:
        InputError: The record is too short.
    """
    if record.duration < LEAST:
        raise InputError(f"{record.name}: {record.duration:.0f} s; a hold-out needs {LEAST:g} s or more")
    states = smoothed(record, start, _NUISANCES.vector())
    lead = min(LEAD, 0.3 * record.duration)
    seconds = float(min(HORIZON, math.floor(0.5 * record.duration)))
    count, width = len(record.times), round(seconds / record.step)
    firsts = range(round(lead / record.step), count - width, max(1, round(EVERY / record.step)))

    def predicted(parameters: PlanarParameters) -> tuple[Prediction, ...]:
        return tuple(
            predict(parameters, part(record, 0, stop), lead=first * record.step, reference=states[:stop, :2])
            for first, stop in ((first, first + width + 1) for first in firsts)
        )

    return HoldoutResult(
        record=record,
        measured=states,
        seconds=seconds,
        firsts=tuple(firsts),
        start=predicted(start),
        fit=predicted(fit),
    )


def root_mean_square(predictions: Sequence[Prediction], times: Array, share: bool = False) -> Array:
    """Position errors [m], or shares of the distance run, at times (m,) [s], rms over predictions."""
    values = [[p.share_at(t) if share else p.error_at(t) for t in times.tolist()] for p in predictions]
    return np.sqrt(np.mean(np.square(values), axis=0))
