"""The short form of a scenario, for one vehicle and at most one dock: its keys stand without their names.

Scenarios written before there were several vehicles have this form, too; their older keys are converted here.
"""

import re
from collections.abc import Mapping
from typing import Any

from pydantic import Field, ValidationError

from auvsim.acoustics.link import AcousticSettings
from auvsim.base import schema
from auvsim.base.errors import InputError
from auvsim.base.settings import OwnPart, Settings, kinds
from auvsim.control.registry import ControlSettings
from auvsim.control.torpedo import AutopilotSettings
from auvsim.missions.docking.guidance import DockingSettings
from auvsim.missions.manoeuvres.settings import ManoeuvreSettings
from auvsim.missions.registry import MissionSettings
from auvsim.navigation.settings import EstimatorSettings, RobustSettings
from auvsim.physics.ballast import BallastSettings
from auvsim.physics.scenes import WorldSettings
from auvsim.simulation.scenario import Scenario, validated
from auvsim.simulation.scenario_settings import DatumSettings, RandomSettings, Rates, Start, StructureSettings
from auvsim.simulation.sensor_settings import SensorSettings
from auvsim.vehicles import model_files
from auvsim.water.settings import CurrentSettings, UniformSettings

FULL_KEYS = {  # keys of the full form as patterns, in turn, and what they are in the short one
    r"vehicles\.[\w-]+\.(model|start|ballast)\b": r"vehicle.\1",
    r"vehicles\.[\w-]+\.": "",
    r"structures\.[\w-]+\b": "dock",
    r"physics\.integrator\b": "world.integrator",
    r"water\.density\b": "world.water_density",
    r"water\.(sea_floor|terrain)\b": r"world.\1",
    r"water\.current\b": "current",
    r"network\.acoustics\b": "acoustics",
}


class LoneVehicle(Settings):
    """The vehicle, its start and its ballast."""

    model: str = Field(default="remus100", description="a folder in models/, or the path of an .xml file")
    start: Start = Start()
    ballast: BallastSettings = BallastSettings()


class ShortScenario(Settings):
    """One run of one vehicle, with every number definite."""

    duration: float = Field(default=1200.0, gt=0.0, le=1e6, description="time limit of the run [s]")
    rates: Rates = Rates()
    random: RandomSettings = RandomSettings()
    datum: DatumSettings = DatumSettings()
    vehicle: LoneVehicle = LoneVehicle()
    dock: StructureSettings | None = Field(default=StructureSettings(), description="The dock.")
    current: CurrentSettings = Field(
        default=UniformSettings(speed=0.0), description="The water's velocity, by its `kind`."
    )
    sensors: SensorSettings = SensorSettings()
    acoustics: AcousticSettings = AcousticSettings()
    estimator: EstimatorSettings = Field(default=RobustSettings(), description="The estimator, by its `kind`.")
    guidance: DockingSettings = DockingSettings()
    control: ControlSettings = Field(default=AutopilotSettings(), description="The controller, by its `kind`.")
    world: WorldSettings = WorldSettings()
    manoeuvre: ManoeuvreSettings | None = Field(
        default=None, description="what the vehicle does instead of docking, by its `kind`"
    )
    mission: MissionSettings | None = Field(
        default=None, description="what the vehicle does instead of docking or a manoeuvre, by its `kind`"
    )


def parse(values: Mapping, places: Mapping[str, str] | None = None) -> Scenario:
    """The full scenario of nested values in the short form.

    Raises:
        InputError: One line with the key, its value and what would be right.
    """
    places = places or {}
    values = renewed(values)
    short: ShortScenario = validated(ShortScenario, values, places)
    whole = _full(short, places)
    try:
        return Scenario.model_validate(whole)
    except ValidationError as error:
        path, _, text = error.errors()[0]["msg"].removeprefix("Value error, ").partition(": ")
        path = short_key(path, short.mission is None)
        raise InputError(": ".join(part for part in (schema.place(path, places), path, text) if part)) from None


def renewed(values: Mapping) -> dict:
    """Converts values of an earlier form: `start` at the top, and the estimator's kind as `factory`.

    An estimator's settings used to be one class for all kinds; those that its kind never used are left out.
    """
    values = dict(values)
    if "start" in values:
        vehicle = values.get("vehicle")
        vehicle = dict(vehicle) if isinstance(vehicle, Mapping) else {}
        start, above = vehicle.get("start"), values.pop("start")
        both = isinstance(start, Mapping) and isinstance(above, Mapping)
        values["vehicle"] = {**vehicle, "start": {**start, **above} if both else above}  # pyright: ignore
    estimator = values.get("estimator")
    if isinstance(estimator, Mapping) and "factory" in estimator:
        values["estimator"] = _of_a_kind(estimator)
    return values


def estimator_keys(kind: str) -> set[str]:
    """The keys that an estimator of a kind knows."""
    for model in schema.members(EstimatorSettings):
        if (":" in kind and issubclass(model, OwnPart)) or kind in kinds(model):
            return set(model.model_fields)
    return set()


def _of_a_kind(estimator: Mapping) -> dict:
    kind = estimator["factory"]  # of a plan, maybe a distribution
    rest = {key: value for key, value in estimator.items() if key != "factory"}
    of_all = {key for model in schema.members(EstimatorSettings) for key in model.model_fields}
    known = estimator_keys(str(kind)) or of_all
    heeded = {"use": []} if "use" in (known or of_all) else {}  # then, no estimator heeded gyro or DVL
    return {"kind": kind} | heeded | {key: value for key, value in rest.items() if key in known or key not in of_all}


def _full(short: ShortScenario, places: Mapping[str, str]) -> dict[str, Any]:
    """The full form of a short scenario."""
    mission: Any = short.mission or short.guidance
    if short.mission is None and short.manoeuvre is not None:
        mission = {"kind": "manoeuvre", "manoeuvre": short.manoeuvre.model_dump()}
    name = _model_name("vehicle", short.vehicle.model, "vehicle.model", places)
    dock = _model_name("structure", short.dock.model, "dock.model", places) if short.dock else ""
    return {
        "duration": short.duration,
        "rates": short.rates,
        "random": short.random,
        "datum": short.datum,
        "physics": {"integrator": short.world.integrator},
        "water": {
            "density": short.world.water_density,
            "sea_floor": short.world.sea_floor,
            "terrain": short.world.terrain,
            "current": short.current,
        },
        "network": {"acoustics": short.acoustics},
        "structures": {dock: short.dock} if short.dock else {},
        "vehicles": {
            name: {
                "model": short.vehicle.model,
                "start": short.vehicle.start,
                "ballast": short.vehicle.ballast,
                "sensors": short.sensors,
                "estimator": short.estimator,
                "control": short.control,
                "mission": mission,
            }
        },
    }  # fmt: skip


def _model_name(kind: str, model: str, key: str, places: Mapping[str, str]) -> str:
    """Name of a model, with errors that say where it was given."""
    try:
        return model_files.model_name(kind, model)
    except InputError as error:
        raise InputError(": ".join(part for part in (schema.place(key, places), key, str(error)) if part)) from None


def short_key(path: str, docks: bool) -> str:
    """The short form of a dotted key of the full form.

    Args:
        path: of the full form.
        docks: whether the mission is a docking or manoeuvre, whose keys stand under `guidance`.
    """
    for full, key in FULL_KEYS.items():
        path = re.sub(rf"^{full}", key, path)
    if docks and path.startswith("mission."):
        return path.replace("mission.", "guidance.", 1)
    return path
