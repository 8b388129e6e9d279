"""The process that all estimators of this package share: a unicycle whose speed and turn rate odometry shows wrong."""

from dataclasses import dataclass

import numpy as np

from estimators.core.models.motion import unicycle, with_error, with_input_error
from estimators.core.models.process import MotionProcess
from estimators.core.types import Gaussian

MOTION = with_input_error(with_input_error(unicycle(), "speed", "bias"), "turn_rate", "bias")
# States after those five: by which frames show too long a way, how far aside for each metre [-], and turned [rad/m].
RELIEF = ("frame_scale", "frame_skew", "frame_turn")
ARM = 20.0  # frame_scale differs by about itself over this distance across, which turns frames [m]
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

    def process(self, relief: float = 0.0, relief_time: float = np.inf) -> MotionProcess:
        """Of states north, east [m], heading [rad], speed_bias [m/s], turn_rate_bias [rad/s].

        Args:
            relief: Standard deviation of the first two of the states `RELIEF`; 0: there are none.
            relief_time: Time constant with which those decay [s].
        """
        motion, noise = MOTION, {"speed_bias": self.speed_walk**2, "turn_rate_bias": self.turn_rate_walk**2}
        for name in RELIEF if relief else ():
            motion = with_error(motion, name, "1", time_constant=relief_time if np.isfinite(relief_time) else None)
            deviation = relief / ARM if name == "frame_turn" else relief
            noise[name] = 2.0 * deviation**2 / relief_time
        return MotionProcess(motion, noise, input_noise={"speed": self.speed**2, "turn_rate": self.turn_rate**2})

    def start(self, pose: Gaussian, relief: float = 0.0) -> Gaussian:
        """A belief of the states of `process` from one of the pose (3)."""
        errors = [self.speed_bias, self.turn_rate_bias, *([relief, relief, relief / ARM] if relief else [])]
        covariance = np.zeros((3 + len(errors), 3 + len(errors)))
        covariance[POSE, POSE] = pose.covariance
        covariance[3:, 3:] = np.diag(np.square(errors))
        return Gaussian(mean=np.concatenate((pose.mean, np.zeros(len(errors)))), covariance=covariance)
