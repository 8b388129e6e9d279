"""Fisher information on parameters of the planar model that a history of rudder and shaft speed would give.

The vehicle is the planar model without noise, from a straight course in still water; its sensors have the white noise
of their settings, and constant errors that are not known. Fixes of position, rare and coarse beside a Doppler log, are
left out.
"""

import math
from typing import NamedTuple

import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.identification import compiled
from auvsim.identification.fit import DEFAULT_FREE, Nuisances, free_indices
from auvsim.simulation.sensor_settings import SensorSettings
from estimators.core.compiling import is_ready
from estimators.planar.model import PlanarParameters

STEP = 0.1  # of the model, and of inputs [s]
FIRST = (1.0, 1.0, 1.0, 1.0, 0.3, 0.3)  # deviations of the first north, east [m], heading [rad], u, v [m/s], r [rad/s]


def is_warm() -> bool:
    """Whether an experiment runs at once; if not, its first use compiles for some seconds."""
    return is_ready(compiled.information().accumulate)


class Progressed(NamedTuple):
    """Where a simulated experiment is, and what was learnt so far."""

    state: Array  # (6,) north, east [m], heading [rad], surge, sway [m/s], yaw rate [rad/s]
    sensitivity: Array  # (6, k + 4) of it by first heading and velocities and by the free parameters
    gathered: Array  # (k + 12, k + 12) information on first state, free parameters, constant errors: upper triangle
    reach: float  # largest distance from the start so far [m]


class Experiment:
    """Simulates histories of inputs and gathers their information.

    Args:
        parameters: The vehicle.
        sensors: Rates, noises and constant errors; those of DVL and gyro count whether enabled or not.
        free: Parameters to be found; their values must not be zero.
        share: Standard deviation of each beforehand, as a share of its value [-].

    Raises:
        InputError: A free parameter is unknown or zero, or a sensor has no noise.
    """

    def __init__(
        self,
        parameters: PlanarParameters,
        sensors: SensorSettings,
        free: tuple[str, ...] = DEFAULT_FREE,
        share: float = 1.0,
    ) -> None:
        self.parameters, self.free, self.share = parameters, free, share
        self._vector, self._free = parameters.vector(), free_indices(free).astype(np.int64)
        self.values = self._vector[self._free]  # (k,)
        if not self.values.all():
            zero = free[int(np.flatnonzero(self.values == 0.0)[0])]
            raise InputError(f"{zero} is zero: nothing can be a share of it; leave it out of the free parameters")
        self.weights = _weights(sensors)
        errors = Nuisances(
            gyro=math.radians(sensors.gyro.bias_deg),
            compass=math.radians(sensors.compass.heading_bias_deg),
            misalignment=math.radians(sensors.dvl.misalignment_deg),
            scale=sensors.dvl.scale_error,
        )
        # An error of zero is known: as good as none, without an infinite weight.
        self._prior = np.array([*FIRST, *np.maximum(errors.vector(), 1e-9)])
        self._loops = compiled.information()

    def start(self, surge: float) -> Progressed:
        """Straight ahead at a surge [m/s], with nothing learnt."""
        k = len(self.free)
        sensitivity = np.zeros((6, k + 4))
        sensitivity[2:, :4] = np.eye(4)
        return Progressed(np.array([0.0, 0.0, 0.0, surge, 0.0, 0.0]), sensitivity, np.zeros((k + 12, k + 12)), 0.0)

    def run(self, before: Progressed, inputs: Array) -> Progressed:
        """Goes on with inputs (n, 2), rudder [rad] and shaft speed [rad/s], each held for STEP; measures after each."""
        state, sensitivity, gathered = before.state.copy(), before.sensitivity.copy(), before.gathered.copy()
        inputs = np.ascontiguousarray(inputs, dtype=float)
        reach = self._loops.accumulate(
            state, sensitivity, gathered, inputs, self.weights, self._vector, self._free, STEP
        )
        return Progressed(state, sensitivity, gathered, max(before.reach, float(reach)))

    def information(self, progressed: Progressed) -> Array:
        """Information (k, k) on the free parameters, each as a share of its value, and of the prior.

        First state and constant errors, which are not asked for, are eliminated (Schur complement).
        """
        k = len(self.free)
        whole = np.triu(progressed.gathered) + np.triu(progressed.gathered, 1).T
        asked, rest = np.arange(6, 6 + k), np.r_[0:6, 6 + k : 12 + k]
        cross = whole[np.ix_(asked, rest)] * self.values[:, None]
        known = whole[np.ix_(rest, rest)] + np.diag(self._prior**-2)
        own = whole[np.ix_(asked, asked)] * np.outer(self.values, self.values)
        return own - cross @ np.linalg.solve(known, cross.T) + np.eye(k) / self.share**2

    def log_det(self, progressed: Progressed) -> float:
        """Natural logarithm of the determinant of `information`: what a D-optimal experiment maximises."""
        return float(np.linalg.slogdet(self.information(progressed))[1])

    def deviations(self, progressed: Progressed) -> Array:
        """Expected standard deviations (k,) of the free parameters as shares of their values (Cramer-Rao bound)."""
        return np.sqrt(np.diag(np.linalg.inv(self.information(progressed))))


def _weights(sensors: SensorSettings) -> Array:
    """Inverse deviations (8,) of the channels of `records.MEASURED` in one step, readings at their own rates."""
    compass, dvl, gyro = sensors.compass, sensors.dvl, sensors.gyro
    noises = (
        (math.inf, 1.0),  # no positions
        (math.inf, 1.0),
        (math.radians(compass.heading_noise_deg), compass.rate),
        *((noise, dvl.rate) for noise in dvl.water_noise[:2]),
        (math.radians(gyro.noise_density_deg) * math.sqrt(gyro.rate), gyro.rate),
        *((noise, dvl.rate) for noise in dvl.bottom_noise[:2]),
    )
    if min(noise for noise, _ in noises) <= 0.0:
        raise InputError("sensors without noise would tell everything; give compass, DVL and gyro noises above 0")
    return np.array([math.sqrt(STEP * rate) / noise for noise, rate in noises])
