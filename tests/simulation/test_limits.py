"""Events of vehicles that come out of the water or touch the floor, one for each stretch."""

import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.base.randomness import stream
from auvsim.physics import scenes
from auvsim.physics.scenes import WorldSettings
from auvsim.physics.world import World
from auvsim.simulation import scenario
from auvsim.simulation.run import run
from auvsim.simulation.stretches import QUIET, Stretches
from auvsim.water.currents import Uniform
from auvsim.water.settings import WavesSettings
from auvsim.water.waves import Waves

RADIUS, HALF = 0.095, 0.8  # of the hull [m]


def manoeuvre(depth, wanted, **more):
    """Straight ahead from one depth to another, away from the dock whose USBL serves it."""
    return scenario.parse(
        {
            "duration": 40.0,
            "vehicle": {"start": {"north": 0.0, "east": 0.0, "depth": depth, "speed": 1.5}},
            "dock": {"north": -100.0, "depth": 4.0},
            "mission": {"kind": "track", "depth": wanted, "speed": 1.5},
            **more,
        }
    )


def limits(log):
    """Kinds of the events that are about limits of the water."""
    return [kind for kind in log.groups["event"]["kind"].tolist() if kind in ("surfaced", "grounded")]


def test_a_stretch_is_told_once():
    stretches, told = Stretches(), []
    for tick in range(400):
        time = 0.1 * tick
        holds = 1.0 <= time < 2.0 or 3.0 <= time < 4.0 or time > 4.0 + QUIET + 1.0
        if holds and stretches.begins(time, "auv", "surfaced"):
            told.append(time)
        if tick == 0:
            assert stretches.begins(time, "other", "surfaced")
    assert told == pytest.approx([1.0, 4.0 + QUIET + 1.1])


def test_a_vehicle_that_surfaces_says_so_once():
    """Sent to half a metre it stays wet but for its overshoot; sent to the surface it comes out once."""
    assert limits(run(manoeuvre(8.0, 8.0))) == []
    assert limits(run(manoeuvre(2.0, 0.05))) == ["surfaced"]


def test_a_vehicle_that_runs_aground_says_so_once():
    start = {"north": 0.0, "east": 0.0, "depth": 6.0, "speed": 1.5}
    heavy = {"start": start, "ballast": {"net_buoyancy": -20.0}}  # so that it stays down and does not bounce
    log = run(manoeuvre(6.0, 9.99, world={"sea_floor": 10.0}, vehicle=heavy))
    assert limits(log) == ["grounded"]
    event = log.groups["event"]
    at = event["kind"].tolist().index("grounded")
    contact = log.groups["vehicles/remus100/contact"]
    first = contact["time"][contact["other"] == "sea_floor"][0]
    assert 0.0 <= event["time"][at] - first < 0.1 + 1e-9  # a control period
    assert event["vehicle"][at] == "remus100"


def test_a_slope_is_run_into():
    """Level at 6 m towards a floor that rises from 8 m by 0.2: 2 m less the hull is met after 9 m and more."""
    terrain = {"kind": "slope", "gradient": 0.2, "direction_deg": 180.0}
    track = {"kind": "track", "depth": 6.0, "radius": 0.1, "pattern": {"kind": "waypoints", "points": [[9.8, 0.0]]}}
    log = run(manoeuvre(6.0, 6.0, duration=12.0, world={"sea_floor": 8.0, "terrain": terrain}, mission=track))
    assert limits(log) == ["grounded"]
    truth = log.groups["vehicles/remus100/truth"]
    contact = log.groups["vehicles/remus100/contact"]
    north = np.interp(contact["time"][0], truth["time"], truth["position"][:, 0])
    assert 7.5 < north < 10.0


def at(place, pitch=0.0, field=None):
    """Whether a vehicle has surfaced at a place with a pitch."""
    world = World(scenes.scene({"auv": "remus100"}, {}, WorldSettings(), 100.0), field or Uniform((0.0, 0.0, 0.0)))
    world.place("auv", np.array([3.0, -2.0, 5.0]), 0.4, 0.0, [0.0] * 5)
    craft = world._craft["auv"]
    craft.position[:] = place[0], -place[1], -place[2]
    # A pitch about the body's starboard axis; yaw is left out, since the surface is level.
    craft._quaternion[:] = np.cos(pitch / 2), 0.0, -np.sin(pitch / 2), 0.0
    craft.refresh_water(world.current, 0.0)
    import mujoco

    mujoco.mj_kinematics(world.model, world.data)
    return world.surfaced("auv")


def test_surfaced_is_when_the_highest_part_of_the_hull_is_out():
    assert not at([3.0, -2.0, RADIUS + 0.005])
    assert at([3.0, -2.0, RADIUS - 0.005])
    pitch = 0.5
    highest = 0.8 * np.sin(pitch) + RADIUS * np.cos(pitch)  # of a cylinder as long as the strips
    assert not at([3.0, -2.0, highest + 0.03], pitch)  # the end strip's disc is wider by its half length
    assert at([3.0, -2.0, highest - 0.03], pitch)
    assert not at([3.0, -2.0, 0.81], 0.5 * np.pi)  # upright, the nose 0.8 m above the origin
    assert at([3.0, -2.0, 0.79], 0.5 * np.pi)


def test_surfaced_follows_the_waves():
    waves = Waves(WavesSettings(height=1.0, period=9.0), stream(4, 0, "waves"))
    level = waves.surface(0.0, np.array([3.0, -2.0, 0.0])).elevation
    assert abs(level) > 0.05
    for above, out in ((0.2, False), (0.03, True)):
        assert at([3.0, -2.0, above - level], field=waves) == out


def test_the_start_is_seen_on_the_slope():
    terrain = {"kind": "slope", "gradient": 0.5, "direction_deg": 180.0}
    with pytest.raises(InputError, match=r"start\.depth: 12 m is not between the surface and the sea floor at 10 m"):
        manoeuvre(12.0, 5.0, world={"sea_floor": 10.0, "terrain": terrain})
