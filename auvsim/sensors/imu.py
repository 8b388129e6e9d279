"""A strapdown inertial measurement unit: three gyros and three accelerometers."""

import math
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator
from pydantic import Field

from auvsim.base.frames import Array, rotation
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import Truth
from auvsim.sensors.sensor import Sensor, Surroundings

GRAVITY = np.array((0.0, 0.0, 9.80665))  # standard, NED [m/s2]


class ImuSettings(Settings):
    """An inertial unit whose errors are white noise, a bias that walks, and a scale of each axis.

    The gyros' defaults are those of `gyro`; the accelerometers' are of the same class: 0.07 mg/sqrt(Hz), 1 mg.
    """

    enabled: bool = Field(default=True, description="whether the vehicle has it")
    rate: float = Field(default=10.0, gt=0.0, description="readings per second, divides the control rate [Hz]")
    gyro_noise_density_deg: float = Field(default=0.005, ge=0.0, description="angular random walk [deg/sqrt(s)]")
    gyro_bias_deg: float = Field(default=0.005, ge=0.0, description="bias at the start of a trial, sd [deg/s]")
    gyro_bias_walk_deg: float = Field(default=5e-5, ge=0.0, description="random walk of that bias [deg/s^1.5]")
    gyro_scale_error: float = Field(
        default=1e-3, ge=0.0, le=0.1, description="scale error of a trial, each axis, sd [-]"
    )
    noise_density: float = Field(default=7e-4, ge=0.0, description="velocity random walk [m/s^1.5]")
    bias: float = Field(default=0.01, ge=0.0, description="accelerometers' bias at the start of a trial, sd [m/s2]")
    bias_walk: float = Field(default=1e-5, ge=0.0, description="random walk of that bias [m/s^2.5]")
    scale_error: float = Field(
        default=1e-3, ge=0.0, le=0.1, description="scale error of a trial, each accelerometer, sd [-]"
    )


class Imu(Sensor):
    """Measures angular velocity [rad/s], then specific force [m/s2], (6,) in the body's axes; 12 normals a reading.

    Each is the mean over the interval since the last reading, as of a unit that sums its increments: the turn of the
    hull, and the change of its velocity over ground less gravity's, at the body's origin. So the sum of readings is
    the true motion, whatever their rate. A reading needs one before it: the first gives nothing.
    """

    kind, Settings = "imu", ImuSettings
    value = Variable(
        ("rates_and_forces",), "float64", "rad/s, m/s2", "angular velocity p, q, r, then specific force x, y, z", "body"
    )
    sizes: ClassVar = {"rates_and_forces": 6}

    def __init__(self, settings: ImuSettings, generator: Generator, **of_instance: Any) -> None:
        super().__init__(settings, generator, **of_instance)
        root, s = math.sqrt(settings.rate), settings
        draws = np.array(self._noise.normals(12))
        self.bias = _six(math.radians(s.gyro_bias_deg), s.bias) * draws[:6]  # (6,) now [rad/s, m/s2]
        self.scale = 1.0 + _six(s.gyro_scale_error, s.scale_error) * draws[6:]  # (6,) of this trial [-]
        self._white = _six(math.radians(s.gyro_noise_density_deg), s.noise_density) * root
        self._walk = _six(math.radians(s.gyro_bias_walk_deg), s.bias_walk) / root
        self._before: Truth | None = None

    def measure(self, truth: Truth, world: Surroundings) -> Reading | None:
        """The means since the last reading; None at the first."""
        draws = np.array(self._noise.normals(12))
        self.bias = self.bias + self._walk * draws[:6]
        before, self._before = self._before, truth
        if before is None:
            return None
        exact = _increments(before, truth) / (truth.time - before.time)
        return self._reading(truth.time, self.scale * exact + self.bias + self._white * draws[6:])


def _six(gyro: float, accelerometer: float) -> Array:
    return np.repeat((gyro, accelerometer), 3)


def _increments(before: Truth, now: Truth) -> Array:
    """Turn [rad] and change of velocity less gravity's [m/s] (6,) between two truths, in the axes half-way."""
    from scipy.spatial.transform import Rotation

    first, last = (Rotation.from_matrix(rotation(*truth.attitude.tolist())) for truth in (before, now))
    turn = (first.inv() * last).as_rotvec()
    velocities = last.apply(now.nu[:3]) - first.apply(before.nu[:3]) - GRAVITY * (now.time - before.time)
    middle = first * Rotation.from_rotvec(0.5 * turn)
    return np.concatenate((turn, middle.inv().apply(velocities)))
