"""What a vehicle hears of another: ranges and bearings, paired with the packets that say where they were sent."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from auvsim.acoustics.message import Delivery
from auvsim.acoustics.modem import ModemSettings
from auvsim.acoustics.payload import PULSE, STATE, StateReport

SAME = 0.01  # stamps of packet and pulse closer than this are the same [s]
OFF = 1.0  # difference between own clock and time of a run above which the clock is not asked [s]
REMEMBERED = 16  # pulses of a sender that wait for their packets


CLOSEST = 1.0  # distance below which a range is not taken to bend any more [m]
LESS_CERTAIN = "less_certain"  # why a range is refused whose sender knows its place no better than the receiver


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
        r = self.report
        return along((r.north - north, r.east - east), r.north_north, r.north_east, r.east_east)


def along(way: tuple[float, float], north_north: float, north_east: float, east_east: float) -> float:
    """Variance [m2] of a horizontal position along a way (north, east), of any length, by its covariance."""
    north, east = way
    square = north**2 + east**2
    if square == 0.0:
        return max(north_north, east_east)
    return max(0.0, (north**2 * north_north + 2.0 * north * east * north_east + east**2 * east_east) / square)


def flat_share(distance: float, down: float) -> float:
    """Share [-] of the variance along the way that a slant range shows to a place that is `down` [m] deeper."""
    return max(0.0, 1.0 - (down / max(abs(distance), 1e-9)) ** 2)


def bend(across: float, distance: float) -> tuple[float, float]:
    """Mean [m] and variance [m2] of what a range is longer than to first order, for a place not known across it.

    It is e^2 / (2 r) of the error e across a range r: where that counts, a filter of first order takes the circle of a
    range for its tangent, and believes it had seen what it has not.

    Args:
        across: Variance of the place across the range [m2].
        distance: Range in the plan view [m].
    """
    mean = 0.5 * across / max(distance, CLOSEST)
    return mean, 2.0 * mean**2


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
