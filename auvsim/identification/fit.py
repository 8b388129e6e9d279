"""What a fit of the planar model's parameters comes to, and what it may leave free."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import InputError, unknown_name
from auvsim.identification.constraints import has_inertia, inertia
from auvsim.identification.records import MEASURED, Record
from estimators.core.consistency import Whiteness, ljung_box
from estimators.core.types import Array
from estimators.planar.model import PARAMETER_NAMES, PlanarParameters

Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

# Masses and added masses stay as they are: a motion shows only the ratios of forces to them. Coriolis terms (X_vr,
# X_rr) follow from them. What is left of the model condensed from a vehicle: drag, thrust and its loss with speed, the
# rudder's drag, and lift, cross-flow and rudder in sway and yaw.
DEFAULT_FREE = (
    "X_uu", "X_dd", "X_nn", "X_nu",
    "Y_uv", "Y_ur", "Y_dd", "Y_vv", "Y_rr",
    "N_uv", "N_ur", "N_dd", "N_vv", "N_rr",
)  # fmt: skip
MASSES = ("m", "x_g", "I_z", "X_ud", "Y_vd", "Y_rd", "N_vd", "N_rd")  # the accelerations are not linear in these

# Constant errors of a record: the current [m/s]; what the gyro [rad/s] and the compass [rad] show too much; how far the
# log's axes are turned from the body's, positive to starboard [rad]; the log shows 1 + scale times the velocity.
NUISANCES = ("current_north", "current_east", "gyro", "compass", "misalignment", "scale")


@dataclass(frozen=True, kw_only=True, slots=True)
class Nuisances:
    """Prior standard deviations of a record's constant errors, about zero; 0: there is none."""

    current: float = 1.0  # each component [m/s]
    gyro: float = 5e-3  # [rad/s]
    compass: float = math.radians(2.0)  # [rad]
    misalignment: float = math.radians(1.0)  # [rad]
    scale: float = 5e-3

    def vector(self) -> Array:
        """The deviations (6,), in the order of NUISANCES."""
        return np.array([self.current, *(getattr(self, field.name) for field in fields(self))], dtype=float)


NO_NUISANCES = Nuisances(current=0.0, gyro=0.0, compass=0.0, misalignment=0.0, scale=0.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class Fit:
    """Parameters fitted to records, and how far they can be trusted."""

    method: str  # "least squares", "segments", "prediction error" or "shooting"
    start: PlanarParameters
    parameters: PlanarParameters
    free: tuple[str, ...]
    covariance: Array  # (k, k) of the free parameters
    nuisances: Array  # (records, 6) in the order of NUISANCES
    nuisance_deviations: Array  # (records, 6)
    residual_rms: Array  # (8,) by MEASURED, in units of the assumed deviations; NaN where nothing was measured
    whiteness: tuple[Whiteness | None, ...]  # (8,) by MEASURED
    cost: float  # half the sum of squares, or the negative log likelihood
    start_cost: float  # the same at the start
    samples: int  # scalar measurements
    iterations: int
    converged: bool
    message: str
    noise: Array | None = None  # (6,) densities of the process noise [m2/s, m2/s, rad2/s, m2/s3, m2/s3, rad2/s3]
    noise_deviations: Array | None = None  # (6,) of their logarithms, NaN of those that were not fitted

    @property
    def values(self) -> Array:
        """The free parameters (k,)."""
        return np.array([getattr(self.parameters, name) for name in self.free])

    @property
    def deviations(self) -> Array:
        """Standard deviations of the free parameters (k,); infinite of those that the data do not show."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """Correlations of the free parameters (k, k)."""
        return self.covariance / np.outer(self.deviations, self.deviations)

    @property
    def improved(self) -> bool:
        """Whether the fit is better than its start."""
        return self.cost < self.start_cost


def with_values(parameters: PlanarParameters, names: Sequence[str], values: Array) -> PlanarParameters:
    """The parameters with some of them replaced."""
    return replace(parameters, **dict(zip(names, np.asarray(values, dtype=float).tolist(), strict=True)))


def free_indices(free: Sequence[str], names: Sequence[str] = PARAMETER_NAMES) -> Indices:
    """Places (k,) of the free parameters among `names`, the planar model's if none are given.

    Raises:
        InputError: A name is unknown or twice there, or there is none.
    """
    for name in free:
        if name not in names:
            raise unknown_name("parameter of the planar model", name, list(names))
    if not free or len(set(free)) < len(free):
        raise InputError(f"free parameters {', '.join(free) or '(none)'}: name at least one, and each once")
    return np.array([names.index(name) for name in free])


def check(records: Sequence[Record], start: PlanarParameters) -> None:
    """Refuses records that cannot be fitted.

    Raises:
        InputError: There is none, or one has arrays that do not fit each other, inputs that are no numbers, or nothing
            measured; or the start holds what is no number.
    """
    if not records:
        raise InputError("there is no record to fit")
    if not np.isfinite(start.vector()).all():
        raise InputError(f"the start's parameters must be finite: {start}")
    if not has_inertia(start):
        raise InputError(f"the start's inertia with added mass is not positive: {inertia(start).tolist()}")
    for record in records:
        n = len(record.times)
        shapes = record.inputs.shape, record.measured.shape, record.deviations.shape
        if n < 3 or shapes != ((n, 2), (n, len(MEASURED)), (len(MEASURED),)):
            raise InputError(f"record {record.name}: {n} times with inputs, measured, deviations of shapes {shapes}")
        if not np.isfinite(record.inputs).all():
            raise InputError(f"record {record.name}: inputs must be finite; split it where they are missing")
        here = np.isfinite(record.measured).any(axis=0)
        if not here.any():
            raise InputError(f"record {record.name}: nothing was measured")
        if not (record.deviations[here] > 0.0).all():
            raise InputError(f"record {record.name}: deviations of what was measured must be positive")


def residual_summary(residuals: Sequence[Array]) -> tuple[Array, tuple[Whiteness | None, ...]]:
    """Root mean square (8,) of weighted residuals (n, 8) of records, and whether each channel's are white.

    Whiteness is tested on the longest record that has the channel, among its samples that were measured.
    """
    together = np.concatenate(list(residuals))
    there = np.isfinite(together)
    squares = np.where(there, together, 0.0) ** 2
    counts = there.sum(axis=0)
    rms = np.sqrt(squares.sum(axis=0) / np.where(counts, counts, 1))
    longest = [max((r[np.isfinite(r[:, c]), c] for r in residuals), key=len)[:, None] for c in range(len(MEASURED))]
    white = tuple(ljung_box(values) if len(values) >= 20 and values.any() else None for values in longest)
    return np.where(counts, rms, np.nan), white


def invert(information: Array) -> Array:
    """Covariance of an information matrix; variances are infinite, and covariances zero, where nothing is known.

    Scaled to a unit diagonal before it is inverted; directions that rounding alone could have made are cut off.
    """
    scale = np.sqrt(np.maximum(np.diag(information), 0.0))
    known = scale > 0.0
    covariance = np.diag(np.where(known, 0.0, np.inf))
    if known.any():
        part = information[np.ix_(known, known)] / np.outer(scale[known], scale[known])
        values, vectors = np.linalg.eigh(part)
        floor = len(part) * np.finfo(float).eps * values[-1]
        inverse = (vectors / np.maximum(values, floor)) @ vectors.T
        covariance[np.ix_(known, known)] = inverse / np.outer(scale[known], scale[known])
    return covariance
