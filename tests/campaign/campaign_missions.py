"""Missions of one's own in campaigns."""

from typing import ClassVar

import numpy as np

from auvsim.control.controller import Setpoints
from auvsim.missions.mission import Metric, Mission


class Wait(Mission):
    """Holds depth and heading for some time."""

    phases = ("begin", "end")
    columns: ClassVar = {
        "calm": Metric("bool", "1", "whether it stayed within a metre of its depth"),
        "deepest": Metric("float", "m", "largest depth"),
        "halves": Metric("int", "1", "halves of the time that have begun"),
        "mood": Metric("str", "", "in words"),
    }

    def __init__(self, setup) -> None:
        super().__init__(setup)
        self._heading, self._depth, self._time = setup.heading, setup.depth, setup.settings["time"]

    def update(self, now):
        """As at the start."""
        self.phase = int(now.time > self._time / 2.0)
        self.finished = now.time >= self._time
        return Setpoints(self._heading, self._depth, 1.0)

    @classmethod
    def metrics(cls, log):
        """From the truth, as NumPy has them."""
        depth = log["truth"]["position"][:, 2]
        halves = 1 + log["mission"]["phase"][-1]
        return {"calm": np.ptp(depth) < 1.0, "deepest": depth.max(), "halves": halves, "mood": "good"}


class Vague(Wait):
    """Gives a text for a number."""

    @classmethod
    def metrics(cls, log):
        """With the wrong type."""
        return {**super().metrics(log), "deepest": "deep"}


class Silent(Wait):
    """Fails where it is to say how it was."""

    @classmethod
    def metrics(cls, log):
        """Raises."""
        raise KeyError("no such group")


class Clashing(Wait):
    """Declares a column that every table has."""

    columns: ClassVar = {"trial": Metric("int", "1", "of patience")}
