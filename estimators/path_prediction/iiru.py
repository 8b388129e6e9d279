"""The incoordinate-interval real-time update, IIRU, as published (Yao et al. 2011, sec. 3 and 4)."""

import numpy as np

from estimators.core import loops
from estimators.core.types import Array, Gaussian
from estimators.path_prediction.follower import Follower
from estimators.path_prediction.kinematics import advance, advance_with_speed, replace
from estimators.path_prediction.messages import Noise, Packet, Pulse, Sight, seen
from estimators.path_prediction.statistics import FadingStatistics

LEADER = 3  # place of the leader's pose in the joint belief
STEP = 1.0  # longest step of the leader's prediction [s]


class IncoordinateIntervalFilter(Follower):
    """A follower with the leader's predicted pose in its state, frozen where the next pulse will leave.

    Args:
        start: Pose (3,) at the time 0.
        noise: Of the follower's odometry.
        leader_noise: Of the leader's; what its speed and yaw rate vary by before there are statistics.
        period: Of the pulses [s].
        forgetting: Of the statistics, b in eq. 10.
        full_gain: Whether S has the cross terms that eq. 16 leaves out.
        coupled: Whether leader and follower are one belief; else the reduced filter of sec. 4.4.
        varying_speed: Whether the leader's speed is a state, its acceleration white noise with the statistics of that
            broadcast (sec. 4.3).
        patience: Time after the emission at which a pulse counts as lost [s].
    """

    def __init__(
        self,
        start: Gaussian,
        noise: Noise,
        leader_noise: Noise,
        *,
        period: float = 10.0,
        forgetting: float = 0.95,
        full_gain: bool = False,
        coupled: bool = True,
        varying_speed: bool = False,
        patience: float = 6.0,
    ) -> None:
        super().__init__(start, noise, 7 if varying_speed else 6)
        self._leader_noise, self._period, self._patience = leader_noise, period, patience
        self._full, self._coupled, self._varies = full_gain, coupled, varying_speed
        self._yaw_rate = FadingStatistics(forgetting, leader_noise.yaw_rate)
        self._speed = FadingStatistics(forgetting, leader_noise.speed)
        self._acceleration = FadingStatistics(forgetting, leader_noise.speed / period)
        self._packet: Packet | None = None  # the newest one
        self._stamp = 0.0  # the time for which the leader's part is
        self._freeze = period  # the time at which it waits for a pulse

    @property
    def leader(self) -> tuple[float, Array] | None:
        """The leader's part and the time that it is for."""
        return None if self._packet is None else (self._stamp, self.mean[LEADER : LEADER + 2])

    def advance(self, time: float, speed: float, yaw_rate: float) -> None:
        """Case 1, eqs 12 and 13: the follower to now, the leader no farther than where it freezes."""
        super().advance(time, speed, yaw_rate)
        while time > self._freeze + self._patience:
            self._freeze += self._period
        if self._packet is not None:
            self._lead(min(time, self._freeze))

    def hear(self, pulse: Pulse) -> None:
        """Case 2, eqs 14 to 19."""
        freeze = pulse.emitted + self._period
        if self._packet is not None:
            if self._stamp > pulse.emitted + 1e-9:
                return  # the leader's part cannot go back
            self._lead(pulse.emitted)
            if (found := seen(pulse, self.mean, self.mean[LEADER:])) is not None:
                self._update(found, pulse.number)
            self._lead(min(self.time, freeze))
        self._freeze = max(self._freeze, freeze)

    def receive(self, packet: Packet) -> None:
        """Case 3, eqs 20 and 21; of one that comes after a newer one only the statistics are used (sec. 4.5)."""
        before = self._packet
        if before is None or packet.number > before.number:
            if before is None:
                self._stamp = max(packet.stamp, min(self.time, self._freeze))
            self._lead(max(self._stamp, packet.stamp))  # also beyond where it froze, if the pulse was lost
            self._fuse(packet, first=before is None)
            if before is not None:
                self._acceleration.update((packet.speed - before.speed) / (packet.stamp - before.stamp))
            self._packet = packet
        self._yaw_rate.update(packet.yaw_rate)
        self._speed.update(packet.speed)

    def _lead(self, time: float) -> None:
        """The leader's part to a time, by the statistics of what it broadcast."""
        while (h := min(time - self._stamp, STEP)) > 0.0 and self._packet is not None:
            w, q = self._yaw_rate.mean, self._yaw_rate.variance
            if self._varies:
                a = self._acceleration
                noise = a.variance * self._period  # of an acceleration that holds for a period
                advance_with_speed(self.mean, self.covariance, LEADER, a.mean, w, h, noise, q)
            else:
                advance(self.mean, self.covariance, LEADER, self._speed.mean, w, h, self._speed.variance, q)
            self._stamp += h

    def _fuse(self, packet: Packet, first: bool) -> None:
        """The packet, predicted in one step to the time of the leader's part, as a measurement of that part."""
        n, h = self.mean.size - LEADER, self._stamp - packet.stamp
        x, P = np.zeros(n), np.zeros((n, n))
        x[:3], P[:3, :3] = packet.pose, packet.covariance
        # A held yaw rate that is wrong by its noise is wrong all the way: the density grows with the duration.
        noise = Noise(*(q * max(h, STEP) for q in self._leader_noise))
        if self._varies:
            x[3], P[3, 3] = packet.speed, self._leader_noise.speed
            a = self._acceleration
            advance_with_speed(x, P, 0, a.mean, packet.yaw_rate, h, a.variance * self._period, noise.yaw_rate)
        else:
            advance(x, P, 0, packet.speed, packet.yaw_rate, h, *noise)
        if first:
            replace(self.mean, self.covariance, LEADER, x, P)
            return
        residual = x - self.mean[LEADER:]
        residual[2] = loops.wrap(residual[2])
        self.correct(np.hstack((np.zeros((n, LEADER)), np.eye(n))), residual, P)

    def _update(self, found: Sight, number: int) -> None:
        """Eqs 14 to 18; with `full_gain` and both parts in one belief the Kalman filter's."""
        H = np.zeros((found.residual.size, self.mean.size))
        H[:, :3], H[:, LEADER : LEADER + 2] = found.by_follower, found.by_leader
        if self._full and self._coupled:
            self.correct(H, found.residual, found.covariance, number)
            return
        P, f, m = self.covariance, found.by_follower, H[:, LEADER:]
        S = f @ P[:3, :3] @ f.T + m @ P[LEADER:, LEADER:] @ m.T + found.covariance  # eq. 16: no cross terms
        K = np.linalg.solve(S, H @ P).T
        if not self._coupled:
            K[LEADER:] = 0.0
        self.mean = self.mean + K @ found.residual
        P = P - K @ H @ P
        if not self._coupled:
            P[:LEADER, LEADER:], P[LEADER:, :LEADER] = 0.0, 0.0
        self.covariance = 0.5 * (P + P.T)
        self.note_fit(number, float(found.residual @ np.linalg.solve(S, found.residual)), S)
