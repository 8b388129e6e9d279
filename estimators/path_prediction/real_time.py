"""SC-RT: a pulse is used at once, with the leader's pose predicted; the packet that comes later puts that right.

The leader's own estimates at the last pulses are states. A packet says what one of them was, and corrects through the
correlations all that was made of its prediction, in whatever order packets come.
"""

import math

import numpy as np

from estimators.core.loops import wrap
from estimators.core.types import Array, Gaussian
from estimators.path_prediction.follower import Follower
from estimators.path_prediction.kinematics import advance, clone, odometry_covariance, replace, transport
from estimators.path_prediction.messages import Noise, Packet, Pulse, curved, seen

ERROR, SLOTS = 3, 6  # places of the leader's error and of the first of its poses
EXACT = 1e-6 * np.eye(3)  # a packet says what the leader's estimate was, not where it was
STEPS = 10  # of the prediction over a period


class RealTimeFilter(Follower):
    """A follower with the leader's own estimates at the last pulses, and their error, in its state.

    Args:
        start: Pose (3,) at the time 0.
        noise: Of the follower's odometry.
        leader_noise: Of the leader's odometry.
        period: Of the pulses [s].
        slots: Of the leader's poses; more than the longest delay over the period.
        manoeuvre: Standard deviation of the leader's mean yaw rate over a period from what is predicted [rad/s].
    """

    def __init__(
        self,
        start: Gaussian,
        noise: Noise,
        leader_noise: Noise,
        *,
        period: float = 10.0,
        slots: int = 10,
        manoeuvre: float = math.radians(0.5),
    ) -> None:
        super().__init__(start, noise, SLOTS + 3 * slots, bends=True)
        self._leader_noise, self._period, self._manoeuvre = leader_noise, period, manoeuvre
        self._numbers = [-1] * slots
        self._newest = -1  # number of the newest slot
        self._packet: Packet | None = None  # the newest one
        self._speed = self._yaw_rate = 0.0  # mean ones of the leader, between its last two packets

    @property
    def leader(self) -> tuple[float, Array] | None:
        """The newest predicted pose, corrected by the estimated error."""
        if self._packet is None:
            return None
        at = self._place(self._newest)
        time = self._packet.stamp + (self._newest - self._packet.number) * self._period
        return time, self.mean[at : at + 2] - self.mean[ERROR : ERROR + 2]

    def hear(self, pulse: Pulse) -> None:
        """Uses a pulse with the predicted pose of the leader; those before the first packet are not used."""
        if self._packet is None or pulse.number <= self._newest - len(self._numbers):
            return
        if not self._extend(pulse.number):
            return
        at = self._place(pulse.number)
        newest = self._place(self._newest)
        north, east = self.mean[newest : newest + 2] - self.mean[at : at + 2]  # of a pulse that comes late
        back = np.array([[1.0, 0.0, east], [0.0, 1.0, -north]])
        place = self.mean[at : at + 2] - back @ self.mean[ERROR : ERROR + 3]
        if (found := seen(pulse, self.mean, place)) is None:
            return
        J = np.zeros((2, self.mean.size))  # of the vector from the follower to the leader
        J[:, :2], J[:, at : at + 2], J[:, ERROR : ERROR + 3] = -np.eye(2), np.eye(2), -back
        found = curved(found, pulse, J @ self.covariance @ J.T)
        H = found.by_leader @ J
        H[:, 2] = found.by_follower[:, 2]
        self.correct(H, found.residual, found.covariance, pulse.number)

    def receive(self, packet: Packet) -> None:
        """Learns what the leader's estimate was at a pulse."""
        if self._packet is None or packet.number >= self._newest + len(self._numbers):
            self._begin(packet)
        elif packet.number > self._newest - len(self._numbers):
            self._extend(packet.number)
            at = self._place(packet.number)
            if self._numbers[packet.number % len(self._numbers)] != packet.number:
                return  # from before the first packet
            H = np.zeros((3, self.mean.size))
            H[:, at : at + 3] = np.eye(3)
            residual = packet.pose - self.mean[at : at + 3]
            residual[2] = wrap(residual[2])
            self.correct(H, residual, EXACT)
        if (before := self._packet) is None or packet.number > before.number:
            self._packet = packet
            self._note_motion(before, packet)

    def _begin(self, packet: Packet) -> None:
        """The first packet, or one after so long that nothing of the leader is known any more."""
        self._numbers = [-1] * len(self._numbers)
        self._numbers[packet.number % len(self._numbers)] = self._newest = packet.number
        replace(self.mean, self.covariance, ERROR, np.zeros(3), packet.covariance)
        replace(self.mean, self.covariance, self._place(packet.number), packet.pose, EXACT)

    def _extend(self, number: int) -> bool:
        """Predicts the leader's poses up to a pulse; whether there is one of that pulse."""
        if number >= self._newest + len(self._numbers):
            return False  # nothing is known of it any more; the next packet begins anew
        while self._newest < number:
            self._predict()
        return self._numbers[number % len(self._numbers)] == number

    def _predict(self) -> None:
        """One pose more of the leader, a period after the newest; its error moves on with it."""
        x, P, T = self.mean, self.covariance, self._period
        source, at = self._place(self._newest), self._place(self._newest + 1)
        heading = x[source + 2] + 0.5 * self._yaw_rate * T
        clone(x, P, at, source)
        for _ in range(STEPS):
            advance(x, P, at, self._speed, self._yaw_rate, T / STEPS, 0.0, 0.0)
        north, east = x[at : at + 2] - x[source : source + 2]
        along, across = self._leader_noise.speed * T, 0.5 * self._speed * T**2 * self._manoeuvre
        turned = self._manoeuvre * T  # a yaw rate that is off all the way
        c, s = math.cos(heading), math.sin(heading)
        G = np.array([[c * math.sqrt(along), -s * across], [s * math.sqrt(along), c * across], [0.0, turned]])
        P[at : at + 3, at : at + 3] += G @ G.T
        e = x[ERROR : ERROR + 3]
        e[0] -= east * e[2]
        e[1] += north * e[2]
        transport(P, ERROR, north, east)
        P[ERROR : ERROR + 3, ERROR : ERROR + 3] += odometry_covariance(heading, self._speed, T, *self._leader_noise)
        self._newest += 1
        self._numbers[self._newest % len(self._numbers)] = self._newest

    def _note_motion(self, before: Packet | None, packet: Packet) -> None:
        if before is None:
            self._speed, self._yaw_rate = packet.speed, packet.yaw_rate
            return
        T = packet.stamp - before.stamp
        self._speed = math.hypot(*(packet.pose[:2] - before.pose[:2])) / T
        self._yaw_rate = wrap(packet.pose[2] - before.pose[2]) / T

    def _place(self, number: int) -> int:
        return SLOTS + 3 * (number % len(self._numbers))
