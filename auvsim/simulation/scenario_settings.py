"""The settings that make up a scenario: rates, starts, vehicles, structures, water, physics, network, randomness."""

import math
from typing import Annotated, NamedTuple

from pydantic import Field, StringConstraints, model_validator

from auvsim.acoustics.clock import ClockSettings
from auvsim.acoustics.link import AcousticSettings
from auvsim.acoustics.modem import ModemSettings
from auvsim.acoustics.modems import SoundSettings
from auvsim.base.randomness import LARGEST, Walk
from auvsim.base.settings import Settings
from auvsim.control.registry import ControlSettings
from auvsim.control.torpedo import AutopilotSettings
from auvsim.missions.docking.guidance import DockingSettings
from auvsim.missions.registry import MissionSettings
from auvsim.navigation.settings import EstimatorSettings, RobustSettings
from auvsim.physics.ballast import BallastSettings
from auvsim.physics.scenes import Integrator, WorldSettings
from auvsim.physics.truth import StructurePose
from auvsim.simulation.sensor_settings import SensorSettings
from auvsim.vehicles import model_files
from auvsim.water.settings import CurrentSettings, UniformSettings
from auvsim.water.terrain import FlatSettings, TerrainSettings

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
