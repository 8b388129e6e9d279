"""Decisions on an approach: whether it may begin, and what is wrong with one under way."""

import math
from typing import NamedTuple

from auvsim.missions.docking.relative import Relative
from auvsim.missions.docking.settings import DockingSettings

DEPTH_LENGTH = 8.0  # way on which the depth control takes a small error down to 1/e [m]
LEVEL_OUT = 15.0  # way before the mouth by which the vehicle is to be level [m]
NO_RETURN = 4.0  # distance before the mouth from which a vehicle no longer stops before it [m]
COMMITS = 6.0  # distance before the mouth at which it decides whether to go in [m]
PASSED = (
    2.5  # distance behind the latch at which it is passed, though friction in the funnel is no part of the model [m]
)
SLACK = 0.5  # depth error that is no reason to break off before the last metres [m]


class PredictedMiss(NamedTuple):
    """Where the nose will pass the mouth's plane: mean and standard deviation, across and below [m]."""

    cross: float
    below: float
    cross_deviation: float
    below_deviation: float

    def certain_beyond(self, radius: float, k: float = 1.0) -> bool:
        """Whether the nose passes outside of a radius [m] even if it is `k` deviations nearer than expected."""
        across = max(abs(self.cross) - k * self.cross_deviation, 0.0)
        down = max(abs(self.below) - k * self.below_deviation, 0.0)
        return math.hypot(across, down) > radius

    def chance_within(self, radius: float) -> float:
        """Probability that the nose passes within a radius [m] across, by the part of it that the depth leaves."""
        half = math.sqrt(max(radius**2 - self.below**2, 0.0))
        scale = math.sqrt(2.0) * max(self.cross_deviation, 1e-9)
        return 0.5 * (math.erf((half - self.cross) / scale) + math.erf((half + self.cross) / scale))


def predicted_miss(here: Relative, lookahead: float) -> PredictedMiss:
    """The miss at the mouth: errors of line of sight and of depth control decay with the way that is left.

    Line of sight turns a small error e into the course -e / lookahead, so that it falls by exp(-way / lookahead).

    Args:
        here: The vehicle before the mouth.
        lookahead: Of the line of sight [m].
    """
    way = max(-here.along, 0.0)
    return PredictedMiss(
        here.cross * math.exp(-way / lookahead),
        here.below * math.exp(-way / DEPTH_LENGTH),
        here.cross_deviation,
        here.below_deviation,
    )


def depth_within_reach(here: Relative, way: float, descent: float) -> bool:
    """Whether a depth error can be flown out on a way [m], at a slope [rad], before the last metres."""
    return abs(here.below) <= SLACK + max(way - LEVEL_OUT, 0.0) * math.tan(descent)


def above_or_below(below: float) -> str:
    """A depth error in words."""
    return f"{abs(below):.1f} m {'below' if below > 0.0 else 'above'} the dock"


def not_ready(here: Relative, distance: float, way: float, settings: DockingSettings) -> str | None:
    """What an approach from a gate lacks; None: nothing.

    Args:
        here: The vehicle.
        distance: Of the gate before the mouth [m].
        way: From there to the mouth through the water [m]: longer against a current, shorter with one.
        settings: Of the docking.
    """
    if not depth_within_reach(here, way, math.radians(settings.descent_deg)):
        return above_or_below(here.below)
    largest = 1.0 + 0.1 * distance
    if here.cross_deviation > largest:
        return f"position across the axis uncertain by {here.cross_deviation:.0f} m"
    return None


class SoFar(NamedTuple):
    """How an approach has gone."""

    silence: float  # time since a fix was last of use [s]
    uncertain: float  # time for which the last metres were more uncertain across the axis than the mouth is wide [s]
    final: float | None  # time since the last metres began [s]; None before
    last: bool  # whether nothing follows if this approach is broken off


def reason_to_break_off(
    here: Relative, so_far: SoFar, settings: DockingSettings, mouth_radius: float, latched: float
) -> str | None:
    """What is wrong with an approach; None: nothing.

    Args:
        here: The vehicle.
        so_far: How the approach has gone.
        settings: Of the docking.
        mouth_radius: Of the dock [m].
        latched: Where its latch holds the nose, behind the mouth [m].
    """
    s = settings
    if s.fix_timeout is not None and so_far.silence > s.fix_timeout:
        return f"no fix for {so_far.silence:.0f} s"
    if here.along < 0.0 and not depth_within_reach(here, -here.along, math.radians(2.0 * s.descent_deg)):
        return above_or_below(here.below)
    if so_far.final is None:
        return None
    if s.uncertain_timeout is not None and so_far.uncertain > s.uncertain_timeout:
        return f"off-axis position uncertain by more than the mouth's radius for {so_far.uncertain:.0f} s"
    if -2.0 * NO_RETURN < here.along < 0.0:
        miss = predicted_miss(here, s.lookahead)
        # An unsteady current may have done since the last fix what a filter in a calm mode does not reckon with.
        spread = math.hypot(miss.cross_deviation, here.unsteadiness * so_far.silence)
        chance = miss._replace(cross_deviation=spread).chance_within(mouth_radius)
        least = s.least_chance if here.along > -COMMITS else 0.5 * s.least_chance
        if here.along < -NO_RETURN and not so_far.last and chance < least:
            return f"chance of {100.0 * chance:.0f} %, off-axis position uncertain by {spread:.1f} m"
        if miss.certain_beyond(mouth_radius):
            return f"would miss the entrance by {math.hypot(miss.cross, miss.below):.2f} m"
    if here.along > -0.5 and abs(here.cross) > mouth_radius + 0.5:
        return f"entrance missed by {abs(here.cross):.2f} m"
    if here.along > latched + PASSED:
        return "entrance passed without capture"
    patience = 3.0 * (s.final_distance + latched) / s.approach_speed
    if so_far.final > patience:
        where = "jammed in the funnel" if 0.0 <= here.along <= latched else "hovering"
        return f"not captured within {patience:.0f} s of the last metres: {where} at {here.along:+.1f} m"
    return None
