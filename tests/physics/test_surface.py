"""The surface: buoyancy of strips, what fades with them, floating, waves; and that a vehicle cannot fly."""

import mujoco
import numpy as np
import pytest
from bodies import (
    DENSITY,
    GRAVITY,
    WHEEL,
    Rigid,
    body_force,
    command,
    dense,
    free_body,
    remus100,
    set_motion,
    set_water,
)
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from auvsim.base.frames import flip
from auvsim.base.randomness import stream
from auvsim.physics import water_slot
from auvsim.physics.submergence import disc_share, surface_above
from auvsim.water.settings import WavesSettings
from auvsim.water.waves import Waves

RADIUS, HALF, COUNT = 0.1, 0.8, 16
XS = HALF * (2.0 * np.arange(COUNT) + 1.0 - COUNT) / COUNT
VOLUME = np.pi * RADIUS**2 * 2.0 * HALF
STRIPS = {"hull_strip_x": XS, "hull_strip_area": np.full(COUNT, 2.0 * RADIUS * 2.0 * HALF / COUNT)}


def cylinder(density=0.7, added=None, drag=0.0, timestep=0.005, **more):
    """A cylinder of a density relative to the water's, its weight 2 cm below the axis."""
    mass = density * DENSITY * VOLUME
    fields = STRIPS | {"hull_linear_damping": drag * np.eye(6)}
    return free_body(
        added_mass=np.zeros((6, 6)) if added is None else added,
        rigid=Rigid(mass=mass - 0.5, centre=np.array([0.0, 0.0, 0.02])),
        volume=VOLUME,
        fields=fields,
        inside=WHEEL,
        gravity=GRAVITY,
        timestep=timestep,
        **more,
    )


def still(model, position, rotation=None, nu=(0, 0, 0, 0, 0, 0), elevation=0.0):
    """Force (6,) in body axes on the hull at a place, with a surface over still water."""
    data = mujoco.MjData(model)
    set_surface(data, elevation)
    set_motion(model, data, nu, rotation, position)
    return body_force(model, data)


def set_surface(data, elevation=0.0, rate=0.0):
    data.userdata[water_slot.SURFACE :][:3] = 1.0, elevation, rate


def segment(t):
    """Share of a unit disc below a level t, by quadrature of its chords."""
    return quad(lambda y: 2.0 * np.sqrt(1.0 - y * y), -1.0, t)[0] / np.pi


@pytest.mark.parametrize("t", [-0.9, -0.3, 0.0, 0.5, 0.99])
def test_share_of_a_disc(t):
    assert disc_share(0.3 * t, 0.3) == pytest.approx(segment(t), abs=1e-8)
    assert disc_share(0.31, 0.3) == 1.0
    assert disc_share(-0.31, 0.3) == 0.0


@pytest.mark.parametrize("depth", [-0.2, -0.06, 0.0, 0.03, 0.09, 0.5])
def test_buoyancy_of_a_level_cylinder(depth):
    force = still(cylinder(), [3.0, -1.0, depth])
    share = segment(np.clip(depth / RADIUS, -1.0, 1.0))
    assert force == pytest.approx([0, 0, -DENSITY * VOLUME * GRAVITY * share, 0, 0, 0], abs=1e-5)


def test_the_surface_is_where_the_slot_has_it():
    low, high = (still(cylinder(), [0, 0, 0.03 - e], elevation=e) for e in (0.0, 0.7))
    assert low == pytest.approx(high, abs=1e-9)


def test_a_trimmed_cylinder_is_the_sum_of_its_sections():
    """At 3 degrees the bow is out and the stern under; 400 sections by quadrature against 16 strips."""
    pitch, depth = np.radians(3.0), 0.02
    rotation = Rotation.from_euler("y", pitch).as_matrix()
    force = rotation @ still(cylinder(), [0, 0, depth], rotation)[:3]
    moment = still(cylinder(), [0, 0, depth], rotation)[4]
    x = HALF * (np.arange(400) + 0.5) / 200.0 - HALF
    shares = np.array([segment(np.clip((depth - s * np.sin(pitch)) / RADIUS, -1, 1)) for s in x])
    lifts = DENSITY * GRAVITY * VOLUME * shares / 400.0
    assert force[2] == pytest.approx(-lifts.sum(), rel=2e-3)  # the strips' width, 0.1 m of 1.6 m, to the second power
    assert moment == pytest.approx((lifts * x * np.cos(pitch)).sum(), rel=1e-2)
    assert moment < 0.0  # the stern floats up: the bow goes down


def test_strips_off_the_middle_still_centre_their_buoyancy():
    """Strips over -0.7 to 0.5 m: what is wholly out of the water must leave neither force nor moment."""
    fields = {"hull_strip_x": np.linspace(-0.7, 0.5, 13), "hull_strip_area": np.linspace(0.01, 0.02, 13)}
    model = free_body(added_mass=np.eye(6), volume=0.02, fields=fields, gravity=GRAVITY)
    pitched = Rotation.from_euler("y", 0.4).as_matrix()
    assert still(model, [0, 0, -3.0], pitched) == pytest.approx(np.zeros(6), abs=1e-10)
    assert still(model, [0, 0, 3.0], pitched)[:3] @ pitched[2] == pytest.approx(-DENSITY * 0.02 * GRAVITY)


def test_a_cylinder_on_end_goes_in_strip_by_strip():
    """Buoyancy grows in proportion to its length under water; a strip enters as a disc does, not as a cylinder."""
    upright = Rotation.from_euler("y", np.pi / 2).as_matrix()
    for depth in np.linspace(-0.7, 0.7, 29):
        share = -still(cylinder(), [0, 0, depth], upright) @ [*upright[2], 0, 0, 0] / (DENSITY * VOLUME * GRAVITY)
        assert share == pytest.approx(0.5 + 0.5 * depth / HALF, abs=0.006)  # a tenth of a strip's sixteenth


def test_deep_water_has_no_surface_bit_for_bit():
    """With and without the flag the remus100 moves alike when it is under water."""
    states = []
    for flag in (0.0, 1.0):
        model = remus100()
        data = mujoco.MjData(model)
        set_motion(model, data, [1.5, 0.1, 0, 0, 0, 0.1], position=[0, 0, 15.0])
        set_water(data, [0.2, -0.1, 0.0], [0.01, 0.0, 0.0], np.diag([0.01, -0.01, 0.0]))
        data.userdata[water_slot.SURFACE] = flag
        command(data, 0.1, -0.02, 1200, at_once=False)
        mujoco.mj_step(model, data, 500)
        states.append(np.concatenate([data.qpos, data.qvel]))
    assert np.array_equal(*states)


def test_air_is_no_water():
    """No force, and a dry inertia: a body falls at g."""
    added = dense(1, 20.0, 2.0)
    model = cylinder(added=added, drag=10.0)
    rotation = Rotation.from_rotvec([0.2, 0.5, -0.3]).as_matrix()
    assert still(model, [0, 0, -2.0], rotation, [1, 2, 3, 0.4, 0.5, 0.6]) == pytest.approx(np.zeros(6), abs=1e-10)
    data = mujoco.MjData(model)
    set_surface(data)
    set_motion(model, data, np.zeros(6), None, [0, 0, -2.0])
    assert data.qacc[:3] == pytest.approx([0.0, 0.0, -GRAVITY], abs=1e-9)


def test_added_mass_and_drag_fade_with_the_volume_under_water():
    """Half out of the water, a level cylinder has half of both."""
    added = np.diag([1.0, 30.0, 30.0, 0.1, 4.0, 4.0])
    model, nu = cylinder(added=added, drag=10.0), np.array([0.3, 0.5, 0.0, 0.0, 0.0, 0.0])
    under, half = still(model, [0, 0, 2.0], None, nu), still(model, [0, 0, 0.0], None, nu)
    assert half[[0, 1, 5]] == pytest.approx(0.5 * under[[0, 1, 5]], rel=1e-9)
    full = []
    for depth in (2.0, 0.0, -2.0):
        data, M = mujoco.MjData(model), np.zeros((model.nv, model.nv))
        set_surface(data)
        set_motion(model, data, np.zeros(6), None, [0, 0, depth])
        mujoco.mj_fullM(model, data, M)
        full.append(M[1, 1])
    assert full[0] - full[2] == pytest.approx(30.0, rel=1e-9)
    assert full[1] - full[2] == pytest.approx(15.0, rel=1e-9)


def test_fins_and_propeller_fade_with_their_own_depth():
    """The axis of the remus100 in the surface: half the thrust, no upper rudder, all of the lower one."""
    model = remus100()
    forces = {}
    for depth in (5.0, 0.0):
        for rpm, rudder in ((0.0, 0.0), (1200.0, 0.0), (0.0, 0.2)):
            data = mujoco.MjData(model)
            set_surface(data)
            command(data, rudder, 0.0, rpm)
            set_motion(model, data, [1.0, 0, 0, 0, 0, 0], position=[0, 0, depth])
            forces[depth, rpm, rudder] = body_force(model, data)
    thrusts = [forces[depth, 1200.0, 0.0][0] - forces[depth, 0.0, 0.0][0] for depth in (0.0, 5.0)]
    assert thrusts[0] == pytest.approx(0.5 * thrusts[1], rel=1e-9)
    sides = [forces[depth, 0.0, 0.2][1] - forces[depth, 0.0, 0.0][1] for depth in (0.0, 5.0)]
    assert sides[0] == pytest.approx(0.5 * sides[1], rel=1e-6)


def test_a_cylinder_floats_at_its_weight():
    """Where the share under water is its relative density, after drag has calmed it."""
    model = cylinder(0.7, drag=60.0)
    data = mujoco.MjData(model)
    set_surface(data)
    set_motion(model, data, np.zeros(6), None, [0, 0, 0.08])
    mujoco.mj_step(model, data, 6000)
    expected = brentq(lambda h: segment(h / RADIUS) - 0.7, -0.09, 0.09)
    assert -data.qpos[2] == pytest.approx(expected, abs=1e-4)


def test_heave_period_of_a_floating_cylinder():
    """omega^2 = rho g A_w / (m + A) for small heave, A_w the area in the surface, A half the added mass."""
    added = 10.0
    model = cylinder(0.5, added=np.diag([added] * 3 + [1.0] * 3), timestep=0.002)
    data = mujoco.MjData(model)
    set_surface(data)
    set_motion(model, data, np.zeros(6), None, [0, 0, 0.002])
    heights = []
    for _ in range(2000):
        mujoco.mj_step(model, data)
        heights.append(data.qpos[2])
    crossings = np.flatnonzero(np.diff(np.sign(heights))) * 0.002
    period = 2.0 * np.diff(crossings).mean()
    water_plane = 2.0 * RADIUS * 2.0 * HALF
    mass = 0.5 * DENSITY * VOLUME + 0.5 * added
    expected = 2.0 * np.pi * np.sqrt(mass / (DENSITY * GRAVITY * water_plane))
    assert period == pytest.approx(expected, rel=0.01)  # crossings to a step of 2 ms of 0.5 s


def test_a_float_rides_a_long_swell():
    """It goes up and down with a surface that rises and falls by a metre in 20 s, a fortieth of its own frequency."""
    model = cylinder(0.7, drag=20.0)
    data = mujoco.MjData(model)
    set_motion(model, data, np.zeros(6), None, [0, 0, 0.02])
    offsets, w = [], 2.0 * np.pi / 20.0
    for _ in range(400):
        data.userdata[0] = data.time
        set_surface(data, np.sin(w * data.time), w * np.cos(w * data.time))
        mujoco.mj_step(model, data, 20)
        offsets.append(data.qpos[2] - np.sin(w * data.time))
    assert np.std(offsets[200:]) < 0.02
    assert np.mean(offsets[200:]) == pytest.approx(-brentq(lambda h: segment(h / RADIUS) - 0.7, -0.09, 0.09), abs=0.01)


def flight(surface):
    """Greatest height of the remus100 above the mean surface, driven up at 30 degrees and full speed for 20 s."""
    model = remus100()
    data = mujoco.MjData(model)
    data.userdata[water_slot.SURFACE] = surface
    rotation = Rotation.from_euler("y", np.radians(30.0)).as_matrix()
    set_motion(model, data, [2.3, 0, 0, 0, 0, 0], rotation, [0, 0, 6.0])
    command(data, 0.0, -0.26, 1525)
    highest = -np.inf
    for _ in range(200):
        mujoco.mj_step(model, data, 10)
        highest = max(highest, data.qpos[2])
    return highest, data


def test_a_vehicle_cannot_fly():
    """It leaps no higher than its speed carries it, v^2 / 2 g = 0.27 m, and floats; in water without end it climbs."""
    assert flight(0.0)[0] > 5.0
    highest, data = flight(1.0)
    assert highest < 0.3
    assert np.all(np.isfinite(data.qpos))
    assert abs(data.qpos[2]) < 1.0


def test_the_slot_holds_the_surface_of_the_waves():
    """Expansion about a place and a time: 1 m and 0.2 s away its error is of the second order."""
    sea = Waves(WavesSettings(height=1.0, period=8.0, direction_deg=130.0), stream(3, 0, "current"))
    slot, place = np.zeros(water_slot.WATER), np.array([5.0, -7.0, 2.0])
    water_slot.fill(slot, 4.0, flip(place), sea.evaluate(4.0, place), sea.surface(4.0, place))
    for shift, later in (([0.5, 0, 0], 0.0), ([0, 0.5, 0], 0.0), ([0, 0, 0.5], 0.0), ([0, 0, 0], 0.1)):
        there = place + shift
        expected = sea.surface(4.0 + later, there).elevation + there[2]
        assert surface_above(slot, 0, 4.0 + later, *flip(there)) == pytest.approx(expected, abs=0.01)
    assert slot[4:7] == pytest.approx(flip(sea.evaluate(4.0, place).velocity))
