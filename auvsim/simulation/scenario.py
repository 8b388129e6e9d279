"""The schema of a scenario: water, structures, vehicles, and what each vehicle carries and does."""

import json
import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, NamedTuple

from pydantic import Field, StringConstraints, ValidationError, model_validator

from auvsim.acoustics.clock import ClockSettings
from auvsim.acoustics.link import AcousticSettings
from auvsim.acoustics.modem import ModemSettings
from auvsim.acoustics.modems import SoundSettings
from auvsim.base import schema, yaml_text
from auvsim.base.errors import InputError
from auvsim.base.randomness import LARGEST, Walk
from auvsim.base.settings import Settings
from auvsim.control.registry import ControlSettings
from auvsim.control.torpedo import AutopilotSettings
from auvsim.missions.docking.guidance import DockingSettings
from auvsim.missions.formation.settings import FormationSettings
from auvsim.missions.registry import MissionSettings
from auvsim.missions.track.mission import TrackSettings
from auvsim.missions.track.patterns import Circle, Weave, points
from auvsim.navigation.settings import EstimatorSettings, RobustSettings
from auvsim.physics.ballast import BallastSettings
from auvsim.physics.scenes import Integrator, WorldSettings
from auvsim.physics.truth import StructurePose
from auvsim.simulation.sensor_settings import SensorSettings, rated
from auvsim.vehicles import model_files
from auvsim.water.seabed import SeabedSettings
from auvsim.water.settings import CurrentSettings, UniformSettings
from auvsim.water.terrain import FlatSettings, TerrainSettings

NEAREST_STATIONS = 1.0  # between two stations of a formation [m]
Name = Annotated[str, StringConstraints(pattern=rf"^{model_files.INSTANCE.pattern}$")]


class DatumSettings(Settings):
    """Place of the origin of NED on the earth; needed only where latitudes and longitudes are used."""

    latitude: float | None = Field(default=None, ge=-90, le=90, description="latitude of the origin, WGS84 [deg]")
    longitude: float | None = Field(default=None, ge=-180, le=180, description="longitude of the origin, WGS84 [deg]")

    @model_validator(mode="after")
    def _whole(self) -> "DatumSettings":
        if (self.latitude is None) != (self.longitude is None):
            raise ValueError("latitude and longitude go together: give both or neither")
        return self


class Rates(Settings):
    """Rates of the parts of the loop; control divides the physics rate, the others divide control."""

    physics: float = Field(default=100.0, ge=0.1, le=10_000.0, description="steps of the dynamics [Hz]")
    control: float = Field(default=10.0, ge=0.01, le=1_000.0, description="guidance and control [Hz]")
    filter: float = Field(default=2.0, ge=0.001, le=1_000.0, description="predictions of the estimator [Hz]")
    log: float = Field(default=10.0, ge=0.001, le=1_000.0, description="logged states of the truth [Hz]")


class Start(Settings):
    """Where and how the vehicle starts: at a place, or at a range and bearing from a structure."""

    range: float = Field(default=300.0, gt=0.0, le=1e5, description="horizontal distance from the dock's mouth [m]")
    bearing_deg: float = Field(
        default=0.0,
        description="bearing from the dock, clockwise from the axis extended out of the mouth [deg]",
    )
    north: float | None = Field(default=None, description="with east: a place instead of range and bearing [m]")
    east: float | None = Field(default=None, description="with north: a place instead of range and bearing [m]")
    structure: str | None = Field(
        default=None, description="structure that range and bearing are from; none: the mission's dock, or the only one"
    )
    heading_deg: float = Field(default=0.0, description="heading, clockwise from north [deg]")
    depth: float = Field(default=20.0, ge=0.0, le=12_000.0, description="depth [m]")
    speed: float = Field(default=1.0, ge=0.0, le=20.0, description="speed through the water, straight ahead [m/s]")

    @model_validator(mode="after")
    def _whole_place(self) -> "Start":
        if (self.north is None) != (self.east is None):
            raise ValueError("north and east go together: give both or neither")
        return self


class VehicleSettings(Settings):
    """One vehicle: what it is, where it starts, what it carries and does."""

    model: str = Field(default="remus100", description="a folder in models/, or the path of an .xml file")
    start: Start = Start()
    ballast: BallastSettings = BallastSettings()
    sensors: SensorSettings = SensorSettings()
    estimator: EstimatorSettings = Field(default=RobustSettings(), description="The estimator, by its `kind`.")
    control: ControlSettings = Field(default=AutopilotSettings(), description="The controller, by its `kind`.")
    mission: MissionSettings = Field(default=DockingSettings(), description="The mission, by its `kind`.")
    modem: ModemSettings | None = Field(default=None, description="acoustic modem; none: it has none")
    clock: ClockSettings = ClockSettings()


class FixedModem(NamedTuple):
    """A modem that stays where it is and tells that place."""

    key: str  # dotted, of its settings
    modem: ModemSettings
    clock: ClockSettings
    place: tuple[float, float, float]  # north, east, depth [m]
    heading: float  # [rad]
    chart: float  # error of the place that it tells, sd along north and east [m]


class StructureSettings(Settings):
    """A dock: its model, where it is, and its modem if it has one."""

    model: str = Field(default="dock", description="a folder in models/, or the path of an .xml file")
    north: float = Field(default=0.0, description="north of the datum, centre of the mouth [m]")
    east: float = Field(default=0.0, description="east of the datum, centre of the mouth [m]")
    depth: float = Field(default=20.0, gt=0.0, le=12_000.0, description="depth of the centre of the mouth [m]")
    heading_deg: float = Field(
        default=0.0, description="course of a vehicle that enters along the axis, clockwise from north [deg]"
    )
    modem: ModemSettings | None = Field(
        default=None, description="acoustic modem at its mouth, which tells that place; none: it has none"
    )
    clock: ClockSettings = ClockSettings()

    @property
    def pose(self) -> StructurePose:
        """Where it is."""
        return StructurePose(north=self.north, east=self.east, depth=self.depth, heading=math.radians(self.heading_deg))


class WaterSettings(Settings):
    """The water and its floor."""

    density: float = Field(
        default=WorldSettings().water_density, ge=900.0, le=1300.0, description="density of the water [kg/m3]"
    )
    sea_floor: float = Field(default=40.0, gt=0, le=12_000.0, description="depth of the sea floor [m]")
    terrain: TerrainSettings = Field(default=FlatSettings(), description="Shape of the sea floor, by its `kind`.")
    current: CurrentSettings = Field(
        default=UniformSettings(speed=0.0), description="The water's velocity, by its `kind`."
    )


class PhysicsSettings(Settings):
    """How the dynamics are stepped."""

    integrator: Integrator = Field(
        default=WorldSettings().integrator, description=WorldSettings.model_fields["integrator"].description
    )


class BeaconSettings(Settings):
    """A modem at a fixed place, on the sea floor or below a buoy, which tells that place as a vehicle tells its own."""

    north: float = Field(default=0.0, description="north of the datum [m]")
    east: float = Field(default=0.0, description="east of the datum [m]")
    depth: float = Field(default=5.0, gt=0.0, le=12_000.0, description="depth [m]")
    chart: float = Field(
        default=0.0, ge=0.0, le=1000.0,
        description="error of the place that it tells, sd along north and east, drawn for each run [m]",
    )  # fmt: skip
    modem: ModemSettings = ModemSettings()
    clock: ClockSettings = ClockSettings()


class NetworkSettings(SoundSettings):
    """What carries messages: the water for modems, those at fixed places, and the link of a dock's USBL."""

    acoustics: AcousticSettings = AcousticSettings()
    beacons: dict[Name, BeaconSettings] = Field(default={}, description="modems at fixed places, by name")


class WalkStep(Settings):
    """One step of a walk: the normals of another trial, mixed in at an angle."""

    trial: int = Field(ge=0, lt=LARGEST, description="trial of the run's seed whose noises are mixed in")
    angle_deg: float = Field(description="x becomes x cos + n sin of it: 0 leaves all as it is, 90 is the other [deg]")


class RandomSettings(Settings):
    """What the run's noises are made of, beside seed and trial."""

    walk: tuple[WalkStep, ...] | None = Field(
        default=None,
        description="steps from the trial's noises to near ones, as `auvsim stress` takes them; none: plain",
    )

    @property
    def steps(self) -> Walk | None:
        """Of `base.randomness.stream`."""
        return None if self.walk is None else [(step.trial, math.radians(step.angle_deg)) for step in self.walk]


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


def check_depths(scenario: Scenario) -> None:
    """Sees that structures, starts and the waypoints of tracks are between the surface and the sea floor.

    Raises:
        InputError: one is not; the text begins with its dotted key.
    """
    terrain = scenario.world.floor
    if isinstance(scenario.water.terrain, SeabedSettings):
        _check_floor(scenario, scenario.water.terrain)
    for key, north, east, depth in _places(scenario):
        floor = terrain.depth(north, east)
        if not 0.0 < depth < floor:
            raise InputError(f"{key}: {depth:g} m is not between the surface and the sea floor at {floor:g} m")


def _check_floor(scenario: Scenario, floor: SeabedSettings) -> None:
    """Sees that something of the scenario is on or near a generated floor, beside which the sea floor is even."""
    (x, y), near = floor.center, 1.5 * 0.5 * floor.extent
    places = [(north, east) for _, north, east, _ in _places(scenario)]
    if places and all(max(abs(north - x), abs(east - y)) > near for north, east in places):
        away = min(math.hypot(north - x, east - y) for north, east in places)
        raise InputError(
            f"water.terrain.center: the generated sea floor of {floor.extent:g} m lies {away:.0f} m from the nearest "
            "vehicle, waypoint or structure; move it there or give a larger extent"
        )


def _places(scenario: Scenario) -> Iterator[tuple[str, float, float, float]]:
    """Dotted key of its depth, north, east, down [m] of all that a scenario places in the water."""
    for name, structure in scenario.structures.items():
        yield f"structures.{name}.depth", structure.north, structure.east, structure.depth
    for name, beacon in scenario.network.beacons.items():
        yield f"network.beacons.{name}.depth", beacon.north, beacon.east, beacon.depth
    for name, vehicle in scenario.vehicles.items():
        yield f"vehicles.{name}.start.depth", *scenario.start_position(name)
        if isinstance(vehicle.mission, FormationSettings):
            yield f"vehicles.{name}.mission.depth", *scenario.start_position(name)[:2], vehicle.mission.depth
        if isinstance(vehicle.mission, TrackSettings):
            pattern = vehicle.mission.pattern
            north, east, _ = scenario.start_position(name)
            ways = [[north, east]] if isinstance(pattern, Weave | Circle) else points(pattern).tolist()
            for north, east in ways:
                yield f"vehicles.{name}.mission.depth", north, east, vehicle.mission.depth


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
