"""Modems of docks and beacons in a run: they stay where they are, and tell the place that a chart has for them."""

import math

import numpy as np
from numpy.random import Generator

from auvsim.acoustics.modems import Equipment
from auvsim.acoustics.payload import StateReport
from auvsim.base.frames import rotation
from auvsim.simulation.scenario_settings import FixedModem


class FixedStation:
    """A modem at a fixed place.

    Args:
        settings: Of the modem, and where it is.
        generator: Of the error of its place on the chart, for this run.
    """

    def __init__(self, settings: FixedModem, generator: Generator) -> None:
        s = settings
        point = np.array(s.place) + rotation(0.0, 0.0, s.heading) @ np.array(s.modem.transducer)
        north, east, down = point.tolist()
        self.equipment = Equipment(s.modem, s.clock, ((north, east, down), s.heading), s.key)
        error = s.chart * generator.standard_normal(2)
        self._charted = north + float(error[0]), east + float(error[1]), down, math.remainder(s.heading, math.tau)
        self._variance = s.chart**2

    def report(self, stamp: float) -> StateReport:
        """What it tells: the place on the chart, at rest, with the chart's variance."""
        v = self._variance
        return StateReport(stamp, *self._charted, 0.0, 0.0, 0.0, v, 0.0, 0.0, v, 0.0, 0.0)
