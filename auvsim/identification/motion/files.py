"""What an identification leaves in files: the motion model, the nearest planar set, intervals."""

import math

import numpy as np

import auvsim
from auvsim.identification.motion.fit import WINDOW
from auvsim.identification.motion.identify import MotionIdentification, planar, verdicts
from auvsim.physics.motion_models import Judged, MotionModel, Value
from auvsim.physics.planar_sets import HoldOut, Noise, PlanarSet, coefficients
from estimators.core.types import Array
from estimators.planar.model import PlanarParameters
from estimators.planar.terms import AXES, LIMITS


def motion_model(found: MotionIdentification) -> MotionModel:
    """What an identification leaves."""
    fit, judged = found.fit, found.judged
    reach = 1.96 * found.deviations
    return MotionModel(
        trust=found.trust, vehicle=found.name, structure=fit.structure.name, method=fit.step,
        version=auvsim.__version__,
        coefficients={
            term: Value(value=value, interval=(value - half, value + half))
            for term, value, half in zip(fit.structure.terms, fit.values.tolist(), reach.tolist(), strict=True)
        },
        limits=dict(zip(LIMITS, fit.limits.tolist(), strict=True)),
        noise=dict(zip(AXES, _noise(found).tolist(), strict=True)),
        velocity_lag=found.lags.velocity, yaw_rate_lag=found.lags.yaw_rate,
        judged=tuple(
            Judged(seconds=s, predictions=int(n), share=float(e), inside=float(i))
            for s, n, e, i in zip(judged.horizons, judged.count, judged.share, judged.inside, strict=True) if n
        ),
        verdict=tuple(text for _, text in verdicts(found)), sources=found.readings.sources,
    )  # fmt: skip


def _noise(found: MotionIdentification) -> Array:
    """Densities (3,) of white noise that spreads positions after the horizon as all that the model lacks does.

    A constant acceleration b moves by b T^2 / 2, white noise of density q by a variance of q T^3 / 3. The coefficients'
    covariance C counts by the terms' integrals s over stretches of the data, of L seconds in all: sum(s' C s) / L.
    """
    constant = 0.75 * found.spread.constant**2 * found.choice.horizon
    factor = float(np.interp(found.choice.horizon, found.spread.horizons, found.spread.factors))
    return factor * (found.spread.noise + constant) + _of_coefficients(found)


def _of_coefficients(found: MotionIdentification) -> Array:
    equations = found.choice.folds.whole
    terms = equations.terms[:, :, list(found.fit.structure.places)]
    sums = np.array([terms[equations.stretch == k].sum(axis=0) for k in np.unique(equations.stretch)])
    spread = np.einsum("sai,ij,saj->a", sums, found.covariance, sums)
    return spread / (WINDOW * len(terms))


def planar_set(found: MotionIdentification, masses: PlanarParameters | None = None) -> PlanarSet | None:
    """The nearest planar model as the set that docking filters read; None if the data show none."""
    parameters = planar(found, masses)
    if parameters is None or found.planar is None:
        return None
    candidate, _ = found.planar
    share = candidate.error
    densities = dict(zip(Noise.model_fields, (0.0, 0.0, 0.0, *_noise(found).tolist()), strict=True))
    unit = "accelerations alone are known: unit mass and moment of inertia" if masses is None else "masses as given"
    return PlanarSet(
        vehicle=found.name, speed=max(found.speed, 1e-3), method=f"{candidate.structure.name} by {candidate.step}",
        start=f"nothing; {unit}", version=auvsim.__version__, sources=found.readings.sources,
        hold_out=HoldOut(
            record="cross-validation", seconds=found.choice.horizon, share=share, start_share=float(found.none[-1])
        ),
        verdict=(found.trust,), parameters=coefficients(parameters, {}), noise=Noise(**densities),
    )  # fmt: skip


def intervals(found: MotionIdentification) -> list[tuple[str, float, float, float]]:
    """Term, coefficient, and ends of its 95 % interval."""
    rows = zip(found.fit.structure.terms, found.fit.values.tolist(), found.deviations.tolist(), strict=True)
    return [(term, value, value - 1.96 * sd, value + 1.96 * sd) for term, value, sd in rows if math.isfinite(sd)]
