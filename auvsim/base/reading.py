"""A reading: the form in which anything measured or received reaches navigation, control and the log."""

from typing import Any, NamedTuple

from auvsim.base.frames import Array


class Reading(NamedTuple):  # a frozen dataclass takes three times as long to make, and a trial makes ten thousand
    """A measurement with the time it was true and the time it arrived.

    | sensor   | value                                                                                    |
    | compass  | (3,) heading, pitch, roll [rad]                                                          |
    | depth    | (1,) depth [m]                                                                           |
    | feedback | (n + 1,) the n fin angles [rad] in the order of the allocation, then shaft speed [rad/s] |
    | usbl     | (7,) transponder in the dock's frame x, y, z [m], dock heading, pitch, roll [rad],       |
    |          | dock depth [m]                                                                           |
    | dvl      | (6,) u, v, w over ground, then through the water [m/s]; NaN where that track is lost     |
    | gyro     | (3,) p, q, r [rad/s]                                                                     |
    | range    | (1,) slant range to a beacon [m]                                                         |
    | fix, gps | (2,) north, east [m]                                                                     |
    | altimeter| (1,) range to the sea floor along the hull's downward axis [m]                           |
    | imu      | (6,) p, q, r [rad/s], specific force x, y, z [m/s2]: means since the last reading        |
    | imaging_ | (2,) mean intensity, largest by the mean; or, if they are logged, (beams, bins) levels   |
    | sonar    | in half decibels; `image` has the intensities                                            |
    """

    sensor: str
    stamp: float  # when it was true [s]
    received: float  # when it arrived [s]
    value: Array
    sequence: int = 0  # counts the readings of one sensor, lost ones included
    image: Any = None  # what is too large for the log: the intensities (beams, bins) of an imaging sonar
