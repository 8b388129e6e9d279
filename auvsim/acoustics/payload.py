"""Payloads of modem messages, as tuples of numbers: what a vehicle tells of its own state, and lengths in bits."""

from typing import NamedTuple

STATE, PULSE, REQUEST = "state", "pulse", "request"  # kinds of message; the last two carry no numbers
HEADER_BITS = 32  # source, destination, sequence, stamp
NUMBER_BITS = 16  # of each number; what is lost by rounding to them is not modelled


class StateReport(NamedTuple):
    """A vehicle's estimate of itself as it was at a time, as it tells it to others."""

    stamp: float  # by the sender's clock [s]
    north: float  # [m]
    east: float  # [m]
    depth: float  # [m]
    heading: float  # [rad]
    speed_north: float  # over ground [m/s]
    speed_east: float  # over ground [m/s]
    yaw_rate: float  # [rad/s]
    north_north: float  # covariance of north and north [m2], and so on
    north_east: float  # [m2]
    north_heading: float  # [m rad]
    east_east: float  # [m2]
    east_heading: float  # [m rad]
    heading_heading: float  # [rad2]


NUMBERS = {STATE: len(StateReport._fields), PULSE: 0, REQUEST: 0}  # in a payload, by kind


def packet_bits(numbers: int) -> int:
    """Length of a packet of so many numbers [bit]."""
    return HEADER_BITS + NUMBER_BITS * numbers
