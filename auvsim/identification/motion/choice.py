"""Which structure, by which step: compared by cross-validation; the average of the good ones, or the simplest of them.

Records, or where they are few their parts, are left out in turn; what was left out is predicted open loop from many
starts. Structures are compared after least squares and after segments first, then the best with more terms and by all
steps.

Few records rank candidates by chance as much as by merit. So those that come near the best are averaged, each by the
inverse of its error to the fourth power, unless what was left out speaks against it: the errors of candidates differ,
and their mean has less of them than most (Bates and Granger, Operational Research Quarterly 20, 1969).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from auvsim.identification.motion import data
from auvsim.identification.motion import fit as fits
from auvsim.identification.motion.data import Motion, slices
from auvsim.identification.motion.fit import AVERAGE, HORIZON, STEPS, MotionFit, Regression
from auvsim.identification.motion.rollout import horizons, rms, roll
from estimators.core.types import Array
from estimators.planar.terms import ASYMMETRY, LABELS, PLANAR, STRUCTURES, TERMS, THRUSTER, TWIN, WIND, Structure

FOLDS = 4
NEAR = 2.0  # times the least error, up to which candidates are averaged
# Weights go by the error to this power: the likelihood of as many independent errors of a normal density.
POWER = 4.0
# By what share an average may be worse than the simplest good candidate: the best of twenty looks better than it is.
LUCK = 0.25
KEPT = 4  # structures that go on to all steps
QUICK_KEPT, QUICK_STEPS = 2, STEPS[1:2]  # the same where speed counts more
EQUAL = 0.05  # a simpler model is no worse than the best one by more than this share of its error
# Records from which on whole ones are left out, and asymmetry may be chosen. Within a record it cannot be told from
# constant errors of its sensors and from its current: it predicts other parts of the record well, and nothing else.
RECORDS = 3
SHORTEST = 40.0  # of a part of a record that is left out [s]
FIRST_STEPS = STEPS[:2]


@dataclass(frozen=True, kw_only=True, slots=True)
class Candidate:
    """A structure fitted by one step, and how it predicts what was left out."""

    structure: Structure
    step: str
    shares: tuple[Array, ...]  # of each part left out, (s, m): position error relative to the distance run
    deviation: float  # standard error of `error` over the parts
    converged: bool  # all of the fits

    @property
    def error(self) -> float:
        """Position error at the horizon relative to the distance run, rms."""
        return float(rms(self.shares)[-1])

    @property
    def parts(self) -> Array:
        """Mean square of each part left out."""
        return np.array([float(np.nanmean(shares[:, -1] ** 2)) for shares in self.shares])

    @property
    def size(self) -> tuple[int, float]:
        """What makes it less simple than another: its terms; of as many, its error."""
        return len(self.structure.terms), self.error


@dataclass(frozen=True, kw_only=True, slots=True)
class Choice:
    """What was compared, and what was kept."""

    candidates: tuple[Candidate, ...]  # from the best
    chosen: Candidate  # an average, or the simplest good one
    alone: Candidate  # the simplest good one
    averaged: tuple[Candidate, ...]  # what the average is of
    horizon: float  # [s]
    fit: MotionFit  # of the chosen one, to all of the data
    said: str  # how it was left out
    folds: "Folds"

    def mark(self, candidate: Candidate) -> str:
        """What became of a candidate, in a word or two."""
        if candidate is self.chosen:
            return "chosen"
        if not candidate.converged:
            return "not converged"
        return "averaged" if self.chosen.step == AVERAGE and candidate in self.averaged else ""


class Folds:
    """Motions with each part left out in turn, and their fits, which are made once."""

    def __init__(self, motions: Sequence[Motion], before: Mapping[str, float] | None = None) -> None:
        self.motions = list(motions)
        self.splits, self.said = _splits(self.motions)
        self.compared = len(self.splits)  # the others are for bands alone
        long = _long(self.motions)
        if len(long) == 2:  # parts of a record share its kind and its errors: their predictions make bands too narrow
            self.splits += [([m for m in self.motions if m is not out], [out]) for out in long]
        self.equations = [fits.regression(rest, before) for rest, _ in self.splits]
        self.whole = fits.regression(self.motions, before)
        self.horizon = min(HORIZON, horizons([m for _, out in self.splits for m in out], (HORIZON,))[-1])
        self._fits: dict[tuple[tuple[str, ...], str, int], MotionFit] = {}
        self._averaged: list[tuple[Candidate, float]] = []  # and the weight of each

    def fit(self, structure: Structure, step: str, fold: int) -> MotionFit:
        """A fit without one part; of the whole with the fold -1."""
        key = structure.terms, step, fold
        if key not in self._fits:
            motions, equations = (
                (self.motions, self.whole) if fold < 0 else (self.splits[fold][0], self.equations[fold])
            )
            self._fits[key] = self._made(structure, step, fold, motions, equations)
        return self._fits[key]

    def _made(
        self, structure: Structure, step: str, fold: int, motions: Sequence[Motion], equations: Regression
    ) -> MotionFit:
        if step == AVERAGE:
            parts = [self.fit(c.structure, c.step, fold) for c, _ in self._averaged]
            return fits.average(parts, [weight for _, weight in self._averaged])
        if step == STEPS[0]:
            return fits.least_squares(motions, structure, equations)
        like = self.fit(structure, step, -1) if fold >= 0 else None
        before = STEPS[: STEPS.index(step)] if like is None else (like.begun,)
        guesses = [self.fit(structure, earlier, fold) for earlier in before]
        return fits.segments(motions, guesses, step, equations, like=like)

    def candidate(self, structure: Structure, step: str) -> Candidate:
        """Fits without each part, and their predictions of it."""
        shares, converged = [], self.fit(structure, step, -1).converged
        for fold, (_, out) in enumerate(self.splits[: self.compared]):
            found = self.fit(structure, step, fold)
            converged &= found.converged
            rolled = [roll(found.vector, motion, (self.horizon,)).shares for motion in out]
            shares += [share for share in rolled if np.isfinite(share[:, -1]).any()]  # not of what is too short
        parts = np.array([np.nanmean(share[:, -1] ** 2) for share in shares])
        error = math.sqrt(float(parts.mean()))
        deviation = float(parts.std(ddof=1)) / math.sqrt(len(parts)) / (2.0 * error) if len(parts) > 1 else math.inf
        return Candidate(
            structure=structure, step=step, shares=tuple(shares), deviation=deviation, converged=converged
        )  # fmt: skip

    def average(self, candidates: Sequence[Candidate]) -> Candidate:
        """Their average, by the inverse of their errors to the power POWER."""
        self._averaged = [(candidate, candidate.error**-POWER) for candidate in candidates]
        labels = {term for candidate in candidates for term in candidate.structure.terms}
        terms = tuple(label for label in LABELS if label in labels)
        return self.candidate(Structure(name=f"average of {len(candidates)}", terms=terms), AVERAGE)


def choose(
    motions: Sequence[Motion],
    structures: Sequence[Structure] = STRUCTURES,
    *,
    before: Mapping[str, float] | None = None,
    quick: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> Choice:
    """Compares structures and steps, and fits the chosen one to all of the data.

    Args:
        motions: What was measured.
        structures: From the simplest; wind and asymmetry are added to the best.
        before: Coefficients that are known before, see `dimensions`.
        quick: Fewer structures go on to fewer steps.
        progress: Called with what is being done and the share that is done.
    """
    say = progress or (lambda text, share: None)
    folds = Folds(motions, before)
    inputs = np.concatenate([motion.record.inputs for motion in motions])
    windy = bool(np.any(inputs[:, data.WIND]))
    added = [TWIN] * bool(np.any(inputs[:, 4])) + [THRUSTER] * bool(np.any(inputs[:, 5])) + [WIND] * windy
    bases = []
    for structure in structures:
        for terms in added:
            structure = with_terms(structure, terms)
        bases.append(seen(folds.whole, structure))
    found: list[Candidate] = []
    first = FIRST_STEPS[:1] if quick else FIRST_STEPS
    for number, structure in enumerate(bases):
        say(f"cross-validation: {structure.name}", 0.5 * number / len(bases))
        found += [folds.candidate(structure, step) for step in first]
    if added and TWIN not in added:  # a docking filter's planar model knows none of these, and steers by a rudder
        calm = [seen(folds.whole, structure) for structure in structures if set(structure.terms) <= set(PLANAR)]
        found += [folds.candidate(structure, FIRST_STEPS[0]) for structure in calm]
    best = _ranked(found)[0].structure
    more = [with_terms(best, ASYMMETRY)] if len(_long(motions)) >= RECORDS else []
    if windy:
        more.append(replace(best, name=best.name.replace(" and wind", ""), terms=_without(best.terms, WIND)))
    for number, structure in enumerate(more):
        say(f"cross-validation: {structure.name}", 0.5 + 0.1 * number)
        found += [folds.candidate(seen(folds.whole, structure), step) for step in first]
    last = list({c.structure.name: c.structure for c in _ranked(found)}.values())[: QUICK_KEPT if quick else KEPT]
    steps = QUICK_STEPS if quick else STEPS[2:]
    for number, structure in enumerate(last):
        for step in steps:
            say(f"{structure.name}: {step}", 0.7 + 0.25 * number / len(last))
            found.append(folds.candidate(structure, step))
    chosen = alone = simplest(_ranked(found))
    near = [c for c in _ranked(found) if c.converged and c.error <= NEAR * alone.error]
    if len(near) > 1:
        found.append(folds.average(near))
        chosen = found[-1] if found[-1].error <= (1.0 + LUCK) * alone.error else alone
    return Choice(
        candidates=tuple(_ranked(found)), chosen=chosen, alone=alone, averaged=tuple(near), horizon=folds.horizon,
        said=folds.said, folds=folds, fit=folds.fit(chosen.structure, chosen.step, -1),
    )  # fmt: skip


def simplest(ranked: Sequence[Candidate]) -> Candidate:
    """The simplest of those as good as the best: within a standard error of the difference, and within EQUAL.

    What has not converged is kept only if nothing else is there.
    """
    settled = [candidate for candidate in ranked if candidate.converged] or list(ranked)
    best = settled[0]
    good = [best]
    for other in settled[1:]:
        away = other.parts - best.parts
        error = float(away.std(ddof=1)) / math.sqrt(len(away)) if len(away) > 1 else 0.0
        if float(away.mean()) <= error and other.error <= (1.0 + EQUAL) * best.error:
            good.append(other)
    return min(good, key=lambda candidate: candidate.size)


def with_terms(structure: Structure, terms: Sequence[str]) -> Structure:
    """A structure with more terms."""
    if not terms:
        return structure
    names = {WIND: "wind", ASYMMETRY: "asymmetry", TWIN: "two shafts", THRUSTER: "side thruster"}
    chosen = {*structure.terms, *terms}
    return Structure(
        name=f"{structure.name} and {names.get(tuple(terms), 'more')}", terms=tuple(t for t in LABELS if t in chosen)
    )


def seen(equations: Regression, structure: Structure) -> Structure:
    """The structure without terms that the data never move or that others make up, such as n|n| of a steady shaft."""
    kept: list[str] = []
    for axis in range(3):
        own = [label for label in structure.terms if TERMS[LABELS.index(label)].axis == axis]
        columns = equations.terms[:, axis, [LABELS.index(label) for label in own]]
        for label, column in zip(own, columns.T, strict=True):
            size = float(np.linalg.norm(column))
            if size == 0.0:
                continue
            basis = equations.terms[:, axis, [LABELS.index(k) for k in kept if TERMS[LABELS.index(k)].axis == axis]]
            rest = column
            if basis.shape[1]:
                scaled = basis / np.linalg.norm(basis, axis=0)
                rest = column - scaled @ np.linalg.lstsq(scaled, column, rcond=1e-10)[0]
            if float(np.linalg.norm(rest)) > 1e-4 * size:
                kept.append(label)
    return replace(structure, terms=tuple(kept))


def _without(terms: Sequence[str], out: Sequence[str]) -> tuple[str, ...]:
    return tuple(term for term in terms if term not in out)


def _ranked(found: Sequence[Candidate]) -> list[Candidate]:
    return sorted(found, key=lambda candidate: candidate.error)


def _long(motions: Sequence[Motion]) -> list[Motion]:
    """Those that can be left out whole."""
    return [motion for motion in motions if motion.duration >= SHORTEST]


def _splits(motions: Sequence[Motion]) -> tuple[list[tuple[list[Motion], list[Motion]]], str]:
    """What is fitted and what is left out, each time; and how that is said."""
    long = _long(motions)
    if len(long) >= RECORDS:
        groups = [long[k::FOLDS] for k in range(min(FOLDS, len(long)))]
        said = f"{len(groups)} groups of whole records left out in turn"
        return [([m for m in motions if all(m is not o for o in out)], out) for out in groups], said
    splits = []
    for motion in long or motions:
        count = len(motion.record.times)
        parts = max(1, min(FOLDS, int(motion.duration // (2.0 * SHORTEST))))
        if parts == 1 and len(motions) == 1:
            parts = 2
        edges = np.linspace(0, count, parts + 1).astype(int)
        for start, stop in pairwise(edges.tolist()):
            rest = [m for m in motions if m is not motion]
            rest += [slices(motion, a, b) for a, b in ((0, start), (stop, count)) if b - a > 20]
            if rest:
                splits.append((rest, [slices(motion, start, stop)]))
    return splits, f"{len(splits)} parts of records left out in turn"
