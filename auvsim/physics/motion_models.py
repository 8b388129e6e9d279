"""Files of motion models of any structure, and which model of a vehicle an estimator assumes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from auvsim.base import model_file, yaml_text
from auvsim.base.settings import Settings
from auvsim.physics import planar_sets
from auvsim.physics.hydrodynamics import SEA_WATER
from auvsim.physics.planar_sets import Source
from estimators.planar.model import Dynamics
from estimators.planar.terms import AXES, LABELS, LIMITS, TermsMotion, TermsProcess

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

    def motion(self) -> TermsMotion:
        """The vehicle as the docking filters take it."""
        return TermsMotion(coefficients={name: c.value for name, c in self.coefficients.items()} | self.limits)

    def process(self, position: float = 0.0, heading: float = 0.0, current: float = 0.0) -> TermsProcess:
        """The model as any filter takes it; densities of position, heading and current besides its own."""
        noise = [position, position, heading, *(self.noise[axis] for axis in AXES), current, current]
        return self.motion().process(np.array(noise))


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


def assumed(model: str, vehicle: str, speed: float, density: float = SEA_WATER) -> Dynamics:
    """Returns the model of a vehicle that an estimator assumes: a motion model's file, or as `planar_sets.assumed`.

    Args:
        model: The path of a file of either kind, a planar set's name, or `condense`.
        vehicle: Name in models/, or the path of an MJCF file.
        speed: Through the water, at which the planar model is fitted to the vehicle [m/s].
        density: Of the water [kg/m3].

    Raises:
        InputError: There is no such file, it cannot be read, or it is another vehicle's.
    """
    if not model.endswith(planar_sets.SUFFIX) or not _is_motion_model(planar_sets.find(model, vehicle)):
        return planar_sets.assumed(model, vehicle, speed, density)
    path = planar_sets.find(model, vehicle)
    found = read(path)
    planar_sets.same_vehicle(found.vehicle, vehicle, path)
    return found.motion()


def _is_motion_model(path: Path) -> bool:
    value = yaml_text.load(path).value
    return isinstance(value, Mapping) and "structure" in value
