"""The condensed planar model against the vehicle it came from: accelerations, a zig-zag, steady speeds."""

import mujoco
import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.physics import hydrodynamics, planar_fit
from auvsim.physics.planar_fit import fit_planar_model
from auvsim.vehicles import library, model_files
from estimators.planar.model import step_function

SPEEDS = (1.0, 1.5, 2.0)


def vehicle():
    root = library.vehicle("remus100").root
    root.find("body", "hull").add("freejoint")
    root.option.timestep, root.option.integrator = 0.01, "implicitfast"
    model = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    hydrodynamics.equip(model)
    return model, mujoco.MjData(model)


def sail(shaft_speed, speed, rudders):
    """Planar states (n, 6) of MuJoCo and of the planar model, every 0.1 s, open loop with the same fins and shaft."""
    model, data = vehicle()
    step = step_function(current=False)
    parameters = fit_planar_model("remus100", speed).parameters.vector()
    x = np.array([0.0, 0.0, 0.0, speed, 0.0, 0.0])
    data.qpos[2] = -20.0
    data.qvel[0] = x[3]
    shaft = model.joint("shaft").dofadr[0]
    data.qvel[shaft] = data.actuator("shaft").ctrl[0] = shaft_speed
    found, believed = [], []
    for rudder in rudders:
        for fin in ("rudder_upper", "rudder_lower"):
            data.actuator(fin).ctrl[0] = rudder
        mujoco.mj_step(model, data, 5)
        measured = data.joint("rudder_upper").qpos[0], data.qvel[shaft]
        mujoco.mj_step(model, data, 5)
        x = np.array(step(x, measured, parameters, 0.1)[0]).ravel()
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, data.qpos[3:7])
        body = R.reshape(3, 3).T @ data.qvel[:3]
        heading = -np.arctan2(R[3], R[0])
        found.append([data.qpos[0], -data.qpos[1], heading, body[0], -body[1], -data.qvel[5]])
        believed.append(x)
    return np.array(found), np.array(believed)


@pytest.mark.parametrize("speed", SPEEDS)
def test_residuals_are_small_against_the_accelerations(speed):
    condensed = fit_planar_model("remus100", speed)
    assert condensed.vehicle == "remus100"
    assert condensed.speed == speed
    # Surge lacks only cross terms of fin drag; sway and yaw put the strips' quadratic into v|v| and r|r| alone.
    # Measured 0.4, 4.3 and 4.9 per cent, the same at every speed because all the forces go with its square.
    assert np.all(condensed.acceleration_rms < np.array([0.006, 0.06, 0.06]) * condensed.acceleration_scale)
    assert condensed.acceleration_scale / speed**2 == pytest.approx([0.203, 0.0214, 0.0592], rel=0.01)


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize(("angle_deg", "bound"), [(5.0, 0.0025), (10.0, 0.009), (14.0, 0.018)])
def test_an_open_loop_zig_zag_stays_close_for_a_minute(speed, angle_deg, bound):
    """Rudder over for 10 s to each side in turn, the planar model fed with the measured fins and shaft.

    Position error over distance run: measured 0.1 to 0.2 per cent at 5 degrees, 0.3 to 0.7 at 10, 0.7 to 1.4 at 14; it
    grows with the drag of the hull's drift, which v|v| and r|r| only average. The bound is a quarter more.
    """
    rudder = np.radians(angle_deg) * np.repeat([1, -1, 1, -1, 1, -1], 100)
    condensed = fit_planar_model("remus100", speed)
    found, believed = sail(condensed.shaft_speed, speed, rudder)
    run = np.sum(np.hypot(found[:, 3], found[:, 4])) * 0.1
    assert run > 0.95 * speed * 60.0
    assert np.ptp(found[:, 2]) > 0.2  # it really turns: 10 m at 1 m/s on a radius of 40 m
    assert np.hypot(*(found - believed)[:, :2].T).max() < bound * run
    heading = np.angle(np.exp(1j * (found - believed)[:, 2]))
    assert np.abs(heading).max() < np.radians(2.0)


@pytest.mark.parametrize("speed", SPEEDS)
def test_the_steady_shaft_speed_holds_the_speed(speed):
    condensed = fit_planar_model("remus100", speed)
    found, believed = sail(condensed.shaft_speed, speed, np.zeros(600))
    assert found[-1, 3] == pytest.approx(speed, rel=1e-3)  # roll under the propeller's torque; velocity servo's droop
    assert believed[-1, 3] == pytest.approx(speed, rel=1e-3)
    # The planar model's own answer: its thrust is that of the fit, exact in n and u.
    assert condensed.shaft_speed_for(speed) == pytest.approx(condensed.shaft_speed, rel=1e-3)
    assert condensed.shaft_speed_for(0.0) == 0.0


def test_inertia_is_mass_and_added_mass_about_the_origin():
    p = fit_planar_model("remus100", 1.5).parameters
    assert (p.X_ud, p.Y_vd, p.N_rd) == (-0.839, -29.44, -3.426)
    assert (p.Y_rd, p.N_vd) == (0.0, 0.0)
    assert p.m == pytest.approx(31.03, rel=1e-6)
    assert p.x_g == pytest.approx(0.0, abs=1e-6)
    # Hull 3.932 about its centre (4 mm off the origin), fins of 80 g 0.747 m behind it, propeller of 80 g at 0.815 m.
    assert p.I_z == pytest.approx(3.932 + 30.87 * 0.004048**2 + 0.08 * (0.747**2 + 0.815**2), rel=1e-3)


def test_signs_and_stability():
    """Positive rudder: bow to starboard, stern to port. Sway and yaw on a straight course are stable."""
    for speed in SPEEDS:
        p = fit_planar_model("remus100", speed).parameters
        assert p.N_dd > 0.0 > p.Y_dd
        assert p.X_uu < 0.0
        assert p.X_nn > 0.0 > p.X_nu
        inertia = np.array([[p.m - p.Y_vd, p.m * p.x_g - p.Y_rd], [p.m * p.x_g - p.N_vd, p.I_z - p.N_rd]])
        damping = speed * np.array([[p.Y_uv, p.Y_ur - p.m], [p.N_uv, p.N_ur - p.m * p.x_g]])
        assert np.linalg.eigvals(np.linalg.solve(inertia, damping)).real.max() < 0.0


def test_condensing_is_repeatable_and_scales_with_density():
    first = fit_planar_model("remus100", 1.5)
    planar_fit._fit_model.cache_clear()
    again = fit_planar_model("remus100", 1.5)
    assert first is not again
    assert first.parameters == again.parameters
    light = fit_planar_model("remus100", 1.5, 900.0)
    # Thrust and drag both scale with density, but for X_uu = 5.84, which is a number of the hull's own.
    assert light.parameters.X_nn == pytest.approx(first.parameters.X_nn * 900.0 / 1026.0, rel=1e-3)


@pytest.mark.parametrize("speed", [0.0, -1.0, 25.0, float("nan")])
def test_a_speed_that_is_none_is_refused(speed):
    with pytest.raises(InputError, match=r"no planar model of 'remus100' at \S+ m/s"):
        fit_planar_model("remus100", speed)


def test_a_vehicle_without_thrust_is_refused(tmp_path):
    text = (model_files.models_folder() / "remus100" / "remus100.xml").read_text(encoding="utf-8")
    path = tmp_path / "drifter.xml"
    path.write_text(text.replace('thrust_coefficients" data="0.4566 -0.4174"', 'thrust_coefficients" data="0 0"'))
    with pytest.raises(InputError, match=r"drifter\.xml' cannot hold 1\.5 m/s with its propeller"):
        fit_planar_model(str(path), 1.5)
