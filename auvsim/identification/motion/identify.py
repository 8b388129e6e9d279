"""From readings to a motion model whose structure the data choose, and how far one may trust it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from auvsim.base.errors import InputError
from auvsim.identification.motion import data, fit, lags
from auvsim.identification.motion.choice import Candidate, Choice, choose
from auvsim.identification.motion.dimensions import Dimensions, coefficients
from auvsim.identification.motion.fit import AVERAGE, STEPS, MotionFit
from auvsim.identification.motion.lags import Lags
from auvsim.identification.motion.rollout import HORIZONS, horizons, persistence, rms, roll
from auvsim.identification.motion.uncertainty import (
    Halves,
    Held,
    Spread,
    between,
    halves,
    held,
    held_of,
    of_left_out,
    spread,
)
from auvsim.identification.records import Readings, Record
from auvsim.physics.planar_sets import dissipates
from estimators.core.types import Array
from estimators.planar.model import SURGE_LIMIT, SWAY_LIMIT, YAW_RATE_LIMIT, PlanarParameters
from estimators.planar.terms import AXES, PLANAR, TermsProcess, planar_parameters

LEAST = 40.0  # of data in all [s]
STILL = math.radians(0.3)  # a rudder that moves less than this excites nothing [rad]
APART = 1.5  # rms of the scores of disjoint halves beyond which intervals do not hold
HOLDS = 0.85  # of held-out positions inside a 95 % band, below which the band is not to be trusted
MARGIN = 0.05  # by which a model must be better than none to be worth a file


@dataclass(frozen=True, kw_only=True, slots=True)
class MotionIdentification:
    """A motion model, how it came about, and how far it goes."""

    name: str  # of the vehicle
    choice: Choice
    covariance: Array  # (k, k) of the coefficients
    spread: Spread
    left_out: Held  # predictions of what cross-validation left out
    holdout: Held | None  # predictions of what the user held out
    # Of the best structure alone, each step's errors (m,) on what was held out.
    steps: tuple[tuple[str, Array], ...]
    none: Array  # (m,) errors of a motion that goes on as it began
    halves: Halves
    planar: tuple[Candidate, MotionFit] | None  # the best of those that the planar model can hold
    lags: Lags
    speed: float  # mean through the water [m/s]
    notes: tuple[str, ...]
    readings: Readings

    @property
    def fit(self) -> MotionFit:
        """The chosen one."""
        return self.choice.fit

    @property
    def judged(self) -> Held:
        """By what it is judged: what was held out, else what cross-validation left out."""
        return self.holdout or self.left_out

    @property
    def place(self) -> int:
        """Of the horizon that decides among those judged."""
        reached = self.judged.horizons
        return min(range(len(reached)), key=lambda k: abs(reached[k] - self.choice.horizon))

    @property
    def better(self) -> bool:
        """Whether it predicts better than a vehicle that goes on as it began."""
        return bool(self.judged.share[self.place] < (1.0 - MARGIN) * self.none[self.place])

    @property
    def deviations(self) -> Array:
        """Standard deviations (k,) of the coefficients."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def trust(self) -> str:
        """How far one may trust the model, in one line."""
        at, k = self.judged, self.place
        source = "held out" if self.holdout is not None else "left out of the fits"
        low = (
            "trust the model to"
            if self.better
            else ("do not trust the model, a vehicle that goes on as it began is foretold as well: it is off by")
        )
        if self.better and at.inside[k] < HOLDS:
            low = "trust the model's error, not its band, for what was held out is unlike what was fitted: it is off by"
        u, v, r = self.fit.limits / fit.BEYOND
        return (
            f"{low} {at.share[k]:.1%} of the distance run after {at.horizons[k]:.0f} s open loop (position error, rms "
            f"of {at.count[k]} predictions of what was {source}; going on as it began: {self.none[k]:.1%}); its 95 % "
            f"band of {at.radius[k]:.1%} holds {at.inside[k]:.0%} of them; known for speeds to {u:.2g} m/s, sway to "
            f"{v:.2g} m/s, {math.degrees(r):.2g} deg/s"
        )


def identify_motion(
    readings: Readings,
    holdout: Readings | None = None,
    *,
    name: str = "vehicle",
    hull: Dimensions | None = None,
    quick: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> MotionIdentification:
    """Chooses and fits a motion model, from nothing but the records.

    Args:
        readings: What was read.
        holdout: What is held out, and judges it; None: cross-validation alone does.
        name: Of the vehicle.
        hull: What is known before the records; None: nothing.
        quick: On a coarser grid, with fewer candidates.
        progress: Called with what is being done and the share that is done.

    Raises:
        InputError: Data from which nothing can be learnt.
    """
    say = progress or (lambda text, share: None)
    _check(readings.records)
    say("lags and smoothing", 0.0)
    known = lags.find(readings.records)
    coarsest = data.QUICK if quick else data.COARSEST
    motions = data.prepare(readings.records, coarsest=coarsest, known=known)
    judging = data.prepare(holdout.records, coarsest=coarsest, known=known) if holdout is not None else []
    before = None if hull is None else coefficients(hull)
    choice = choose(motions, before=before, quick=quick, progress=lambda text, share: say(text, 0.05 + 0.7 * share))
    chosen, alone, folds = choice.chosen, choice.alone, choice.folds
    say("disjoint halves", 0.8)
    before_it = [folds.fit(alone.structure, step, -1) for step in STEPS[1 : STEPS.index(alone.step) + 1]]
    apart = halves(folds, alone.structure, before_it)
    widened = between(folds, alone.structure, alone.step) * max(1.0, apart.rms**2)
    own = widened * fit.covariance(choice.fit)
    say("bands", 0.85)
    reached = horizons([m for _, out in folds.splits for m in out], HORIZONS)
    left_out = of_left_out(folds, chosen.structure, chosen.step, reached, widened)
    found = spread(left_out)
    say("predicting what was held out", 0.95)
    ends = horizons(judging, HORIZONS) if judging else reached
    judged = held(choice.fit, judging, own, found, ends) if judging else None
    targets = judging or [m for _, out in folds.splits for m in out]
    steps = tuple(
        (step, rms([roll(folds.fit(alone.structure, step, -1).vector, m, ends).shares for m in judging]))
        for step in STEPS
        if judging and any(c.step == step for c in choice.candidates)
    )
    say("done", 1.0)
    speed = float(np.mean([m.states[:, 3].mean() for m in motions]))
    return MotionIdentification(
        name=name, choice=choice, covariance=own, spread=found, left_out=held_of(left_out, found), holdout=judged,
        steps=steps, none=rms([persistence(m, ends).shares for m in targets]), halves=apart,
        planar=_planar(choice, speed), lags=known, speed=speed,
        notes=tuple(known.notes), readings=readings,
    )  # fmt: skip


def _check(records: Sequence[Record]) -> None:
    total = sum(record.duration for record in records)
    if total < LEAST:
        raise InputError(
            f"{total:.0f} s of data in spans of 10 s or more; a motion model needs {LEAST:g} s at the very least, two "
            "manoeuvres of two minutes each are better"
        )
    twin = any(record.thrusters is not None and np.std(record.thrusters) > 0.0 for record in records)
    if not twin and max(float(np.std(record.inputs[:, 0])) for record in records) < STILL:
        at = math.degrees(float(np.mean(np.concatenate([record.inputs[:, 0] for record in records]))))
        raise InputError(
            f"the rudder stays at {at:.1f} deg throughout: nothing in sway and yaw can be learnt; "
            "log a zig-zag, turns to both sides, or a multisine"
        )


def _planar(choice: Choice, speed: float) -> tuple[Candidate, MotionFit] | None:
    """The best candidate whose terms are all the planar model's and whose drag slows it; its fit to all of the data."""
    fitting = [
        (c, choice.folds.fit(c.structure, c.step, -1))
        for c in choice.candidates
        if set(c.structure.terms) <= set(PLANAR)
    ]
    slowed = [pair for pair in fitting if dissipates(planar_parameters(pair[1].coefficients), speed)]
    return next((pair for pair in slowed if pair[0].converged), slowed[0] if slowed else None)


def planar(found: MotionIdentification, masses: PlanarParameters | None = None) -> PlanarParameters | None:
    """Parameters of the planar model that comes nearest, with unit masses if none are given; None: none does.

    The planar model counts velocities beyond its own limits as these; of a vehicle that goes there it is none.
    """
    if found.planar is None or _too_fast(found):
        return None
    return planar_parameters(found.planar[1].coefficients, masses)


def _too_fast(found: MotionIdentification) -> bool:
    """Whether the data go beyond the limits of the docking filters' planar model."""
    return bool(np.any(found.fit.limits / fit.BEYOND > (SURGE_LIMIT, SWAY_LIMIT, YAW_RATE_LIMIT)))


def verdicts(found: MotionIdentification) -> list[tuple[bool, str]]:
    """What the data say, whether it is good, the most important first."""
    chosen = found.choice.chosen
    best = found.choice.candidates[0]
    holds = bool(found.judged.inside[found.place] >= HOLDS)
    said = [(found.better and holds, found.trust)]
    terms = len(chosen.structure.terms)
    if chosen.step == AVERAGE:
        count = len(found.choice.averaged)
        first = found.choice.averaged[0]
        text = f"chosen: the average of {count} models that predict nearly as well ({terms} terms; {chosen.error:.2%} "
        text += f"in cross-validation; the best alone, {first.structure.name} by {first.step}, {first.error:.2%})"
    else:
        text = f"chosen: {chosen.structure.name} by {chosen.step} ({terms} terms)"
    if best is not chosen and chosen.step != AVERAGE:
        text += f"; {best.structure.name} by {best.step} is no better by more than chance ({best.error:.2%} against "
        text += f"{chosen.error:.2%})"
    said.append((chosen.converged, text if chosen.converged else f"{text}; it has not converged"))
    good = found.halves.rms <= APART
    text = f"fits to disjoint halves differ by {found.halves.rms:.2g} of their standard deviations, rms"
    alone = found.choice.alone
    if chosen.step == AVERAGE:
        text += f" ({alone.structure.name} by {found.halves.step})"
    if found.halves.step != alone.step:
        text += f" (by {found.halves.step}, for by {alone.step} they do not converge)"
    if found.halves.between > 1.0:
        text += f"; these are {math.sqrt(found.halves.between):.2g} times those within records, as records differ"
    said.append((good, text if good else f"{text}: intervals and bands are widened by it"))
    weak = [
        term for term, value, deviation in zip(chosen.structure.terms, found.fit.values, found.deviations, strict=True)
        if not deviation < 0.5 * abs(value)
    ]  # fmt: skip
    if weak:
        text = f"{len(weak)} of {terms} coefficients are not known by themselves, as the report's table shows"
        said.append((False, f"{text}: look at predictions, not at these"))
    lost = [f"{c.structure.name} by {c.step}" for c in found.choice.candidates if not c.converged]
    if lost:
        said.append((False, f"not converged, and not kept: {', '.join(lost)}"))
    said += [(False, note) for note in found.notes]
    if _too_fast(found):
        text = f"the docking filters' planar model ends at {SURGE_LIMIT:g} m/s, {SWAY_LIMIT:g} m/s of sway and "
        text += f"{math.degrees(YAW_RATE_LIMIT):.0f} deg/s, this vehicle does not: no parameters.yaml"
        said.append((False, text))
    driving = [axis for axis, factor in zip(AXES, _growth(found), strict=True) if factor > 1.0]
    if driving:
        text = f"beyond its limits the terms of {', '.join(driving)} would drive the vehicle: there it is held"
        said.append((False, text))
    return said


def _growth(found: MotionIdentification) -> Array:
    """Whether each velocity would grow on its own at twice its limit, all else as usual (3,): 1 or more if so."""
    free = {**found.fit.coefficients, "surge limit": np.inf, "sway limit": np.inf, "yaw rate limit": np.inf}
    process = TermsProcess(free, np.zeros(8))
    ratios = np.zeros(3)
    for axis in range(3):
        x = np.zeros(8)
        x[3] = found.speed
        x[3 + axis] = 2.0 * found.fit.limits[axis]
        after = process.evaluate(x, (0.0, 0.0), 0.05)
        ratios[axis] = abs(after[3 + axis]) / abs(x[3 + axis])
    return ratios
