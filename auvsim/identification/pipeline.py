"""From readings to parameters, step by step, and what the data say of each: never more than they do."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammainc

from auvsim.base.errors import InputError, unknown_name
from auvsim.identification import checks, judgement
from auvsim.identification.constraints import SIGNS, limits, prior_information
from auvsim.identification.fit import DEFAULT_FREE, Fit, invert
from auvsim.identification.identifiability import Identifiability, assess, likelihood_interval, sizes
from auvsim.identification.judgement import HoldoutResult
from auvsim.identification.least_squares import fit_least_squares
from auvsim.identification.prediction_error import PredictionErrorOptions, fit_prediction_error
from auvsim.identification.records import MEASURED, Readings, Record
from auvsim.identification.segments import SegmentOptions, fit_segments
from auvsim.physics.planar_fit import fit_planar_model
from auvsim.vehicles import library
from estimators.core.consistency import chi_square
from estimators.planar.model import SURGE_LIMIT, PlanarParameters

STEPS = ("least squares", "segments", "prediction error")
LENGTH = 20.0  # of the segments fitted [s]
PRIOR = 0.5  # relative standard deviation of the prior about the start, where the data alone cannot tell
PROBABILITY = 0.95
PROFILED = 4  # weak parameters whose likelihood is followed: each takes some dozens of fits
NOISY = 1.1  # residuals beyond this many deviations show noise of the process
LACKING = 2.0  # residuals beyond this many show what the model lacks: then the deviations bear it too
REWEIGHTED = 3  # times at most
STEP_MARGIN = 0.03  # by which an earlier step must predict the fitted records better than the last to be kept instead
LARGEST_SHARE = 0.25  # error on what was held out, by the distance run, beyond which no parameters are written
LARGEST_RESIDUAL = 20.0  # standard deviations, likewise
NAMES = tuple(name.replace("_", " ") for name in MEASURED)


@dataclass(frozen=True, kw_only=True, slots=True)
class Verdict:
    """One thing that the data say."""

    good: bool
    text: str


@dataclass(frozen=True, kw_only=True, slots=True)
class Identification:
    """Parameters, how they came about, and how far they go."""

    vehicle: str
    speed: float  # mean through the water of the fitted records [m/s]
    start_text: str  # what the fit started from
    fitted: tuple[Record, ...]
    fits: tuple[Fit, ...]  # of each step
    identifiability: Identifiability
    intervals: dict[str, tuple[float, float]]  # 95 % of the free parameters; infinite where open
    profiled: tuple[str, ...]  # those of them by the ratio of likelihoods
    judged: tuple[HoldoutResult, ...]  # of each held-out record
    verdicts: tuple[Verdict, ...]
    readings: Readings
    kept: int = -1  # which of the fits is the result

    @property
    def fit(self) -> Fit:
        """That of the step which is kept."""
        return self.fits[self.kept]

    @property
    def start(self) -> PlanarParameters:
        """The parameters from which the first step started."""
        return self.fits[0].start

    @property
    def share(self) -> float:
        """Position error of the fit on what was held out, by the distance run, rms."""
        return float(np.sqrt(np.mean([judged.share**2 for judged in self.judged])))

    @property
    def start_share(self) -> float:
        """Position error of the start's parameters on what was held out, by the distance run, rms."""
        return float(np.sqrt(np.mean([judged.start_share**2 for judged in self.judged])))

    @property
    def better(self) -> bool:
        """Whether the fit predicts what was held out better than its start does."""
        return self.share < (1.0 - judgement.MARGIN) * self.start_share

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why its parameters are not to be used at all, each with what to look at; empty where nothing forbids it."""
        return tuple(_doubts(self))


def identify(
    readings: Readings,
    holdout: Readings | None = None,
    *,
    vehicle: str = "remus100",
    model: str | None = None,
    start: PlanarParameters | None = None,
    free: Sequence[str] = DEFAULT_FREE,
    steps: Sequence[str] = STEPS,
    progress: Callable[[str, float], None] | None = None,
) -> Identification:
    """Fits the planar model to records and judges it on others.

    Args:
        readings: What was read.
        holdout: What is held out; chosen from `readings` if None.
        vehicle: Whose parameters they are.
        model: Its name in models/ or the path of its MJCF file, if that is another: its masses, and if no start is
            given its condensed forces, are where the fit starts.
        start: Other parameters to start from.
        free: Names of those that are fitted.
        steps: Of STEPS, in their order.
        progress: Called with what is being done and the share that is done.

    Raises:
        InputError: Data from which nothing can be learnt, with what would make them right.
    """
    _check_steps(steps)
    say = progress or (lambda text, share: None)
    records = readings.records
    judging = holdout.records if holdout is not None else ()
    model = model or vehicle
    speed = _speed(records, model)
    start_text = "parameters given" if start is not None else f"{vehicle} condensed at {speed:.2f} m/s"
    start = start or fit_planar_model(model, speed).parameters
    checks.records((*records, *judging), start)
    said = "held out: as asked for"
    if not judging:
        records, judging, said = judgement.choose(records)
    checks.records(records, start)
    fits, weighed, prior_on, notes = _fits(records, start, free, steps, say)
    kept, why = _kept(records, start, fits)
    notes += why
    fit = fits[kept]
    assessed = assess(_by_data_alone(fit, prior_on) if prior_on else fit)
    intervals, profiled = _intervals(weighed, fits, fit, assessed, say)
    say("predicting what was held out", 0.95)
    judged = tuple(judgement.judge(record, start, fit.parameters) for record in judging)
    draft = Identification(
        vehicle=vehicle, speed=speed, start_text=start_text, fitted=tuple(records), fits=tuple(fits),
        identifiability=assessed, intervals=intervals, profiled=profiled, judged=judged, verdicts=(),
        readings=_joined(readings, holdout), kept=kept,
    )  # fmt: skip
    verdicts = (*_verdicts(draft), Verdict(good="would say more" not in said, text=said), *notes)
    say("done", 1.0)
    return replace(draft, verdicts=verdicts)


def _check_steps(steps: Sequence[str]) -> None:
    for step in steps:
        if step not in STEPS:
            raise unknown_name("step", step, list(STEPS))
    if not {"segments", "prediction error"} & set(steps):
        raise InputError("steps: least-squares is but a start; give segments or prediction-error too")


def _speed(records: Sequence[Record], vehicle: str) -> float:
    """Mean speed ahead through the water [m/s]: measured, over ground, or that of the vehicle's shaft speed."""
    for column in (MEASURED.index("surge"), MEASURED.index("ground_surge")):
        values = np.concatenate([r.measured[:, column] for r in records]) if records else np.empty(0)
        if np.isfinite(values).any():
            return float(np.clip(np.nanmean(values), 0.2, 10.0))
    if not records:
        return 1.0
    shaft = float(np.mean(np.concatenate([r.inputs[:, 1] for r in records])))
    limit = library.vehicle(vehicle).actuation.shaft_limit
    return float(np.clip(fit_planar_model(vehicle, 1.0).parameters.steady_surge(min(shaft, limit)), 0.2, 10.0))


def _fits(
    records: Sequence[Record],
    start: PlanarParameters,
    free: Sequence[str],
    steps: Sequence[str],
    say: Callable[[str, float], None],
) -> tuple[list[Fit], Sequence[Record], tuple[str, ...], list[Verdict]]:
    """The fit of each step, each from the one before; and what segments found on the way.

    That is the records as they are weighed, the parameters with a prior about the start, and verdicts that say so.
    """
    weighed: Sequence[Record] = records
    fits: list[Fit] = []
    notes: list[Verdict] = []
    prior_on: tuple[str, ...] = ()
    if "least squares" in steps:
        say("least squares", 0.0)
        fits.append(fit_least_squares(records, start, free))
    if "segments" in steps:
        say("segments", 0.1)
        found, weighed = _reweighted(records, start, free)
        blind = assess(found).blind
        if blind or not found.converged:
            prior_on = tuple(dict.fromkeys(name for c in blind for name in c.named)) if found.converged else tuple(free)
            why = f"cannot tell {'; '.join(c.text for c in blind)}" if blind else "lead to no end"
            text = f"the data alone {why}: a prior of {PRIOR:.0%} about the start was put on {', '.join(prior_on)}"
            notes.append(Verdict(good=False, text=f"{text}, and decides these"))
            options = SegmentOptions(length=LENGTH, signs=True, prior=PRIOR, prior_on=prior_on)
            found = fit_segments(weighed, start, free, options)
        fits.append(found)
    if "prediction error" in steps:
        say("prediction error", 0.3)
        guess = fits[-1].parameters if "segments" in steps else None
        held = PredictionErrorOptions(signs=True, prior=PRIOR if prior_on else None, prior_on=prior_on)
        fits.append(fit_prediction_error(records, start, free, held, guess=guess))
    return fits, weighed, prior_on, notes


def _reweighted(records: Sequence[Record], start: PlanarParameters, free: Sequence[str]) -> tuple[Fit, list[Record]]:
    """The fit of segments, and the records with deviations that bear what the model lacks.

    Signals that were filtered show less noise than a fit leaves; weighed by that alone, one sensor decides everything.
    """
    options = SegmentOptions(length=LENGTH, signs=True)
    found, records = fit_segments(records, start, free, options), list(records)
    for _ in range(REWEIGHTED):
        if not np.nanmax(found.residual_rms) > LACKING:
            break
        factors = np.where(found.residual_rms > 1.0, found.residual_rms, 1.0)  # NaN: never measured
        records = [replace(record, deviations=record.deviations * factors) for record in records]
        found = fit_segments(records, start, free, options)
    return found, records


def _kept(records: Sequence[Record], start: PlanarParameters, fits: Sequence[Fit]) -> tuple[int, list[Verdict]]:
    """Which step's fit predicts the fitted records best: the last, unless an earlier one is clearly better.

    All have the same free parameters, so that none of them has the advantage on what it was fitted to.
    """
    long = [record for record in records if record.duration >= judgement.LEAST]
    tried = [k for k, fit in enumerate(fits) if fit.method != "least squares"]
    if len(tried) < 2 or not long:
        return -1, []
    errors = {}
    for k in tried:
        judged = [judgement.judge(record, start, fits[k].parameters) for record in long]
        errors[k] = float(np.sqrt(np.mean([one.share**2 for one in judged])))
    best = min(tried, key=lambda k: errors[k])
    if errors[best] >= (1.0 - STEP_MARGIN) * errors[tried[-1]]:
        return -1, []
    text = f"kept: {fits[best].method}, which predicts the fitted records better ({errors[best]:.2%} of the distance "
    text += f"run) than {fits[-1].method} ({errors[tried[-1]]:.2%})"
    return best, [Verdict(good=True, text=text)]


def _by_data_alone(fit: Fit, prior_on: Sequence[str]) -> Fit:
    """The same with the covariance that the data alone would give."""
    centre = np.array([getattr(fit.start, name) for name in fit.free])
    prior = prior_information(centre, fit.free, PRIOR, prior_on)
    known = np.isfinite(fit.deviations) & (fit.deviations > 0.0)
    information = np.zeros_like(fit.covariance)
    information[np.ix_(known, known)] = np.linalg.inv(fit.covariance[np.ix_(known, known)])
    return replace(fit, covariance=invert(information - np.diag(np.where(known, prior, 0.0))))


def _intervals(
    records: Sequence[Record],
    fits: Sequence[Fit],
    fit: Fit,
    assessed: Identifiability,
    say: Callable[[str, float], None],
) -> tuple[dict[str, tuple[float, float]], tuple[str, ...]]:
    """Intervals by curvature; of weak parameters by the ratio of likelihoods.

    Those are followed on segments, and widened as prediction errors widen the segments' deviations: each step of a
    profile is a whole fit, and a filter's takes minutes.
    """
    reach = math.sqrt(chi_square(PROBABILITY, 1))
    found = {
        name: (float(value - reach * sd), float(value + reach * sd))
        for name, value, sd in zip(fit.free, fit.values, fit.deviations, strict=True)
    }
    segments = next((f for f in fits if f.method == "segments"), None)
    weak = [name for name in assessed.names[::-1] if name in assessed.weak][:PROFILED]
    profiled = []
    for number, name in enumerate(weak if segments is not None else ()):
        say(f"likelihood of {name}", 0.8 + 0.15 * number / len(weak))
        assert segments is not None
        interval = _profile(records, segments, fit, name, reach)
        if interval is not None:
            found[name] = interval
            profiled.append(name)
    limited = zip(fit.free, *(side.tolist() for side in limits(fit.free, signs=True)), strict=True)
    for name, lowest, highest in limited:
        low, high = found[name]
        found[name] = max(low, lowest), min(high, highest)
    return found, tuple(profiled)


def _profile(records: Sequence[Record], segments: Fit, fit: Fit, name: str, reach: float) -> tuple[float, float] | None:
    """Interval by the ratio of likelihoods; None where it cannot be followed."""
    j = fit.free.index(name)
    wider = float(fit.deviations[j] / segments.deviations[j])
    if not 0.3 < wider < 2.0:
        return None  # beyond that the two likelihoods have little in common
    probability = float(gammainc(0.5, 0.5 * (reach * wider) ** 2))  # of chi-square with one degree of freedom
    try:
        options = SegmentOptions(length=LENGTH, signs=True)
        low, high = likelihood_interval(records, segments, name, options, probability)
    except InputError:  # the model runs away with such a value
        return None
    return min(low, float(fit.values[j])), max(high, float(fit.values[j]))


def _verdicts(found: Identification) -> list[Verdict]:
    """What the data say, the most important first."""
    fit, seconds = found.fit, min(judged.seconds for judged in found.judged)
    said = [_judgement(found, seconds)]
    for judged in found.judged if len(found.judged) > 1 else ():
        if judged.ratio > 1.0 + judgement.MARGIN and found.better:
            said.append(Verdict(good=False, text=f"on {judged.record.name} its start is better: {_shares(judged)}"))
    if not fit.converged:
        said.append(Verdict(good=False, text=f"the last step has not converged: {fit.message}"))
    fastest = max(float(np.nanmax(np.abs(r.measured[:, [3, 6]]), initial=0.0)) for r in found.fitted)
    if fastest > SURGE_LIMIT:
        text = f"the planar model counts speeds beyond {SURGE_LIMIT:g} m/s as these; the data go to {fastest:.2g} m/s"
        said.append(Verdict(good=False, text=text))
    said += _identifiable(found)
    coloured = [NAMES[c] for c, test in enumerate(fit.whiteness) if test is not None and test.probability < 0.01]
    if coloured:
        text = f"residuals of {', '.join(coloured)} are not white: intervals are too narrow by what the model lacks"
        said.append(Verdict(good=False, text=text))
    else:
        said.append(Verdict(good=True, text="residuals are white"))
    large = [f"{NAMES[c]} {rms:.1f}" for c, rms in enumerate(fit.residual_rms) if rms > NOISY]
    if large:
        text = f"residuals larger than the sensors' noise, in its deviations: {', '.join(large)}"
        said.append(Verdict(good=False, text=text))
    return said


def _judgement(found: Identification, seconds: float) -> Verdict:
    shares = f"{found.share:.2%} of the distance run after {seconds:.0f} s, its start {found.start_share:.2%}"
    shares += f" (a vehicle of {found.start.m:.4g} kg, as {found.vehicle} has: forces are by that mass)"
    if found.better:
        return Verdict(good=True, text=f"on what was held out the fit is off by {shares}")
    worse = found.share > (1.0 + judgement.MARGIN) * found.start_share
    text = f"on what was held out the fit is {'worse' if worse else 'no better'} than its start: off by {shares}"
    return Verdict(good=False, text=f"{text}; keep the start, or log other manoeuvres")


def _doubts(found: Identification) -> Iterator[str]:
    if not found.better:
        yield "it predicts what was held out no better than its start: log other manoeuvres"
    if found.share > LARGEST_SHARE:
        yield (
            f"it is off by {found.share:.0%} of the distance run on what was held out, more than {LARGEST_SHARE:.0%}: "
            "look at units, signs and stamps, and whether the vehicle is this one"
        )
    if not found.fit.converged:
        yield f"it has not converged ({found.fit.message}): log more, or with a rudder that moves more"
    for name, rms in zip(NAMES, found.fit.residual_rms.tolist(), strict=True):
        if rms > LARGEST_RESIDUAL:
            yield f"{name} is {rms:.0f} standard deviations off what the model explains: look at its unit, sign and lag"


def _shares(judged: HoldoutResult) -> str:
    return f"{judged.start_share:.2%} against {judged.share:.2%}"


def _identifiable(found: Identification) -> list[Verdict]:
    fit, assessed = found.fit, found.identifiability
    said = []
    if assessed.weak:
        text = f"not identifiable by themselves: {', '.join(assessed.weak)}; look at predictions, not at these"
        said.append(Verdict(good=False, text=text))
    if assessed.tied:
        pairs = ", ".join(f"{a} and {b} ({r:+.2f})" for a, b, r in assessed.tied)
        said.append(Verdict(good=False, text=f"go together, and cannot be told apart well: {pairs}"))
    bound = [n for n, v, s in zip(fit.free, fit.values, sizes(fit), strict=True) if n in SIGNS and abs(v) < 1e-6 * s]
    if bound:
        text = f"kept at zero, since the data pull them to a side that would drive the vehicle: {', '.join(bound)}"
        said.append(Verdict(good=False, text=text))
    if not assessed.weak and not assessed.tied:
        said.append(Verdict(good=True, text="every parameter is identifiable by itself"))
    return said


def _joined(readings: Readings, holdout: Readings | None) -> Readings:
    if holdout is None:
        return readings
    sources = dict.fromkeys((*readings.sources, *holdout.sources))
    notes = (*readings.notes, *holdout.notes)
    return Readings(records=readings.records, sources=tuple(sources), notes=notes)
