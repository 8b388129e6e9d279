"""Settings of a vehicle's sensors: the standard ones by kind, any others under names of the user's choice."""

from collections.abc import Iterator
from typing import Any, Literal

from pydantic import ConfigDict, Field, ValidationError, create_model, model_validator

from auvsim.acoustics.usbl import UsblSettings
from auvsim.base import schema
from auvsim.base.settings import OwnPart, Settings
from auvsim.sensors.compass import CompassSettings
from auvsim.sensors.depth import DepthSettings
from auvsim.sensors.dvl import DvlSettings
from auvsim.sensors.feedback import FeedbackSettings
from auvsim.sensors.gyro import GyroSettings
from auvsim.sensors.registry import SENSORS
from auvsim.vehicles.model_files import INSTANCE


class OwnSensor(OwnPart):
    """A sensor of the user's own."""

    enabled: bool = Field(default=True, description="whether the vehicle has it")
    rate: float = Field(default=1.0, gt=0.0, description="readings per second, divides the control rate [Hz]")


def _of_a_kind(kind: str, settings: type[Settings]) -> type[Settings]:
    """The settings class of a sensor with its kind as a field, for one under a name of the user's."""
    field: Any = (Literal[kind], kind)
    return create_model(settings.__name__, __base__=settings, __doc__=settings.__doc__, kind=field)


OTHERS: dict[str, type[Settings]] = {kind: _of_a_kind(kind, sensor.Settings) for kind, sensor in SENSORS.items()}


class SensorSettings(Settings):
    """The sensors on board, and the dock's USBL; more by names of one's own, each with a `kind`."""

    model_config = ConfigDict(extra="allow")

    compass: CompassSettings = CompassSettings()
    depth: DepthSettings = DepthSettings()
    feedback: FeedbackSettings = FeedbackSettings()
    usbl: UsblSettings = UsblSettings()
    dvl: DvlSettings = DvlSettings()
    gyro: GyroSettings = GyroSettings()

    @model_validator(mode="after")
    def _others_are_sensors(self) -> "SensorSettings":
        extra = self.__pydantic_extra__ or {}
        for name, values in extra.items():
            if not INSTANCE.fullmatch(name) or hasattr(type(self), name):
                raise ValueError(
                    f"{name[:80]!r}: a sensor's name is 1 to 64 letters, digits, '_' and '-', for example altimeter_2"
                )
            if not isinstance(values, Settings):
                extra[name] = _other(name, values)
        return self


def rated(sensors: SensorSettings) -> Iterator[tuple[str, float]]:
    """Names and rates [Hz] of the sensors that the vehicle has; an event-driven one has none."""
    for name, settings in on_board(sensors):
        if (rate := getattr(settings, "rate", None)) is not None:
            yield name, rate


def on_board(sensors: SensorSettings) -> Iterator[tuple[str, Any]]:
    """Names and settings of the sensors on board that the vehicle has, in the order in which they are read."""
    names: list[str] = [*SENSORS, *(sensors.__pydantic_extra__ or {})]
    for name in dict.fromkeys(names):  # one may be called as its kind is
        settings = getattr(sensors, name, None)
        if settings is not None and getattr(settings, "enabled", True):
            yield name, settings


def _other(name: str, values: Any) -> Settings:
    """The settings of a sensor under a name of the user's.

    Raises:
        ValueError: in one line, with what would be right.
    """
    kind = values.get("kind") if isinstance(values, dict) else None
    if kind is None:
        known = [*SensorSettings.model_fields]
        raise schema.UnknownKeyError(name, known, "; any other sensor has a name of its own and a `kind`")
    model = OwnSensor if ":" in str(kind) else OTHERS.get(str(kind))
    if model is None:
        raise ValueError(f"{name}.kind: no sensor '{kind}'; there are {', '.join(OTHERS)}, package.module:Class")
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise ValueError(f"{name}.{schema.explain(error, model, values, {})}") from None
