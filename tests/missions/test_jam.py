"""Fixes of a vehicle that is held at the dock, against those of one that moves."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from dockings import DOCK_DEPTH, NOSE, new, update

from auvsim.base.reading import Reading
from auvsim.missions.docking.guidance import DockingSettings, Phase
from auvsim.missions.docking.jam import DockShape, JamWatch, jam_watch
from auvsim.missions.fixes import FixSource
from auvsim.navigation.estimate import Estimate

MOUNT = (0.2, -0.3, -1.0)  # of the transceiver from the mouth [m]
AHEAD = 0.8  # of the nose from the transponder [m]
SHAPE = DockShape(0.75, 0.15, 1.04, MOUNT)


def fix(time: float, place: tuple[float, float, float]) -> Reading:
    """A fix of a transponder at a place from the mouth, in the dock's axes."""
    value = [a - b for a, b in zip(place, MOUNT, strict=True)]
    return Reading("usbl", time, time + 1.5, np.array([*value, 0.0, 0.0, 0.0, 20.0]))


def said(places: list[tuple[float, float, float]], *, period=5.0, off=0.0, speed=1.0, turned: float | None = None):
    """What is said of fixes at places, the thrust on since 0 s, and turned to the other side at a time."""
    watch = JamWatch(SHAPE, AHEAD)
    found = []
    for k in range(round((len(places) + 2) * period / 0.5)):
        time = 0.5 * k
        watch.driven(time, -speed if turned is not None and time >= turned else speed)
        n, rest = divmod(time, period)
        readings = [fix(time, places[int(n) - 1])] if rest == 0.0 and 1 <= n <= len(places) else []
        if text := watch.observe(readings, off):
            found.append((time, text))
    return found


def test_fixes_that_stay_say_where_the_nose_is_held():
    off = math.radians(-30.0)  # the nose to port of the tail
    held = (0.6, 0.62, -0.05)
    ((time, text),) = said([held] * 4, off=off)
    assert time == 15.0  # the fix at 5 s is the first under steady thrust; that at 10 s comes too soon after it
    cross = math.hypot(0.62 - 0.8 * math.sin(math.radians(30.0)), 0.05)
    assert text == f"jammed beside the funnel: the nose at +1.3 m, {cross:.1f} m off the axis"
    ((_, text),) = said([(-0.4, 0.1, 0.0)] * 3)
    assert text.startswith("jammed in the funnel: the nose at +0.4 m, 0.1 m")  # the cone is 0.52 m wide there
    ((_, text),) = said([(-0.4, 0.6, 0.0)] * 3)
    assert text.startswith("jammed beside the funnel: the nose at +0.4 m, 0.6 m")
    ((_, text),) = said([(-1.0, 0.1, 0.0)] * 3)
    assert "beside" in text  # before the mouth there is no inside


@pytest.mark.parametrize(
    ("places", "more"),
    [
        ([(-1.0, 0.0, 0.0), (1.5, 0.0, 0.0), (-1.0, 0.0, 0.0), (1.5, 0.0, 0.0)], {}),  # it moves
        ([(8.0, 3.0, 0.0)] * 6, {}),  # far from the dock nothing holds it
        ([(0.3, 0.0, 0.0)] * 2, {}),  # two fixes 5 s apart
        ([(0.3, 0.0, 0.0)] * 4, {"turned": 11.0}),  # the thrust turned, and 9 s of it are no proof
        ([(0.3, 0.0, 0.0)] * 6, {"speed": 0.0}),  # it does not want to move
    ],
    ids=["moves", "far", "soon", "turned", "idle"],
)
def test_nothing_is_said_of_others(places, more):
    assert said(places, **more) == []


def test_a_vehicle_held_astern_is_noticed_too():
    ((time, text),) = said([(0.3, 0.0, 0.0)] * 7, turned=6.0)
    assert time == 25.0  # under steady thrust from 11 s on: the fixes at 15 and 25 s
    assert "jammed" in text


def test_the_watch_needs_a_usbl_and_takes_the_docks_shape():
    dock: Any = SimpleNamespace(mouth_radius=0.75, throat_radius=0.15, cone_length=1.04)
    ranged = FixSource((1.0, 2.0, 3.0), 1.0, lambda d: 0.1)
    assert jam_watch(dock, AHEAD, [ranged]) is None
    watch = jam_watch(dock, AHEAD, [ranged, ranged._replace(bearing=True, mount=MOUNT)])
    assert watch is not None
    assert (watch._dock, watch._ahead) == (SHAPE, AHEAD)


def test_guidance_backs_out_and_ahead_again_where_astern_it_is_held_too():
    guidance = new(DockingSettings(), sources=[FixSource((0.0, 0.0, DOCK_DEPTH), 5.0, lambda d: 0.1, True)])
    speeds, time = {}, 0.0

    def tick(along: float, fixed: float | None = None) -> None:
        nonlocal time
        time = round(time + 0.5, 1)
        here = Estimate(
            time=time, position=np.array([along - NOSE, 0.0, DOCK_DEPTH]), heading=0.0, velocity=np.zeros(3),
            current=np.zeros(2), covariance=np.diag([1e-2] * 2 + [0.0] * 6), initialised=True,
        )  # fmt: skip
        fixes = [] if fixed is None else [Reading("usbl", time, time, np.array([fixed, 0, 0, 0, 0, 0, DOCK_DEPTH]))]
        speeds[time] = update(guidance, time, here, 0.0, DOCK_DEPTH, fixes=fixes).speed

    for along in (-250.0, -195.0, -100.0, -15.0, -2.0):
        tick(along, along - NOSE)
    assert guidance.phase == Phase.FINAL
    held = None
    while time < 90.0:  # the nose stays 0.4 m behind the mouth, whatever the estimate says
        tick(0.4, -0.4 if time % 5.0 == 4.5 else None)
        if held is None and guidance.phase == Phase.GO_AROUND:
            held = time
    kinds = [(event.kind, event.text) for event in guidance.events][3:]
    assert held == 20.0  # fixes count from 10 s on: 5 s of steady thrust, and two that are 8 s apart or more
    assert kinds[0] == ("go_around", "jammed in the funnel: the nose at +0.4 m, 0.0 m off the axis; attempt 2 follows")
    assert kinds[1] == ("jammed", "in the funnel: the nose at +0.4 m, 0.0 m off the axis")
    assert all(speeds[held + k] < 0.0 for k in range(1, 15))  # astern
    freed = next(event.time for event in guidance.events if event.kind == "jammed")
    assert 35.0 <= freed <= 40.0  # held astern too: fixes from 25.5 s on
    assert speeds[freed + 2.0] > 0.0
