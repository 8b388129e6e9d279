"""Noise and constant errors that a docking filter assumes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from estimators.core.errors import ParameterError
from estimators.core.types import Array
from estimators.planar.model import BIASES, Biases

AIDED = ("gyro", "dvl_surge", "dvl_sway", "range_", "light_")  # how the errors of `aids` are called


@dataclass(frozen=True, slots=True)
class Bias:
    """Prior of a constant error before it is estimated; units as in `planar_model.BIASES`."""

    deviation: float  # standard deviation of its first value
    density: float = 0.0  # of its random walk [its unit squared per second]


@dataclass(frozen=True, kw_only=True, slots=True)
class DockingNoise:
    """Noise that a docking filter assumes; process noise as power spectral densities.

    The defaults suit a planar model that was fitted to a vehicle: the process noise of its accelerations is ten times
    that of the reference study, in which truth and filter shared the model.
    """

    position: float = 4e-4  # [m^2/s]
    heading: float = 1e-6  # [rad^2/s]
    surge: float = 1e-4  # [m^2/s^3]
    sway: float = 1e-4  # [m^2/s^3]
    yaw_rate: float = 1e-5  # [rad^2/s^3]
    current: float = 3e-3  # random walk of the current [m^2/s^3]; 1e-5 suits a constant one and fails in turns
    compass: float = math.radians(1.0)  # standard deviation of a sample [rad]
    initial_surge: float = 0.1  # standard deviations at the first fix [m/s]
    initial_sway: float = 0.05  # [m/s]
    initial_yaw_rate: float = 0.05  # [rad/s]
    initial_current: float = 0.5 / math.sqrt(2.0)  # each component [m/s]
    biases: Mapping[str, Bias] = field(default_factory=dict)  # estimated besides, by the names of BIASES

    def __post_init__(self) -> None:
        unknown = [name for name in self.biases if name not in BIASES and not name.startswith(AIDED)]
        if unknown:
            raise ParameterError(f"no bias {', '.join(unknown)}; there are {', '.join((*BIASES, *AIDED))}")

    @property
    def bias_names(self) -> Biases:
        """The biases in the state, in their order there: those of BIASES, then those of `aids`."""
        first = [name for name in BIASES if name in self.biases]
        return (*first, *(name for name in self.biases if name not in BIASES))

    def densities(self) -> Array:
        """Power spectral densities (8,) in the order of the state, then one of each bias."""
        velocities = (self.surge, self.sway, self.yaw_rate)
        biases = [self.biases[name].density for name in self.bias_names]
        return np.array([self.position, self.position, self.heading, *velocities, self.current, self.current, *biases])


# The reference study's truth (Qiu and Li 2019; calibrated to its Table 1), with a current that hardly changes.
REFERENCE_NOISE = DockingNoise(position=4e-4, heading=1e-7, surge=1e-5, sway=1e-5, yaw_rate=1e-6, current=1e-8)
# For eq. 11's filter, whose covariance does not know the error of the current: position noise covers for it.
PAPER_NOISE = DockingNoise(position=2.5e-3, heading=1e-7, surge=1e-5, sway=1e-5, yaw_rate=1e-6, current=0.0)

# Errors of the model that are fixed to the vehicle and not to the world, and so are no current: thrust or drag by some
# tenth (3e-3 m/s^2 shift the REMUS-100's surge by 5 % at 0.8 m/s), and the compass.
BIASES_OF_VEHICLE = {"surge": Bias(3e-3), "compass": Bias(0.02)}
# For interacting modes, which bring the current's noise themselves: without and with these errors in the state.
INTERACTING_NOISE = replace(REFERENCE_NOISE, current=0.0)
ROBUST_NOISE = replace(INTERACTING_NOISE, biases=BIASES_OF_VEHICLE)
REGULAR_NOISE = replace(PAPER_NOISE, position=1.0)  # the best for a filter that knows neither current nor delay
