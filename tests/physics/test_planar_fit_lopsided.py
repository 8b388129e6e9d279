"""The planar model of a vehicle whose weight and added mass are off-centre, against MuJoCo's own accelerations."""

import lopsided
import mujoco
import numpy as np
import pytest

from auvsim.physics import hydrodynamics
from auvsim.physics.planar_fit import PlanarFit, fit_planar_model
from auvsim.vehicles import library
from estimators.core.types import Array
from estimators.planar.model import step_function

SPEED = 1.5  # [m/s]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> str:
    return lopsided.vehicle(tmp_path_factory.mktemp("lopsided"))


@pytest.fixture(scope="module")
def fitted(path: str) -> PlanarFit:
    return fit_planar_model(path, SPEED)


def accelerations(path: str, nu: Array, shaft_speed: float) -> Array:
    """Rates of u, v, r (3,) in MuJoCo at zero rudder, of a vehicle that is held level and at its depth."""
    root = library.vehicle(path).root
    root.find("body", "hull").add("freejoint")
    model = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    hydrodynamics.equip(model)
    data = mujoco.MjData(model)
    u, v, r = nu
    planar = [0, 1, 5]
    data.qvel[planar] = u, -v, -r
    data.qvel[model.joint("shaft").dofadr[0]] = shaft_speed
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    force = data.qfrc_passive - data.qfrc_bias
    ahead, port, left = np.linalg.solve(inertia[np.ix_(planar, planar)], force[planar])  # what holds it does no work
    return np.array([ahead + v * r, -port - u * r, -left])  # rates of the components along axes that turn with the body


def modelled(fitted: PlanarFit, nu: Array, shaft_speed: float) -> Array:
    """The same by the planar model, as a difference over a short step."""
    step, p = step_function(current=False, integrator="euler"), fitted.parameters.vector()
    after = np.array(step(np.array([0.0, 0.0, 0.0, *nu]), (0.0, shaft_speed), p, 1e-4)[0]).ravel()
    return (after[3:] - nu) / 1e-4


def test_inertia_is_read_off_the_vehicle(fitted: PlanarFit) -> None:
    p = fitted.parameters
    assert (p.Y_rd, p.N_vd, p.X_rr) == (lopsided.Y_RD, lopsided.Y_RD, -lopsided.Y_RD)
    # Four fins of 20 g at 0.747 m and a propeller of 80 g at 0.815 m behind the origin.
    moment = lopsided.MASS * lopsided.X_G - 0.08 * 0.747 - 0.08 * 0.815
    assert p.x_g == pytest.approx(moment / (lopsided.MASS + 0.16), rel=1e-4)


def test_residuals_stay_small(fitted: PlanarFit) -> None:
    """Measured 0.25, 5.1 and 4.3 %, always the same; surge without m x_g r^2 or Y_rd r^2 has 0.30 or 0.36 %."""
    assert np.all(fitted.acceleration_rms < np.array([0.0027, 0.06, 0.05]) * fitted.acceleration_scale)


@pytest.mark.parametrize("rate", [0.3, -0.3])
def test_pure_rotation_pulls_along_the_hull(path: str, fitted: PlanarFit, rate: float) -> None:
    """Surge in pure rotation is (m x_g - Y_rd) r^2 / (m - X_ud) beside the fins' drag, which is a hundredth of it."""
    p, nu = fitted.parameters, np.array([0.0, 0.0, rate])
    surge = accelerations(path, nu, 0.0)[0]
    expected = (p.m * p.x_g - p.Y_rd) * rate**2 / (p.m - p.X_ud)
    assert surge == pytest.approx(expected, rel=0.03)
    assert modelled(fitted, nu, 0.0)[0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("nu", [(1.5, 0.0, 0.003), (1.5, 0.004, 0.0), (1.2, -0.004, 0.003), (1.8, 0.003, -0.004)])
def test_accelerations_near_a_straight_course(path: str, fitted: PlanarFit, nu: tuple[float, float, float]) -> None:
    """Lift, Munk moment, Coriolis force of the shifted weight; cross-flow, second order in v and r, is small here."""
    state = np.array(nu)
    truth, model = accelerations(path, state, fitted.shaft_speed), modelled(fitted, state, fitted.shaft_speed)
    assert model[1:] == pytest.approx(truth[1:], abs=0.02 * np.abs(truth[1:]).max())
    assert model[0] == pytest.approx(truth[0], abs=2e-3)  # [m/s2], of 0.2 that drag and thrust differ by in the fit
