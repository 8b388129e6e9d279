"""Extended Kalman filters that take a late pulse or packet as if it were of now (Yao et al. 2011, sec. 5)."""

from typing import Literal

import numpy as np

from estimators.core.types import Array, Gaussian
from estimators.path_prediction.follower import Follower
from estimators.path_prediction.messages import Noise, Packet, Pulse, seen


class DelayIgnoringFilter(Follower):
    """An extended Kalman filter without a notion of delay.

    Args:
        pairing: What is taken to be of now. "packet": at a packet, its pose and the range of its own pulse (E2);
            "pulse": at a pulse, the pose of the last packet (E1).
        range_offset: Left in every range [m]: the sound path of the mean detection delay (E3).
    """

    def __init__(
        self,
        start: Gaussian,
        noise: Noise,
        *,
        pairing: Literal["packet", "pulse"] = "packet",
        range_offset: float = 0.0,
    ) -> None:
        super().__init__(start, noise)
        self._pairing, self._offset = pairing, range_offset
        self._pulses: dict[int, Pulse] = {}
        self._packet: Packet | None = None

    @property
    def leader(self) -> tuple[float, Array] | None:
        """Leader's pose as the last packet says."""
        return None if self._packet is None else (self._packet.stamp, self._packet.pose[:2])

    def hear(self, pulse: Pulse) -> None:
        """Uses a pulse with the last packet, or keeps it for its own."""
        packet = self._packet
        if packet is not None and (self._pairing == "pulse" or packet.number == pulse.number):
            self._use(pulse, packet)
        elif self._pairing == "packet":
            self._pulses[pulse.number] = pulse

    def receive(self, packet: Packet) -> None:
        """Uses a packet with its own pulse, if that was heard."""
        if self._packet is None or packet.number > self._packet.number:
            self._packet = packet
        if packet.number in self._pulses:
            self._use(self._pulses.pop(packet.number), packet)
        self._pulses = {n: p for n, p in self._pulses.items() if n > packet.number - 100}

    def _use(self, pulse: Pulse, packet: Packet) -> None:
        pulse = pulse._replace(range=pulse.range + self._offset)
        if (found := seen(pulse, self.mean, packet.pose)) is not None:
            R = found.covariance + found.by_leader @ packet.covariance[:2, :2] @ found.by_leader.T
            self.correct(np.ascontiguousarray(found.by_follower), found.residual, R, pulse.number)
