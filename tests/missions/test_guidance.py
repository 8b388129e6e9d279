"""Guidance laws against vector sums, the phase machine with hand-made estimates, and a point vehicle all the way in."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from dockings import DOCK_DEPTH, LATCHED, MOUTH, NOSE, PERIOD, SETTINGS, new, update

from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.control.controller import Setpoints
from auvsim.missions.docking.guidance import CLEAR, Docking, DockingSettings, Phase, approach_course
from auvsim.missions.line_of_sight import heading_for_course
from auvsim.navigation.estimate import Estimate
from estimators.core.types import Outcome

LIMITED = DockingSettings(fix_timeout=30.0, uncertain_timeout=10.0)
LIMIT = math.radians(SETTINGS.heading_limit_deg)


def fix(time: float, axis: float = 0.0, depth: float = DOCK_DEPTH) -> Reading:
    """A packet of the dock; guidance takes only the dock's attitude and depth from it."""
    return Reading("usbl", time - 1.6, time, np.array([50.0, 1.0, 2.0, axis, 0.01, -0.01, depth]))


def estimate(time, north, east, heading, speed=1.0, current=(0.0, 0.0), sigma=0.1, initialised=True) -> Estimate:
    """An estimate of the body origin; `sigma` of north and of east."""
    return Estimate(
        time=time,
        position=np.array([north, east, DOCK_DEPTH]),
        heading=heading,
        velocity=np.array([speed, 0.0, 0.0]),
        current=np.array(current),
        covariance=np.diag([sigma**2, sigma**2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        initialised=initialised,
    )


@dataclass
class Script:
    """Feeds a guidance of axis north with places of the nose, as if estimated exactly, a tick apart."""

    guidance: Docking
    time: float = 0.0

    def tick(self, along, cross=0.0, fixed=True, sigma=0.1, latched=False, after=PERIOD) -> Setpoints:
        """One call, `after` [s] the last, with or without a new fix."""
        self.time += after
        if fixed:
            self.guidance._observe([fix(self.time)])
        here = estimate(self.time, along - NOSE, cross, 0.0, sigma=sigma)
        return update(self.guidance, self.time, here, 0.0, DOCK_DEPTH, latched)

    @property
    def last(self) -> tuple[str, str]:
        """Kind and reason of the last event."""
        return self.guidance.events[-1].kind, self.guidance.events[-1].text

    def to_final(self, along=-5.0) -> "Script":
        """Runs up to the last metres."""
        for place in (-250.0, -190.0, -100.0, -15.0, along):
            self.tick(place)
        assert self.guidance.phase == Phase.FINAL
        return self


def over_ground(heading: float, speed: float, current: tuple[float, float]) -> tuple[float, float]:
    """Velocity over ground, north and east."""
    return speed * math.cos(heading) + current[0], speed * math.sin(heading) + current[1]


def test_heading_for_course_cancels_the_current_exactly() -> None:
    """The vector sum of speed through water and current points along the course, forwards."""
    generator = np.random.default_rng(1)
    for _ in range(500):
        course = generator.uniform(-math.pi, math.pi)
        speed = generator.uniform(0.5, 2.0)
        set_, drift = generator.uniform(-math.pi, math.pi), generator.uniform(0.0, 0.9) * speed
        current = (drift * math.cos(set_), drift * math.sin(set_))
        north, east = over_ground(heading_for_course(course, speed, current), speed, current)
        assert wrap(math.atan2(east, north) - course) == pytest.approx(0.0, abs=1e-9)  # rounding


def test_heading_for_course_in_too_strong_a_current_turns_into_it() -> None:
    """No heading holds the course; the one given crabs as far as the law goes and is a number."""
    heading = heading_for_course(0.0, 1.0, (0.0, 3.0))
    assert heading == pytest.approx(-math.asin(0.95))


def test_approach_course_is_the_axis_while_the_crab_fits_and_keeps_the_limit_beyond() -> None:
    """Steady crab angle from the axis: below the limit on the axis itself, exactly the limit on a turned line."""
    generator = np.random.default_rng(2)
    kinds = set()
    for _ in range(500):
        axis, speed = generator.uniform(-math.pi, math.pi), generator.uniform(0.8, 1.5)
        set_, drift = generator.uniform(-math.pi, math.pi), generator.uniform(0.0, 0.7) * speed
        current = (drift * math.cos(set_), drift * math.sin(set_))
        needed = abs(math.asin(drift * math.sin(set_ - axis) / speed))
        line = approach_course(axis, speed, current, LIMIT)
        crab = wrap(heading_for_course(line, speed, current) - axis)
        if needed <= LIMIT:
            assert line == axis
            assert abs(crab) == pytest.approx(needed, abs=1e-9)
        else:
            assert abs(crab) == pytest.approx(LIMIT, abs=1e-9)
            assert abs(wrap(line - axis)) < math.pi / 2  # still towards the funnel's open side
        kinds.add(needed <= LIMIT)
    assert kinds == {True, False}


def test_turned_line_runs_through_the_entrance() -> None:
    """On the line through the entrance the course over ground is the line's; off it, the vehicle is turned back."""
    current = (0.0, 0.5)
    line = approach_course(0.0, SETTINGS.approach_speed, current, LIMIT)
    assert line > 0.1  # turned with the current that flows to starboard: the crab would be 30 degrees
    guidance = new(
        DockingSettings(crab_limit_deg=60.0, ground_speed=0.0, speed_per_current=0.0)
    )  # not faster for the current
    guidance._observe([fix(0.1)])
    courses = {}
    for off in (-2.0, 0.0, 2.0):
        distance = 60.0
        heading = math.pi / 3  # whatever it is, the nose is where it is
        north = -distance * math.cos(line) - off * math.sin(line) - NOSE * math.cos(heading)
        east = -distance * math.sin(line) + off * math.cos(line) - NOSE * math.sin(heading)
        guidance.phase = Phase.APPROACH
        command = update(guidance, 0.1, estimate(0.1, north, east, heading, current=current), heading, 12.0, False)
        velocity = over_ground(command.heading, command.speed, current)
        courses[off] = wrap(math.atan2(velocity[1], velocity[0]) - line)
    assert courses[0.0] == pytest.approx(0.0, abs=1e-9)
    # Line of sight: an error to starboard turns to port by atan(error / lookahead).
    assert courses[2.0] == pytest.approx(-math.atan2(2.0, SETTINGS.lookahead), abs=1e-9)
    assert courses[-2.0] == pytest.approx(math.atan2(2.0, SETTINGS.lookahead), abs=1e-9)


def test_dead_reckoning_from_an_old_estimate() -> None:
    """Between estimates the nose is carried on by speed through the water and current."""
    guidance = new()
    guidance._observe([fix(0.1)])
    old = estimate(10.0, -100.0, 5.0, 0.3, speed=1.2, current=(0.1, -0.2))
    update(guidance, 10.4, old, 0.3, DOCK_DEPTH, False)
    assert guidance.along == pytest.approx(-100.0 + 0.4 * (1.2 * math.cos(0.3) + 0.1) + NOSE * math.cos(0.3))
    assert guidance.cross == pytest.approx(5.0 + 0.4 * (1.2 * math.sin(0.3) - 0.2) + NOSE * math.sin(0.3))


def test_axis_and_depth_are_means_of_the_reports_across_south() -> None:
    """Reports on both sides of 180 degrees average to 180, not to 0; packets that are not numbers do not count."""
    guidance = new()
    broken = fix(3.0)
    broken.value[0] = math.nan
    guidance._observe([fix(1.0, math.pi - 0.01, 12.2), fix(2.0, -math.pi + 0.03, 11.9), broken])
    assert wrap(guidance.axis - (math.pi + 0.01)) == pytest.approx(0.0, abs=1e-12)
    assert guidance.dock_depth == pytest.approx(12.05)


def test_phases_of_a_docking_in_their_order() -> None:
    """Search, homing, approach, final, docked: where each begins, and what it commands."""
    guidance = new()
    held = Setpoints(0.7, 5.0, SETTINGS.approach_speed)
    for time in (0.0, 5.0):  # holds what it had, although the vehicle has turned meanwhile
        assert update(guidance, time, None, 0.7 + time, 5.0 + time, False) == held
    waiting = estimate(5.0, 0.0, 0.0, 0.0, initialised=False)
    update(guidance, 5.0, waiting, 0.0, 5.0, False)
    assert guidance.phase == Phase.SEARCH
    script = Script(guidance, time=5.0)
    places = {-300.0: Phase.HOMING, -221.0: Phase.HOMING, -219.0: Phase.APPROACH, -20.5: Phase.APPROACH}
    places |= {-19.5: Phase.FINAL, 1.0: Phase.FINAL}
    for along, phase in places.items():
        speed = SETTINGS.homing_speed if guidance.phase <= Phase.HOMING else SETTINGS.approach_speed
        assert script.tick(along).speed == speed
        assert guidance.phase == phase
    assert script.tick(1.3, latched=True).speed == 0.0
    assert [event.kind for event in guidance.events] == ["homing", "approach", "final", "docked"]
    assert all(event.text for event in guidance.events)
    assert guidance.finished


@pytest.mark.parametrize(
    ("reason", "finish"),
    [
        ("entrance missed by 1.40 m", lambda s: s.to_final().tick(0.1, 1.4)),
        # Line of sight takes an error back by exp(-way / lookahead): 1.40 m at 0.4 m before the mouth.
        ("would miss the entrance by 1.32 m", lambda s: s.to_final().tick(-0.4, -1.4)),
        ("entrance passed without capture", lambda s: s.to_final().tick(LATCHED + 2.6)),
        (
            "not captured within 64 s of the last metres: jammed in the funnel at +0.5 m",
            lambda s: s.to_final().tick(0.5, after=64.0),
        ),
        ("no fix for 31 s", lambda s: s.to_final().tick(-3.0, fixed=False, after=31.0)),
    ],
)
def test_go_around_in_the_last_metres(reason: str, finish) -> None:
    """Every way to fail there is seen, named, and followed by another attempt."""
    script = Script(new(LIMITED))
    finish(script)
    assert script.guidance.phase == Phase.GO_AROUND
    assert script.guidance.attempt == 2
    assert script.last == ("go_around", f"{reason}; attempt 2 follows")


def test_go_around_on_silence_already_on_the_approach() -> None:
    """Fixes that stop break the approach off after `fix_timeout`, where one is set, not before; no attempt counts."""
    script = Script(new(LIMITED))
    script.tick(-250.0)
    script.tick(-190.0)
    script.tick(-180.0, fixed=False, after=29.9)
    assert script.guidance.phase == Phase.APPROACH
    script.tick(-179.0, fixed=False, after=0.2)
    assert script.guidance.phase == Phase.GO_AROUND
    assert script.last[1].startswith("no fix for 30 s")


@pytest.mark.parametrize(("sigma", "broken_off"), [(0.7, False), (0.8, True)])
def test_go_around_on_uncertainty_that_lasts(sigma: float, broken_off: bool) -> None:
    """A deviation across the axis above the mouth's radius, 0.75 m, for ten seconds, and not for less."""
    script = Script(new(LIMITED)).to_final(-19.0)
    script.tick(-15.0, sigma=sigma, after=9.8)
    assert script.guidance.phase == Phase.FINAL
    script.tick(-14.0, sigma=sigma, after=0.4)
    assert (script.guidance.phase == Phase.GO_AROUND) == broken_off
    if broken_off:
        assert script.last[1].startswith("off-axis position uncertain by more than the mouth's radius for 10 s")


def test_only_uncertainty_across_the_axis_counts() -> None:
    """An error along the axis only changes when the vehicle arrives: a dock that faces east, uncertain east."""
    guidance, axis = new(LIMITED), math.pi / 2
    for time, along in ((0.1, -250.0), (1.0, -190.0), (2.0, -15.0), (30.0, -10.0)):
        guidance._observe([fix(time, axis)])
        here = estimate(time, 0.0, along - NOSE, axis, sigma=0.1)
        here.covariance[1, 1] = 25.0
        update(guidance, time, here, axis, DOCK_DEPTH, False)
    assert guidance.phase == Phase.FINAL
    guidance._observe([fix(41.0, axis)])
    here = estimate(41.0, 0.0, along - NOSE, axis, sigma=0.1)
    here.covariance[0, 0] = 25.0
    update(guidance, 41.0, here, axis, DOCK_DEPTH, False)
    assert guidance.phase == Phase.GO_AROUND


def test_gives_up_after_the_last_attempt() -> None:
    """Three attempts that miss, then aborted, stopped, with the reason of the last; nothing wakes it but the latch."""
    script = Script(new())
    for attempt in (1, 2, 3):
        assert script.guidance.attempt == attempt
        for along, cross in ((-250.0, 0.0), (-190.0, 0.0), (-100.0, 20.0), (-15.0, 0.0), (0.0, 3.5)):
            command = script.tick(along, cross)
    assert script.last == ("aborted", "entrance missed by 3.50 m; attempt 3 was the last")
    assert command.speed == 0.0
    assert script.tick(-200.0).speed == 0.0
    assert script.guidance.phase == Phase.ABORTED
    assert script.guidance.finished
    kinds = [event.kind for event in script.guidance.events]
    assert kinds == ["homing", *["approach", "final", "go_around"] * 2, "approach", "final", "aborted"]


def test_an_approach_that_is_broken_off_in_time_is_no_attempt_so_often_as_set() -> None:
    """Twice too uncertain at 5 m with one return to spend: the first costs no attempt, the second does."""
    script = Script(new(DockingSettings(returns=1)))
    for attempt, reason in ((1, "attempt 1 anew"), (2, "attempt 2 follows")):
        for along, cross in ((-250.0, 0.0), (-190.0, 0.0), (-100.0, 20.0), (-15.0, 0.0)):
            script.tick(along, cross)
        script.tick(-5.0, sigma=1.5)
        assert script.last[0] == "go_around"
        assert script.last[1] == f"chance of 38 %, off-axis position uncertain by 1.5 m; {reason}"
        assert script.guidance.attempt == attempt


def paced(speed_of_current: float, number: int = 8, interval: float = 8.0) -> tuple[float, float]:
    """Setpoint of speed and its pace, 60 m before the mouth, the last of some packets just heard.

    Args:
        speed_of_current: Deviation of the current [m/s].
        number: Of packets heard.
        interval: Between them [s].
    """
    guidance = new(DockingSettings(approach_speed=1.5))
    for k in range(number):
        time = interval * k
        guidance._reports.observe([Reading("usbl", time, time, fix(time).value, k)])
        here = estimate(time, (-250.0, -190.0)[min(k, 1)] - NOSE, 0.0, 0.0, speed=1.5)
        update(guidance, time, here, 0.0, DOCK_DEPTH)
    assert guidance.phase == Phase.APPROACH
    assert guidance._here is not None
    here = guidance._here._replace(along=-60.0, cross=0.0, north=-60.0, east=0.0, unsteadiness=speed_of_current)
    found = guidance._follow_line(interval * (number - 1), here).speed
    return found, guidance._speed(here)


def test_in_unsteady_water_a_fix_is_met_before_the_mouth() -> None:
    """Within 1.5 times the speed that it has anyhow, and so that a whole number of intervals leads to 11 m before."""
    speed, least = paced(0.12)
    assert least <= speed <= 1.5 * least
    count = 49.0 / speed / 8.0
    assert count == pytest.approx(round(count), abs=1e-9)
    assert 49.0 / (1.5 * least) > 8.0 * (round(count) - 1)  # the one before is out of reach


def test_in_steady_water_the_speed_is_as_ever() -> None:
    """0.04 m/s for 8 s is less than half the mouth's radius; and every 6 s a fix comes near the mouth anyway."""
    for speed, least in (paced(0.04), paced(0.12, interval=6.0)):
        assert speed == least


@pytest.mark.parametrize("fixed", [True, False])
def test_gives_up_when_lost(fixed: bool) -> None:
    """No fix for `lost_timeout`, whether there ever was one or not."""
    guidance, start = new(), 0.0
    update(guidance, start, None, 0.0, 5.0, False)
    if fixed:
        Script(guidance, time=49.9).tick(-300.0)
        start = 50.0
    update(guidance, start + 179.9, None, 0.0, 5.0, False)
    assert not guidance.finished
    assert update(guidance, start + 180.1, None, 0.0, 5.0, False).speed == 0.0
    assert guidance.phase == Phase.ABORTED
    assert guidance.events[-1].text == "no fix for 180 s"


def test_silence_counts_from_when_a_docking_begins() -> None:
    """One that begins late, as a survey's does, is not lost because its first fix is refused."""
    guidance, begun = new(), 1320.0
    refused = Outcome("usbl", "", begun - 1.0, 0, False, "outlier", 30.0)
    here = replace(estimate(begun, -60.0, 0.0, 0.0), outcomes=(refused,))
    update(guidance, begun, here, 0.0, DOCK_DEPTH, fixes=[fix(begun)])
    assert guidance.phase != Phase.ABORTED
    later = begun + 179.0
    update(guidance, later, None, 0.0, DOCK_DEPTH)
    assert guidance.phase != Phase.ABORTED
    update(guidance, later + 2.0, None, 0.0, DOCK_DEPTH)
    assert guidance.phase == Phase.ABORTED
    assert guidance.events[-1].text == "no fix for 181 s: 1 refused, outlier"


RADIUS = 16.0  # tightest turn of the REMUS 100 model at any speed: 15.8 m at full rudder [m]


@dataclass
class Point:
    """A point that moves ahead through the water as commanded and turns no tighter than a circle."""

    north: float
    east: float
    heading: float
    current: tuple[float, float]
    speed: float = 1.0

    def step(self, command: Setpoints) -> None:
        """One control period."""
        self.speed += PERIOD / 3.0 * (command.speed - self.speed)  # surge lags by some seconds
        limit = abs(self.speed) / RADIUS
        self.heading += PERIOD * max(-limit, min(limit, wrap(command.heading - self.heading)))
        north, east = over_ground(self.heading, self.speed, self.current)
        self.north += north * PERIOD
        self.east += east * PERIOD

    def in_dock(self, axis: float, ahead: float) -> tuple[float, float]:
        """Along and cross track of a point of the hull's axis, `ahead` of its origin [m]."""
        north, east = self.north + ahead * math.cos(self.heading), self.east + ahead * math.sin(self.heading)
        return north * math.cos(axis) + east * math.sin(axis), east * math.cos(axis) - north * math.sin(axis)

    def clearance(self, axis: float) -> float:
        """Distance of the hull's axis from the funnel, as wide as its mouth and 2 m long [m]."""
        distances = []
        for ahead in (-NOSE, 0.0, NOSE):
            along, cross = self.in_dock(axis, ahead)
            distances.append(math.hypot(along - min(max(along, 0.0), 2.0), max(abs(cross) - MOUTH, 0.0)))
        return min(distances)


@dataclass
class Passage:
    """What a point vehicle did."""

    guidance: Docking
    cross: float  # of the nose where it passes the mouth's plane for the last time [m]
    heading_error: float  # there, from the axis [rad]
    clearance: dict[Phase, float]  # least one while moving ahead in each phase [m]


def run(point: Point, axis: float, blind_until: float = -math.inf, error: float = 0.0) -> Passage:
    """Guides a point with exact estimates to the latch.

    Args:
        blind_until: until the nose is there, along track [m], on the first attempt, the estimate is wrong.
        error: by how much, to starboard [m].
    """
    guidance, latched, time, here = new(), False, 0.0, None
    passage = Passage(guidance, math.nan, math.nan, {})
    for tick in range(20_000):
        time = tick * PERIOD
        if tick % 50 == 0:
            guidance._observe([fix(time, axis)])
        along, cross = point.in_dock(axis, NOSE)
        if tick % 5 == 0:
            off = error if guidance.attempt == 1 and along < blind_until else 0.0
            north, east = point.north - off * math.sin(axis), point.east + off * math.cos(axis)
            here = estimate(time, north, east, point.heading, point.speed, point.current)
        command = update(guidance, time, here, point.heading, DOCK_DEPTH, latched)
        if latched:
            return passage
        point.step(command)
        if command.speed > 0.0:
            least = passage.clearance.get(guidance.phase, math.inf)
            passage.clearance[guidance.phase] = min(least, point.clearance(axis))
        now, cross = point.in_dock(axis, NOSE)
        if along < 0.0 <= now:
            passage.cross, passage.heading_error = cross, wrap(point.heading - axis)
        latched = LATCHED - 0.15 < now < LATCHED + 0.15 and abs(cross) < MOUTH
    raise AssertionError(f"still {guidance.phase.name} after {time:.0f} s")


@pytest.mark.parametrize("bearing", range(0, 360, 45))
def test_point_vehicle_reaches_the_mouth(bearing: int) -> None:
    """From all round the dock, all headings, in currents up to half the speed; round the dock, not through it."""
    generator = np.random.default_rng(bearing)
    for heading in (0.0, 2.0, -2.0):
        axis, set_ = generator.uniform(-math.pi, math.pi, 2)
        drift, place = generator.uniform(0.0, 0.5), axis + math.pi + math.radians(bearing)
        current = (drift * math.cos(set_), drift * math.sin(set_))
        start = Point(300.0 * math.cos(place), 300.0 * math.sin(place), axis + heading, current)
        passage = run(start, axis)
        assert passage.guidance.attempt == 1
        assert abs(passage.cross) < 0.05  # 200 m are many lookaheads; what is left is the funnel-bound turn's lag
        assert abs(passage.heading_error) < LIMIT + math.radians(1.0)  # 1 degree: still on its way to the line's crab
        assert passage.clearance[Phase.HOMING] > 10.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("drift", [(0.0, 0.0), (0.3, 0.0), (0.0, 0.3), (0.0, -0.3), (-0.3, 0.0), (0.5, 0.0)])
def test_go_around_keeps_clear_of_the_dock(side: float, drift: tuple[float, float]) -> None:
    """A miss that is seen too late: back out, round, in at the second attempt, also where the current sets on it."""
    axis = 0.4
    current = (
        drift[0] * math.cos(axis) - drift[1] * math.sin(axis),
        drift[0] * math.sin(axis) + drift[1] * math.cos(axis),
    )
    point = Point(-260.0 * math.cos(axis), -260.0 * math.sin(axis), axis, current)
    passage = run(point, axis, blind_until=-0.4, error=-side * 1.5)
    events = [(event.kind, event.text) for event in passage.guidance.events]
    assert "miss" in dict(events)["go_around"]  # seen before the mouth or behind it
    assert passage.guidance.attempt == 2
    assert passage.clearance[Phase.GO_AROUND] > 2.0
    assert abs(passage.cross) < 0.05


def test_break_off_before_the_funnel_backs_out_first() -> None:
    """With less room than a turn needs before the dock, the vehicle goes astern until there is enough."""
    script = Script(new(LIMITED)).to_final(-5.0)
    assert script.tick(-4.5, fixed=False, after=31.0).speed < 0.0
    assert script.guidance.phase == Phase.GO_AROUND
    room = CLEAR + SETTINGS.turning_radius
    assert script.tick(-room + 0.5).speed < 0.0
    assert script.tick(-room - 0.5).speed == SETTINGS.homing_speed
