"""Open-loop prediction: the model, a record's inputs, and nothing measured after the start; what a fit is judged by."""

import math
from dataclasses import dataclass

import numpy as np

from auvsim.base.errors import InputError
from auvsim.identification import compiled
from auvsim.identification.fit import Nuisances, check
from auvsim.identification.records import Record
from auvsim.identification.states import first_belief, substeps
from estimators.core.types import Array
from estimators.planar.model import PlanarParameters

# While the lead is taken, the model is trusted nearly as far as its planar noise in the docking filters goes.
_NOISE = np.array([0.0, 0.0, 0.0, 1e-5, 1e-5, 1e-6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True, kw_only=True, slots=True)
class Prediction:
    """Motion predicted from a start on, beside what was measured or true."""

    times: Array  # (n,) since the prediction began [s]
    states: Array  # (n, 6) predicted: north, east, heading, u, v, r [m, rad, m/s, rad/s]
    reference: Array  # (n, 2) north, east against which it is judged [m]; NaN where there is none
    errors: Array  # (n,) distance between the two [m]
    distance: Array  # (n,) run through the water, as predicted [m]

    def error_at(self, seconds: float) -> float:
        """Position error [m] at the last sample up to this time that has one; NaN if the prediction is shorter."""
        here = np.flatnonzero((self.times <= seconds + 1e-9) & np.isfinite(self.errors))
        return float(self.errors[here[-1]]) if len(here) and self.times[-1] >= seconds - 1e-9 else math.nan

    def share_at(self, seconds: float) -> float:
        """That error as a share of the distance run until then."""
        here = min(int(np.searchsorted(self.times, seconds + 1e-9)), len(self.times)) - 1
        return self.error_at(seconds) / float(self.distance[here])


def predict(
    parameters: PlanarParameters,
    record: Record,
    current: Array | None = None,
    *,
    lead: float = 20.0,
    state: Array | None = None,
    reference: Array | None = None,
    nuisances: Nuisances | None = None,
) -> Prediction:
    """Predicts a record from its inputs alone.

    The first `lead` seconds give the state, the current and the sensors' biases at which the prediction begins, by a
    filter on the same parameters; from then on nothing measured is used. With `state` it begins there, at once.

    Args:
        parameters: The model judged.
        record: Its inputs, and what it measured.
        current: North, east (2,) [m/s]; None: the record's, or else the filter's after the lead.
        lead: Seconds taken to begin.
        state: True state (6,) at the record's start, instead of the lead.
        reference: True positions (n, 2) on the record's grid; None: those that were measured.
        nuisances: Deviations of the constant errors, for the lead.

    Raises:
        InputError: The record is too short for the lead, or cannot be used.
    """
    check([record], parameters)
    first = 0 if state is not None else round(lead / record.step)
    if first >= len(record.times) - 1:
        raise InputError(f"record {record.name}: {record.times[-1] - record.times[0]:g} s leave none after {lead:g} s")
    x = np.zeros(12)
    if state is not None:
        x[:6] = state
        x[6:8] = record.current if record.current is not None else 0.0
    else:
        x = _after_lead(parameters, record, first, nuisances or Nuisances())
    if current is not None:
        x[6:8] = current
    states = _open_loop(parameters, record, first, x)
    positions = (record.measured[:, :2] if reference is None else reference)[first:]
    speed = np.hypot(states[:-1, 3], states[:-1, 4])
    return Prediction(
        times=record.times[first:] - record.times[first],
        states=states[:, :6],
        reference=positions,
        errors=np.hypot(*(states[:, :2] - positions).T),
        distance=np.concatenate([[0.0], np.cumsum(speed) * record.step]),
    )


def _after_lead(parameters: PlanarParameters, record: Record, first: int, nuisances: Nuisances) -> Array:
    mean, covariance = first_belief(record, parameters, nuisances.vector())
    means, _ = compiled.filters().trace(
        mean, covariance, np.ascontiguousarray(record.inputs[: first + 1], dtype=float),
        np.ascontiguousarray(record.measured[: first + 1], dtype=float), record.deviations**2, parameters.vector(),
        _NOISE, record.step, substeps(record.step),
    )  # fmt: skip
    return means[-1]


def _open_loop(parameters: PlanarParameters, record: Record, first: int, x: Array) -> Array:
    """States (n - first, 12) from `x` on: the filter, when it measures nothing."""
    nothing = np.full((len(record.times) - first, 8), np.nan)
    states, _ = compiled.filters().trace(
        x.copy(), np.zeros((12, 12)), np.ascontiguousarray(record.inputs[first:], dtype=float), nothing,
        np.ones(8), parameters.vector(), np.zeros(12), record.step, substeps(record.step),
    )  # fmt: skip
    return states
