"""Contact with a dock's panels in SI units: stiffness, damping, and what does not depend on the step."""

import mujoco
import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.physics import scenes
from auvsim.physics.scenes import WorldSettings
from auvsim.physics.truth import StructurePose
from auvsim.physics.world import World
from auvsim.vehicles import library
from auvsim.water.currents import Uniform

STIFFNESS, DAMPING = 24000.0, 600.0  # of dock_tube
RADIUS, CAP = 0.095, 0.705  # of the hull; centre of its nose's sphere ahead of the origin [m]
CONE = np.radians(30.0)


def build(rate=100.0, heading=0.0):
    dock = ("dock_tube", StructurePose(depth=20.0, heading=heading))
    scene = scenes.scene({"auv": "remus100"}, {"tube": dock}, WorldSettings(), rate)
    return World(scene, Uniform((0.0, 0.0, 0.0)))


def press(world, depth, speed=0.0):
    """Normal force [N] on the nose that is pressed that deep [m] into the cone, and goes deeper at a speed [m/s]."""
    along = 0.4
    across = 0.75 - along * np.tan(CONE) - (RADIUS - depth) / np.cos(CONE)
    world.place("auv", np.array([along - CAP, across, 20.0]), 0.0, 0.0, [0.0] * 5)
    world.data.qvel[:3] = speed * np.array([np.sin(CONE), -np.cos(CONE), 0.0])
    mujoco.mj_forward(world.model, world.data)
    assert world.data.ncon == 1
    force = np.zeros(6)
    mujoco.mj_contactForce(world.model, world.data, 0, force)
    return force[0]


def test_panels_are_springs_and_dampers_as_their_model_says():
    """To a tenth: MuJoCo's impedance of 0.05 and the nose's inverse mass, which is thrice the mean one."""
    world = build()
    for depth in (0.001, 0.002, 0.004):
        assert press(world, depth) == pytest.approx(STIFFNESS * depth, rel=0.11)
    slope = (press(world, 0.002, 0.1) - press(world, 0.002)) / 0.1
    assert slope == pytest.approx(DAMPING, rel=0.11)
    assert press(world, 0.004) == pytest.approx(4.0 * press(world, 0.001), rel=0.01)


def hit(rate, across):
    """Largest force [N] and impulse [N s] of a vehicle that comes in at 1 m/s off the axis."""
    world = build(rate)
    world.place("auv", np.array([-2.5, across, 20.0]), 0.0, 1.0, [0.0, 0.0, 0.0, 0.0, 75.0])
    world.advance(round(4.0 * rate))
    found = world.contacts("auv")
    return max(c.force for c in found), sum(c.force * c.duration for c in found)


@pytest.mark.parametrize("across", [0.4, 0.55])
def test_peak_and_impulse_do_not_depend_on_the_step(across):
    """Within a tenth between 50 and 1000 Hz: what the vehicle moves in a substep, on the spring, is 6 % of the peak."""
    fine_peak, fine_impulse = hit(1000.0, across)
    for rate in (50.0, 100.0, 200.0):
        peak, impulse = hit(rate, across)
        assert peak == pytest.approx(fine_peak, rel=0.1)
        assert impulse == pytest.approx(fine_impulse, rel=0.1)
    assert 200.0 < fine_peak < np.sqrt(STIFFNESS * 60.0)  # of all that moves, stopped at once from 1 m/s


def test_the_tube_takes_the_whole_hull():
    """Latched and drawn in, all of the vehicle is within the tube, and straight."""
    world = build()
    world.place("auv", np.array([-1.0, 0.1, 20.1]), 0.1, 1.0, [0.0, 0.0, 0.0, 0.0, 75.0])
    world.advance(1500)
    assert world.latched("auv") == "tube"
    truth, dock = world.truth("auv"), library.structure("dock_tube")
    nose, tail = truth.position[0] + 0.8, truth.position[0] + 0.8 - library.vehicle("remus100").length
    assert nose == pytest.approx(dock.latched, abs=0.05)
    assert tail > dock.cone_length
    assert np.abs(truth.attitude[1:]).max() < dock.aligned_within


def test_a_step_too_long_for_the_panels_is_refused():
    with pytest.raises(InputError, match=r"rates\.physics: 15 Hz is too slow for the panels of 'tube'; at least 20 Hz"):
        build(15.0)


def test_time_stays_on_the_grid_of_physics_steps():
    """Bit for bit, with substeps beside the dock: readings' stamps are multiples of the step."""
    world = build()
    world.place("auv", np.array([-1.0, 0.5, 20.0]), 0.0, 1.0, [0.0, 0.0, 0.0, 0.0, 75.0])
    for tick in range(1, 200):
        world.advance(1)
        assert world.time == tick * 0.01
    assert {c.duration for c in world.contacts("auv")} == {0.01 / 4}


def test_the_shipped_dock_is_as_it_was():
    """MuJoCo's default contact and friction cones."""
    scene = scenes.scene(
        {"auv": "remus100"}, {"dock": ("dock", StructurePose(depth=20.0, heading=0.0))}, WorldSettings(), 100.0
    )
    world = World(scene, Uniform((0.0, 0.0, 0.0)))
    assert np.array_equal(world.model.geom_solref, np.tile([0.02, 1.0], (world.model.ngeom, 1)))
    assert world.model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
