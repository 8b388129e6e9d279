"""The schema of a scenario: water, structures, vehicles, and what each vehicle carries and does."""

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import Field, ValidationError, model_validator

from auvsim.base import schema, yaml_text
from auvsim.base.errors import InputError
from auvsim.base.settings import Settings
from auvsim.missions.formation.settings import FormationSettings
from auvsim.physics.scenes import WorldSettings
from auvsim.simulation.depths import check_depths
from auvsim.simulation.scenario_settings import (
    DatumSettings,
    FixedModem,
    Name,
    NetworkSettings,
    PhysicsSettings,
    RandomSettings,
    Rates,
    StructureSettings,
    VehicleSettings,
    WaterSettings,
)
from auvsim.simulation.sensor_settings import rated

NEAREST_STATIONS = 1.0  # between two stations of a formation [m]


class Scenario(Settings):
    """One run, with every number definite."""

    duration: float = Field(default=1200.0, gt=0.0, le=1e6, description="time limit of the run [s]")
    rates: Rates = Rates()
    random: RandomSettings = RandomSettings()
    datum: DatumSettings = DatumSettings()
    physics: PhysicsSettings = PhysicsSettings()
    water: WaterSettings = WaterSettings()
    network: NetworkSettings = NetworkSettings()
    structures: dict[Name, StructureSettings] = Field(default={}, description="docks, by name")
    vehicles: dict[Name, VehicleSettings] = Field(min_length=1, description="vehicles, by name")

    @model_validator(mode="after")
    def _rates_divide(self) -> "Scenario":
        for key, rate, name, faster in self._ratios():
            ratio = faster / rate
            if ratio < 0.5 or abs(ratio - round(ratio)) > 1e-9 * ratio:
                fitting = _divisors(rate, faster)
                raise ValueError(f"{key}: {rate:g} Hz does not divide the {name} rate {faster:g} Hz; use {fitting} Hz")
        return self

    @model_validator(mode="after")
    def _missions_fit(self) -> "Scenario":
        for name, vehicle in self.vehicles.items():
            wanted = getattr(getattr(vehicle.mission, "manoeuvre", None), "duration", 0.0)
            if wanted > self.duration:
                raise ValueError(f"duration: {self.duration:g} s is too short for a manoeuvre of {wanted:g} s")
            for key, structure in self._structures_named(name):
                if structure is not None and structure not in self.structures:
                    raise ValueError(f"{key}: no structure '{structure}'; there are {self._known}")
            if vehicle.start.north is None and self.dock_of(name, vehicle.start.structure) is None:
                key = f"vehicles.{name}.start.structure"
                raise ValueError(f"{key}: range and bearing are from a structure; name one of {self._known}, or give "
                                 "north and east")  # fmt: skip
        return self

    @model_validator(mode="after")
    def _formations_fit(self) -> "Scenario":
        stations: dict[str, FormationSettings] = {}
        for name, vehicle in self.vehicles.items():
            s = vehicle.mission
            if not isinstance(s, FormationSettings):
                continue
            self._leaders_fit(name, s.leaders)
            for other, o in stations.items():
                same = (s.north, s.east, s.course_deg, s.speed) == (o.north, o.east, o.course_deg, o.speed)
                apart = math.dist((s.ahead, s.starboard, s.depth), (o.ahead, o.starboard, o.depth))
                if same and apart < NEAREST_STATIONS:
                    raise ValueError(f"vehicles.{name}.mission: its station is {apart:g} m from that of '{other}'; "
                                     f"give it one {NEAREST_STATIONS:g} m away or more")  # fmt: skip
            stations[name] = s
        return self

    def _leaders_fit(self, name: str, leaders: tuple[str, ...]) -> None:
        key, others = f"vehicles.{name}.mission.leaders", [other for other in self.vehicles if other != name]
        for leader in leaders:
            if leader not in others:
                raise ValueError(f"{key}: no other vehicle '{leader}'; there are {', '.join(others) or 'none'}")
        if len({*leaders}) < len(leaders):
            raise ValueError(f"{key}: {', '.join(leaders)} must name each once")
        for one in (name, *leaders) if leaders else ():
            if self.vehicles[one].modem is None:
                raise ValueError(f"{key}: '{one}' has no modem; give vehicles.{one}.modem, or no leaders")

    @model_validator(mode="after")
    def _modems_have_names_of_their_own(self) -> "Scenario":
        for name in self.network.beacons:
            if name in self.vehicles or name in self.structures:
                raise ValueError(f"network.beacons.{name}: a vehicle or structure has that name; give it another")
        for name, structure in self.structures.items():
            if structure.modem and name in self.vehicles:
                raise ValueError(f"structures.{name}.modem: a vehicle has that name; give the structure another")
        return self

    @model_validator(mode="after")
    def _all_in_the_water(self) -> "Scenario":
        if self.water.terrain.kind != "grid":  # whose file is read when the run begins
            try:
                check_depths(self)
            except InputError as error:
                raise ValueError(str(error)) from None
        return self

    @property
    def lone(self) -> tuple[str, VehicleSettings]:
        """Name and settings of the only vehicle.

        Raises:
            InputError: there are several.
        """
        if len(self.vehicles) != 1:
            raise InputError(f"the scenario has {len(self.vehicles)} vehicles ({', '.join(self.vehicles)}), not one")
        return next(iter(self.vehicles.items()))

    @property
    def fixed_modems(self) -> dict[str, FixedModem]:
        """The modems that are on no vehicle: of structures and beacons, by name."""
        found = {
            name: FixedModem(
                f"structures.{name}.modem", s.modem, s.clock, (s.north, s.east, s.depth), s.pose.heading, 0.0
            )
            for name, s in self.structures.items()
            if s.modem
        }
        for name, b in self.network.beacons.items():
            found[name] = FixedModem(
                f"network.beacons.{name}.modem", b.modem, b.clock, (b.north, b.east, b.depth), 0.0, b.chart
            )
        return found

    @property
    def modem_names(self) -> list[str]:
        """All that have a modem: vehicles, structures, beacons."""
        return [*(name for name, vehicle in self.vehicles.items() if vehicle.modem), *self.fixed_modems]

    @property
    def world(self) -> WorldSettings:
        """What the physics needs."""
        return WorldSettings(
            integrator=self.physics.integrator,
            water_density=self.water.density,
            sea_floor=self.water.sea_floor,
            terrain=self.water.terrain,
        )

    def dock_of(self, vehicle: str, structure: str | None = None) -> str | None:
        """The structure that a vehicle's settings mean: the one given, its mission's, or the only one; else None."""
        named = structure or getattr(self.vehicles[vehicle].mission, "dock", None)
        if named is None and len(self.structures) == 1:
            return next(iter(self.structures))
        return named

    def start_position(self, vehicle: str) -> tuple[float, float, float]:
        """North, east, down [m] of a vehicle's start."""
        start = self.vehicles[vehicle].start
        if start.north is not None and start.east is not None:
            return start.north, start.east, start.depth
        dock = self.structures[self.dock_of(vehicle, start.structure) or ""]
        direction = math.radians(dock.heading_deg + 180.0 + start.bearing_deg)
        north, east = start.range * math.cos(direction), start.range * math.sin(direction)
        return north + dock.north, east + dock.east, start.depth

    @property
    def _known(self) -> str:
        return ", ".join(self.structures) or "none"

    def _structures_named(self, vehicle: str) -> Iterator[tuple[str, str | None]]:
        """Dotted key and name of every structure that a vehicle's settings name."""
        settings = self.vehicles[vehicle]
        yield f"vehicles.{vehicle}.mission.dock", getattr(settings.mission, "dock", None)
        yield f"vehicles.{vehicle}.sensors.usbl.dock", settings.sensors.usbl.dock
        yield f"vehicles.{vehicle}.start.structure", settings.start.structure

    def _ratios(self) -> Iterator[tuple[str, float, str, float]]:
        """Key, rate, and the name and value of the rate that it must divide."""
        rates = self.rates
        yield "rates.control", rates.control, "physics", rates.physics
        yield "rates.filter", rates.filter, "control", rates.control
        yield "rates.log", rates.log, "control", rates.control
        for name, vehicle in self.vehicles.items():
            for sensor, rate in rated(vehicle.sensors):
                yield f"vehicles.{name}.sensors.{sensor}.rate", rate, "control", rates.control


def parse(values: Mapping, places: Mapping[str, str] | None = None) -> Scenario:
    """A scenario of nested values, in full or, without the key `vehicles`, in the short form for one vehicle.

    Values that are left out have their defaults. Strict: a text or truth value is no number.

    Args:
        values: As read from YAML.
        places: Where each dotted key was given, for errors.

    Raises:
        InputError: One line with the key, its value and what would be right.
    """
    from auvsim.simulation import short

    if "vehicles" not in values:
        return short.parse(values, places)
    return validated(Scenario, values, places or {})


def validated(model: type[Settings], values: Mapping, places: Mapping[str, str]) -> Any:
    """Settings of nested values, with errors in one line.

    Raises:
        InputError: One line with the key, its value and what would be right.
    """
    try:
        return model.model_validate_json(json.dumps(values, default=str), strict=True)
    except ValidationError as error:
        raise schema.explain(error, model, values, places) from None


def to_yaml(scenario: Scenario) -> str:
    """The full scenario as YAML text, defaults written out."""
    return yaml_text.dump(scenario.model_dump(mode="json"))


def from_yaml(text: str, source: str = "scenario") -> Scenario:
    """The scenario of a YAML text, such as a log holds, of this form or an earlier one.

    Raises:
        InputError: If it is no YAML or no scenario.
    """
    document = yaml_text.read(text, source)
    if not isinstance(document.value, Mapping):
        raise InputError(f"{source}: a scenario is a mapping of keys to values")
    return parse(document.value, {"": source, **document.places})


def _divisors(rate: float, faster: float) -> str:
    """The rates next to `rate` that divide `faster`, whole ones or whole periods where there are any."""
    candidates = [faster / n for n in range(1, 10_001)]
    printable = [value for value in candidates if float(f"{value:g}") == value]
    whole = [value for value in printable if value.is_integer() or (1.0 / value).is_integer()]
    below = max((value for value in whole or printable if value < rate), default=None)
    above = min((value for value in whole or printable if value > rate), default=None)
    return " or ".join(f"{value:g}" for value in (below, above) if value is not None)
