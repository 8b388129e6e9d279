"""Guidance where nothing is symmetric: a vehicle that slips, a dock turned from north, an error ellipse turned too."""

import math

import numpy as np
import pytest
from dockings import DOCK_DEPTH as DEPTH
from dockings import NOSE, new, update
from lopsided import DOCK_HEADING as AXIS

from auvsim.base.frames import Array
from auvsim.base.reading import Reading
from auvsim.control.controller import Setpoints
from auvsim.missions.docking.guidance import CLEAR, DockingSettings, Phase
from auvsim.navigation.estimate import Estimate

SETTINGS = DockingSettings(uncertain_timeout=10.0)
SMALL = 0.01 * np.eye(2)  # covariance of a position [m2]


class Run:
    """Feeds a guidance with places of the nose in the frame of a dock whose axis is AXIS, as if estimated exactly."""

    def __init__(self) -> None:
        self.guidance = new(SETTINGS)
        self.time = 0.0

    def tick(
        self, along: float, cross: float = 0.0, off: float = 0.0, covariance: Array = SMALL, after: float = 0.1
    ) -> Setpoints:
        """One call, `after` [s] the last, with a fix; the heading is `off` the axis [rad]."""
        self.time += after
        packet = np.array([50.0, 1.0, 2.0, AXIS, 0.01, -0.01, DEPTH])
        self.guidance._observe([Reading("usbl", self.time - 1.6, self.time, packet)])
        heading = AXIS + off
        north = along * math.cos(AXIS) - cross * math.sin(AXIS) - NOSE * math.cos(heading)
        east = along * math.sin(AXIS) + cross * math.cos(AXIS) - NOSE * math.sin(heading)
        here = estimate(self.time, (north, east), heading, (1.0, 0.0), covariance)
        return update(self.guidance, self.time, here, heading, DEPTH, False)

    def to_final(self) -> "Run":
        """Runs up to the last metres."""
        for along in (-250.0, -190.0, -100.0, -15.0):
            self.tick(along)
        assert self.guidance.phase == Phase.FINAL
        return self


def estimate(
    time: float, place: tuple[float, float], heading: float, velocity: tuple[float, float], covariance: Array = SMALL
) -> Estimate:
    """An estimate of the body's origin without current."""
    whole = np.zeros((8, 8))
    whole[:2, :2] = covariance
    return Estimate(
        time=time, position=np.array([*place, DEPTH]), heading=heading, velocity=np.array([*velocity, 0.0]),
        current=np.zeros(2), covariance=whole, initialised=True,
    )  # fmt: skip


def ellipse(along: float, across: float) -> Array:
    """Covariance (2, 2) in north and east of deviations along and across the axis [m]."""
    turn = np.array([[math.cos(AXIS), -math.sin(AXIS)], [math.sin(AXIS), math.cos(AXIS)]])
    return turn @ np.diag([along**2, across**2]) @ turn.T


@pytest.mark.parametrize("sway", [0.25, -0.25])
def test_a_vehicle_that_slips_is_reckoned_to_the_side_it_slips_to(sway: float) -> None:
    """The place ahead in time is that of the velocity vector turned from body to NED and added up."""
    run, heading, age = Run(), 1.1, 0.4
    run.tick(-100.0)
    here = estimate(10.0, (-60.0, 20.0), heading, (1.2, sway))
    update(run.guidance, 10.0 + age, here, heading, DEPTH, False)
    ahead, starboard = (
        np.array([math.cos(heading), math.sin(heading)]),
        np.array([-math.sin(heading), math.cos(heading)]),
    )
    nose = np.array([-60.0, 20.0]) + age * (1.2 * ahead + sway * starboard) + NOSE * ahead
    assert run.guidance.along == pytest.approx(nose @ [math.cos(AXIS), math.sin(AXIS)])
    assert run.guidance.cross == pytest.approx(nose @ [-math.sin(AXIS), math.cos(AXIS)])


@pytest.mark.parametrize(("along", "across", "broken_off"), [(5.0, 0.1, False), (0.1, 5.0, True), (0.9, 0.7, False)])
def test_uncertainty_counts_across_a_turned_axis(along: float, across: float, broken_off: bool) -> None:
    """An ellipse along the axis says where the vehicle is across it; one across the axis does not."""
    run = Run().to_final()
    run.tick(-12.0, covariance=ellipse(along, across), after=9.0)
    run.tick(-10.0, covariance=ellipse(along, across), after=2.0)
    assert (run.guidance.phase == Phase.GO_AROUND) == broken_off


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_backing_out_ends_where_a_turn_to_the_near_side_has_room(side: float) -> None:
    """A hull turned off the axis goes round to that side, though its nose is on the other, and needs less room.

    A turn of radius R that begins at an angle `off` comes nearer to the dock by R (1 - sin off) only.
    """
    run, off = Run().to_final(), side * math.pi / 6.0
    room = CLEAR + SETTINGS.turning_radius * (1.0 - math.sin(math.pi / 6.0))
    assert run.tick(-6.0, -0.2 * side, off, after=70.0).speed < 0.0  # not captured in the time that it may take
    assert run.guidance.phase == Phase.GO_AROUND
    assert run.tick(-room + 0.5, -0.2 * side, off).speed < 0.0
    ahead = run.tick(-room - 0.5, -0.2 * side, off)
    assert ahead.speed == SETTINGS.homing_speed
    assert math.copysign(1.0, math.sin(ahead.heading - AXIS)) == side
