"""How far a simulation is from a log: errors by horizon, spectra of residuals, the coefficient that explains them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import welch

from auvsim.base.errors import DivergenceError, InputError
from auvsim.comparison.simulation import in_mujoco, in_planar
from auvsim.identification.fit import DEFAULT_FREE, Nuisances
from auvsim.identification.records import Record
from auvsim.identification.states import smoothed
from auvsim.physics.planar_fit import fit_planar_model
from estimators.core.types import Array
from estimators.planar.model import PlanarParameters

HORIZONS = (10.0, 30.0, 60.0, 120.0)  # [s]
LEAD, EVERY = 20.0, 10.0  # before the first start, and from one to the next [s]
LEAST = 40.0  # of a record [s]
# Largest error after 60 s by the distance run for each grade; a worse one is E. A compass wrong by 1 deg makes 1.7 %.
GRADES = (("A", 0.03), ("B", 0.06), ("C", 0.12), ("D", 0.25))
GRADED = 60.0  # horizon of the grade [s]; the longest there is where a record is shorter
VELOCITIES = ("surge", "sway", "yaw rate")
CANDIDATES = (*DEFAULT_FREE, "X_ud", "Y_vd", "N_rd")
MEANS = {
    "X_uu": "axial drag", "X_dd": "the rudder's drag", "X_nn": "thrust", "X_nu": "thrust lost to speed",
    "Y_uv": "side force in drift", "Y_ur": "side force in turns", "Y_vv": "cross-flow drag in drift",
    "Y_rr": "cross-flow drag in turns", "Y_dd": "the rudder's side force", "N_uv": "moment in drift",
    "N_ur": "damping of turns", "N_vv": "cross-flow moment in drift", "N_rr": "cross-flow moment in turns",
    "N_dd": "the rudder's moment", "X_ud": "added mass ahead", "Y_vd": "added mass aside", "N_rd": "added inertia",
}  # fmt: skip
FLOOR = np.array([0.02, 0.03, math.radians(0.2)])  # residuals that no coefficient is sought for [m/s, m/s, rad/s]
# Of the floor, what smoothing, servos and the planar model's own lack may leave that looks like a change of a
# coefficient: half of it over an equal REMUS-100.
SYSTEMATIC = 0.5
PLAUSIBLE = 1.0  # a coefficient that vanishes or doubles; larger changes stand for something else
HIDDEN = 4  # changes that are named of those that a log would not show
ITERATIONS = 3  # of the change that explains most: the motion is not linear in it
LEAST_SHARE = 0.2  # explained, for a coefficient to be named
NEAR = 0.1  # share explained by which two coefficients are not told apart
BLOCK, DRAWS = 20.0, 200  # of the bootstrap [s]


@dataclass(frozen=True, kw_only=True, slots=True)
class Beside:
    """One record and one model of the vehicle."""

    record: Record
    measured: Array  # (n, 12) states by what was measured, without hydrodynamics (see `states`)
    simulated: Array  # (n, 3) surge, sway, yaw rate [m/s, m/s, rad/s]

    @property
    def residual(self) -> Array:
        """(n, 3) measured less simulated, after the lead."""
        return (self.measured[:, 3:6] - self.simulated)[self.first :]

    @property
    def first(self) -> int:
        """Sample at which the lead ends."""
        return round(LEAD / self.record.step)


@dataclass(frozen=True, kw_only=True, slots=True)
class Explanation:
    """What a change of one coefficient explains of the residuals."""

    name: str
    change: float  # of the coefficient, by its size in the model
    low: float  # of the 95 % interval of that
    high: float
    share: float  # of the residuals' weighed squares that it takes away


@dataclass(frozen=True, kw_only=True, slots=True)
class Gap:
    """What the sheet says."""

    vehicle: str
    records: tuple[Beside, ...]
    planar: tuple[Beside, ...]  # the same by the planar model, if one is given
    errors: dict[float, float]  # rms over starts by the distance run, by horizon [s]
    planar_errors: dict[float, float]
    starts: int
    explanations: tuple[Explanation, ...]  # by the plausible candidates, the best first
    size: Array  # (3,) rms of the residuals in surge, sway [m/s] and yaw rate [rad/s], see `cleared`
    visible: dict[str, float]  # relative change of each coefficient that alone would reach the floor in this log
    grade: str
    graded: float  # horizon of the grade [s]
    notes: tuple[str, ...]

    @property
    def explained(self) -> tuple[Explanation, ...]:
        """The best coefficient and those that cannot be told from it; none where there is nothing to explain."""
        clear = [e for e in self.explanations if not e.low <= 0.0 <= e.high]
        if (self.size < FLOOR).all() or not clear or clear[0].share < LEAST_SHARE:
            return ()
        return tuple(e for e in clear if e.share > clear[0].share - NEAR)

    @property
    def hidden(self) -> list[tuple[str, float]]:
        """Coefficients with the change up to which this log shows nothing of it; from the largest plausible one."""
        return sorted(((n, c) for n, c in self.visible.items() if c <= PLAUSIBLE), key=lambda pair: -pair[1])

    @property
    def unseen(self) -> list[str]:
        """Coefficients of which this log shows not even that they double or vanish."""
        return [name for name, change in self.visible.items() if change > PLAUSIBLE]

    @property
    def verdict(self) -> str:
        """The sheet in one line."""
        error = f"off by {self.errors[self.graded]:.1%} of the distance run after {self.graded:.0f} s"
        said = f"grade {self.grade}: {self.vehicle} is {error}"
        if not self.explained and (self.size < FLOOR).all():
            hidden = ", ".join(f"{change:.0%} of {name}" for name, change in self.hidden[:HIDDEN])
            more = f", and any of {', '.join(self.unseen)}" if self.unseen else ""
            return f"{said}; too little is left to name a coefficient: this log hides changes of {hidden}{more}"
        if not self.explained:
            return f"{said}; no one coefficient explains the rest"
        best, *near = self.explained
        text = f"{best.name} ({MEANS[best.name]}) {best.change:+.0%} ({best.low:+.0%} to {best.high:+.0%}) explains "
        text += f"{best.share:.0%} of it"
        return f"{said}; {text}" + (f", as would {' or '.join(e.name for e in near)}" if near else "")


def compare(
    records: Sequence[Record], vehicle: str, parameters: PlanarParameters | None = None, *,
    measured: bool = True, notes: Sequence[str] = (), progress: Callable[[float], None] = lambda _: None,
) -> Gap:  # fmt: skip
    """Holds a vehicle's model against records.

    Args:
        records: Of the log.
        vehicle: Name in models/, or the path of an MJCF file.
        parameters: A planar model that is held against them too.
        measured: Whether rudders were measured, not only commanded.
        notes: On how the log was understood.
        progress: Told the share that is done.

    Raises:
        InputError: No record is long enough, the vehicle has no rudder, or cannot move as the record says.
    """
    usable = [record for record in records if record.duration >= LEAST]
    if not usable:
        longest = max((record.duration for record in records), default=0.0)
        raise InputError(f"the longest record lasts {longest:.0f} s; the comparison needs {LEAST:.0f} s of motion")
    found, planar = [], []
    base = fit_planar_model(vehicle, 1.0).parameters
    for k, record in enumerate(usable):
        states = smoothed(record, base, Nuisances().vector())
        surge = float(np.clip(states[0, 3], 0.05, None))
        try:
            velocities = in_mujoco(vehicle, record, surge, measured=measured)
        except DivergenceError:
            fastest = float(np.abs(record.inputs[:, 1]).max())
            raise InputError(
                f"{record.name}: no motion of '{vehicle}' begins at {surge:.3g} m/s or has its shaft at {fastest:.3g} "
                "rad/s: see the units of surge and shaft speed, such as `n [rpm]`, or give another --vehicle"
            ) from None
        found.append(Beside(record=record, measured=states, simulated=velocities))
        if parameters is not None:
            walked = in_planar(parameters, record, surge)
            planar.append(Beside(record=record, measured=states, simulated=walked))
        progress((k + 1) / (len(usable) + 1))
    errors, starts = by_horizon(found)
    graded = max(h for h in errors if h <= GRADED)
    mean = float(np.mean(np.concatenate([b.measured[:, 3] for b in found])))
    condensed = fit_planar_model(vehicle, max(mean, 0.2)).parameters
    residuals = np.concatenate([cleared(beside, beside.residual) for beside in found])
    return Gap(
        vehicle=vehicle, records=tuple(found), planar=tuple(planar), errors=errors,
        planar_errors=by_horizon(planar)[0] if planar else {}, starts=starts,
        explanations=explain(found, condensed), size=np.sqrt(np.mean(residuals**2, axis=0)),
        visible=visible(found, condensed),
        grade=next((grade for grade, most in GRADES if errors[graded] <= most), "E"), graded=graded,
        notes=tuple(notes),
    )  # fmt: skip


def by_horizon(besides: Sequence[Beside]) -> tuple[dict[float, float], int]:
    """Errors of the position by the distance run, rms over starts every few seconds, by horizon; and how many starts.

    Each start takes the measured place and heading, and the current that the record shows; the velocities go on as they
    were simulated from the record's beginning.
    """
    squares: dict[float, list[float]] = {}
    starts = 0
    for beside in besides:
        step, n = beside.record.step, len(beside.record.times)
        for first in range(beside.first, n - 1, max(1, round(EVERY / step))):
            track, run = reckoned(beside, first)
            starts += 1
            for horizon in HORIZONS:
                last = round(horizon / step)
                if first + last < n and run[last] > 0.0:
                    off = track[last] - beside.measured[first + last, :2]
                    squares.setdefault(horizon, []).append(float(off @ off) / run[last] ** 2)
    return {horizon: math.sqrt(float(np.mean(values))) for horizon, values in sorted(squares.items())}, starts


def reckoned(beside: Beside, first: int) -> tuple[Array, Array]:
    """Track (m, 2) north, east [m] by the simulated velocities from a sample on, and the distance run (m,) [m]."""
    step = beside.record.step
    u, v, r = beside.simulated[first:].T
    heading = beside.measured[first, 2] + np.concatenate([[0.0], np.cumsum(0.5 * step * (r[1:] + r[:-1]))])
    current = beside.measured[-1, 6] + 1j * beside.measured[-1, 7]
    water = (u + 1j * v) * np.exp(1j * heading)
    over_ground = water + current
    place = beside.measured[first, 0] + 1j * beside.measured[first, 1]
    way = np.concatenate([[0.0], np.cumsum(0.5 * step * (over_ground[1:] + over_ground[:-1]))])
    run = np.concatenate([[0.0], np.cumsum(0.5 * step * (np.abs(water[1:]) + np.abs(water[:-1])))])
    track = place + way
    return np.column_stack([track.real, track.imag]), run


def cleared(beside: Beside, values: Array) -> Array:
    """Residuals or slopes (n, 3) of a record without what its sensors' constant errors may make.

    A log turned from the body's axes shows a share of surge as sway, a gyro's bias a constant yaw rate.
    """
    surge = beside.measured[beside.first :, 3]
    found = values.copy()
    found[:, 1] -= surge * (surge @ values[:, 1]) / max(float(surge @ surge), 1e-9)
    found[:, 2] -= values[:, 2].mean()
    return found


def explain(besides: Sequence[Beside], condensed: PlanarParameters) -> tuple[Explanation, ...]:
    """What each coefficient of the planar model alone explains of the residuals, the best first.

    The residuals of surge, sway and yaw rate, each by its floor, are regressed on the change that a change of the
    coefficient makes in the planar model's own motion under the same inputs. The interval is by a bootstrap over
    blocks, and by what the floor itself may look like. Changes that are not plausible are left out.
    """
    residuals = [cleared(b, b.residual) / FLOOR for b in besides]
    found = [
        _explained(name, besides, residuals, condensed) for name in CANDIDATES if getattr(condensed, name) != 0.0
    ]  # fmt: skip
    return tuple(sorted((e for e in found if e is not None), key=lambda e: -e.share))


def visible(besides: Sequence[Beside], condensed: PlanarParameters) -> dict[str, float]:
    """The relative change of each coefficient whose effect on this log's motion is as large as the floor.

    Nothing is named of smaller ones. Their effect is taken as linear in the change.
    """
    found = {}
    for name in CANDIDATES:
        if getattr(condensed, name) != 0.0:
            slopes = np.concatenate([_slope(b, condensed, name, 0.0) for b in besides])
            largest = float(np.sqrt(np.mean(slopes**2, axis=0)).max())
            found[name] = 1.0 / largest if largest > 0.0 else math.inf
    return found


def _explained(
    name: str, besides: Sequence[Beside], residuals: Sequence[Array], condensed: PlanarParameters
) -> Explanation | None:
    """The change of one coefficient that explains most, by Gauss and Newton; None where it is not plausible."""
    change = 0.0
    for _ in range(ITERATIONS):
        made = [_made(b, condensed, name, change) / FLOOR for b in besides]
        slopes = [_slope(b, condensed, name, change) for b in besides]
        rest = [residual - own for residual, own in zip(residuals, made, strict=True)]
        if not all(np.isfinite(values).all() for values in (*slopes, *rest)):
            return None
        squares = sum(float((slope**2).sum()) for slope in slopes)
        if squares <= 0.0:
            return None
        step = sum(float((s * r).sum()) for s, r in zip(slopes, rest, strict=True)) / squares
        change += step
        if abs(change) > PLAUSIBLE:
            return None
    total = sum(float((residual**2).sum()) for residual in residuals)
    left = [
        residual - _made(b, condensed, name, change) / FLOOR for b, residual in zip(besides, residuals, strict=True)
    ]  # fmt: skip
    reach = 1.96 * _deviation(besides, left, slopes)
    share = 1.0 - sum(float((own**2).sum()) for own in left) / max(total, 1e-300)
    return Explanation(name=name, change=change, low=change - reach, high=change + reach, share=share)


def _made(beside: Beside, condensed: PlanarParameters, name: str, change: float) -> Array:
    """What a relative change of a coefficient makes in the planar model's velocities (n, 3)."""
    surge = float(beside.simulated[0, 0])
    value = float(getattr(condensed, name))
    ends = [in_planar(replace(condensed, **{name: value * f}), beside.record, surge) for f in (1.0 + change, 1.0)]
    return cleared(beside, (ends[0] - ends[1])[beside.first :])


def _slope(beside: Beside, condensed: PlanarParameters, name: str, change: float) -> Array:
    """Derivative (n, 3) of that by the relative change, in floors."""
    up, down = (_made(beside, condensed, name, change + d) for d in (0.05, -0.05))
    return (up - down) / (0.1 * FLOOR)


def _deviation(besides: Sequence[Beside], left: Sequence[Array], slopes: Sequence[Array]) -> float:
    """Standard deviation of a change: of blocks drawn anew, and of what the floor may look like."""
    sums = []  # of each block: slope squared, slope times what is left
    for beside, rest, slope in zip(besides, left, slopes, strict=True):
        edges = np.arange(0, len(rest), max(1, round(BLOCK / beside.record.step)))
        squares = np.add.reduceat((slope**2).sum(axis=1), edges)
        products = np.add.reduceat((slope * rest).sum(axis=1), edges)
        sums.append(np.column_stack([squares, products]))
    blocks = np.concatenate(sums)
    drawn = np.random.default_rng(0).integers(len(blocks), size=(DRAWS, len(blocks)))
    resampled = blocks[drawn].sum(axis=1)
    chance = float(np.std(resampled[:, 1] / np.maximum(resampled[:, 0], 1e-300)))
    samples = sum(len(slope) for slope in slopes)
    size = math.sqrt(float(blocks[:, 0].sum()) / samples)  # in floors
    return math.hypot(chance, SYSTEMATIC / size)


def spectra(besides: Sequence[Beside]) -> list[tuple[Array, Array, Array]]:
    """Of surge, sway and yaw rate: frequencies (m,) [Hz], and densities of the motion and of the residual (Welch)."""
    longest = max(besides, key=lambda b: b.record.duration)
    rate = 1.0 / longest.record.step
    width = min(len(longest.residual), round(60.0 * rate))
    found = []
    for k in range(3):
        f, motion = welch(longest.measured[longest.first :, 3 + k], rate, nperseg=width)
        _, rest = welch(longest.residual[:, k], rate, nperseg=width)
        found.append((f[1:], motion[1:], rest[1:]))
    return found
