"""Wald's sequential probability ratio test of a success rate (Wald 1945), with an end."""

import math
from collections.abc import Iterable

from auvsim.stress.settings import EdgeSettings


def decided(settings: EdgeSettings, outcomes: Iterable[bool]) -> bool | None:
    """Whether the success rate is good enough, by the first outcomes that decide it; None while more are needed.

    A rate of `above` or more is called too low, and one of `below` or less good enough, in at most a share `error` of
    tests, as far as these end before `most` outcomes.
    """
    limit = math.log((1.0 - settings.error) / settings.error)
    up = math.log(settings.above / settings.below)
    down = math.log((1.0 - settings.above) / (1.0 - settings.below))
    ratio, successes = 0.0, 0
    for count, success in enumerate(outcomes, 1):
        ratio += up if success else down
        successes += success
        if abs(ratio) >= limit:
            return ratio > 0.0
        if count >= settings.most:
            return successes >= indifferent(settings) * count
    return None


def indifferent(settings: EdgeSettings) -> float:
    """The success rate at which the test goes either way: the edge."""
    up = math.log(settings.above / settings.below)
    down = math.log((1.0 - settings.below) / (1.0 - settings.above))
    return down / (up + down)
