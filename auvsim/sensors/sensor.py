"""The contract of a sensor on board: settings, log variable, measurement."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

from numpy.random import Generator

from auvsim.base.frames import Array
from auvsim.base.randomness import Noise
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import Truth
from auvsim.vehicles.library import Vehicle
from auvsim.water.currents import CurrentField
from auvsim.water.terrain import Terrain

_new = tuple.__new__


class Surroundings(Protocol):
    """What a sensor may ask of the world beside the truth of its own vehicle; `physics.world.World` is one."""

    @property
    def current(self) -> CurrentField:
        """The water's velocity."""
        ...

    @property
    def terrain(self) -> Terrain:
        """The sea floor."""
        ...

    @property
    def structures(self) -> Mapping[str, Any]:
        """Docks and the like by name, each with a `pose`."""
        ...

    def rays(self, place: Array, directions: Array, reach: float) -> tuple[Array, Array] | None:
        """Distances (n,) [m] at which rays meet structures or vehicles, infinite for none, and cosines (n,) there.

        Args:
            place: (3,) where they begin, NED [m].
            directions: (n, 3) unit vectors, NED.
            reach: their length [m].

        Returns:
            None where none of these is within reach.
        """
        ...

    def truth(self, vehicle: str) -> Truth:
        """The true state of any vehicle, by name."""
        ...


class Sensor(ABC):
    """A sensor on board; one file and one test add another.

    A subclass names its `kind` and `Settings` (with a `rate` [Hz], and `enabled` if a vehicle may lack it), says in
    `value` and `sizes` what it logs, and implements `measure`. For every reading it takes the same number of draws from
    `_noise`, so that a run replays bit for bit and no loss changes other noise.

    Args:
        settings: an instance of the class `Settings`.
        generator: random stream of all its noise, which no other source uses.
        name: instance name, which its readings carry; its kind by default.
        vehicle: model of the vehicle that carries it, for sensors that depend on it.
    """

    kind: ClassVar[str]
    Settings: ClassVar[type[Settings]]
    value: Variable  # the log variable of a reading's `value`
    sizes: Mapping[str, int]  # of the dimensions that `value` names

    def __init__(
        self, settings: Any, generator: Generator, *, name: str | None = None, vehicle: Vehicle | None = None
    ) -> None:
        self.settings = settings
        self.name = name or self.kind
        self._noise = Noise(generator)
        self._sequence = 0

    @abstractmethod
    def measure(self, truth: Truth, world: Surroundings) -> Reading | None:
        """A reading of the state now, or None where the sensor measures nothing."""

    def _reading(self, time: float, value: Array) -> Reading:
        """A reading with this time [s] as stamp and arrival, and the next sequence number."""
        sequence = self._sequence
        self._sequence = sequence + 1
        return _new(Reading, (self.name, time, time, value, sequence, None))  # half the time of Reading(...)
