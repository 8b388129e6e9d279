"""States of the vehicle along a record, from whatever was measured, by a smoother that knows no hydrodynamics."""

import math

import numpy as np

from auvsim.identification import compiled
from auvsim.identification.records import Record
from estimators.core.errors import ParameterError
from estimators.core.types import Array
from estimators.planar.model import MAX_SUBSTEP, PlanarParameters

# A body on which nothing acts in its own axes: its velocities stay as they are.
STEADY = PlanarParameters(m=1.0, I_z=1.0, X_vr=-1.0, Y_ur=1.0)
# Manoeuvres change velocities by some 0.05 m/s^2 and 0.05 rad/s^2 for a second or two.
STEADY_NOISE = np.array([0.0, 0.0, 0.0, 5e-3, 5e-3, 3e-3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
# Standard deviations of the first state: a torpedo-shaped vehicle hardly slips.
FIRST = np.array([100.0, 100.0, 1.0, 1.0, 0.3, 0.3])


def substeps(step: float, longest: float = MAX_SUBSTEP) -> int:
    """In how many equal parts, none over the `longest` [s], a sample's step [s] is taken."""
    return max(1, math.ceil(step / longest - 1e-9))


def first_belief(record: Record, start: PlanarParameters, nuisances: Array) -> tuple[Array, Array]:
    """Mean (12,) and covariance (12, 12) of the filters' state before the first sample of a record.

    Args:
        record: What was measured; the first value of each channel is the guess.
        start: Of a surge that was never measured the guess is the steady one of these parameters.
        nuisances: Their standard deviations (6,) beforehand.
    """
    firsts = np.zeros(8)
    for c in range(8):
        there = np.flatnonzero(np.isfinite(record.measured[:, c]))
        firsts[c] = record.measured[there[0], c] if len(there) else np.nan
    mean = np.zeros(12)
    mean[:3] = np.nan_to_num(firsts[:3])
    mean[5] = np.nan_to_num(firsts[5])
    if np.isfinite(firsts[3]) or np.isfinite(firsts[6]):
        mean[3] = firsts[3] if np.isfinite(firsts[3]) else firsts[6]
    else:
        mean[3] = _guessed_surge(start, float(record.inputs[0, 1]))
    deviations = np.concatenate([FIRST, nuisances])
    if record.current is not None:
        mean[6:8], deviations[6:8] = record.current, 0.0
    return mean, np.diag(deviations**2)


def _guessed_surge(start: PlanarParameters, shaft_speed: float) -> float:
    try:
        return start.steady_surge(shaft_speed)
    except ParameterError:  # a start without drag
        return 1.0


def smoothed(record: Record, start: PlanarParameters, nuisances: Array) -> Array:
    """States (n, 12) along a record; in the order of `filter_loops`."""
    mean, covariance = first_belief(record, start, nuisances)
    arguments = STEADY.vector(), STEADY_NOISE, record.step, substeps(record.step)
    inputs = np.ascontiguousarray(record.inputs, dtype=float)
    module = compiled.filters()
    measured = np.ascontiguousarray(record.measured, dtype=float)
    means, covariances = module.trace(mean, covariance, inputs, measured, record.deviations**2, *arguments)
    return module.smooth(means, covariances, inputs, *arguments)
