"""SC-EKF: the follower's pose at each detection is cloned, and the pulse used there when its packet has come.

Stochastic cloning (Roumeliotis and Burdick 2002). A leader's estimates are not independent of each other: its error e
is that of dead reckoning, and a state. e follows its broadcast displacement, and what it gains is known from the
broadcast covariances: n = P_m(l) - Phi P_m(l') Phi'.
"""

import numpy as np

from estimators.core.loops import wrap
from estimators.core.types import Array, Gaussian
from estimators.path_prediction.follower import Follower
from estimators.path_prediction.kinematics import clone, replace, transport
from estimators.path_prediction.messages import Noise, Packet, Pulse, curved, seen

ERROR, CLONES = 3, 6  # places of the leader's error and of the first clone


class CloningFilter(Follower):
    """A follower with clones of its pose at the detections, and the leader's error, in its state.

    Args:
        start: Pose (3,) at the time 0.
        noise: Of the follower's odometry.
        clones: How many pulses wait for packets at most; more than the longest delay over the period.
        interpolated: Whether a pulse whose packet is lost is used at the next packet, the leader interpolated.
        interpolation_variance: What interpolation adds to the leader's position along each axis [m^2].
        bends: See `Follower`.
    """

    def __init__(
        self,
        start: Gaussian,
        noise: Noise,
        *,
        clones: int = 8,
        interpolated: bool = True,
        interpolation_variance: float = 4.0,
        bends: bool = True,
    ) -> None:
        super().__init__(start, noise, CLONES + 3 * clones, bends=bends)
        self._interpolated, self._interpolation_variance = interpolated, interpolation_variance
        self._pulses: list[Pulse | None] = [None] * clones
        self._packet: Packet | None = None  # the newest one

    @property
    def leader(self) -> tuple[float, Array] | None:
        """The leader of the last packet, corrected by its estimated error."""
        return None if (p := self._packet) is None else (p.stamp, p.pose[:2] - self.mean[ERROR : ERROR + 2])

    def hear(self, pulse: Pulse) -> None:
        """Clones the pose for the pulse's packet; the oldest clone gives way where there are too many."""
        slot = min(range(len(self._pulses)), key=lambda k: -1 if (p := self._pulses[k]) is None else p.number)
        self._pulses[slot] = pulse
        clone(self.mean, self.covariance, CLONES + 3 * slot, 0)
        if (packet := self._packet) is not None and packet.number == pulse.number:  # it was faster than its pulse
            self._pulses[slot] = None
            self._use(slot, pulse, packet.pose, packet)

    def receive(self, packet: Packet) -> None:
        """Moves the leader's error on, and uses the pulses up to that of the packet."""
        before = self._packet
        if before is not None and packet.number <= before.number:
            return  # its pulse was used already
        if before is None:
            replace(self.mean, self.covariance, ERROR, np.zeros(3), packet.covariance)
        else:
            self._move_error(before, packet)
        self._packet = packet
        due = [k for k, p in enumerate(self._pulses) if p is not None and p.number <= packet.number]
        for slot in sorted(due, key=lambda k: _number(self._pulses[k])):
            pulse, self._pulses[slot] = self._pulses[slot], None
            if pulse is not None and pulse.number == packet.number:
                self._use(slot, pulse, packet.pose, packet)
            elif pulse is not None and before is not None and self._interpolated:
                self._use(slot, pulse, interpolated(before, packet, pulse.emitted), packet)

    def _move_error(self, before: Packet, packet: Packet) -> None:
        east, north = packet.pose[1] - before.pose[1], packet.pose[0] - before.pose[0]
        e = self.mean[ERROR : ERROR + 3]
        e[0] -= east * e[2]
        e[1] += north * e[2]
        transport(self.covariance, ERROR, north, east)
        known = before.covariance.copy()
        transport(known, 0, north, east)
        gained = packet.covariance - known
        values, vectors = np.linalg.eigh(0.5 * (gained + gained.T))
        if values[0] < -1e-3 * np.abs(values).max() - 1e-9:  # a fix of its own: its error has begun anew
            replace(self.mean, self.covariance, ERROR, np.zeros(3), packet.covariance)
            return
        self.covariance[ERROR : ERROR + 3, ERROR : ERROR + 3] += (vectors * np.maximum(values, 0.0)) @ vectors.T

    def _use(self, slot: int, pulse: Pulse, leader: Array, packet: Packet) -> None:
        """A pulse seen from its clone, the leader's error taken back from the packet's time to the pulse's."""
        at = CLONES + 3 * slot
        north, east = packet.pose[:2] - leader[:2]
        back = np.array([[1.0, 0.0, east], [0.0, 1.0, -north]])  # of the error, (2, 3)
        place = leader[:2] - back @ self.mean[ERROR : ERROR + 3]
        if (found := seen(pulse, self.mean[at : at + 3], place)) is None:
            return
        J = np.zeros((2, self.mean.size))  # of the vector from the follower to the leader
        J[:, at : at + 2], J[:, ERROR : ERROR + 3] = -np.eye(2), -back
        if self._bends:
            found = curved(found, pulse, J @ self.covariance @ J.T)
        H = found.by_leader @ J
        H[:, at + 2] = found.by_follower[:, 2]
        R = found.covariance
        if leader is not packet.pose:
            R = R + self._interpolation_variance * found.by_leader @ found.by_leader.T
        self.correct(H, found.residual, R, pulse.number)


def interpolated(before: Packet, after: Packet, time: float) -> Array:
    """Leader's pose (3,) between two packets: cubic Hermite, with their velocities."""
    T = after.stamp - before.stamp
    s = (time - before.stamp) / T
    tangents = [T * p.speed * np.array([np.cos(p.pose[2]), np.sin(p.pose[2])]) for p in (before, after)]
    place = (
        (1.0 + 2.0 * s) * (1.0 - s) ** 2 * before.pose[:2]
        + s * (1.0 - s) ** 2 * tangents[0]
        + s * s * (3.0 - 2.0 * s) * after.pose[:2]
        - s * s * (1.0 - s) * tangents[1]
    )
    return np.array([*place, before.pose[2] + s * wrap(after.pose[2] - before.pose[2])])


def _number(pulse: Pulse | None) -> int:
    return -1 if pulse is None else pulse.number
