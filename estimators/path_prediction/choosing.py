"""A follower that chooses between SC-EKF and SC-RT by how well each has foretold the pulses.

SC-RT is better as long as the leader goes where it is predicted to go, SC-EKF when it turns and packets are lost. Each
runs by itself; the odds are the likelihood ratio of the pulses that both have used, tempered because errors along a run
are correlated, fading so that a leader may change its ways, and bounded for each pulse: where both have lost their
heading, one pulse that surprises one of them says nothing of which is nearer.
"""

import math

import numpy as np

from estimators.core.types import Array, Gaussian
from estimators.path_prediction.cloning import CloningFilter
from estimators.path_prediction.follower import Follower
from estimators.path_prediction.messages import Packet, Pulse
from estimators.path_prediction.real_time import RealTimeFilter

FADING = 0.99  # of the evidence, a pulse
TEMPER = 0.3  # of the likelihood
LARGEST = 2.0  # log-likelihood ratio of one pulse
PRIOR = -1.0  # log-odds of SC-EKF over SC-RT: it has foretold a pulse with a packet more
SATURATED = 50.0  # log-odds beyond which the weight no longer changes


class ChoosingFilter(Follower):
    """The mixture of both filters' beliefs, weighted by their odds.

    Args:
        cloning: SC-EKF.
        real_time: SC-RT, with the same start and noise.
    """

    def __init__(self, cloning: CloningFilter, real_time: RealTimeFilter) -> None:
        self.time = cloning.time  # it has no joint belief of its own, only `belief`
        self.members = (cloning, real_time)
        self._evidence = 0.0  # fading sum of log-likelihood ratios

    @property
    def weight(self) -> float:
        """Of SC-EKF; that of SC-RT is the rest of 1."""
        odds = TEMPER * self._evidence + PRIOR
        return 1.0 / (1.0 + math.exp(-min(max(odds, -SATURATED), SATURATED)))

    @property
    def belief(self) -> Gaussian:
        """Mean and covariance of the mixture."""
        beliefs: list[Gaussian] = [member.belief for member in self.members]
        weights = (w := self.weight, 1.0 - w)
        mean = sum((w * b.mean for w, b in zip(weights, beliefs, strict=True)), np.zeros(3))
        spread = [b.mean - mean for b in beliefs]
        parts = (w * (b.covariance + np.outer(d, d)) for w, b, d in zip(weights, beliefs, spread, strict=True))
        return Gaussian(mean=mean, covariance=sum(parts, np.zeros((3, 3))))

    @property
    def leader(self) -> tuple[float, Array] | None:
        """Leader's pose as the member of the larger weight has it."""
        return self.members[self.weight < 0.5].leader

    def advance(self, time: float, speed: float, yaw_rate: float) -> None:
        """Both."""
        for member in self.members:
            member.advance(time, speed, yaw_rate)
        self.time = time

    def hear(self, pulse: Pulse) -> None:
        """Both."""
        for member in self.members:
            member.hear(pulse)
        self._judge()

    def receive(self, packet: Packet) -> None:
        """Both."""
        for member in self.members:
            member.receive(packet)
        self._judge()

    def _judge(self) -> None:
        """Takes the evidence of pulses that both have used by now, once."""
        one, other = (member.fit for member in self.members)
        for number in sorted(one.keys() & other.keys()):
            ratio = one.pop(number) - other.pop(number)
            self._evidence = FADING * self._evidence + min(max(ratio, -LARGEST), LARGEST)
