"""What a vehicle hears of another: ranges and bearings, paired with the packets that say where they were sent."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from auvsim.acoustics.message import Delivery
from auvsim.acoustics.modem import ModemSettings
from auvsim.acoustics.payload import PULSE, STATE, StateReport

SAME = 0.01  # stamps of packet and pulse closer than this are the same [s]
OFF = 1.0  # difference between own clock and time of a run above which the clock is not asked [s]
REMEMBERED = 16  # pulses of a sender that wait for their packets


class Sight(NamedTuple):
    """Another vehicle as it was when it sent a pulse or packet, and where it was seen from here when that arrived."""

    source: str
    sequence: int
    sent: float  # by the other's clock [s]
    stamp: float  # when it arrived here [s]
    received: float  # when all of this was known [s]
    range: float | None  # [m]
    bearing: float | None  # from the bow [rad]
    two_way: bool  # whether the range is by two-way travel time
    report: StateReport

    def variance_along(self, north: float, east: float) -> float:
        """Variance [m2] of the other's horizontal position along the way from a place [m] to it."""
        to_north, to_east = self.report.north - north, self.report.east - east
        square = to_north**2 + to_east**2
        if square == 0.0:
            return max(self.report.north_north, self.report.east_east)
        r = self.report
        along = to_north**2 * r.north_north + 2.0 * to_north * to_east * r.north_east + to_east**2 * r.east_east
        return max(0.0, along / square)


class Listener:
    """Pairs pulses with packets, in order of arrival.

    Args:
        modem: Own data sheet.
    """

    def __init__(self, modem: ModemSettings) -> None:
        self._modem = modem.modem
        self._pulses: dict[str, dict[int, Delivery]] = {}

    def sights(self, deliveries: Sequence[Delivery]) -> Iterator[Sight]:
        """What is seen of others, once a packet says where they were."""
        for delivery in deliveries:
            message = delivery.message
            waiting = self._pulses.setdefault(message.source, {})
            if message.kind == PULSE:
                waiting[message.sequence] = delivery
                for old in list(waiting)[:-REMEMBERED]:
                    del waiting[old]
            elif message.kind == STATE:
                report = StateReport(*message.payload)
                pulse = waiting.pop(message.sequence, None)
                if abs(report.stamp - message.sent) <= SAME:
                    pulse = delivery
                if pulse is not None:
                    yield Sight(
                        message.source, message.sequence, pulse.message.sent, self.arrival(pulse), delivery.received,
                        pulse.range, pulse.bearing, pulse.message.answers is not None, report,
                    )  # fmt: skip

    def arrival(self, delivery: Delivery) -> float:
        """When a packet's first wave front arrived, in the time of the run [s], by the own clock unless that is off."""
        modem, bits = self._modem, delivery.message.bits
        nominal = delivery.received - modem.processing - modem.duration(bits)
        arrived = delivery.arrived
        return min(arrived, delivery.received) if abs(arrived - nominal) <= OFF else nominal
