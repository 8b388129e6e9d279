"""Ballast of one vehicle in a scene: forces and moments at rest against statics, of that vehicle alone."""

import mujoco
import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.base.frames import FLIP6
from auvsim.physics import hydrodynamics, scenes
from auvsim.physics.ballast import BallastSettings
from auvsim.physics.scenes import WorldSettings
from auvsim.physics.world import World
from auvsim.simulation import sampling, scenario
from auvsim.water.currents import Uniform

G, DENSITY = 9.81, hydrodynamics.SEA_WATER
NEVER = {"auv": BallastSettings()}


def build(ballast, fleet=("auv",)):
    scene = scenes.scene(dict.fromkeys(fleet, "remus100"), {}, WorldSettings(), 100.0, ballast)
    world = World(scene, Uniform((0.0, 0.0, 0.0)), DENSITY)
    for i, name in enumerate(fleet):
        world.place(name, np.array([0.0, 10.0 * i, 15.0]), 0.0, 0.0, [0.0] * 5)
    return world


def at_rest(world, name="auv", quaternion=(1.0, 0.0, 0.0, 0.0)):
    """Force and moment (6,) about the body's origin in forward-starboard-down axes, of a vehicle that stands still."""
    craft = world._craft[name]
    craft._quaternion[:] = quaternion
    world.data.qvel[:] = 0.0
    mujoco.mj_forward(world.model, world.data)
    force = (world.data.qfrc_passive - world.data.qfrc_bias)[craft.dofs][:6].copy()
    force[:3] = force[:3] @ world.data.xmat[world.model.body(f"{name}/hull").id].reshape(3, 3)
    return force * FLIP6


def masses(world, name="auv"):
    """Mass [kg] and centre of gravity (3,) in forward-starboard-down axes from the origin, of a level vehicle."""
    craft = world._craft[name]
    craft._quaternion[:] = 1.0, 0.0, 0.0, 0.0
    mujoco.mj_forward(world.model, world.data)
    base = world.model.body(f"{name}/").id
    centre = world.data.subtree_com[base] - craft.position
    return world.model.body_subtreemass[base], centre * [1.0, -1.0, -1.0]


def test_net_buoyancy_lifts_and_does_not_turn():
    plain, light = build(None), build({"auv": BallastSettings(net_buoyancy=7.0)})
    mass, centre = masses(plain)
    lighter, new_centre = masses(light)
    assert lighter == pytest.approx(mass - 7.0 / G, abs=1e-12)
    assert new_centre == pytest.approx(centre, abs=1e-12)
    assert at_rest(light)[2] - at_rest(plain)[2] == pytest.approx(-7.0, abs=1e-9)  # upward


@pytest.mark.parametrize("tilt", [0.0, 0.4])
def test_shifted_centres_turn_as_statics_says(tilt):
    """Moments r x F of weight and buoyancy, level and pitched nose-up."""
    cg, cb = np.array([0.01, -0.004, 0.006]), np.array([-0.007, 0.003, -0.005])
    ballast = BallastSettings(net_buoyancy=5.0, cg_shift=tuple(cg), cb_shift=tuple(cb))
    plain, shifted = build(None), build({"auv": ballast})
    mass, centre = masses(plain)
    # Nose-up about the starboard axis is a negative turn about MuJoCo's y, to port.
    quaternion = (np.cos(tilt / 2), 0.0, -np.sin(tilt / 2), 0.0)
    down = np.array([-np.sin(tilt), 0.0, np.cos(tilt)])
    buoyancy, weight = DENSITY * 0.0302437 * G, (mass - 5.0 / G) * G
    expected = np.cross(centre + cg, weight * down) - np.cross(cb, buoyancy * down)
    found = at_rest(shifted, quaternion=quaternion)
    assert found[:3] == pytest.approx((weight - buoyancy) * down, abs=1e-6)
    assert found[3:] == pytest.approx(expected, abs=1e-6)  # the two bodies of 0.1 g weigh in with 1e-7
    assert masses(shifted)[1] == pytest.approx(centre + cg, abs=1e-6)


def test_ballast_is_of_one_vehicle_alone():
    world = build({"a": BallastSettings(net_buoyancy=6.0, cb_shift=(0.01, 0.0, 0.0))}, ("a", "b"))
    both = build(None, ("a", "b"))
    assert np.array_equal(at_rest(world, "b"), at_rest(both, "b"))
    assert at_rest(world, "a")[2] == pytest.approx(at_rest(both, "a")[2] - 6.0, abs=1e-6)


def test_none_changes_nothing():
    """The compiled model is the same bit for bit."""
    first, second = build(None).model, build(NEVER).model
    for name in ("body_mass", "body_ipos", "body_inertia", "body_invweight0", "dof_invweight0", "body_user"):
        assert np.array_equal(getattr(first, name), getattr(second, name)), name
    assert first.nbody == second.nbody


def test_constraints_weigh_the_lightened_vehicle():
    """What the solver divides by is of the mass with its ballast: 3 % lighter, but not its added mass."""
    light, plain = build({"auv": BallastSettings(net_buoyancy=10.0)}).model, build(None).model
    hull = plain.body("auv/hull").id
    change = light.body_invweight0[hull] / plain.body_invweight0[hull]
    assert 1.005 < change[0] < 10.0 / (31.03 * G) + 1.0
    assert change[1] == pytest.approx(1.0, abs=1e-3)


def test_too_much_is_refused():
    with pytest.raises(InputError, match=r"ballast\.net_buoyancy: 40 N is more than 10% of the weight of 'auv', 304"):
        build({"auv": BallastSettings(net_buoyancy=40.0)})


def test_keys_in_both_forms_and_distributions():
    """Each number may be a distribution; both forms say the same."""
    pinned = {
        "vehicle": {"ballast": {"net_buoyancy": {"uniform": [0, 10]}, "cg_shift": [{"normal": [0, 0.002]}, 0, 0]}}
    }
    plan = sampling.merge(sampling.default_plan(), pinned)
    drawn = [scenario.parse(sampling.draw(plan, 5, trial)).lone[1].ballast for trial in range(40)]
    nets = [ballast.net_buoyancy for ballast in drawn]
    assert 0.0 < min(nets) < 2.0 < 8.0 < max(nets) < 10.0
    assert np.std([ballast.cg_shift[0] for ballast in drawn]) == pytest.approx(0.002, rel=0.5)
    whole = scenario.from_yaml(scenario.to_yaml(scenario.parse(sampling.draw(plan, 5, 3))))
    assert whole.lone[1].ballast == drawn[3]
    # The other draws are those of the plan without it.
    plain = scenario.parse(sampling.draw(sampling.default_plan(), 5, 3))
    assert plain.lone[1].start == whole.lone[1].start
    with pytest.raises(InputError, match=r"vehicle\.ballast\.net_buoyancy"):
        scenario.parse({"vehicle": {"ballast": {"net_buoyancy": "light"}}})
