"""What one trial is made of: the settings that each module owns, composed into one schema."""

import json
import math
from collections.abc import Iterator, Mapping

from pydantic import Field, ValidationError, model_validator

from auvsim.acoustics.link import AcousticSettings
from auvsim.acoustics.usbl import UsblSettings
from auvsim.base import schema, yaml_text
from auvsim.base.errors import InputError
from auvsim.base.settings import Settings
from auvsim.control.torpedo import ControlSettings
from auvsim.missions.docking.guidance import GuidanceSettings
from auvsim.missions.manoeuvres.settings import ManoeuvreSettings
from auvsim.navigation.navigator import EstimatorSettings
from auvsim.physics.world import WorldSettings
from auvsim.sensors.compass import CompassSettings
from auvsim.sensors.depth import DepthSettings
from auvsim.sensors.dvl import DvlSettings
from auvsim.sensors.feedback import FeedbackSettings
from auvsim.sensors.gyro import GyroSettings
from auvsim.water.settings import CurrentSettings, UniformSettings


class Rates(Settings):
    """Rates of the parts of the loop; control divides the physics rate, the others divide control."""

    physics: float = Field(default=100.0, gt=0.0, description="steps of the dynamics [Hz]")
    control: float = Field(default=10.0, gt=0.0, description="guidance and control [Hz]")
    filter: float = Field(default=2.0, gt=0.0, description="predictions of the estimator [Hz]")
    log: float = Field(default=10.0, gt=0.0, description="logged states of the truth [Hz]")


class Start(Settings):
    """Where and how the vehicle starts."""

    range: float = Field(default=300.0, gt=0.0, description="horizontal distance from the dock's mouth [m]")
    bearing_deg: float = Field(
        default=0.0,
        description="direction seen from the dock, clockwise from the axis on the side vehicles come from [deg]",
    )
    heading_deg: float = Field(default=0.0, description="heading, clockwise from north [deg]")
    depth: float = Field(default=20.0, ge=0.0, description="depth [m]")
    speed: float = Field(default=1.0, ge=0.0, description="speed through the water, straight ahead [m/s]")


class VehicleSettings(Settings):
    """The vehicle and its start."""

    model: str = Field(default="remus100", description="a folder in models/, or the path of an .xml file")
    start: Start = Start()


class DockSettings(Settings):
    """The dock; its mouth is below the origin of north and east."""

    model: str = Field(default="dock", description="a folder in models/, or the path of an .xml file")
    depth: float = Field(default=20.0, gt=0.0, description="depth of the centre of the mouth [m]")
    heading_deg: float = Field(
        default=0.0, description="course of a vehicle that enters straight, clockwise from north [deg]"
    )


class SensorSettings(Settings):
    """The sensors on board and at the dock."""

    compass: CompassSettings = CompassSettings()
    depth: DepthSettings = DepthSettings()
    feedback: FeedbackSettings = FeedbackSettings()
    usbl: UsblSettings = UsblSettings()
    dvl: DvlSettings = DvlSettings()
    gyro: GyroSettings = GyroSettings()


class Scenario(Settings):
    """One trial, with every number definite."""

    duration: float = Field(default=1200.0, gt=0.0, description="time limit of the trial [s]")
    rates: Rates = Rates()
    vehicle: VehicleSettings = VehicleSettings()
    dock: DockSettings = DockSettings()
    current: CurrentSettings = Field(
        default=UniformSettings(speed=0.0), description="The water's velocity, by its `kind`."
    )
    sensors: SensorSettings = SensorSettings()
    acoustics: AcousticSettings = AcousticSettings()
    estimator: EstimatorSettings = EstimatorSettings()
    guidance: GuidanceSettings = GuidanceSettings()
    control: ControlSettings = ControlSettings()
    world: WorldSettings = WorldSettings()
    manoeuvre: ManoeuvreSettings | None = Field(
        default=None, description="what the vehicle does instead of docking, by its `kind`"
    )

    @model_validator(mode="after")
    def _rates_divide(self) -> "Scenario":
        for key, rate, name, faster in self._ratios():
            ratio = faster / rate
            if ratio < 0.5 or abs(ratio - round(ratio)) > 1e-9 * ratio:
                fitting = _divisors(rate, faster)
                raise ValueError(f"{key}: {rate:g} Hz does not divide the {name} rate {faster:g} Hz; use {fitting} Hz")
        return self

    @model_validator(mode="after")
    def _manoeuvre_fits(self) -> "Scenario":
        if self.manoeuvre is not None and self.manoeuvre.duration > self.duration:
            raise ValueError(
                f"duration: {self.duration:g} s is too short for a manoeuvre of {self.manoeuvre.duration:g} s"
            )
        return self

    def _ratios(self) -> Iterator[tuple[str, float, str, float]]:
        """Key, rate, and the name and value of the rate that it must divide."""
        rates = self.rates
        yield "rates.control", rates.control, "physics", rates.physics
        yield "rates.filter", rates.filter, "control", rates.control
        yield "rates.log", rates.log, "control", rates.control
        for name in SensorSettings.model_fields:
            sensor = getattr(self.sensors, name)
            rate = getattr(sensor, "rate", None)
            # The USBL has a period with jitter instead; a sensor that the vehicle does not have sets no limit.
            if rate is not None and getattr(sensor, "enabled", True):
                yield f"sensors.{name}.rate", rate, "control", rates.control


def parse(values: Mapping, places: Mapping[str, str] | None = None) -> Scenario:
    """A scenario of nested values; what they leave out has its default.

    Strict: no text or truth value passes for a number.

    Args:
        values: As read from YAML.
        places: Where each dotted key was given, for errors.

    Raises:
        InputError: One line with the key, its value and what would be right.
    """
    try:
        return Scenario.model_validate_json(json.dumps(values, default=str), strict=True)
    except ValidationError as error:
        raise schema.explain(error, Scenario, values, places or {}) from None


def to_yaml(scenario: Scenario) -> str:
    """The full scenario as YAML text, defaults written out."""
    return yaml_text.dump(scenario.model_dump(mode="json"))


def from_yaml(text: str, source: str = "scenario") -> Scenario:
    """The scenario that `to_yaml` wrote.

    Raises:
        InputError: If it is no YAML or no scenario.
    """
    document = yaml_text.read(text, source)
    if not isinstance(document.value, Mapping):
        raise InputError(f"{source}: a scenario is a mapping of keys to values")
    return parse(document.value, {"": source, **document.places})


def start_position(scenario: Scenario) -> tuple[float, float, float]:
    """North, east, down [m] of the vehicle's start."""
    start = scenario.vehicle.start
    direction = math.radians(scenario.dock.heading_deg + 180.0 + start.bearing_deg)
    return start.range * math.cos(direction), start.range * math.sin(direction), start.depth


def _divisors(rate: float, faster: float) -> str:
    """The rates next to `rate` that divide `faster`, whole ones or whole periods where there are any."""
    candidates = [faster / n for n in range(1, 10_001)]
    printable = [value for value in candidates if float(f"{value:g}") == value]
    whole = [value for value in printable if value.is_integer() or (1.0 / value).is_integer()]
    below = max((value for value in whole or printable if value < rate), default=None)
    above = min((value for value in whole or printable if value > rate), default=None)
    return " or ".join(f"{value:g}" for value in (below, above) if value is not None)
