"""The delayed extended Kalman filter: a range is used at its packet, at the place where the follower had been then."""

import math
from typing import NamedTuple

import numpy as np

from estimators.core.types import Array, Gaussian
from estimators.path_prediction.follower import Follower
from estimators.path_prediction.kinematics import odometry_covariance
from estimators.path_prediction.messages import Noise, Packet, Pulse, seen


class _Heard(NamedTuple):
    pulse: Pulse
    track: Array  # (3,) raw odometry's pose at the detection


class DelayedFilter(Follower):
    """DEKF: goes back by the raw odometry, turned to the present heading, and corrects the present pose.

    The back-propagated place is p_d = p - R(heading - raw heading) (raw p - raw p_d). A range whose packet is lost is
    not used.

    Args:
        gap_noise: Whether the odometry's noise since the detection adds to the range's.
    """

    def __init__(self, start: Gaussian, noise: Noise, *, gap_noise: bool = True) -> None:
        super().__init__(start, noise)
        self._gap_noise = gap_noise
        self._track = np.array(start.mean, dtype=float)
        self._speed = 0.0
        self._heard: dict[int, _Heard] = {}
        self._packet: Packet | None = None

    @property
    def leader(self) -> tuple[float, Array] | None:
        """Leader's pose as the last packet says."""
        return None if self._packet is None else (self._packet.stamp, self._packet.pose[:2])

    def advance(self, time: float, speed: float, yaw_rate: float) -> None:
        """Moves the belief and the raw odometry on."""
        h, track = time - self.time, self._track
        super().advance(time, speed, yaw_rate)
        self._speed = speed
        track[0] += h * speed * math.cos(track[2])
        track[1] += h * speed * math.sin(track[2])
        track[2] += h * yaw_rate

    def hear(self, pulse: Pulse) -> None:
        """Keeps a pulse for its packet, or uses it if that was faster."""
        heard = _Heard(pulse, self._track.copy())
        if self._packet is not None and self._packet.number == pulse.number:
            self._use(heard, self._packet)
        else:
            self._heard[pulse.number] = heard

    def receive(self, packet: Packet) -> None:
        """Uses a packet with its own pulse, if that was heard."""
        if self._packet is None or packet.number > self._packet.number:
            self._packet = packet
        heard = self._heard.pop(packet.number, None)
        self._heard = {n: h for n, h in self._heard.items() if n > packet.number - 100}
        if heard is not None:
            self._use(heard, packet)

    def _use(self, heard: _Heard, packet: Packet) -> None:
        north, east = self._track[:2] - heard.track[:2]
        turn = self.mean[2] - self._track[2]
        c, s = math.cos(turn), math.sin(turn)
        gone = np.array([c * north - s * east, s * north + c * east])  # since the detection, in the present frame
        then = np.array([*(self.mean[:2] - gone), heard.track[2] + turn])
        if (found := seen(heard.pulse, then, packet.pose)) is None:
            return
        back = np.eye(3)  # derivative of the pose then by the pose now
        back[0, 2], back[1, 2] = gone[1], -gone[0]
        R = found.covariance + found.by_leader @ packet.covariance[:2, :2] @ found.by_leader.T
        if self._gap_noise:
            gap = odometry_covariance(then[2], self._speed, self.time - heard.pulse.detected, *self.noise)
            R = R + found.by_follower @ gap @ found.by_follower.T
        self.correct(found.by_follower @ back, found.residual, R, heard.pulse.number)
