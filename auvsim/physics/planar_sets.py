"""Files of planar model parameters, and which of them an estimator assumes.

A vehicle's own sets are `models/<vehicle>/planar/<name>.yaml`; any other is given by its path. A set says of each
parameter its value, unit and interval, and of itself where it came from.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from pydantic import Field, model_validator

from auvsim.base import model_file
from auvsim.base.errors import InputError, unknown_name
from auvsim.base.settings import Settings
from auvsim.physics.hydrodynamics import SEA_WATER
from auvsim.physics.planar_fit import fit_planar_model
from auvsim.vehicles import model_files
from estimators.planar.model import PARAMETER_NAMES, PlanarParameters

UNNAMED = "vehicle"  # of a log alone, without a model
CONDENSE = "condense"  # names no file but the model that is fitted to the vehicle
SUFFIX = ".yaml"
UNITS = {
    "m": "kg", "x_g": "m", "I_z": "kg m2",
    "X_ud": "kg", "Y_vd": "kg", "Y_rd": "kg m", "N_vd": "kg m", "N_rd": "kg m2",
    "X_uu": "kg/m", "X_vr": "kg", "X_rr": "kg m", "X_dd": "kg/m", "X_prop": "N",
    "Y_vv": "kg/m", "Y_rr": "kg m", "Y_uv": "kg/m", "Y_ur": "kg", "Y_dd": "kg/m", "Y_v": "kg/s", "Y_r": "kg m/s",
    "N_vv": "kg", "N_rr": "kg m2", "N_uv": "kg", "N_ur": "kg m", "N_dd": "kg", "N_v": "kg m/s", "N_r": "kg m2/s",
    "X_u": "kg/s", "X_nn": "kg m", "X_nu": "kg",
}  # fmt: skip


class Coefficient(Settings):
    """One parameter; a radian counts as 1, as in SNAME's tables."""

    value: float
    unit: str
    interval: tuple[float | None, float | None] | None = Field(
        default=None, description="95 % interval, null where it is open; without one the parameter was not fitted"
    )


class Source(Settings):
    """A file the parameters came from."""

    file: str
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="of the file's bytes")


class HoldOut(Settings):
    """How well the set predicts a manoeuvre that it was not fitted to, open loop."""

    record: str
    seconds: float = Field(description="length of each prediction [s]")
    share: float = Field(ge=0, description="error of the position at its end relative to the distance run, rms [-]")
    start_share: float = Field(ge=0, description="the same of the parameters from which the fit started [-]")


class Noise(Settings):
    """Densities of the process noise that the data show."""

    north: float = Field(ge=0, description="[m2/s]")
    east: float = Field(ge=0, description="[m2/s]")
    heading: float = Field(ge=0, description="[rad2/s]")
    surge: float = Field(ge=0, description="[m2/s3]")
    sway: float = Field(ge=0, description="[m2/s3]")
    yaw_rate: float = Field(ge=0, description="[rad2/s3]")


class PlanarSet(Settings):
    """Parameters of the planar model of one vehicle, and where they came from."""

    format: Annotated[int, Field(ge=1, le=1, description="version of this layout")] = 1
    vehicle: str
    speed: float = Field(gt=0, description="mean speed through the water of the data [m/s]")
    method: str
    start: str = Field(description="the parameters from which the fit started")
    version: str = Field(description="of auvsim")
    sources: tuple[Source, ...]
    hold_out: HoldOut | None = None
    verdict: tuple[str, ...] = Field(default=(), description="what the data say of the fit")
    parameters: dict[str, Coefficient] = Field(description="rudder positive to starboard, about the body's origin")
    noise: Noise | None = None

    @model_validator(mode="after")
    def _parameters_are_known(self) -> "PlanarSet":
        for name, coefficient in self.parameters.items():
            if name not in UNITS:
                raise ValueError(f"parameters.{name}: no such parameter; there are {', '.join(PARAMETER_NAMES)}")
            if coefficient.unit != UNITS[name]:
                raise ValueError(f"parameters.{name}: is in '{coefficient.unit}', it must be in '{UNITS[name]}'")
        missing = [name for name in ("m", "I_z") if name not in self.parameters]
        if missing:
            raise ValueError(f"parameters: {' and '.join(missing)} must be given; what else is left out is 0")
        return self

    def planar(self) -> PlanarParameters:
        """The parameters as filters take them."""
        return PlanarParameters(**{name: coefficient.value for name, coefficient in self.parameters.items()})


def coefficients(
    parameters: PlanarParameters, intervals: Mapping[str, tuple[float | None, float | None]]
) -> dict[str, Coefficient]:
    """All parameters as a set holds them; those with an interval were fitted."""
    return {
        name: Coefficient(value=getattr(parameters, name), unit=UNITS[name], interval=intervals.get(name))
        for name in PARAMETER_NAMES
    }


def write(planar_set: PlanarSet, path: Path) -> None:
    """Writes a set, whole or not at all; `read` gives it back bit for bit.

    Raises:
        InputError: If it cannot be written.
    """
    values = planar_set.model_dump(mode="json", exclude_none=True)
    del values["parameters"]
    # A line for each parameter, since they are read as a table; an interval's open side is null.
    shown = {name: of.model_dump(exclude={"interval"} if of.interval is None else None)
             for name, of in planar_set.parameters.items()}  # fmt: skip
    model_file.write(path, values, "parameters", shown)


def read(path: Path) -> PlanarSet:
    """Reads a set.

    Raises:
        InputError: One line with the file, the line and the key at fault.
    """
    return model_file.read(path, PlanarSet, "a parameter set")


def folder(vehicle: str) -> Path:
    """Where the sets of a vehicle are: `planar` beside its MJCF file."""
    home = Path(vehicle).expanduser().parent if vehicle.endswith(".xml") else model_files.models_folder() / vehicle
    return home / "planar"


def find(name: str, vehicle: str) -> Path:
    """The file of a set, by its name among the vehicle's or by its path, which ends in `.yaml`.

    Raises:
        InputError: There is none; the text lists those that exist.
    """
    path = Path(name).expanduser() if name.endswith(SUFFIX) else folder(vehicle) / f"{name}{SUFFIX}"
    if path.is_file():
        return path
    if name.endswith(SUFFIX):
        raise InputError(f"no parameter file {path}; `auvsim identify LOG... --out DIR` writes DIR/parameters.yaml")
    known = [found.stem for found in folder(vehicle).glob(f"*{SUFFIX}")]
    raise unknown_name("planar model", name, [CONDENSE, *known, "the path of a .yaml"])


def load(name: str, vehicle: str) -> PlanarParameters:
    """Reads the parameters of a set, by its name among the vehicle's or by its path.

    A set that was identified from the log of a vehicle without a name may be believed of any.

    Raises:
        InputError: There is no such set, it cannot be read, or it is another vehicle's.
    """
    path = find(name, vehicle)
    found = read(path)
    same_vehicle(found.vehicle, vehicle, path)
    parameters = found.planar()
    _check(parameters, found.speed, path)
    return parameters


def same_vehicle(named: str, vehicle: str, path: Path) -> None:
    """Refuses what a file says of another vehicle; what was identified from a log without a vehicle goes for any.

    Raises:
        InputError: It is another vehicle's.
    """
    wanted = Path(vehicle).stem if vehicle.endswith(".xml") else vehicle
    if named not in (wanted, UNNAMED):
        raise InputError(f"{path}: these are parameters of '{named}', not of '{wanted}'")


def dissipates(p: PlanarParameters, speed: float) -> bool:
    """Whether surge's drag as a whole slows the vehicle at a speed [m/s] and at all beyond it."""
    return p.X_uu <= 0.0 and p.X_uu * speed + p.X_u <= 0.0


def _check(p: PlanarParameters, speed: float, path: Path) -> None:
    """Sees that a vehicle of these parameters has inertia in every direction and is slowed by its drag.

    Raises:
        InputError: It has not; the text names the parameter or the sum at fault.
    """
    positive = {
        "m": p.m,
        "I_z": p.I_z,
        "m - X_ud": p.m - p.X_ud,
        "m - Y_vd": p.m - p.Y_vd,
        "I_z - N_rd": p.I_z - p.N_rd,
    }
    for name, value in positive.items():
        if not value > 0.0:
            raise InputError(f"{path}: parameters: {name} is {value:g}; it must be above 0")
    coupled = (p.m * p.x_g - p.Y_rd) * (p.m * p.x_g - p.N_vd)
    if not (p.m - p.Y_vd) * (p.I_z - p.N_rd) > coupled:
        sum_of = "m, x_g, I_z, Y_vd, Y_rd, N_vd, N_rd"
        raise InputError(f"{path}: parameters: the inertia in sway and yaw ({sum_of}) is not positive definite")
    if not dissipates(p, speed):
        raise InputError(
            f"{path}: parameters: surge's drag, X_uu {p.X_uu:g} and X_u {p.X_u:g}, drives it at {speed:.2g} m/s "
            "or beyond; X_uu and X_uu u + X_u must not be above 0"
        )


def assumed(model: str, vehicle: str, speed: float, density: float = SEA_WATER) -> PlanarParameters:
    """Returns the planar model that an estimator assumes.

    Args:
        model: `condense` for the model fitted to the vehicle, or a set by name or path.
        vehicle: Name in models/, or the path of an MJCF file.
        speed: Through the water, at which the model is fitted to the vehicle [m/s].
        density: Of the water [kg/m3].

    Raises:
        InputError: As `load`, or the model cannot be fitted at that speed.
    """
    if model == CONDENSE:
        return fit_planar_model(vehicle, speed, density).parameters
    return load(model, vehicle)
