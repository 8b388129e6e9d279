"""An estimate: named states with covariance, the views that control and plots use, outcomes of measurements."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from auvsim.base.frames import Array
from estimators.core.types import Outcome

# The planar states of a rudder-driven vehicle and their units; estimators of other states name their own.
PLANAR_STATES: Mapping[str, str] = MappingProxyType(
    {
        "north": "m",
        "east": "m",
        "heading": "rad",
        "surge": "m/s",
        "sway": "m/s",
        "yaw_rate": "rad/s",
        "current_north": "m/s",
        "current_east": "m/s",
    }
)
# Constant errors that guidance heeds where they are estimated: what a sensor shows too much.
COMPASS_BIAS, DOCK_HEADING_BIAS, DEPTH_BIAS = "compass_bias", "dock_heading_bias", "depth_bias"


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimate:
    """Estimated state of a vehicle at one instant, in NED from the datum."""

    time: float  # [s]
    position: Array  # (3,) north, east, depth of the body origin [m]
    heading: float  # [rad]
    velocity: Array  # (3,) surge, sway [m/s] and yaw rate [rad/s], through the water
    current: Array  # (2,) north, east [m/s]
    covariance: Array  # (n, n) of the states; zeros where not estimated
    initialised: bool  # false until position is known
    mean: Array | None = None  # (n,) of the states; None: the eight planar ones, as the views say
    names: tuple[str, ...] = tuple(PLANAR_STATES)  # of the states, in their order
    refused: int = 0  # measurements refused so far
    reasons: Mapping[str, int] = field(default_factory=dict)  # the same by reason
    reinitialised: int = 0  # number of restarts after its numbers were no longer finite
    warnings: tuple[str, ...] = ()  # why it may be more wrong than its covariance says, each "what: why"
    outcomes: tuple[Outcome, ...] = ()  # of the measurements accepted or refused since the last estimate

    @classmethod
    def unknown(cls, time: float) -> "Estimate":
        """The estimate at a time [s] of which nothing is known: zeros, not initialised."""
        nothing = np.zeros(3)
        return cls(
            time=time, position=nothing, heading=0.0, velocity=nothing, current=nothing[:2],
            covariance=np.zeros((8, 8)), initialised=False,
        )  # fmt: skip

    @property
    def state(self) -> Array:
        """(n,) mean of the named states."""
        if self.mean is not None:
            return self.mean
        return np.array((*self.position[:2], self.heading, *self.velocity, *self.current))

    def value(self, name: str, default: float = 0.0) -> float:
        """Mean of a named state; a default where it is not estimated."""
        return float(self.state[self.names.index(name)]) if name in self.names else default

    def deviation(self, slopes: Mapping[str, float]) -> float:
        """Standard deviation of a quantity that changes by `slopes` with the named states; others do not count."""
        found, block = _block(self.names, tuple(slopes))
        if len(found) == 1:  # the common case, cheaply
            (slope,) = (slopes[name] for name in found)
            return math.sqrt(max(slope * self.covariance.item(block.item()) * slope, 0.0))
        along = np.array([slopes[name] for name in found])
        return math.sqrt(max(float(along @ self.covariance.take(block) @ along), 0.0))

    @property
    def horizontal_covariance(self) -> Array:
        """(2, 2) of north and east [m2], which are the first two states."""
        return self.covariance[:2, :2]

    def at(self, time: float) -> tuple[Array, Array, float]:
        """By dead reckoning at a time [s]: north, east [m]; surge, sway over ground (2,) [m/s]; heading [rad]."""
        dt, turn = time - self.time, float(self.velocity[2])
        heading = self.heading + turn * dt
        cos, sin = math.cos(heading), math.sin(heading)
        to_ned = np.array(((cos, -sin), (sin, cos)))
        over_ground = self.velocity[:2] + self.current @ to_ned
        return self.position[:2] + to_ned @ over_ground * dt, over_ground, heading


@lru_cache(maxsize=64)
def _block(names: tuple[str, ...], wanted: tuple[str, ...]) -> tuple[tuple[str, ...], NDArray[np.int64]]:
    """Those k of the states that are wanted, in their order, and places (k, k) of their block in a flat covariance."""
    places = np.array([k for k, name in enumerate(names) if name in wanted], dtype=np.int64)
    return tuple(names[k] for k in places), places[:, np.newaxis] * len(names) + places


def estimator_events(before: Estimate | None, now: Estimate) -> list[tuple[str, str]]:
    """Kinds and texts of the events between two estimates: measurements refused, by reason, and starts anew, doubts."""
    known, events = before.reasons if before else {}, []
    for reason, count in now.reasons.items():
        if (more := count - known.get(reason, 0)) > 0:
            events.append(("refused", f"{more} measurement{'s' * (more > 1)}: {reason.replace('_', ' ')}"))
    if now.reinitialised > (before.reinitialised if before else 0):
        events.append(("reinitialised", "the estimator started anew: its numbers were no longer finite"))
    doubts = {warning.partition(":")[0] for warning in before.warnings} if before else set()
    events += [("doubtful", warning) for warning in now.warnings if warning.partition(":")[0] not in doubts]
    if doubts and not now.warnings:
        events.append(("told", "the geometry of ranges tells position and current again"))
    return events
