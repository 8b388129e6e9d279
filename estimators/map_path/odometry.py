"""The process that all estimators of this package share: a unicycle whose speed and turn rate odometry shows wrong."""

from dataclasses import dataclass

import numpy as np

from estimators.core.models.motion import unicycle, with_input_error
from estimators.core.models.process import MotionProcess
from estimators.core.types import Gaussian

MOTION = with_input_error(with_input_error(unicycle(), "speed", "bias"), "turn_rate", "bias")
POSE, ERRORS = slice(0, 3), slice(3, 5)  # of the states: north, east, heading; biases of speed and turn rate


@dataclass(frozen=True, kw_only=True, slots=True)
class OdometryNoise:
    """How odometry errs: a bias of the start, which walks, and white noise. One standard deviation each."""

    speed_bias: float = 0.12  # at the start [m/s]
    turn_rate_bias: float = np.radians(0.4)  # [rad/s]
    speed_walk: float = 0.005  # in 1 s [m/s]
    turn_rate_walk: float = np.radians(0.02)  # [rad/s]
    speed: float = 0.06  # white, averaged over 1 s [m/s]
    turn_rate: float = np.radians(0.18)  # [rad/s]

    def process(self) -> MotionProcess:
        """Of states north, east [m], heading [rad], speed_bias [m/s], turn_rate_bias [rad/s]."""
        walks = {"speed_bias": self.speed_walk**2, "turn_rate_bias": self.turn_rate_walk**2}
        return MotionProcess(MOTION, walks, input_noise={"speed": self.speed**2, "turn_rate": self.turn_rate**2})

    def start(self, pose: Gaussian) -> Gaussian:
        """A belief of the five states from one of the pose (3)."""
        covariance = np.zeros((5, 5))
        covariance[POSE, POSE] = pose.covariance
        covariance[3, 3], covariance[4, 4] = self.speed_bias**2, self.turn_rate_bias**2
        return Gaussian(mean=np.concatenate((pose.mean, (0.0, 0.0))), covariance=covariance)
