"""The contract of a mission: from the estimate to setpoints, with phases, events, log variables and metrics."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from auvsim.acoustics.message import Delivery, Outgoing
from auvsim.base.reading import Reading
from auvsim.control.controller import Setpoints
from auvsim.data.log import VehicleLog
from auvsim.data.variables import Table
from auvsim.missions.fixes import FixSource
from auvsim.navigation.estimate import Estimate
from auvsim.physics.truth import StructurePose
from auvsim.vehicles.library import Structure, Vehicle


class Event(NamedTuple):
    """A change of phase or another decision, for the log."""

    time: float  # [s]
    kind: str
    text: str


class Situation(NamedTuple):
    """What a mission may decide by: time, estimate, smoothed heading and depth, latch, readings, messages."""

    time: float  # [s]
    estimate: Estimate | None  # the last one, or None before there is any
    heading: float  # smoothed by the controller [rad]
    depth: float  # likewise [m]
    latched: str | None  # structure whose latch holds the vehicle
    readings: Sequence[Reading]  # of this control period
    messages: Sequence[Delivery]  # likewise, from the network


@dataclass(frozen=True, kw_only=True, slots=True)
class Place:
    """A charted structure: its name, pose and dimensions."""

    name: str
    pose: StructurePose
    structure: Structure


@dataclass(frozen=True, kw_only=True, slots=True)
class MissionSetup:
    """The set-up that a mission is made from."""

    name: str  # of the vehicle
    settings: Any  # an instance of its settings class; for a user's own, what stands under `settings`
    vehicle: Vehicle
    heading: float  # at the start [rad]
    depth: float  # at the start [m]
    period: float  # time between two updates [s]
    holds: Callable[[float], bool]  # whether the vehicle can hold a speed through the water [m/s]
    structures: Mapping[str, Place]  # all that are charted, by name
    usbl: bool = True  # whether a dock reports where it lies
    ranges: tuple[str, ...] = ()  # names of the sensors that measure ranges to beacons
    altimeters: tuple[str, ...] = ()  # names of those that measure the range to the sea floor
    fixes: tuple[FixSource, ...] = ()  # what tells where it is


class Metric(NamedTuple):
    """A metric of a mission; also a column of a campaign's table."""

    dtype: str  # str, bool, int or float
    units: str
    meaning: str


class Mission:
    """A mission; made by `Class(setup)`.

    A subclass sets `phases`, keeps `phase` (the index of the present one) and `finished` up to date, appends to
    `events`, and to `outbox` what its vehicle's modem is to send, and implements `update`. All else has defaults, which
    it may override.
    """

    phases: ClassVar[tuple[str, ...]]  # names of the phases, as logged
    variables: ClassVar[Table] = {}  # variables logged at each update, in the order of `row`
    columns: ClassVar[Mapping[str, Metric]] = {}  # metrics that `metrics` returns
    aftermath: ClassVar[float] = 0.0  # time that is still simulated after its end [s]

    def __init__(self, setup: MissionSetup) -> None:
        self.phase = 0
        self.finished = False
        self.events: list[Event] = []
        self.outbox: list[Outgoing] = []
        self.dock: Place | None = None  # the structure at which it ends, if any

    @property
    def at_rest(self) -> bool:
        """Whether a latch holds the vehicle, so that nothing is estimated."""
        return False

    @property
    def approach(self) -> int | None:
        """Number of the approach to `dock` under way, from 1; None while there is none."""
        return None

    def update(self, now: Situation) -> Setpoints:
        """The setpoints now."""
        raise NotImplementedError(f"{type(self).__name__} needs update(now) -> Setpoints")

    def row(self) -> tuple[Any, ...]:
        """Values of `variables` after the last update."""
        return ()

    def overdue(self, duration: float) -> str:
        """Text of the event that is logged when the time limit [s] ends the run first."""
        return f"not finished within {duration:g} s"

    @classmethod
    def metrics(cls, log: VehicleLog) -> dict[str, Any]:
        """Metrics of a vehicle's log: the values of `columns`, by name."""
        return {}
