"""Manoeuvres that make a worst formation observable: places of leaders over time, in the frame of the moving formation.

A line of leaders through the follower tells nothing across it. A line a little aside tells how far it is, but not on
which side: the follower's mirror image has the same ranges, and a filter that has drifted there is held there, the
surer the more it is told. Leaders on alternate sides leave no such image: the squares of (e^2 - 2 e d_i) / (2 r_i),
summed over leaders at distances r_i with offsets d_i, have a second minimum in the error e only where the offsets are
much alike.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from estimators.core.errors import ParameterError
from estimators.core.types import Array

Manoeuvre = Callable[[float], Array]  # time [s] -> places of the leaders from the follower's station (n, 2) [m]


def hold(leaders: ArrayLike) -> Manoeuvre:
    """Leaders that keep their places."""
    places = np.array(leaders, dtype=float)
    return lambda time: places


def stagger(leaders: ArrayLike, offset: float) -> Manoeuvre:
    """Leaders set to alternate sides of their line by an offset [m]."""
    places = np.array(leaders, dtype=float)
    signs = np.where(np.arange(len(places)) % 2 == 0, 1.0, -1.0)
    staggered = places + offset * signs[:, None] * _across(places)
    return lambda time: staggered


def aside(leaders: ArrayLike, offset: float) -> Manoeuvre:
    """Leaders all set to one side of the follower by an offset [m], where its mirror image is two offsets away."""
    places = np.array(leaders, dtype=float)
    shifted = places + offset * _across(places)
    return lambda time: shifted


def weave(leaders: ArrayLike, amplitude: float, period: float) -> Manoeuvre:
    """Leaders that swing across their line, each a phase apart from the next.

    Raises:
        ParameterError: The period is not above 0.
    """
    if not period > 0.0:
        raise ParameterError(f"period {period} s must be above 0")
    places = np.array(leaders, dtype=float)
    phases = 2.0 * math.pi * np.arange(len(places)) / len(places)

    def at(time: float) -> Array:
        swing = amplitude * np.sin(2.0 * math.pi * time / period + phases)
        return places + swing[:, None] * _across(places)

    return at


def rotating_line(leaders: ArrayLike, rate: float) -> Manoeuvre:
    """A line of leaders that turns about the follower at a rate [rad/s], clockwise if positive."""
    places = np.array(leaders, dtype=float)

    def at(time: float) -> Array:
        c, s = math.cos(rate * time), math.sin(rate * time)
        return places @ np.array([[c, s], [-s, c]])

    return at


def greatest_speed(manoeuvre: Manoeuvre, duration: float, step: float = 1.0) -> float:
    """The greatest speed of any leader relative to the formation [m/s]: whether vehicles can do it."""
    places = np.array([manoeuvre(time) for time in np.arange(0.0, duration + step, step)])
    return float(np.linalg.norm(np.diff(places, axis=0), axis=-1).max() / step)


def mirrored(place: ArrayLike, leaders: ArrayLike) -> Array:
    """The mirror image of places (..., 2) across the leaders' line of best fit through their centre."""
    leaders = np.asarray(leaders, dtype=float)
    centre, across = leaders.mean(axis=0), _across(leaders)
    away = np.asarray(place, dtype=float) - centre
    return centre + away - 2.0 * (away @ across)[..., None] * across


def _across(places: Array) -> Array:
    """Unit vector (2,) across the line of best fit."""
    return np.linalg.svd(places - places.mean(axis=0))[2][1]
