"""What holds a speed through the water straight ahead: a shaft speed, or a force and moment of thrusters."""

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from auvsim.base.frames import Array
from auvsim.physics.planar_fit import Level, fit_planar_model
from auvsim.vehicles import library, model_files
from auvsim.vehicles.actuation import Thrusters, Wrench


class Propulsion(NamedTuple):
    """How a vehicle is driven ahead."""

    ahead: Callable[[float], Any]  # demand that holds a speed through the water >= 0 [m/s]
    holds: Callable[[float], bool]  # whether its actuators reach that demand


def propulsion(model: str, speed: float, density: float) -> Propulsion:
    """How a vehicle is driven ahead: by its planar model's shaft speed, or by thrusters against the drag of its hull.

    Args:
        model: name in models/, or the path of an MJCF file.
        speed: at which the planar model of one with a shaft is fitted [m/s].
        density: of the water [kg/m3].

    Raises:
        InputError: the vehicle cannot be used, or not at that speed.
    """
    actuation = library.actuation(model)
    if isinstance(actuation, Thrusters):
        level = _level(model, *model_files.source("vehicle", model), density)
        return Propulsion(
            ahead=lambda wanted: Wrench(*(-drag(level, wanted)).tolist()),
            holds=lambda wanted: bool(np.all(actuation.shares(-drag(level, wanted)) <= 1.0)),
        )
    fitted = fit_planar_model(model, speed, density)
    return Propulsion(
        ahead=lambda wanted: actuation.at_speed(fitted.shaft_speed_for(wanted)),
        holds=lambda wanted: fitted.shaft_speed_for(wanted) <= actuation.shaft_limit,
    )


def drag(level: Level, speed: float) -> Array:
    """Force and moment (6,) on a level vehicle that moves ahead, its thrusters at rest [N, N m]."""
    return level.resistance((speed, 0.0, 0.0, 0.0, 0.0, 0.0))


@lru_cache(maxsize=16)
def _level(model: str, path: Path, text: str, density: float) -> Level:
    """The vehicle alone; its file and text are keys of the cache."""
    return Level(model, density)
