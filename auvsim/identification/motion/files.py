"""The file of a motion model: what a filter needs to believe it, and where it came from."""

import math
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

import auvsim
from auvsim.base import model_file
from auvsim.base.settings import Settings
from auvsim.identification.motion.identify import MotionIdentification, planar, verdicts
from auvsim.physics.planar_sets import HoldOut, Noise, PlanarSet, Source, coefficients
from estimators.core.types import Array
from estimators.planar.model import PlanarParameters
from estimators.planar.terms import AXES, LABELS, LIMITS, TermsProcess

NAME = "motion_model.yaml"


class Value(Settings):
    """One coefficient: an acceleration by its term, in SI units."""

    value: float
    interval: tuple[float, float] = Field(description="95 % interval")


class Judged(Settings):
    """How the model predicts over one horizon, open loop."""

    seconds: float = Field(gt=0, description="length of each prediction [s]")
    predictions: int = Field(gt=0, description="how many")
    share: float = Field(ge=0, description="error of the position at the end relative to the distance run, rms [-]")
    inside: float = Field(ge=0, le=1, description="share of the positions inside their 95 % band [-]")


class MotionModel(Settings):
    """A motion model of one vehicle."""

    format: Annotated[int, Field(ge=1, le=1, description="version of this layout")] = 1
    trust: str = Field(description="how far one may trust it")
    vehicle: str
    structure: str
    method: str
    version: str = Field(description="of auvsim")
    coefficients: dict[str, Value] = Field(
        description="by term; surge, sway [m/s2] and yaw [rad/s2] by the term's unit"
    )
    limits: dict[str, float] = Field(description="largest velocities the terms are known for [m/s, m/s, rad/s]")
    noise: dict[str, float] = Field(description="densities of the process noise [m2/s3, m2/s3, rad2/s3]")
    velocity_lag: float = Field(description="of the log's velocities behind its positions [s]")
    yaw_rate_lag: float = Field(description="of the log's yaw rate behind its heading [s]")
    judged: tuple[Judged, ...]
    verdict: tuple[str, ...]
    sources: tuple[Source, ...]

    @model_validator(mode="after")
    def _terms_are_known(self) -> "MotionModel":
        for key, names, known in (("coefficients", self.coefficients, LABELS), ("limits", self.limits, LIMITS)):
            for name in names:
                if name not in known:
                    raise ValueError(f"{key}.{name}: no such term; there are {', '.join(known)}")
        if set(self.noise) != set(AXES):
            raise ValueError(f"noise: give {', '.join(AXES)}")
        return self

    def process(self, position: float = 0.0, heading: float = 0.0, current: float = 0.0) -> TermsProcess:
        """The model as a filter takes it; densities of position, heading and current besides its own."""
        noise = [position, position, heading, *(self.noise[axis] for axis in AXES), current, current]
        values = {name: found.value for name, found in self.coefficients.items()} | self.limits
        return TermsProcess(values, noise)  # pyright: ignore[reportArgumentType]


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
    """Densities (3,) of white noise that spreads positions after the horizon as the white and constant parts do.

    A constant acceleration b moves by b T^2 / 2, white noise of density q by a variance of q T^3 / 3.
    """
    constant = 0.75 * found.spread.constant**2 * found.choice.horizon
    factor = float(np.interp(found.choice.horizon, found.spread.horizons, found.spread.factors))
    return factor * (found.spread.noise + constant)


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


def write(model: MotionModel, path: Path) -> None:
    """Writes a model, whole or not at all; `read` gives it back bit for bit.

    Raises:
        InputError: If it cannot be written.
    """
    values = model.model_dump(mode="json")
    own = values.pop("coefficients")
    model_file.write(path, values, "coefficients", own)


def read(path: Path) -> MotionModel:
    """Reads a model.

    Raises:
        InputError: One line with the file, the line and the key at fault.
    """
    return model_file.read(path, MotionModel, "a motion model")


def intervals(found: MotionIdentification) -> list[tuple[str, float, float, float]]:
    """Term, coefficient, and ends of its 95 % interval."""
    rows = zip(found.fit.structure.terms, found.fit.values.tolist(), found.deviations.tolist(), strict=True)
    return [(term, value, value - 1.96 * sd, value + 1.96 * sd) for term, value, sd in rows if math.isfinite(sd)]
