"""A follower that localises itself by its leader: the contract of all methods, and dead reckoning, the first one."""

from abc import ABC, abstractmethod

import numpy as np

from estimators.core import loops
from estimators.core.errors import ParameterError
from estimators.core.types import Array, Gaussian
from estimators.path_prediction.kinematics import advance, bend
from estimators.path_prediction.messages import Noise, Packet, Pulse

REMEMBERED = 100  # pulses of which the likelihood is kept


class Follower(ABC):
    """An estimator of the pose of a vehicle with odometry that hears pulses and packets of a leader.

    Its joint belief begins with the follower's pose north, east [m], heading [rad], which is not wrapped.

    Args:
        start: Pose (3,) at the time 0.
        noise: Of the follower's odometry.
        size: States of the joint belief.
        bends: Whether predictions and pulses are taken to second order, which a long silence needs; the published
            filters take the first alone.
    """

    def __init__(self, start: Gaussian, noise: Noise, size: int = 3, *, bends: bool = False) -> None:
        self.time, self.noise, self._bends = 0.0, noise, bends
        self._gone = np.zeros(2)
        self.mean, self.covariance = np.zeros(size), np.zeros((size, size))
        self.mean[:3], self.covariance[:3, :3] = start.mean, start.covariance
        self.fit: dict[int, float] = {}  # log-likelihood of the last pulses used, by number

    @property
    def belief(self) -> Gaussian:
        """The follower's pose (3,)."""
        return Gaussian(mean=self.mean[:3].copy(), covariance=self.covariance[:3, :3].copy())

    @property
    def leader(self) -> tuple[float, Array] | None:
        """A time [s] and where this method takes the leader to have been (2,) then; None before the first packet."""
        return None

    def advance(self, time: float, speed: float, yaw_rate: float) -> None:
        """Moves on to a time [s] with the odometry [m/s, rad/s] held, in steps that are no longer than its period.

        Raises:
            ParameterError: The time goes backwards.
        """
        if not time >= self.time:
            raise ParameterError(f"time {time} s must not come before {self.time} s")
        duration, heading = time - self.time, self.mean[2]
        if self._bends:
            bend(self.covariance, 0, self._gone, heading, speed, duration)
        advance(self.mean, self.covariance, 0, speed, yaw_rate, duration, *self.noise)
        self.time = time

    @abstractmethod
    def hear(self, pulse: Pulse) -> None:
        """Takes a pulse at the time of its detection."""

    @abstractmethod
    def receive(self, packet: Packet) -> None:
        """Takes a packet at the time of its reception."""

    def correct(self, H: Array, residual: Array, R: Array, number: int | None = None) -> None:
        """Kalman correction of the joint belief by a residual (m,) = H (m, n) error + noise of covariance R (m, m).

        Args:
            number: Of the pulse, to note how well it fitted.
        """
        result = loops.correct(self.mean, self.covariance, H, residual, R, np.inf)
        if result[-1] != loops.OK:
            return  # what cannot be used changes nothing
        self.mean, self.covariance = result[0], result[1]
        self._gone[:] = 0.0
        if number is not None:
            self.note_fit(number, result[4], result[3])

    def note_fit(self, number: int, nis: float, S: Array) -> None:
        """Keeps the log-likelihood of a pulse by its normalised innovation squared and covariance S (m, m)."""
        self.fit[number] = -0.5 * (nis + float(np.linalg.slogdet(S)[1]))
        if len(self.fit) > REMEMBERED:
            del self.fit[next(iter(self.fit))]


class DeadReckoning(Follower):
    """Hears nothing."""

    def hear(self, pulse: Pulse) -> None:
        """Nothing."""

    def receive(self, packet: Packet) -> None:
        """Nothing."""
