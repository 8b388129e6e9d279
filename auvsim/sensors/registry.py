"""Registry of the sensors by kind."""

from collections.abc import Callable
from typing import Any

from numpy.random import Generator

from auvsim.base import plugins
from auvsim.base.errors import AuvsimError, InputError
from auvsim.data.variables import Variable
from auvsim.sensors.altimeter import Altimeter
from auvsim.sensors.compass import Compass
from auvsim.sensors.depth import Depth
from auvsim.sensors.dvl import Dvl
from auvsim.sensors.feedback import Feedback
from auvsim.sensors.fix import Fix
from auvsim.sensors.gps import Gps
from auvsim.sensors.gyro import Gyro
from auvsim.sensors.imaging_sonar import ImagingSonar
from auvsim.sensors.imu import Imu
from auvsim.sensors.light import Light
from auvsim.sensors.range import Range
from auvsim.sensors.sensor import Sensor
from auvsim.vehicles.library import Vehicle

STANDARD: tuple[type[Sensor], ...] = (Compass, Depth, Feedback, Dvl, Gyro)  # every vehicle has settings for them
OTHERS: tuple[type[Sensor], ...] = (Range, Fix, ImagingSonar, Altimeter, Gps, Imu, Light)
SENSORS: dict[str, type[Sensor]] = {sensor.kind: sensor for sensor in (*STANDARD, *OTHERS)}


def find(kind: str) -> Callable[..., Sensor]:
    """The class of a kind, or a user's own as `package.module:Class`.

    Raises:
        InputError: there is none.
    """
    return plugins.find("sensor", kind, SENSORS)


def build(kind: str, settings: Any, generator: Generator, *, name: str, vehicle: Vehicle) -> Sensor:
    """Makes a sensor of a vehicle.

    Args:
        kind: of the sensor.
        settings: an instance of its settings class; for a user's own, what stands under `settings`.
        generator: random stream of its noise.
        name: instance name.
        vehicle: model of the vehicle that carries it.

    Raises:
        InputError: there is no such kind, or a user's own cannot be made.
    """
    made = find(kind)
    try:
        sensor = made(settings, generator, name=name, vehicle=vehicle)
    except AuvsimError:
        raise
    except (Exception, SystemExit) as error:  # a user's class may fail in any way
        raise InputError(f"sensor '{name}' ({kind}) cannot be made: {type(error).__name__}: {error}") from error
    plugins.require(f"sensor '{name}' ({kind})", sensor, "name", "value", "sizes", "measure")
    if not isinstance(sensor.value, Variable):
        raise InputError(f"sensor '{name}' ({kind}): value is {sensor.value!r}, not the Variable that the log holds")
    return sensor
