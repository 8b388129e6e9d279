"""Odometry of a follower: means of DVL, compass and gyro between two updates of its estimator."""

import math
from collections.abc import Sequence

import numpy as np

from auvsim.base.alpha_beta import AlphaBeta
from auvsim.base.errors import InputError
from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.navigation.docking import DEPTH_GAINS
from auvsim.navigation.measurements import of_kind
from auvsim.navigation.navigator import NavigatorSetup
from auvsim.sensors.dvl import DvlSettings
from auvsim.sensors.gyro import GyroSettings

UNKNOWN = math.radians(1.0)  # compass bias assumed where no compass has a data sheet [rad]


class Odometry:
    """Speed through the water or over ground, heading and yaw rate: means of what arrived since the last update.

    Args:
        setup: Of the estimator.
        track: Components of a DVL's reading: those of its bottom or its water track.
    """

    def __init__(self, setup: NavigatorSetup, track: slice) -> None:
        self._dvls, self._gyros = of_kind(setup.sensors, DvlSettings), of_kind(setup.sensors, GyroSettings)
        self._track = track
        self.forward = self.starboard = self.yaw_rate = 0.0
        self.heading: float | None = None
        self.depth = AlphaBeta(*DEPTH_GAINS)
        self.known = False  # whether there is a speed yet

    def update(self, time: float, readings: Sequence[Reading]) -> None:
        """Takes readings, in order of arrival; what no sensor tells stays as it was."""
        headings: list[float] = []
        speeds, rates = [], []
        for reading in readings:
            if reading.sensor == "compass":
                headings.append(float(reading.value[0]))
            elif reading.sensor == "depth":
                self.depth.update(reading.stamp, float(reading.value[0]))
            elif reading.sensor in self._dvls:
                speeds.append(reading.value[self._track][:2])
            elif reading.sensor in self._gyros:
                rates.append(float(reading.value[2]))
        if headings:
            first = headings[0]
            mean = wrap(first + sum(wrap(h - first) for h in headings) / len(headings))
            self.heading = mean
        good = [speed for speed in speeds if np.isfinite(speed).all()]
        if good:
            self.forward, self.starboard = np.mean(good, axis=0).tolist()
            self.known = True
        if rates:
            self.yaw_rate = sum(rates) / len(rates)


def required(setup: NavigatorSetup, *needs: tuple[str, bool]) -> None:
    """Sees that a follower has a modem and somebody to hear, and what else its estimator needs.

    Args:
        setup: Of the estimator.
        needs: What is needed, and whether it is given.

    Raises:
        InputError: Something is missing.
    """
    heard = (
        "another vehicle, a structure or a beacon with a modem (vehicles.NAME.modem: {}), of which there is none",
        bool(setup.others),
    )
    for what, given in (("a modem (modem: {})", setup.modem is not None), heard, *needs):
        if not given:
            raise InputError(f"estimator '{setup.settings.kind}' of '{setup.vehicle}': needs {what}")


def planned_start(setup: NavigatorSetup) -> tuple[float, float]:
    """North and east [m] of the start, as the settings have it or else the plan."""
    s, (north, east) = setup.settings, setup.start
    return north if s.north is None else s.north, east if s.east is None else s.east
