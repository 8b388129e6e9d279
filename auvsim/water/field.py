"""The contract of a current field: velocity, its time derivative and its gradient at any time and place, in NED.

A current is where the water flows TO. Every field is continuous; its derivative and gradient are exact, so that the
material acceleration of the water, which pushes on a body, is right.
"""

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from auvsim.base.frames import Array


@dataclass(frozen=True, kw_only=True, slots=True)
class Water:
    """The water at one time and place. Fields may share arrays: read them, do not write them."""

    velocity: Array  # (3,) NED [m/s]
    derivative: Array  # (3,) partial derivative of the velocity in time [m/s^2]
    gradient: Array  # (3, 3) dv_i / dx_j [1/s]


class CurrentField(Protocol):
    """Water velocity as a function of time and place."""

    @property
    def steady_uniform(self) -> bool:
        """True if one evaluation holds for all times and places."""
        ...

    def evaluate(self, time: float, position: Array) -> Water:
        """The water at a time [s] and a position (3,) in NED [m]."""
        ...


@runtime_checkable
class ProgressListener(Protocol):
    """A field that depends on how far a vehicle's docking attempt has come."""

    def approach(self, attempt: int, distance: float, time: float) -> None:
        """Reports the vehicle's distance [m] from the dock on the approach of an attempt (from 1)."""
        ...


@runtime_checkable
class Composite(Protocol):
    """A field made of others."""

    @property
    def terms(self) -> tuple[CurrentField, ...]:
        """The fields that it adds."""
        ...


def terms(field: CurrentField) -> tuple[CurrentField, ...]:
    """The fields of which a field is the sum, down to those that are no sums; of any other, itself."""
    if isinstance(field, Composite):
        return tuple(part for term in field.terms for part in terms(term))
    return (field,)


def listeners(field: CurrentField) -> tuple[ProgressListener, ...]:
    """Parts of a field that depend on how docking attempts proceed; most fields have none."""
    return tuple(part for part in terms(field) if isinstance(part, ProgressListener))


ZERO, ZERO_GRADIENT = np.zeros(3), np.zeros((3, 3))
ZERO.setflags(write=False)
ZERO_GRADIENT.setflags(write=False)


def horizontal(speed: float, direction_deg: float) -> tuple[float, float]:
    """North and east velocity [m/s] of a flow to a direction [deg], clockwise from north."""
    direction = math.radians(direction_deg)
    return speed * math.cos(direction), speed * math.sin(direction)
