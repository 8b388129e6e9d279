"""The contract of a controller: from setpoints and its own smoothed readings to a demand on the actuators."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from auvsim.base.reading import Reading
from auvsim.vehicles.actuation import Actuation


class Setpoints(NamedTuple):
    """What a mission asks of the controller."""

    heading: float  # [rad]; NaN where the rudder is given instead
    depth: float  # [m]
    speed: float  # through the water, negative astern [m/s]
    rudder: float | None = None  # effective rudder, positive to starboard, in place of a heading [rad]


class Station(NamedTuple):
    """What a mission asks of the controller of a hovering vehicle: to be at a place."""

    heading: float  # [rad]
    depth: float  # [m]
    speed: float  # at which the place moves over ground [m/s]
    place: tuple[float, float]  # north, east of the vehicle's origin [m]


@dataclass(frozen=True, kw_only=True, slots=True)
class ControllerSetup:
    """The set-up that a controller is made from."""

    settings: Any  # an instance of its settings class; for a user's own, what stands under `settings`
    actuation: Actuation  # of its vehicle
    ahead: Callable[[float], Any]  # demand that holds a speed through the water >= 0 [m/s], straight ahead
    period: float  # time between two commands [s]

    def shaft_speed(self, speed: float) -> float:
        """Shaft speed [rad/s] that holds a speed through the water >= 0 [m/s]; of a vehicle with a shaft."""
        return self.ahead(speed).shaft_speed


class Controller(Protocol):
    """Turns setpoints into demands by the readings of the sensors on board; made by `Class(setup)`.

    It may have a property `warning`, a line that says what it cannot hold with all its authority, or None; the run logs
    an event `authority` when one begins. Of a controller with a method `locate(estimate)` it is told each estimate.
    """

    @property
    def heading(self) -> float | None:
        """Smoothed heading [rad]; None before it is known."""
        ...

    @property
    def depth(self) -> float | None:
        """Smoothed depth [m]; None before it is known."""
        ...

    def observe(self, readings: Sequence[Reading]) -> None:
        """Takes the readings of this control period, of all sensors."""
        ...

    def command(self, setpoints: Setpoints | Station) -> tuple[float, ...]:
        """The demand now, of the kind that the vehicle's actuation allocates."""
        ...
