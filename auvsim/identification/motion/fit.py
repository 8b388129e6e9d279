"""Fits of one structure: least squares of changes of velocity, then the motion over segments, longer and longer.

Deviations of the channels are those of the fit's own residuals, found by iteration, so that they bear what the model
lacks and not only what the sensors' data sheets say.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from auvsim.identification.fit import invert
from auvsim.identification.motion import engine
from auvsim.identification.motion.data import Motion, nuisances
from auvsim.identification.motion.dimensions import UNSURE
from auvsim.identification.motion.rollout import horizons, rms, roll
from auvsim.identification.segment_problem import Point, Problem, SegmentOptions, minimise
from estimators.core.types import Array
from estimators.planar.terms import LABELS, LIMITS, TERMS, Structure, vector

STEPS = ("least squares", "segments of 20 s", "segments of 60 s", "output error")
AVERAGE = "average"  # of several structures and steps
LENGTHS = {"segments of 20 s": 20.0, "segments of 60 s": 60.0}  # [s]; else whole records
WINDOW = 2.0  # over which changes of velocity are taken [s]
WIDE = 5.0  # of the weak prior: a term alone may make so many times the rms of its axis' change of velocity
# Residuals of a motion that runs freely for L seconds are alike for much of that time: on the tests' tanker a sum of
# their squares counts 1.2 to 1.7 L times what it is worth (the ratio of its blocks' gradients to its curvature).
ALIKE = 1.5  # [1/s]
START = np.array([0.3, 0.3, 0.02, 0.03, 0.03, 0.01])  # deviations of first states about smoothed ones [m, rad, m/s]
HORIZON = 60.0  # of the predictions that decide [s]
ITERATIONS = 30  # at most, of each round of a search
THRESHOLD = 3.0  # of Huber's loss, in deviations: what a few stretches cannot explain does not decide
FORGET = 0.2  # share of the last step's information that the next one, which sees the same data, keeps
ROUNDS = 2  # of deviations from residuals
BEYOND = 1.5  # limits of a model's velocities, by the largest in the data
_TOLERANCE = 1e-3  # of half the sum of squares, by what it is worth


class Coefficients(NamedTuple):
    """A vector of all terms' coefficients, as `Problem` takes a start."""

    values: Array  # (terms,)

    def vector(self) -> Array:
        """All values."""
        return self.values


@dataclass(frozen=True, kw_only=True, slots=True)
class MotionFit:
    """Coefficients of a structure."""

    structure: Structure
    step: str  # of STEPS, or AVERAGE
    values: Array  # (k,) in the order of the structure's terms
    information: Array  # (k, k) of the weighted least squares with the prior, nuisances eliminated
    blocks: tuple[tuple[Array, Array], ...]  # (k, k) and (k,): information and gradient of each stretch of the data
    deviations: Array  # (8,) of the channels, with what the model lacks
    currents: Array  # (records, 2) [m/s]
    limits: Array  # (3,) of surge, sway and yaw rate [m/s, rad/s]
    converged: bool
    iterations: int
    begun: str = ""  # by which step's fit the search began; least squares begin at nothing
    held: Array | None = None  # (k, k) the information if the nuisances were known; None: there are none
    worth: float = 1.0  # by what the information overstates the data, see ALIKE
    known: Array | None = None  # (k, k) covariance of an average; else `covariance` finds it

    @property
    def vector(self) -> Array:
        """All parameters (parameters,)."""
        return vector(self.coefficients)

    @property
    def coefficients(self) -> dict[str, float]:
        """By their labels."""
        return dict(zip((*self.structure.terms, *LIMITS), [*self.values.tolist(), *self.limits.tolist()], strict=True))


class Regression(NamedTuple):
    """Equations of the changes of velocity: what `least_squares` solves for any structure."""

    terms: Array  # (w, 3, all terms)
    changes: Array  # (w, 3)
    stretch: Array  # (w,) which block of the data an equation belongs to
    limits: Array  # (3,) of the velocities, see BEYOND
    centre: Array  # (terms,) about which the weak prior lies
    unsure: Array  # (terms,) standard deviation of what is known before; infinite: nothing


def regression(
    motions: Sequence[Motion], before: Mapping[str, float] | None = None, *, block: float = 60.0
) -> Regression:
    """Changes of velocity over windows, and the integrals of all terms over them.

    Args:
        motions: What was measured.
        before: Coefficients that are known to within `dimensions.UNSURE` of their size.
        block: Of the stretches that count as one [s].
    """
    centre, unsure = np.zeros(len(TERMS)), np.full(len(TERMS), np.inf)
    for label, value in (before or {}).items():
        centre[LABELS.index(label)], unsure[LABELS.index(label)] = value, UNSURE * abs(value)
    every = np.arange(len(LABELS))
    zero = vector({})
    terms, changes, stretch, number = [], [], [], 0
    for motion in motions:
        record = motion.record
        _, values = engine.loops().regressors(motion.states, np.ascontiguousarray(record.inputs), zero, every)
        # Inputs are held from sample to sample, states are not: each part's ends with the input of its beginning.
        _, after = engine.loops().regressors(motion.states[1:], np.ascontiguousarray(record.inputs[:-1]), zero, every)
        parts = 0.5 * record.step * (values[:-1] + after)
        size = max(1, round(WINDOW / record.step))
        edges = np.arange(0, len(parts) + 1, size)
        if len(edges) < 2:
            continue
        summed = np.add.reduceat(parts[: edges[-1]], edges[:-1])
        nu = motion.states[edges, 3:6]
        terms.append(summed)
        changes.append(np.diff(nu, axis=0))
        blocks = ((edges[:-1] * record.step) // block).astype(int)
        stretch.append(number + blocks)
        number += int(blocks[-1]) + 1
    limits = BEYOND * np.max([np.abs(motion.states[:, 3:6]).max(axis=0) for motion in motions], axis=0)
    joined = np.concatenate(terms), np.concatenate(changes), np.concatenate(stretch)
    return Regression(*joined, np.maximum(limits, 1e-3), centre, unsure)


def reach(equations: Regression, structure: Structure) -> Array:
    """Standard deviations (k,) of the weak prior; a term that the data never move is held at its centre."""
    places = list(structure.places)
    axes = np.array([TERMS[place].axis for place in places])
    size = np.sqrt(np.mean(equations.terms[:, axes, places] ** 2, axis=0))
    moved = np.sqrt(np.mean(equations.changes**2, axis=0))[axes]
    wide = np.where(size > 0.0, WIDE * moved / np.where(size > 0.0, size, 1.0), 1e-9) + 1e-12
    return np.minimum(wide, equations.unsure[places])


def least_squares(motions: Sequence[Motion], structure: Structure, equations: Regression | None = None) -> MotionFit:
    """Ordinary least squares of each axis with the weak prior."""
    found = regression(motions) if equations is None else equations
    places = np.array(structure.places)
    wide, centre = reach(found, structure), found.centre[places]
    k = len(places)
    values, information = np.zeros(k), np.diag(1.0 / wide**2)
    blocks = [(np.zeros((k, k)), np.zeros(k)) for _ in range(int(found.stretch.max()) + 1)]
    for axis in range(3):
        own = np.flatnonzero([TERMS[place].axis == axis for place in places])
        if not len(own):
            continue
        A, b = found.terms[:, axis, places[own]], found.changes[:, axis]
        weight = 1.0
        for _ in range(2):  # the residuals of the first weigh the prior of the second
            rows = np.vstack([A * weight, np.diag(1.0 / wide[own])])
            scale = np.linalg.norm(rows, axis=0)
            solved = np.linalg.lstsq(rows / scale, np.concatenate([b * weight, centre[own] / wide[own]]), rcond=1e-12)[
                0
            ]
            values[own] = solved / scale
            weight = 1.0 / max(float(np.std(b - A @ values[own])), 1e-9)
        rest = (b - A @ values[own]) * weight
        information[np.ix_(own, own)] += weight**2 * A.T @ A
        for number, (H, g) in enumerate(blocks):
            here = found.stretch == number
            H[np.ix_(own, own)] += weight**2 * A[here].T @ A[here]
            g[own] += weight * A[here].T @ rest[here]
    return MotionFit(
        structure=structure, step="least squares", values=values, information=information, blocks=tuple(blocks),
        deviations=np.array([motions[0].record.deviations[c] for c in range(8)]),
        currents=np.array([motion.states[-1, 6:8] for motion in motions]), limits=found.limits,
        converged=True, iterations=1,
    )  # fmt: skip


def segments(
    motions: Sequence[Motion],
    guesses: Sequence[MotionFit],
    step: str,
    equations: Regression | None = None,
    *,
    like: MotionFit | None = None,
) -> MotionFit:
    """Fits the motion over segments from where another fit of the structure ended.

    It begins at that guess whose free run over the segments is the likeliest. So a structure that cannot follow the
    motion, whose fit to shorter segments gave up one channel for another, does not lead the longer ones astray.
    Deviations are found from residuals, first with the guess's; where that does not converge, or predicts the data
    worse than the guess, also with larger ones, by the guess's free run, and the better fit is kept.

    The prior is the weak one, and where the guess ended, with a share of its information: so coefficients that go
    together do not leave each other where the longer segments see only their sum. Both count by what the sum of squares
    is worth.

    Args:
        motions: What was measured.
        guesses: Fits by the steps before, the last one last.
        step: Of STEPS, but the first.
        equations: Those of the motions; they are made if None.
        like: A fit of the same structure and step to more data: the search begins there, with its deviations, and the
            prior is of the guess by the same step. None: deviations are found from residuals.
    """
    found = regression(motions) if equations is None else equations
    if like is not None:
        guess = next(fit for fit in guesses if fit.step == like.begun)
        return _searched(motions, guess, like.values, like.deviations, step, found, rounds=1)
    sensors = guesses[0].deviations
    runs = [(guess, _free_run(_problem(motions, guess, sensors, step, found), guess.values)) for guess in guesses]
    guess, run = min(runs, key=lambda pair: _unlikely(pair[1], sensors))
    wide = _from_residuals(run, sensors) if np.isfinite(run.cost) else sensors
    tried = [wide] if guess.step == STEPS[0] else [guess.deviations, np.sqrt(guess.deviations * wide)]
    asked, fits = off(motions, guess), []
    for deviations in tried:
        fits.append(_searched(motions, guess, guess.values, deviations, step, found, rounds=ROUNDS))
        if fits[-1].converged and off(motions, fits[-1]) <= asked:
            break
    return min(fits, key=lambda fit: (not fit.converged, off(motions, fit)))


def off(motions: Sequence[Motion], fit: MotionFit) -> float:
    """Position error of open-loop predictions of motions after HORIZON by the distance run, rms."""
    at = horizons(motions, (HORIZON,))
    return float(rms([roll(fit.vector, motion, at).shares for motion in motions])[-1])


def _problem(motions: Sequence[Motion], guess: MotionFit, deviations: Array, step: str, found: Regression) -> Problem:
    """The segments' sum of squares with these deviations, and a prior about a guess."""
    records = [replace(motion.record, deviations=deviations) for motion in motions]
    weak = np.diag(1.0 / reach(found, guess.structure) ** 2)
    options = SegmentOptions(
        nuisances=nuisances([motion.record for motion in motions]), max_iterations=ITERATIONS, loss="huber",
        threshold=THRESHOLD,
    )  # fmt: skip
    return Problem(
        records, Coefficients(guess.vector), guess.structure.terms, options, LENGTHS.get(step, np.inf),
        [motion.states for motion in motions], engine.EQUATIONS,
        _worth(motions, step) * (weak + FORGET * guess.information / guess.worth), START,
    )  # fmt: skip


def _worth(motions: Sequence[Motion], step: str) -> float:
    return ALIKE * min(LENGTHS.get(step, np.inf), max(motion.duration for motion in motions))


def _searched(
    motions: Sequence[Motion],
    guess: MotionFit,
    values: Array,
    deviations: Array,
    step: str,
    found: Regression,
    rounds: int,
) -> MotionFit:
    """The way down from some values, with deviations from residuals after each round but the last."""
    point, problem, converged, used = None, _problem(motions, guess, deviations, step, found), False, 0
    worth = _worth(motions, step)
    for turn in range(rounds):
        if point is None:
            first = _free_run(problem, values)
        else:
            problem = _problem(motions, guess, deviations, step, found)
            first = problem.at(point.values, point.nuisances, point.starts)
        if not np.isfinite(first.cost):
            break
        # Deviations that are no more than guessed do not merit a way to its end.
        tolerance = _TOLERANCE * worth if turn == rounds - 1 else 0.1 * worth
        point, iterations, converged = minimise(problem, first, tolerance)
        used += iterations
        deviations = _from_residuals(point, deviations)
    if point is None:
        return replace(guess, step=step, begun=guess.step, converged=False)
    total, _, _ = problem.reduced(point, 0.0)
    k = len(point.values)
    return MotionFit(
        structure=guess.structure, step=step, values=point.values, information=_without_nuisances(total, k),
        blocks=tuple(_blocks(problem, point)), deviations=deviations, currents=point.nuisances[:, :2],
        limits=guess.limits, converged=converged, iterations=used, begun=guess.step, held=total[:k, :k], worth=worth,
    )  # fmt: skip


def _free_run(problem: Problem, values: Array) -> Point:
    """The segments from the smoothed states at their beginnings."""
    return problem.at(values, problem.nuisances, [cut.held for cut in problem.cuts])


def _unlikely(point: Point, deviations: Array) -> float:
    """Less the logarithm of the likelihood of residuals whose deviations are the likeliest, but for a constant."""
    if not np.isfinite(point.cost):
        return np.inf
    counts = np.isfinite(np.concatenate(point.residuals)).sum(axis=0)
    return float(counts @ np.log(_from_residuals(point, deviations)))


def _from_residuals(point: Point, deviations: Array) -> Array:
    """Deviations (8,) that the residuals show; those of channels without one stay."""
    together = np.concatenate(point.residuals)
    there = np.isfinite(together)
    counts = there.sum(axis=0)
    squares = np.where(there, together, 0.0) ** 2
    rms = np.sqrt(squares.sum(axis=0) / np.maximum(counts, 1))
    return np.where(counts > 0, deviations * np.maximum(rms, 1e-3), deviations)


def _without_nuisances(total: Array, k: int) -> Array:
    """Information of the first k unknowns, whatever the others are."""
    if len(total) == k:
        return total
    return total[:k, :k] - total[:k, k:] @ np.linalg.pinv(total[k:, k:]) @ total[k:, :k]


def _blocks(problem: Problem, point: Point) -> list[tuple[Array, Array]]:
    """Information and gradient of each segment, its first state eliminated."""
    k = len(problem.free)
    found = []
    for H, g in point.normal_equations:
        for s in range(len(H)):
            part, descent, _, _ = engine.loops().eliminate(H[s : s + 1], g[s : s + 1], 0.0)
            found.append((part[:k, :k], descent[:k]))
    return found


def average(parts: Sequence[MotionFit], weights: Sequence[float]) -> MotionFit:
    """The weighed mean of fits to the same data; a term that one lacks is zero there.

    Its covariance is the mean of theirs and the spread between them (Hoeting et al., Statistical Science 14, 1999, eq.
    2), as if each knew nothing of the others.

    Args:
        parts: The fits.
        weights: Of each, in any unit.
    """
    share = np.array(weights) / np.sum(weights)
    terms = tuple(label for label in LABELS if any(label in fit.structure.terms for fit in parts))
    values, spread = np.zeros((len(parts), len(terms))), np.zeros((len(terms), len(terms)))
    for row, fit, weight in zip(values, parts, share, strict=True):
        own = [terms.index(term) for term in fit.structure.terms]
        row[own] = fit.values
        spread[np.ix_(own, own)] += weight * covariance(fit)
    mean = share @ values
    spread += np.einsum("p,pi,pj->ij", share, values - mean, values - mean)
    first = parts[int(np.argmax(share))]
    return replace(
        first, structure=Structure(name=f"average of {len(parts)}", terms=terms), step=AVERAGE, values=mean,
        information=np.linalg.pinv(spread), blocks=(), converged=all(fit.converged for fit in parts), held=None,
        known=spread,
    )  # fmt: skip


def covariance(fit: MotionFit) -> Array:
    """Covariance (k, k) of the coefficients by the jackknife of stretches of the data.

    Leaving out a stretch moves the coefficients by (H - H_b)^-1 g_b to first order; the spread of these bears residuals
    that are neither white nor of the size believed. Where stretches are few it is no smaller than that of the weighted
    least squares itself; of less than three it is that, by what their squares are worth.
    """
    if fit.known is not None:
        return fit.known
    H = fit.information if fit.held is None else fit.held
    # What the currents of the records leave unknown besides: they are eliminated from all stretches at once.
    wider = np.sqrt(np.diag(invert(fit.information)) / np.diag(invert(H)))
    moves = []
    for part, gradient in fit.blocks:
        if np.any(gradient):
            moves.append(-invert(H - part) @ gradient)
    if len(moves) < 3:
        return fit.worth * invert(fit.information)
    away = np.array(moves)
    count = len(away)
    spread = (count - 1) / count * (away - away.mean(axis=0)).T @ (away - away.mean(axis=0))
    # Few stretches leave directions in which none of them moves: there the mean inflation of the others counts.
    size = np.sqrt(np.diag(H))
    inflation = max(1.0, float(np.mean(np.diag(spread) * np.diag(H))) / float(np.mean(np.diag(invert(H)) * size**2)))
    share = min(0.5, len(H) / (2.0 * count))
    return np.outer(wider, wider) * ((1.0 - share) * spread + share * inflation * invert(H))
