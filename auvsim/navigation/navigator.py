"""The contract of an estimator in a run, and the set-up that it is made from."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

from auvsim.acoustics.message import Delivery
from auvsim.acoustics.modem import ModemSettings
from auvsim.acoustics.usbl import UsblSettings
from auvsim.base.reading import Reading
from auvsim.navigation.estimate import Estimate
from auvsim.physics.truth import StructurePose
from auvsim.vehicles.actuation import Actuation
from estimators.core.estimator import StateFilter
from estimators.core.history import Node
from estimators.core.types import Gaussian
from estimators.planar.model import Dynamics


class Navigator(Protocol):
    """An estimator in a run."""

    states: Mapping[str, str]  # units of the estimated states by name, in their order; north and east first

    def update(self, time: float, readings: Sequence[Reading], messages: Sequence[Delivery], commands: Any) -> Estimate:
        """The estimate at a time.

        Args:
            time: now [s].
            readings: all that arrived since the last call, in order of arrival.
            messages: likewise, from the network.
            commands: the demand on the actuators that is in force.
        """
        ...

    def reset(self) -> None:
        """Forgets everything."""
        ...


@runtime_checkable
class Buffered(Protocol):
    """A navigator with a delay buffer, of which innovations and refined poses are to be had."""

    @property
    def nodes(self) -> Sequence[Node[Any]]:
        """The delay buffer."""
        ...

    @property
    def filter(self) -> StateFilter:
        """What runs over it."""
        ...

    def smoothed(self) -> list[tuple[float, Gaussian]]:
        """Times [s] and beliefs of the nodes still kept, given all that arrived since; NED from the datum.

        Raises:
            ParameterError: The filter cannot be smoothed.
        """
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class NavigatorSetup:
    """What an estimator may know before the start; never the errors that its sensors drew."""

    vehicle: str  # its name
    settings: Any  # of the estimator; of a user's own, its class `Settings` or what stands under `settings`
    parameters: Dynamics | None  # the model of its motion that it assumes; None of one that thrusters drive
    actuation: Actuation
    period: float  # time between two updates [s]
    rates: Mapping[str, float]  # of the sensors that the vehicle has, by name [Hz]
    usbl: UsblSettings  # lever arms of the dock's USBL
    dock: StructurePose | None = None  # charted pose of the mission's dock
    sensors: Mapping[str, Any] = field(default_factory=dict)  # settings of those on board by name: data sheets, places
    modem: ModemSettings | None = None  # data sheet of its modem
    others: tuple[str, ...] = ()  # names of the others that have a modem
    ranging: tuple[str, ...] = ()  # those of them whose estimates rest on ranges to others, maybe to this vehicle
    start: tuple[float, float] = (0.0, 0.0)  # planned, north and east [m]


NavigatorFactory = Callable[[NavigatorSetup], Navigator]
