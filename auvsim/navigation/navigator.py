"""The contract of an estimator in a run, and the set-up that it is made from."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from auvsim.acoustics.message import Delivery
from auvsim.acoustics.usbl import UsblSettings
from auvsim.base.reading import Reading
from auvsim.navigation.estimate import Estimate
from auvsim.physics.truth import StructurePose
from auvsim.vehicles.actuation import Actuation
from estimators.planar.model import PlanarParameters


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


@dataclass(frozen=True, kw_only=True, slots=True)
class NavigatorSetup:
    """What an estimator may know before the start; never the errors that its sensors drew."""

    vehicle: str  # its name
    settings: Any  # of the estimator; of a user's own, its class `Settings` or what stands under `settings`
    parameters: PlanarParameters  # the planar model that it assumes
    actuation: Actuation
    period: float  # time between two updates [s]
    rates: Mapping[str, float]  # of the sensors that the vehicle has, by name [Hz]
    usbl: UsblSettings  # lever arms of the dock's USBL
    dock: StructurePose | None = None  # charted pose of the mission's dock


NavigatorFactory = Callable[[NavigatorSetup], Navigator]
