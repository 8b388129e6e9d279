"""Several vehicles and structures in one world: each has its own commands, water and latch, and they collide."""

import numpy as np
import pytest
from bodies import Rigid
from scipy.spatial.transform import Rotation

from auvsim.base.errors import DivergenceError, InputError
from auvsim.physics.scenes import WorldSettings, scene
from auvsim.physics.truth import StructurePose
from auvsim.physics.world import World
from auvsim.vehicles import library
from auvsim.water.currents import Shear, Uniform
from auvsim.water.settings import ShearPoint, ShearSettings

STILL = Uniform((0.0, 0.0, 0.0))
DOCK = library.structure("dock")
WEST = StructurePose(north=140.0, east=-95.0, depth=19.0, heading=2.3)
EAST = StructurePose(north=-31.0, east=77.0, depth=13.5, heading=-0.8)


def build(vehicles, structures=None, field=STILL, **settings):
    """A world of REMUS-100s and docks."""
    docks = {name: ("dock", pose) for name, pose in (structures or {}).items()}
    return World(scene(dict.fromkeys(vehicles, "remus100"), docks, WorldSettings(**settings), 100.0), field)


def ahead_of(pose, along, across=0.0):
    """A place (3,) in NED, in the dock's frame: along its axis and to starboard of it."""
    return pose.position + Rotation.from_euler("z", pose.heading).apply([along, across, 0.0])


def shear():
    points = (ShearPoint(depth=0.0, speed=0.6, direction_deg=35.0), ShearPoint(depth=30.0, speed=0.1))
    return Shear(ShearSettings(points=points))


PLACES = {"auv_1": (np.array([120.0, -60.0, 8.0]), 0.4), "auv_2": (np.array([-80.0, 55.0, 21.0]), -2.0)}
COMMANDS = {"auv_1": [0.1, 0.12, -0.05, -0.03, 60.0], "auv_2": [-0.2, -0.2, 0.08, 0.08, 110.0]}


def sail(world, calls=100):
    """Truths of all vehicles while each follows its own commands."""
    for name in world.vehicles:
        world.place(name, *PLACES[name], 1.1, [0.0, 0.0, 0.0, 0.0, 80.0])
    truths = {name: [] for name in world.vehicles}
    for _ in range(calls):
        for name in world.vehicles:
            world.command(name, COMMANDS[name])
        world.advance(10)
        for name in world.vehicles:
            truths[name].append(world.truth(name))
    return {
        name: [np.concatenate([np.ravel(part) for part in truth]) for truth in list_] for name, list_ in truths.items()
    }


@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
def test_each_of_two_of_a_model_moves_as_if_alone(integrator):
    """Own commands, own water (they are at different depths of a shear), to the last bit."""
    together = sail(build(PLACES, {"dock": WEST}, shear(), integrator=integrator))
    for name in PLACES:
        alone = sail(build([name], {"dock": WEST}, shear(), integrator=integrator))
        assert np.array_equal(together[name], alone[name])
        fins, shaft = together[name][-1][-5:-1], together[name][-1][-1]
        assert fins == pytest.approx(COMMANDS[name][:-1], abs=3e-4)  # 20 g behind the hinge bend a servo by 0.1 mrad
        assert shaft == pytest.approx(COMMANDS[name][-1], rel=1e-3)  # 10 of its time constants after the command


def test_the_name_of_a_vehicle_changes_no_number():
    first = sail(build(["auv_1"], {"dock": WEST}, shear()))["auv_1"]
    PLACES["a-long.name_7"], COMMANDS["a-long.name_7"] = PLACES["auv_1"], COMMANDS["auv_1"]
    try:
        other = sail(build(["a-long.name_7"], {"elsewhere": EAST}, shear()))["a-long.name_7"]
    finally:
        del PLACES["a-long.name_7"], COMMANDS["a-long.name_7"]
    assert np.array_equal(first, other)


MASS, VOLUME_CENTRE = 30.87, np.array([0.004048, 0.0, 0.020104])  # of the hull, forward-starboard-down
ADDED = np.diag([0.839, 29.44, 29.44, 0.0336, 3.426, 3.426])
# Movable fins of 20 g, 12 mm behind hinges at 0.735 m, and the propeller of 80 g: forward-starboard-down.
SMALL = [(0.02, [-0.747, 0, -0.13]), (0.02, [-0.747, 0, 0.13]), (0.02, [-0.747, 0.13, 0]), (0.02, [-0.747, -0.13, 0])]
SMALL.append((0.08, [-0.815, 0.0, 0.0]))


def momentum(truth):
    """Linear momentum (3,) in NED of a vehicle and of the water that it sets in motion, from the model's numbers."""
    inertia = Rigid(mass=MASS, centre=VOLUME_CENTRE, inertia=np.diag([0.111, 3.933, 3.932])).matrix + ADDED
    body = (inertia @ truth.nu)[:3]
    for mass, place in SMALL:
        body = body + mass * (truth.nu[:3] + np.cross(truth.nu[3:], place))
    w, x, y, z = truth.quaternion
    return Rotation.from_quat((x, y, z, w)).apply(body)


def meet(offset, calls=100):
    """Two vehicles that run at each other's noses, their shafts at rest.

    Returns the world, the unit vector (3,) from the first to the second, and for every tick the truths of both.
    """
    world = build(["auv_1", "auv_2"])
    course, middle = 0.7, np.array([300.0, -120.0, 15.0])
    axis, across = np.array([np.cos(course), np.sin(course), 0.0]), np.array([-np.sin(course), np.cos(course), 0.0])
    world.place("auv_1", middle - 1.2 * axis, course, 1.3, [0.0] * 5)
    world.place("auv_2", middle + 1.0 * axis + offset * across, course + np.pi, 0.8, [0.0] * 5)
    ticks = []
    for _ in range(calls):
        world.advance(1)
        ticks.append([world.truth(name) for name in world.vehicles])
    return world, axis, ticks


def nose_sphere(truth):
    """Centre (3,) of the sphere of radius 0.095 m in which the hull ends ahead."""
    return truth.position + Rotation.from_euler("ZYX", truth.attitude[::-1]).apply([0.705, 0.0, 0.0])


@pytest.mark.parametrize("offset", [0.0, 0.04, -0.06])
def test_two_vehicles_that_meet_head_on_touch_and_bounce(offset):
    world, axis, ticks = meet(offset)
    first, second = (world.contacts(name) for name in world.vehicles)
    assert {contact.other for contact in first} == {"auv_2"}
    assert {contact.other for contact in second} == {"auv_1"}
    # Each feels the same force at the same time, and the blow of some 40 N s is over in a tick.
    assert [contact[:2] for contact in first] == [contact[:2] for contact in second]
    momenta = np.array([[momentum(truth) for truth in pair] for pair in ticks])
    hit = round(first[0].time / 0.01) - 1
    exchanged = momenta[hit, 0] - momenta[hit - 1, 0]
    assert np.linalg.norm(exchanged) > 30.0
    # The force is the whole one: without friction (0.2 of the normal force) it were 2 % less off the centre.
    assert first[0].force * 0.01 == pytest.approx(np.linalg.norm(exchanged), rel=5e-3)
    # What the first loses the second gains, but for 10 N of drag during the tick.
    assert momenta[hit].sum(axis=0) == pytest.approx(momenta[hit - 1].sum(axis=0), abs=0.1)
    # They came together and part, and did not go through each other.
    distance = [(pair[1].position - pair[0].position) @ axis for pair in ticks]
    assert distance[hit] < distance[hit - 10] - 0.15
    assert distance[hit + 10] > distance[hit] + 0.002
    gaps = [np.linalg.norm(nose_sphere(pair[1]) - nose_sphere(pair[0])) - 2 * 0.095 for pair in ticks]
    assert min(gaps) > -0.015  # a step at their closing speed of 2 m/s is 0.02 m


def test_the_recorded_force_is_what_the_other_vehicle_takes_over():
    """Tick by tick in a central hit: force x time is the change of the first one's momentum but for thrust and drag."""
    world, axis, ticks = meet(0.0)
    contact = world.contacts("auv_1")[0]
    at = round(contact.time / 0.01) - 1
    lost = -(momentum(ticks[at][0]) - momentum(ticks[at - 1][0])) @ axis
    assert contact.force * 0.01 == pytest.approx(lost, rel=5e-3)  # drag; without added mass 2.6 %
    assert contact.force > 500.0


def test_vehicles_that_pass_do_not_touch():
    world, axis, ticks = meet(1.0, calls=200)
    assert not world.contacts("auv_1")
    assert not world.contacts("auv_2")
    assert (ticks[-1][1].position - ticks[-1][0].position) @ axis < 0.0


def test_a_long_call_does_not_let_vehicles_pass_through_each_other():
    world = build(["auv_1", "auv_2"])
    world.place("auv_1", np.array([0.0, 200.0, 15.0]), 0.0, 2.0, [0.0, 0.0, 0.0, 0.0, 120.0])
    world.place("auv_2", np.array([30.0, 200.0, 15.0]), np.pi, 2.0, [0.0, 0.0, 0.0, 0.0, 120.0])
    world.advance(1500)
    assert world.contacts("auv_1")


def captured(world, vehicle, pose, seconds=12.0):
    """Runs a vehicle into a dock; returns whether its latch took it."""
    world.place(vehicle, ahead_of(pose, -3.0, 0.06), pose.heading, 1.0, [0.0, 0.0, 0.0, 0.0, 62.0])
    for _ in range(round(seconds / 0.1)):
        world.advance(10)
    return world.latched(vehicle)


def nose_tip(truth):
    """The nose (3,) in NED."""
    return truth.position + Rotation.from_euler("ZYX", truth.attitude[::-1]).apply([0.8, 0.0, 0.0])


def park(world, *names):
    for i, name in enumerate(names):
        world.place(name, np.array([-400.0 - 10.0 * i, 400.0, 20.0]), 0.3, 0.0, [0.0] * 5)


def test_each_latch_holds_its_own_vehicle_at_its_own_place():
    world = build(["auv_1", "auv_2", "auv_3"], {"west": WEST, "east": EAST})
    park(world, "auv_3")
    world.place("auv_1", ahead_of(EAST, -3.0, 0.1), EAST.heading, 1.0, [0.0, 0.0, 0.0, 0.0, 62.0])
    world.place("auv_2", ahead_of(WEST, -3.5, -0.2), WEST.heading, 1.0, [0.0, 0.0, 0.0, 0.0, 62.0])
    for _ in range(200):
        world.advance(10)
    assert [world.latched(name) for name in world.vehicles] == ["east", "west", None]
    assert {name: state.latched for name, state in world.structures.items()} == {"east": "auv_1", "west": "auv_2"}
    for vehicle, pose in (("auv_1", EAST), ("auv_2", WEST)):
        nose = nose_tip(world.truth(vehicle))
        # Thrust of 13 N on a soft weld draws it 1 cm past where the latch holds it.
        assert nose == pytest.approx(ahead_of(pose, DOCK.latched), abs=0.02)
        assert {contact.other for contact in world.contacts(vehicle)} <= {"east" if pose is EAST else "west"}


def test_two_that_dock_at_once_move_as_if_alone():
    """Contact and latch of one do not reach the other: equal but for the rounding of one solver for both."""

    def dock(*names):
        world = build(names, {"west": WEST, "east": EAST})
        starts = {"auv_1": (EAST, -3.0, 0.1), "auv_2": (WEST, -3.5, -0.4)}
        for name in names:
            pose, along, across = starts[name]
            world.place(name, ahead_of(pose, along, across), pose.heading, 1.0, [0.0, 0.0, 0.0, 0.0, 62.0])
        world.advance(1200)
        return world

    together = dock("auv_1", "auv_2")
    for name in together.vehicles:
        alone = dock(name)
        assert together.latched(name) == alone.latched(name) is not None
        assert len(together.contacts(name)) == len(alone.contacts(name)) > 0
        for found, expected in zip(together.truth(name), alone.truth(name), strict=True):
            assert found == pytest.approx(expected, abs=1e-11)  # measured 1e-14


def test_an_occupied_structure_captures_no_other():
    world = build(["auv_1", "auv_2"], {"west": WEST})
    park(world, "auv_2")
    assert captured(world, "auv_1", WEST) == "west"
    held = nose_tip(world.truth("auv_1"))
    assert captured(world, "auv_2", WEST) is None
    assert world.structures["west"].latched == "auv_1"
    assert "auv_1" in {contact.other for contact in world.contacts("auv_2")}  # it ran into the one inside
    # Pushed with 13 N after a blow at 1 m/s, the first one's nose stays where the latch holds it.
    assert nose_tip(world.truth("auv_1")) == pytest.approx(held, abs=0.05)


def test_even_a_nose_in_the_throat_is_left_alone_by_an_occupied_structure():
    """The second vehicle is put inside the capture zone while the first is held: no latch closes on it."""
    world = build(["auv_1", "auv_2"], {"west": WEST})
    park(world, "auv_2")
    assert captured(world, "auv_1", WEST) == "west"
    world.place("auv_2", ahead_of(WEST, DOCK.latched - 0.8), WEST.heading, 0.0, [0.0] * 5)
    world.advance(1)
    assert world.latched("auv_2") is None
    assert world.data.eq_active.sum() == 1
    # Taken away and put back without the first, it is captured.
    park(world, "auv_1")
    world.place("auv_2", ahead_of(WEST, DOCK.latched - 0.8), WEST.heading, 0.0, [0.0] * 5)
    world.advance(1)
    assert world.latched("auv_1") is None
    assert world.structures["west"].latched == "auv_2"


def test_a_held_vehicle_is_not_captured_by_another_structure():
    """Two docks in one place: only the first latch closes, and holds one vehicle."""
    world = build(["auv_1"], {"west": WEST, "twin": WEST})
    world.place("auv_1", ahead_of(WEST, DOCK.latched - 0.8), WEST.heading, 0.0, [0.0] * 5)
    world.advance(3)
    assert world.latched("auv_1") == "west"
    assert world.structures["twin"].latched is None
    assert world.data.eq_active.sum() == 1


def test_divergence_names_the_vehicle():
    world = build(["auv_1", "auv_2"])
    park(world, "auv_1", "auv_2")
    world.data.qvel[world.model.joint("auv_2/plane_port").dofadr[0]] = 1e9
    with pytest.raises(DivergenceError, match=r"^diverged at 0\.01 s: joint 'auv_2/"):
        world.advance(1)


def test_many_shafts_at_full_speed_are_no_divergence():
    """The bound on speeds is each vehicle's own."""
    names = [f"auv_{i}" for i in range(42)]  # 42 x 158^2 is above the bound of 1e6, each far below it
    world = build(names)
    for i, name in enumerate(names):
        world.place(name, np.array([100.0 * i, 0.0, 20.0]), 0.0, 2.0, [0.0, 0.0, 0.0, 0.0, 158.0])
    world.advance(1)


def test_placed_actuators_already_carry_out_their_commands():
    world = build(["auv_1", "auv_2"], {"west": WEST})
    park(world, "auv_1")
    for channels in ([0.1, 0.12, -0.05, -0.03, 60.0], [-0.2, 0.2, 0.0, 0.15, -40.0]):  # again, over what was
        world.place("auv_2", np.array([20.0, -30.0, 9.0]), -2.0, 1.0, channels)
        assert np.array_equal(world.truth("auv_2").actuators, channels)
        assert world.truth("auv_2").nu == pytest.approx([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], abs=1e-15)
        world.advance(40)
        assert world.truth("auv_2").actuators == pytest.approx(channels, abs=0.2)
        assert world.truth("auv_1").actuators == pytest.approx(np.zeros(5), abs=1e-3)  # and the other's do not


def test_a_vehicle_without_a_place_is_named():
    world = build(["auv_1", "auv_2"])
    park(world, "auv_2")
    with pytest.raises(InputError, match=r"^vehicles without a place: auv_1; place them first$"):
        world.advance(1)
    park(world, "auv_1")
    world.advance(1)
    world.reset()
    with pytest.raises(InputError, match=r"^vehicles without a place: auv_1, auv_2;"):
        world.advance(1)


def test_a_world_without_structures_has_a_floor_all_the_same():
    world = build(["auv_1"], sea_floor=25.0)
    assert world.terrain.depth(3.0, -4.0) == 25.0
    world.place("auv_1", np.array([900.0, 50.0, 23.6]), -1.0, 1.5, [0.0, 0.0, 0.2, 0.2, 93.0])
    world.advance(800)
    assert {contact.other for contact in world.contacts("auv_1")} == {"sea_floor"}
