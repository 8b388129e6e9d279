"""Pitch that holds a depth against what is steady, such as net buoyancy; zero until it is needed."""

import math

REFERENCE = 1.0  # speed through the water at which the trim is kept [m/s]
SLOWEST = 0.3  # below it the trim does not grow any more [m/s]
PATIENCE = 5.0  # time in which a depth error must shrink [s]
SHRINKS = 0.8  # to which share of itself
SMALL = 0.3  # error with which the trim does not begin [m]
FAR = 3.0  # error beyond which it stands still [m]
HELPLESS = 10.0  # time at the limit of the pitch without a gain of `GAIN` after which authority is at its end [s]
GAIN = 0.5  # [m]


class Trim:
    """Integral of the depth error that begins once an error stays, scheduled with speed: lift grows with its square.

    It begins when the vehicle, ahead and with its pitch free, has kept more than `SHRINKS` of an error above `SMALL`
    for `PATIENCE`; a vehicle that floats level is steered without it. What happens at the limit of the pitch is
    watched, too.

    Args:
        gain: pitch at 1 m/s per integrated depth error [rad/(m s)].
        limit: largest pitch [rad].
        period: between two updates [s].
    """

    def __init__(self, gain: float, limit: float, period: float) -> None:
        self._gain, self._limit, self._period = gain, limit, period
        self._kept = 0.0  # trim at `REFERENCE`, positive dives [rad]
        self.begun = False
        self._watched, self._first, self._setpoint = 0.0, 0.0, math.nan  # of an error that should shrink
        self._pressed, self._from = 0.0, 0.0  # of one at the limit of the pitch

    def pitch(self, speed: float) -> float:
        """What is added to the pitch, nose down, at a speed through the water [m/s]: [rad]."""
        if not self.begun:
            return 0.0
        return max(-self._limit, min(self._limit, self._kept * (REFERENCE / max(abs(speed), SLOWEST)) ** 2))

    def update(self, setpoint: float, error: float, speed: float, limited: bool, begun_from: float) -> None:
        """Learns from a depth error.

        Args:
            setpoint: depth that is wanted [m].
            error: it, less the depth [m].
            speed: through the water [m/s].
            limited: whether the pitch is at its limit.
            begun_from: trim to begin with, positive dives, at this speed [rad].
        """
        self._watch_limit(error, limited)
        if speed <= 0.0:
            self._watched = 0.0
        elif self.begun:
            if not limited and abs(error) < FAR:
                self._kept += self._gain * error * self._period
        elif setpoint != self._setpoint or limited or abs(error) < SMALL:
            self._watched, self._setpoint = 0.0, setpoint
        else:
            if self._watched == 0.0:
                self._first = error
            self._watched += self._period
            if self._watched >= PATIENCE:
                self.begun, self._watched = error / self._first > SHRINKS, 0.0
                self._kept = begun_from * (max(speed, SLOWEST) / REFERENCE) ** 2

    @property
    def helpless(self) -> bool:
        """Whether the largest pitch has not brought the vehicle nearer to its depth for a while."""
        return self._pressed >= HELPLESS

    def _watch_limit(self, error: float, limited: bool) -> None:
        if not limited or abs(error) < GAIN:
            self._pressed = 0.0
        elif self._pressed == 0.0 or abs(error) < abs(self._from) - GAIN or error * self._from < 0.0:
            self._pressed, self._from = self._period, error
        else:
            self._pressed += self._period
