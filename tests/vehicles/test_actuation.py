"""The fin map of cross and X tails: there and back, limits, refusals."""

from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from auvsim.base.errors import InputError
from auvsim.physics import hydrodynamics
from auvsim.vehicles import library, model_files
from auvsim.vehicles.actuation import Commands, FinsAndShaft

LIMIT = 0.25
SPEED, AREA, SLOPE, TAIL = 2.0, 0.00665, 0.5, -0.735  # through the water [m/s], of one fin [m2], lift, place [m]
LIMITS = np.array([[-LIMIT, LIMIT]] * 4 + [[-160.0, 150.0]])
CROSS = FinsAndShaft(
    fins=("upper", "lower", "port", "starboard"),
    matrix=np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]]),
    limits=LIMITS,
    lags=np.zeros(5),
)
X_TAIL = FinsAndShaft(
    fins=("a", "b", "c", "d"),
    matrix=np.array([[1.0, 1.0], [1.0, -1.0], [1.0, 1.0], [1.0, -1.0]]) * np.sqrt(0.5),
    limits=LIMITS,
    lags=np.zeros(5),
)


@pytest.mark.parametrize("allocation", [CROSS, X_TAIL], ids=["cross", "X"])
def test_what_is_asked_for_is_what_the_fins_do(allocation):
    random = np.random.default_rng(0)
    for rudder, elevator in random.uniform(-0.17, 0.17, (20, 2)):  # 0.17 sqrt 2 is inside the limit
        channels = allocation.allocate(Commands(rudder, elevator, 300.0))  # the shaft's servo keeps its own limit
        assert channels[:-1] == pytest.approx(allocation.matrix @ [rudder, elevator], abs=1e-15)
        # Rounding; the shaft's speed passes as it is.
        assert allocation.effective(channels) == pytest.approx((rudder, elevator, 300.0), abs=1e-15)
        assert allocation.effective(np.array(channels)) == allocation.effective(channels)


@pytest.mark.parametrize("allocation", [CROSS, X_TAIL], ids=["cross", "X"])
def test_beyond_the_limit_all_fins_shrink_together(allocation):
    for rudder, elevator in ((0.5, 0.0), (-0.4, 0.3), (0.1, 1.0), (0.25, -0.25)):
        channels = allocation.allocate(Commands(rudder, elevator, -70.0))
        assert max(map(abs, channels[:-1])) == pytest.approx(LIMIT, rel=1e-15)
        found = allocation.effective(channels)
        assert found.shaft_speed == channels[-1] == -70.0  # not scaled with the fins
        assert found[0] * elevator == pytest.approx(found[1] * rudder, abs=1e-15)  # the same direction
        assert found[0] * rudder + found[1] * elevator > 0.0


def test_disagreeing_fins_count_by_least_squares():
    assert CROSS.effective([0.1, 0.2, 0.0, -0.1, 5.0]) == pytest.approx((0.15, -0.05, 5.0), abs=1e-15)


@pytest.mark.parametrize(
    "matrix", [np.ones((3, 2)), np.ones((4, 3)), np.array([[1.0, 1.0]] * 4)], ids=["rows", "columns", "rank"]
)
def test_a_map_that_cannot_steer_both_ways_is_refused(matrix):
    with pytest.raises(InputError, match=r"allocation of 4 fins must be \(4, 2\) of rank 2"):
        FinsAndShaft(fins=CROSS.fins, matrix=matrix, limits=LIMITS, lags=np.zeros(5))


def test_limits_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match=r"4 fins and a shaft need limits \(5, 2\) and lags \(5,\), not \(4, 2\)"):
        FinsAndShaft(fins=CROSS.fins, matrix=CROSS.matrix, limits=LIMITS[:-1], lags=np.zeros(5))
    with pytest.raises(InputError, match="the limits of 'shaft' are 160 and -150; they must enclose 0"):
        FinsAndShaft(
            fins=CROSS.fins, matrix=CROSS.matrix, limits=LIMITS * np.array([[1.0]] * 4 + [[-1.0]]), lags=np.zeros(5)
        )


def test_unequal_limits_count_by_the_smallest():
    limits = LIMITS.copy()
    limits[2] = -0.2, 0.22
    tail = FinsAndShaft(fins=CROSS.fins, matrix=CROSS.matrix, limits=limits, lags=np.zeros(5))
    assert (tail.fin_limit, tail.shaft_limit) == (0.2, 150.0)
    assert max(tail.allocate(Commands(0.5, 0.1, 0.0))) == pytest.approx(0.2)


def test_what_may_be_demanded_is_what_commands_hold():
    assert tuple(demand.name for demand in CROSS.demands) == Commands._fields


def test_remus100_is_a_cross_tail():
    allocation = library.vehicle("remus100").actuation
    assert np.array_equal(allocation.matrix, CROSS.matrix)
    assert allocation.fin_limit == pytest.approx(np.radians(15.0), abs=1e-5)  # the model's printed digits


def turned_tail(angle, path):
    """The remus100 as a user's file, its tail turned about the hull's axis, all fins alike; and its map.

    A fin whose hinge has turned by phi from the upright has the share cos(phi) of a rudder and sin(phi) of a plane.
    """
    root = ElementTree.parse(model_files.models_folder() / "remus100" / "remus100.xml").getroot()
    turn = Rotation.from_euler("x", angle)
    hinges = {}
    for body in root.iter("body"):
        if body.get("name").split("_")[0] in ("stabiliser", "rudder", "plane"):
            w, x, y, z = numbers(body.get("quat", "1 0 0 0"))
            turned = turn * Rotation.from_quat((x, y, z, w))
            x, y, z, w = turned.as_quat()
            body.set("pos", text(turn.apply(numbers(body.get("pos")))))
            body.set("quat", text((w, x, y, z)))
            hinges[body.get("name")] = turned.apply((0.0, 0.0, 1.0))
    axes = np.array([hinges[fin] for fin in library.vehicle("remus100").actuation.fins])
    fields = {"allocation_rudder": text(axes[:, 2]), "allocation_elevator": text(-axes[:, 1])}
    for numeric in root.iter("numeric"):
        if numeric.get("name").endswith("lift_slope"):
            numeric.set("data", str(SLOPE))
        numeric.set("data", fields.get(numeric.get("name"), numeric.get("data")))
    path.write_text(ElementTree.tostring(root, encoding="unicode"))
    return library.vehicle(str(path))


def numbers(written):
    return [float(number) for number in written.split()]


def text(values):
    return " ".join(repr(float(value)) for value in values)


def tail_force(vehicle, rudder, elevator):
    """What the fins add to force and moment (6,) on the hull straight ahead, forward-port-up, in MuJoCo's own step."""
    vehicle.root.find("body", "hull").add("freejoint")
    model = mujoco.MjModel.from_xml_string(vehicle.root.to_xml_string(), vehicle.root.get_assets())
    hydrodynamics.equip(model)
    data = mujoco.MjData(model)
    data.qvel[0] = SPEED
    forces = []
    for fins in ([0.0] * 4, vehicle.actuation.allocate(Commands(rudder, elevator, 0.0))[:-1]):
        for name, angle in zip(vehicle.actuation.fins, fins, strict=True):
            data.joint(name).qpos[0] = angle
        mujoco.mj_forward(model, data)
        forces.append(data.qfrc_passive[:6].copy())
    return forces[1] - forces[0]


@pytest.mark.parametrize(
    ("rudder", "elevator"), [(0.08, 0.0), (-0.08, 0.0), (0.0, 0.08), (0.05, -0.06), (-0.03, -0.05)]
)
def test_an_x_tail_steers_as_the_cross_tail_does(tmp_path, rudder, elevator):
    """The same effective angles give the same moments, by MuJoCo's forces on both and by hand."""
    cross, x_tail = (turned_tail(angle, tmp_path / f"{angle:.1f}.xml") for angle in (0.0, np.pi / 4))
    assert np.abs(cross.actuation.matrix) == pytest.approx(CROSS.matrix, abs=1e-12)
    assert np.abs(x_tail.actuation.matrix) == pytest.approx(X_TAIL.matrix[0, 0], abs=1e-12)
    # Two fins' lift by the angle. To starboard: the stern is pushed to port; nose down: it is pushed up.
    lift = 2.0 * 0.5 * hydrodynamics.SEA_WATER * SPEED**2 * AREA * SLOPE
    force = lift * np.array([0.0, rudder, elevator])
    expected = [*force[1:], *np.cross([TAIL, 0.0, 0.0], force)]
    # Lift goes with sin(alpha) cos(alpha), two thirds of alpha^2 less than alpha: at 0.08 rad, 0.4 % of it.
    tolerance = 0.005 * 0.08 * lift
    for vehicle in (cross, x_tail):
        assert vehicle.actuation.effective(
            vehicle.actuation.allocate(Commands(rudder, elevator, 9.0))
        ) == pytest.approx((rudder, elevator, 9.0), abs=1e-12)
        assert tail_force(vehicle, rudder, elevator)[1:] == pytest.approx(expected, abs=tolerance)
