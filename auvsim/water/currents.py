"""Builds the current field that settings describe, and offers the kinds of field by name."""

from numpy.random import Generator

from auvsim.water.boundary_layer import BoundaryLayer
from auvsim.water.field import CurrentField, ProgressListener, Water, horizontal, listeners
from auvsim.water.grid import Grid
from auvsim.water.gust import GUST_CORRELATION, Gust
from auvsim.water.knots import Knots
from auvsim.water.settings import (
    ApproachTurnSettings,
    BoundaryLayerSettings,
    CurrentSettings,
    GridSettings,
    GustSettings,
    KnotsSettings,
    NoneSettings,
    ShearSettings,
    SumSettings,
    TurningSettings,
    UniformSettings,
    WakeSettings,
    WavesSettings,
)
from auvsim.water.shear import Shear
from auvsim.water.sums import Sum
from auvsim.water.turning import ApproachTurn, Turning
from auvsim.water.uniform import Uniform
from auvsim.water.wake import Wake
from auvsim.water.waves import Waves

__all__ = [
    "GUST_CORRELATION",
    "ApproachTurn",
    "BoundaryLayer",
    "CurrentField",
    "Grid",
    "Gust",
    "Knots",
    "ProgressListener",
    "Shear",
    "Sum",
    "Turning",
    "Uniform",
    "Wake",
    "Water",
    "Waves",
    "build_current",
    "listeners",
]


def build_current(settings: CurrentSettings, generator: Generator, duration: float) -> CurrentField:
    """The current field that the settings describe.

    Args:
        settings: One of the current kinds.
        generator: Source of everything random in it; each term of a sum gets a child of its own.
        duration: Time until which the field will be evaluated [s].

    Raises:
        InputError: A file of currents cannot be used.
    """
    match settings:
        case UniformSettings():
            return Uniform([*horizontal(settings.speed, settings.direction_deg), settings.down])
        case TurningSettings():
            return Turning(settings)
        case ApproachTurnSettings():
            return ApproachTurn(settings, generator)
        case KnotsSettings():
            return Knots(settings)
        case ShearSettings():
            return Shear(settings)
        case GustSettings():
            return Gust(settings, generator, duration)
        case BoundaryLayerSettings():
            return BoundaryLayer(settings)
        case WakeSettings():
            return Wake(settings)
        case WavesSettings():
            return Waves(settings, generator)
        case GridSettings():
            return Grid.read(settings, duration)
        case SumSettings():
            children = generator.spawn(len(settings.terms))
            return Sum([build_current(*pair, duration) for pair in zip(settings.terms, children, strict=True)])
        case NoneSettings():
            return Uniform([0.0, 0.0, 0.0])
