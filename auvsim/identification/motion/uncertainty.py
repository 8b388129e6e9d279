"""How far a chosen model may be trusted: bands of predictions, their coverage, and fits to disjoint halves compared.

A band has four parts: the coefficients' covariance, white noise of the process, a constant acceleration that the model
lacks in each prediction, and the error of the first state. The sizes of the last three are the likeliest for
predictions of what was left out while fitting, and a factor for each horizon makes the band hold as much of those as
it says.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize

from auvsim.identification.motion import fit as fits
from auvsim.identification.motion.choice import Folds
from auvsim.identification.motion.data import Motion, slices
from auvsim.identification.motion.fit import MotionFit
from auvsim.identification.motion.rollout import Rollouts, roll
from estimators.core.consistency import chi_square
from estimators.core.types import Array
from estimators.planar.terms import LABELS, Structure

PROBABILITY = 0.95
ROUND = 0.1  # share of a position's whole variance that each direction has at least
BETWEEN = 1.0  # standard deviations among records by which bands are wider than on the mean of them
CONSTANTS = tuple(LABELS.index(f"{axis} 1") for axis in ("surge", "sway", "yaw"))
_SEEN = (0, 1, 2)  # of the state: position and heading say what the process does between sensors
_SHORTEST = 20.0  # of a half of a record [s]


@dataclass(frozen=True, kw_only=True, slots=True)
class Spread:
    """What spreads predictions besides the coefficients."""

    noise: Array  # (3,) densities of white noise in surge, sway [m2/s3] and yaw [rad2/s3]
    constant: Array  # (3,) standard deviations of the constant acceleration that the model lacks [m/s2, rad/s2]
    first: float  # factor on the variance of the first state, see `rollout_loops.predict`
    horizons: Array  # (m,) at which bands were compared with predictions of what was left out [s]
    factors: Array  # (m,) on all of the covariance there, so that bands hold what they say


@dataclass(frozen=True, kw_only=True, slots=True)
class Held:
    """What bands hold of some predictions."""

    horizons: tuple[float, ...]  # [s]
    share: Array  # (m,) position error relative to the distance run, rms
    inside: Array  # (m,) share of the positions inside their band
    parameters_inside: Array  # (m,) the same of the band of the coefficients' covariance alone
    radius: Array  # (m,) longer semi-axis of the band relative to the distance run, median
    count: Array  # (m,) predictions


@dataclass(frozen=True, kw_only=True, slots=True)
class Halves:
    """Fits of the same structure to disjoint halves of the data."""

    scores: Array  # (k,) difference of the coefficients by its standard deviation
    rms: float
    step: str  # to which both converge
    between: float = 1.0  # factor on their covariances that is in these, see `between`


def of_left_out(
    folds: Folds, structure: Structure, step: str, horizons: Sequence[float], widened: float = 1.0
) -> list[tuple[Rollouts, Array]]:
    """Predictions of each part left out by the fit without it, with that fit's covariance times `widened`."""
    found = []
    for fold, (_, out) in enumerate(folds.splits):
        if not folds.fit(structure, step, fold).converged and fold >= folds.compared:
            continue
        fit = folds.fit(structure, step, fold)
        own = widened * fits.covariance(fit)
        found += [(_spread_out(fit, motion, horizons), own) for motion in out]
    return found


def _spread_out(fit: MotionFit, motion: Motion, horizons: Sequence[float]) -> Rollouts:
    places = np.array([*fit.structure.places, *CONSTANTS])
    return roll(fit.vector, motion, horizons, sensitive=places, spread=True)


def _parts(rollouts: Rollouts, covariance: Array) -> tuple[Array, Array, Array]:
    """Errors (n, 6) that there are, their covariance by the coefficients (n, 6, 6), and by each unit of the spread."""
    k = len(covariance)
    errors = rollouts.errors.reshape(-1, 6)
    S = rollouts.sensitivity.reshape(-1, 6, rollouts.sensitivity.shape[-1])
    W = rollouts.covariance.reshape(-1, 4, 6, 6)
    there = np.isfinite(errors).all(axis=1) & np.isfinite(S).all(axis=(1, 2)) & np.isfinite(W).all(axis=(1, 2, 3))
    errors, S, W = errors[there], S[there], W[there]
    known = S[..., :k] @ covariance @ np.swapaxes(S[..., :k], 1, 2)
    constant = np.einsum("nia,nja->naij", S[..., k:], S[..., k:])
    return errors, known, np.concatenate([W[:, :3], constant, W[:, 3:]], axis=1)


def spread(left_out: Sequence[tuple[Rollouts, Array]]) -> Spread:
    """The likeliest spread of predictions of what was left out, and the factor with which their bands hold."""
    parts = [_parts(rollouts, covariance) for rollouts, covariance in left_out]
    errors, known, units = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    seen = list(_SEEN)
    e, K, U = errors[:, seen], known[:, seen][..., seen], units[:, :, seen][..., seen]
    floor = np.diag([1e-4, 1e-4, 1e-8])

    def cost(logs: Array) -> float:
        P = K + np.einsum("a,naij->nij", np.exp(logs), U) + floor
        sign, log_det = np.linalg.slogdet(P)
        if not (sign > 0.0).all():
            return 1e12
        squares = np.einsum("ni,nij,nj->n", e, np.linalg.inv(P), e)
        # Student's density with five degrees of freedom, so that a few outlying predictions do not decide.
        return float(np.mean(0.5 * log_det + 0.5 * (5.0 + len(seen)) * np.log1p(squares / 5.0)))

    begin = np.log(np.array([1e-6, 1e-6, 1e-8, 1e-6, 1e-6, 1e-8, 1e-2]))
    best = minimize(cost, begin, method="L-BFGS-B", bounds=[(-40.0, 3.0)] * 6 + [(-12.0, 3.0)], options={"maxiter": 60})
    sizes = np.exp(best.x)
    at = np.array(left_out[0][0].horizons)
    draft = Spread(
        noise=sizes[:3], constant=np.sqrt(sizes[3:6]), first=float(sizes[6]), horizons=at, factors=np.ones(len(at))
    )
    scores = [_scores(rollouts, covariance, draft) for rollouts, covariance in left_out]
    return replace(draft, factors=np.array([_factor([one[:, m] for one in scores]) for m in range(len(at))]))


def _factor(scores: Sequence[Array]) -> float:
    """On a covariance, by the scores (s,) of each record, so that it holds what it says of the next one.

    Records differ from each other by more than predictions of one record do.
    """
    there = [one[np.isfinite(one)] for one in scores]
    logs = np.array([math.log(max(float(np.quantile(one, PROBABILITY)), 1e-6)) for one in there if len(one)])
    if not len(logs):
        return 1.0
    between = float(np.std(logs, ddof=1)) if len(logs) > 1 else 0.0
    return math.exp(float(np.mean(logs)) + BETWEEN * between) / chi_square(PROBABILITY, 2)


def position_covariance(rollouts: Rollouts, covariance: Array, found: Spread) -> Array:
    """Covariance (s, m, 2, 2) of predicted positions [m2]."""
    k = len(covariance)
    S = rollouts.sensitivity[..., :2, :]
    W = rollouts.covariance[..., :2, :2]
    P = S[..., :k] @ covariance @ np.swapaxes(S[..., :k], -1, -2)
    P = P + np.einsum("a,smaij->smij", found.noise, W[:, :, :3])
    P = P + np.einsum("a,smia,smja->smij", found.constant**2, S[..., k:], S[..., k:])
    P = P + found.first * W[:, :, 3] + 1e-4 * np.eye(2)
    # An unstable vehicle's linear covariance is a line after a minute; its true errors bend round.
    P = P + ROUND * np.trace(P, axis1=-2, axis2=-1)[..., None, None] * np.eye(2)
    factors = np.exp(np.interp(rollouts.horizons, found.horizons, np.log(found.factors)))
    return factors[:, None, None] * P


def _scores(rollouts: Rollouts, covariance: Array, found: Spread) -> Array:
    """Squares (s, m) of position errors by their covariance; NaN past a motion's end, infinite where it ran away."""
    P = position_covariance(rollouts, covariance, found)
    e = rollouts.errors[..., :2]
    there = np.isfinite(e).all(axis=-1) & np.isfinite(P).all(axis=(-1, -2))
    found_scores = np.full(there.shape, np.nan)
    found_scores[there] = np.einsum("ni,nij,nj->n", e[there], np.linalg.inv(P[there]), e[there])
    return np.where(np.isfinite(rollouts.distance) & ~there, np.inf, found_scores)


def held(
    fit: MotionFit, motions: Sequence[Motion], covariance: Array, found: Spread, horizons: Sequence[float]
) -> Held:
    """Errors of predictions of motions, and what their bands hold, horizon by horizon."""
    rolled = [_spread_out(fit, motion, horizons) for motion in motions]
    return held_of([(rollouts, covariance) for rollouts in rolled], found)


def held_of(left_out: Sequence[tuple[Rollouts, Array]], found: Spread) -> Held:
    """Errors of predictions, each with its covariance, and what their bands hold, horizon by horizon."""
    alone = Spread(
        noise=np.zeros(3),
        constant=np.zeros(3),
        first=0.0,
        horizons=found.horizons,
        factors=np.ones(len(found.horizons)),
    )
    scores = np.concatenate([_scores(r, c, found) for r, c in left_out])
    plain = np.concatenate([_scores(r, c, alone) for r, c in left_out])
    shares = np.concatenate([r.shares for r, _ in left_out])
    lengths = np.concatenate(
        [
            np.sqrt(np.linalg.eigvalsh(np.nan_to_num(position_covariance(r, c, found)))[..., -1])
            / np.maximum(r.distance, 1e-6)
            for r, c in left_out
        ]
    )
    limit = chi_square(PROBABILITY, 2)
    count = np.isfinite(shares).sum(axis=0)
    some = np.maximum(count, 1)
    return Held(
        horizons=left_out[0][0].horizons,
        share=np.sqrt(np.nansum(shares**2, axis=0) / some),
        inside=np.sum(scores <= limit, axis=0) / some,
        parameters_inside=np.sum(plain <= limit, axis=0) / some,
        radius=math.sqrt(limit) * np.nanmedian(np.where(np.isfinite(shares), lengths, np.nan), axis=0),
        count=count,
    )


def between(folds: Folds, structure: Structure, step: str) -> float:
    """Factor on a fit's covariance by what coefficients differ from record to record, beyond what stretches show.

    A structure that is not the vehicle's own fits each manoeuvre with other coefficients, and all stretches of a record
    alike. The jackknife of the records, or parts, that cross-validation leaves out bears that; of so few it says the
    size, not the shape: the mean ratio of its variances to those of the stretches. At least 1.
    """
    fitted = [folds.fit(structure, step, fold) for fold in range(folds.compared)]
    values = np.array([fit.values for fit in fitted if fit.converged])
    count = len(values)
    if count < 3:
        return 1.0
    spread = (count - 1) / count * np.sum((values - values.mean(axis=0)) ** 2, axis=0)
    own = np.diag(fits.covariance(folds.fit(structure, step, -1)))
    return max(1.0, float(np.mean(spread / own)))


def halves(folds: Folds, structure: Structure, steps: Sequence[MotionFit] = ()) -> Halves:
    """Fits a structure to every other record, or every other part of few records, and to the rest.

    Both go as far as both converge: what has run away says nothing of the intervals.

    Args:
        folds: All motions, and their fits without each part, which say how much records differ.
        structure: What is fitted.
        steps: Fits of it to all of them, by the steps from the second on; searches begin there.
    """
    parts = list(folds.motions)
    if len(parts) < 4:
        parts = []
        for motion in folds.motions:
            count = max(1, min(4, int(motion.duration // _SHORTEST)))
            edges = np.linspace(0, len(motion.record.times), count + 1).astype(int)
            parts += [slices(motion, a, b) for a, b in pairwise(edges.tolist())]
    both = [parts[::2], parts[1::2]]
    equations = [fits.regression(half) for half in both]
    begun = [fits.least_squares(half, structure, own) for half, own in zip(both, equations, strict=True)]
    found = {begun[0].step: begun}
    last = begun[0].step
    for whole in steps:
        if whole.begun not in found:  # by a step whose halves did not converge
            continue
        further = [
            fits.segments(half, [guess], whole.step, own, like=whole)
            for half, guess, own in zip(both, found[whole.begun], equations, strict=True)
        ]
        if all(fit.converged for fit in further):
            found[whole.step], last = further, whole.step
    first, second = found[last]
    more = between(folds, structure, first.step)
    spread = more * np.diag(fits.covariance(first) + fits.covariance(second))
    scores = (first.values - second.values) / np.sqrt(np.maximum(spread, 1e-300))
    return Halves(scores=scores, rms=float(np.sqrt(np.mean(scores**2))), step=first.step, between=more)
