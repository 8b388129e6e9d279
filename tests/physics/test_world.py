"""The world: scene, placing, currents, contact with the dock, the latch, and divergence."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from auvsim.base.errors import DivergenceError, InputError
from auvsim.physics.scenes import WorldSettings, compile_scene, compose, scene
from auvsim.physics.truth import StructurePose
from auvsim.physics.world import World
from auvsim.vehicles import library
from auvsim.vehicles.actuation import Commands
from auvsim.water.currents import Shear, Turning, Uniform
from auvsim.water.settings import ShearPoint, ShearSettings, TurningSettings

VEHICLE, DOCK = library.vehicle("remus100"), library.structure("dock")
DEPTH, HEADING = 20.0, 0.7
PLACE = (0.0, 0.0)


class Alone(World):
    """A world of one vehicle and one dock, whose names need not be said."""

    @property
    def pose(self):
        return self.structures["dock"].pose

    @property
    def is_latched(self):
        return self.latched("remus100") == "dock"

    @property
    def touches(self):
        return self.contacts("remus100")

    def put(self, position, heading, speed, shaft_speed):
        self.reset()
        self.place("remus100", position, heading, speed, [0.0, 0.0, 0.0, 0.0, shaft_speed])

    def steer(self, rudder, elevator, shaft_speed):
        self.command("remus100", VEHICLE.actuation.allocate(Commands(rudder, elevator, shaft_speed)))

    def state(self):
        return self.truth("remus100")


def build(current=(0.0, 0.0, 0.0), *, heading=0.0, rate=100.0, depth=DEPTH, place=PLACE, field=None, **settings):
    pose = StructurePose(north=place[0], east=place[1], depth=depth, heading=heading)
    field = Uniform(current) if field is None else field
    surroundings = WorldSettings(**settings)
    fleet, structures = {"remus100": "remus100"}, {"dock": ("dock", pose)}
    return Alone(scene(fleet, structures, surroundings, rate), field, surroundings.water_density)


def fin_corners(world):
    """Corners (n, 3) of all fins and stabilisers, in the dock frame: along the axis, to starboard, down."""
    model, data = world.model, world.data
    corners = []
    for geom in range(model.ngeom):
        name = model.body(model.geom_bodyid[geom]).name
        if any(part in name for part in ("rudder", "plane", "stabiliser")):
            signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1)
            offsets = data.geom_xmat[geom].reshape(3, 3) @ (model.geom_size[geom][:, None] * signs)
            corners.append((data.geom_xpos[geom][:, None] + offsets).T)
    corners = np.concatenate(corners) * [1.0, -1.0, -1.0] - world.pose.position
    return corners @ Rotation.from_euler("z", world.pose.heading).as_matrix()


def nose(world):
    """The nose in the dock frame (3,)."""
    site = world.data.site("remus100/nose").xpos * [1.0, -1.0, -1.0] - world.pose.position
    return site @ Rotation.from_euler("z", world.pose.heading).as_matrix()


def approach(world, across=0.0, below=0.0, seconds=10.0):
    """Runs the vehicle at the dock.

    Returns, for every tick: latched, the nose (3,), the depth of contact, and how far a latched vehicle's fins reach
    in.
    """
    c, s = np.cos(world.pose.heading), np.sin(world.pose.heading)
    position = world.pose.position + np.array([-3.0 * c - s * across, -3.0 * s + c * across, below])
    world.put(position, world.pose.heading, 1.0, 62.0)
    ticks = []
    for _ in range(round(seconds / world.model.opt.timestep)):
        world.advance(1)
        depth = -world.data.contact.dist.min() if world.data.ncon else 0.0
        reach = fin_corners(world)[:, 0].max() if world.is_latched else -np.inf
        ticks.append((world.is_latched, nose(world), depth, reach))
    return ticks


def test_a_placed_vehicle_is_where_and_how_it_was_asked():
    world = build((0.3, -0.2, 0.1))
    world.put(np.array([-30.0, 40.0, 12.0]), 2.0, 1.4, 90.0)
    truth = world.state()
    assert truth.time == 0.0
    assert truth.position == pytest.approx([-30, 40, 12], abs=1e-12)
    assert truth.attitude == pytest.approx([0, 0, 2.0], abs=1e-12)
    rotation = Rotation.from_euler("z", 2.0).as_matrix()
    over_ground = rotation.T @ [0.3, -0.2, 0.1] + [1.4, 0, 0]
    assert truth.nu == pytest.approx([*over_ground, 0, 0, 0], abs=1e-12)
    assert truth.actuators[-1] == 90.0
    assert np.array_equal(truth.current, [0.3, -0.2, 0.1])
    assert not truth.actuators[:-1].any()


def test_placing_again_forgets_what_was():
    world = build()
    approach(world, across=0.3, seconds=6.0)
    assert world.is_latched
    assert world.touches
    assert world.time > 5.0
    world.put(np.array([-50.0, 0.0, 20.0]), 0.0, 1.0, 62.0)
    assert (world.time, world.is_latched, world.touches) == (0.0, False, [])
    fresh = build()
    fresh.put(np.array([-50.0, 0.0, 20.0]), 0.0, 1.0, 62.0)
    for other in (world, fresh):
        other.steer(0.1, 0.05, 100.0)
        other.advance(300)
    assert np.array_equal(world.data.qpos, fresh.data.qpos)  # to the last bit: nothing of the first run is left


@pytest.mark.parametrize("depth", [0.0, -1.0, 40.0, 55.0, float("nan")])
def test_a_start_out_of_the_water_is_refused(depth):
    world = build()
    with pytest.raises(InputError, match=r"start depth \S+ m is not between the surface and the sea floor at 40 m"):
        world.put(np.array([0.0, 0.0, depth]), 0.0, 1.0, 60.0)


def test_truth_keeps_time_and_frames():
    """After a while: position is the integral of R nu, attitude agrees with the quaternion, fins with the commands."""
    world = build(integrator="RK4")
    world.put(np.array([-200.0, 0.0, 20.0]), 0.5, 1.0, 90.0)
    world.steer(0.12, 0.05, 90.0)
    travelled = np.zeros(3)
    before = world.state()
    for _ in range(500):
        world.advance(1)
        after = world.state()
        velocities = []
        for truth in (before, after):
            w, x, y, z = truth.quaternion
            rotation = Rotation.from_quat((x, y, z, w))
            assert Rotation.from_euler("ZYX", truth.attitude[::-1]).as_matrix() == pytest.approx(
                rotation.as_matrix(), abs=1e-12
            )
            velocities.append(rotation.apply(truth.nu[:3]))
        travelled += 0.01 * np.mean(velocities, axis=0)
        before = after
    # The trapezoidal rule: h^2 / 12 times the change of acceleration, some 1e-5 m.
    assert before.position - [-200, 0, 20] == pytest.approx(travelled, abs=1e-4)
    assert before.time == pytest.approx(5.0, abs=1e-12)
    assert before.attitude[2] > 0.5 + 0.1  # positive rudder: to starboard
    assert before.position[2] > 20.1  # positive elevator: down
    # A plane's 20 g, 12 mm behind its hinge, turn its servo of 20 N m/rad by 0.1 mrad.
    assert before.actuators[:-1] == pytest.approx([0.12, 0.12, 0.05, 0.05], abs=2e-4)
    assert before.actuators[-1] == pytest.approx(90.0, rel=2e-3)


def test_advance_gives_the_same_in_one_piece_and_tick_by_tick():
    """Near the dock each tick is watched, far from it they go in one call: not a bit of difference."""
    runs = []
    for pieces in ((40, 60), (1,) * 100):
        world = build((0.2, 0.1, 0.0))
        world.put(np.array([-4.6, 0.2, 20.0]), 0.0, 1.0, 62.0)
        world.steer(0.05, 0.0, 62.0)
        for ticks in pieces:
            world.advance(ticks)
        runs.append(np.concatenate([world.data.qpos, world.data.qvel]))
    assert np.array_equal(*runs)


def test_the_water_in_userdata_is_the_current_here_and_now():
    shear = Shear(
        ShearSettings(profile="linear", points=(ShearPoint(depth=0.0, speed=0.0), ShearPoint(depth=40.0, speed=0.8)))
    )
    world = build(field=shear)
    world.put(np.array([-60.0, 10.0, 15.0]), 0.0, 1.0, 62.0)
    assert world.state().nu[0] == pytest.approx(1.0 + 0.3)
    world.advance(50)
    world.refresh_water()
    slot = world.data.userdata
    depth = world.state().position[2]
    assert slot[0] == world.time
    assert slot[1:4] * [1, -1, -1] == pytest.approx(world.state().position, abs=1e-12)
    assert slot[4:7] == pytest.approx([0.02 * depth, 0, 0], abs=1e-12)
    assert slot[10:19].reshape(3, 3) == pytest.approx(np.array([[0, 0, -0.02], [0, 0, 0], [0, 0, 0]]), abs=1e-12)


def test_a_turning_current_turns_the_drift():
    """Without thrust the vehicle ends up going with the water, which then flows east."""
    world = build(field=Turning(TurningSettings(speed=0.5, start=5.0, end=15.0)))
    world.put(np.array([-200.0, 0.0, 20.0]), 0.0, 0.0, 0.0)
    for _ in range(600):
        world.advance(10)
    truth = world.state()
    w, x, y, z = truth.quaternion
    velocity = Rotation.from_quat((x, y, z, w)).apply(truth.nu[:3])
    assert truth.current == pytest.approx([0, 0.5, 0], abs=1e-12)
    # Quadratic drag forgets as 1 / t: (m + a) / (k t) = 60 kg / (190 kg/m x 45 s) across, slower ahead.
    assert velocity == pytest.approx([0, 0.5, 0], abs=0.1)


@pytest.mark.parametrize(("heading", "place"), [(0.0, PLACE), (HEADING, PLACE), (-2.1, (130.0, -45.0))])
def test_the_latch_closes_in_the_throat_and_holds_the_vehicle_clear_of_the_cone(heading, place):
    ticks = approach(build(heading=heading, place=place), 0.05, seconds=20.0)
    closed = next(i for i, (latched, *_) in enumerate(ticks) if latched)
    # Captured within the cylinder 0.1 to 0.4 m behind the cone's end, a tick (0.01 m) before the latch is seen closed.
    x, y, z = ticks[closed][1]
    assert 1.03923 + 0.1 - 0.02 < x < 1.03923 + 0.4
    assert np.hypot(y, z) < 0.15
    assert ticks[closed - 1][1][0] < 1.03923 + 0.1 + 0.02
    latched = ticks[closed:]
    assert all(tick[0] for tick in latched)
    # Fins stand 0.173 m out from the axis: beyond the mouth plane the cone would still clear them only to 1.0 m.
    assert max(tick[3] for tick in latched) < 0.0
    final = ticks[-1][1]
    # Thrust of 13 N on a soft weld draws it 1 cm past where the latch holds it.
    assert final == pytest.approx([DOCK.latched, 0.0, 0.0], abs=0.02)
    assert np.ptp([tick[1] for tick in ticks[-100:]], axis=0).max() < 0.01


@pytest.mark.parametrize(("across", "below"), [(0.1, 0.0), (0.3, 0.0), (-0.5, 0.2), (0.6, 0.0), (0.0, -0.6)], ids=str)
def test_a_hit_on_the_cone_guides_the_vehicle_in_without_going_through(across, below):
    world = build()
    ticks = approach(world, across, below)
    assert world.touches
    assert max(tick[2] for tick in ticks) < 0.01  # [m] deep at 1 m/s; measured 2.5 mm
    assert world.is_latched
    assert max(tick[3] for tick in ticks if tick[0]) < 0.0
    times = [contact.time for contact in world.touches]
    assert times == sorted(times)
    assert all(contact.force > 0.0 and contact.other == "dock" for contact in world.touches)


def test_a_hit_on_the_rim_stays_out_of_the_wall():
    world = build()
    ticks = approach(world, 0.74, seconds=10.0)
    assert world.touches
    assert max(tick[2] for tick in ticks) < 0.01  # edge on; measured 9.7 mm


def test_no_latch_and_no_contact_beside_the_dock():
    world = build()
    ticks = approach(world, 1.2, seconds=8.0)
    assert not any(tick[0] for tick in ticks)
    assert not world.touches
    assert ticks[-1][1][0] > 2.0  # it passed


def test_the_recorded_force_is_the_change_of_momentum():
    """The first touch of the cone: |dP| / dt of that tick, added mass in P, but for 15 N of drag and thrust."""
    world = build()
    world.put(np.array([-3.0, 0.1, 20.0]), 0.0, 1.0, 62.0)

    def momentum():
        mujoco.mj_forward(world.model, world.data)
        full = np.zeros((world.model.nv, world.model.nv))
        mujoco.mj_fullM(world.model, world.data, full)
        return (full @ world.data.qvel)[:3]

    while not world.touches:
        before = momentum()
        world.advance(1)
        assert world.time < 5.0
    impulse = np.linalg.norm(momentum() - before)
    assert world.touches[0].time == world.time
    assert world.touches[0].force == pytest.approx(impulse / 0.01, rel=0.03)
    assert world.touches[0].force > 500.0


def test_the_sea_floor_holds():
    world = build(sea_floor=30.0)
    world.put(np.array([-100.0, 0.0, 28.5]), 0.0, 1.5, 93.0)
    world.steer(0.0, 0.2, 93.0)
    world.advance(1000)
    assert {contact.other for contact in world.touches} == {"sea_floor"}
    # The hull's radius above it, on fins 0.173 m out, with its nose down on the floor.
    assert 29.0 < world.state().position[2] < 30.0 - 0.09


def test_divergence_is_an_error_with_a_diagnosis():
    world = build()
    world.put(np.array([-100.0, 0.0, 20.0]), 0.0, 1.0, 62.0)
    world.data.qvel[world.model.joint("remus100/rudder_upper").dofadr[0]] = 1e9
    with pytest.raises(DivergenceError) as caught:
        world.advance(1)
    message = str(caught.value)
    assert message.startswith("diverged at 0.01 s: joint 'remus100/")
    assert message.endswith("raise rates.physics above 100 Hz")
    assert "\n" not in message
    world.put(np.array([-100.0, 0.0, 20.0]), 0.0, 1.0, 62.0)
    world.advance(100)  # and the next run is a new one
    assert world.state().nu[0] == pytest.approx(1.0, abs=0.05)


def test_a_value_that_is_not_a_number_is_divergence():
    world = build()
    world.put(np.array([-100.0, 0.0, 20.0]), 0.0, 1.0, 62.0)
    world.data.qpos[0] = np.nan
    with pytest.raises(DivergenceError):
        world.advance(10)


def test_a_scene_that_mujoco_refuses_is_an_input_error():
    vehicle = library.vehicle("remus100")
    vehicle.root.find("body", "propeller").inertial.mass = 0.0
    dock = (library.structure("dock"), StructurePose(depth=DEPTH, heading=0.0))
    root = compose({"remus100": vehicle}, {"dock": dock}, WorldSettings(), 100.0)
    with pytest.raises(InputError, match=r"^scene 'trial': "):
        compile_scene(root)


def test_two_worlds_at_once_do_not_disturb_each_other():
    def run(worlds):
        for world, current in zip(worlds, (0.1, -0.2), strict=False):
            world.put(np.array([-50.0, 0.0, 20.0]), current, 1.0, 62.0)
        for _ in range(20):
            for world in worlds:
                world.steer(0.1, 0.0, 80.0)
                world.advance(10)
        return [world.data.qpos.copy() for world in worlds]

    together = run([build((0.1, 0, 0)), build((-0.3, 0.2, 0))])
    assert np.array_equal(together[0], run([build((0.1, 0, 0))])[0])


def test_the_water_of_one_call_is_right_to_second_order():
    """A turning current, expanded once a call: against an expansion every tick the error falls with the square."""

    def velocity(ticks: int) -> np.ndarray:
        world = build(field=Turning(TurningSettings(speed=0.5, start=0.0, end=10.0)))
        world.put(np.array([-200.0, 0.0, 20.0]), 0.0, 1.0, 62.0)
        for _ in range(400 // ticks):
            world.advance(ticks)
        return world.data.qvel[:6].copy()

    exact = velocity(1)
    coarse, fine = (np.linalg.norm(velocity(ticks) - exact) for ticks in (40, 20))
    # Expansions of 0.4 and 0.2 s against 0.01 s, which itself is off by 1/400 of the finer one's error.
    assert coarse / fine == pytest.approx(4.0, rel=0.1)
    assert fine < 1e-3


def test_truth_is_what_mujoco_and_scipy_say():
    """Position, quaternion, attitude and body velocity of a vehicle that rolls, pitches and turns."""
    world = build((0.2, -0.1, 0.05))
    world.put((3.0, -4.0, 15.0), 1.1, 1.4, 80.0)
    world.steer(0.2, -0.15, 90.0)
    world.advance(250)
    pose, velocity, truth = world.data.qpos[:7], world.data.qvel[:6], world.state()
    ned = Rotation.from_euler("x", np.pi)
    body = ned * Rotation.from_quat(pose[3:], scalar_first=True) * ned
    yaw, pitch, roll = body.as_euler("ZYX")
    assert min(abs(roll), abs(pitch), abs(yaw)) > 1e-3
    assert truth.position == pytest.approx(ned.apply(pose[:3]), abs=1e-12)
    assert truth.attitude == pytest.approx((roll, pitch, yaw), abs=1e-12)
    assert truth.nu[:3] == pytest.approx(body.inv().apply(ned.apply(velocity[:3])), abs=1e-12)
    assert truth.nu[3:] == pytest.approx(ned.apply(velocity[3:]), abs=1e-12)
    assert Rotation.from_quat(truth.quaternion, scalar_first=True).approx_equal(body, atol=1e-12)


def test_what_is_far_is_not_looked_at_again_before_it_can_be_near():
    """The same states bit for bit as of a world that looks at every step; near the dock and the floor it looks, too."""
    runs, looks = [], []
    for patient in (True, False):
        world = build(sea_floor=400.0)
        world.put((-30.0, 0.1, DEPTH), 0.0, 1.5, 90.0)
        world.steer(0.0, 0.0, 90.0)
        look, count = world._is_near, [0]

        def counted(look=look, count=count):
            count[0] += 1
            return look()

        world._is_near, world._looks_ahead, states = counted, patient, []
        for _ in range(250):
            world.advance(10)
            states.append(np.concatenate((world.data.qpos, world.data.qvel)))
        assert world.time == world.data.time == pytest.approx(25.0)
        assert world.is_latched
        runs.append(np.array(states))
        looks.append(count[0])
    assert (runs[0] == runs[1]).all()
    assert looks[0] < 0.6 * looks[1]
