"""What an estimator was given, in the order in which it came: what a log is made into before it is replayed."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from auvsim.acoustics.message import Delivery
from auvsim.base.frames import Array
from auvsim.base.reading import Reading
from auvsim.data.log import VehicleLog
from auvsim.navigation.gate import Gate
from auvsim.navigation.message_gate import MessageGate
from auvsim.navigation.navigator import NavigatorSetup


class Arrival(NamedTuple):
    """A reading as it reached the vehicle."""

    reading: Reading
    rank: int  # place of its sensor among those that are read at one time; what the network delivers comes last
    delivery: Delivery | None = None  # that brought it, if one did


class Tick(NamedTuple):
    """One update of an estimator."""

    time: float  # [s]
    readings: list[Reading]  # since the last one, in order of arrival
    messages: list[Delivery]  # likewise
    commands: Any  # the demand on the actuators that was in force


@dataclass(frozen=True, kw_only=True, slots=True)
class Recording:
    """All that the estimator of one vehicle was given in a run."""

    name: str  # of the file and, where there are several, the vehicle
    times: Array  # (n,) of the updates [s]
    clock: Array  # (k,) when the vehicle looks what has arrived [s], in order; the updates among them
    commands: Sequence[Any]  # (n,) in force at each update
    arrivals: Sequence[Arrival]
    setup: Callable[[Any], NavigatorSetup]  # of an estimator's settings, or of None: those of the run
    own: Any  # settings of the run's own estimator
    vehicle: VehicleLog | None = None  # the log that it is of, where that is a trial's
    messages: Sequence[Delivery] = ()  # of other vehicles' modems, in order of arrival

    @property
    def gate(self) -> Gate:
        """The gate before the estimator, as in the run; in tables, which round, the same value again is no fault."""
        setup = self.setup(None)
        return Gate(setup.sensors, setup.actuation, frozen=self.vehicle is not None)

    @property
    def message_gate(self) -> MessageGate:
        """The gate for messages of modems, as in the run."""
        return MessageGate(self.setup(None).vehicle, self.setup(None).others)

    def ticks(self) -> Iterator[Tick]:
        """The updates, with what came between."""
        received = np.array([a.reading.received for a in self.arrivals])
        looked = np.searchsorted(self.clock, received)  # at the first look at or after its arrival
        ranks = np.array([a.rank for a in self.arrivals])
        order = np.lexsort((np.arange(len(received)), np.where(ranks == DELIVERED, received, 0.0), ranks, looked))
        waiting = [(looked[k], self.arrivals[k]) for k in order if looked[k] < len(self.clock)]
        handed = np.searchsorted(self.clock, np.array([m.received for m in self.messages]))
        ends, start, first = np.searchsorted(self.clock, self.times), 0, 0
        for time, end, commands in zip(self.times.tolist(), ends.tolist(), self.commands, strict=True):
            stop = start
            while stop < len(waiting) and waiting[stop][0] <= end:
                stop += 1
            came, start = [arrival for _, arrival in waiting[start:stop]], stop
            last = int(np.searchsorted(handed, end, side="right"))
            fixes, heard, first = [a.delivery for a in came if a.delivery], self.messages[first:last], last
            yield Tick(time, [a.reading for a in came], [*fixes, *heard], commands)


DELIVERED = 1_000_000  # rank of what the network delivers
