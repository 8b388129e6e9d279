"""Fins: lift slope, stall, astern flow, dissipation, and the local velocity that rotation and current give."""

import mujoco
import numpy as np
import pytest
from bodies import DENSITY, TURN, Rigid, body_force, command, free_body, remus100, set_motion, set_water

AREA, SLOPE, STALL = 0.01, 3.0, 0.35
COEFFICIENTS = {"area": AREA, "lift_slope": SLOPE, "stall_angle": STALL, "astern_lift": 0.7}
DRAG = {"drag": 0.01, "induced_drag": 0.16, "normal_drag": 1.2}
STEEP = STALL + 0.0873  # beyond the blend round the stall angle, separated for good


def tail(at=(0.0, 0.0, 0.0), **coefficients):
    """A hull without hydrodynamics of its own that carries one upright fin at a place (forward-port-up)."""
    fin = f'<body name="fin" pos="{at[0]} {at[1]} {at[2]}"/>'
    fields = {f"fin_{name}": value for name, value in (COEFFICIENTS | coefficients).items()}
    rigid = Rigid(centre=np.array([0.0, 0.0, 0.05]))
    model = free_body(added_mass=np.zeros((6, 6)), rigid=rigid, inside=fin, fields=fields)
    return model, mujoco.MjData(model)


def lift_and_drag(model, data, alpha, speed=2.0):
    """Force across and against a motion at an angle to the chord [N]; alpha > 0 drifts to starboard."""
    set_motion(model, data, [speed * np.cos(alpha), speed * np.sin(alpha), 0, 0, 0, 0])
    X, Y = body_force(model, data)[:2]
    return -(Y * np.cos(alpha) - X * np.sin(alpha)), -(X * np.cos(alpha) + Y * np.sin(alpha))


def test_lift_slope_at_small_angles_is_the_coefficient():
    """L = rho A a alpha U^2 / 2, against the drift, odd in the angle, quadratic in speed."""
    model, data = tail(**DRAG)
    for speed in (0.5, 2.0):
        q = 0.5 * DENSITY * AREA * speed**2
        for alpha in (1e-3, -1e-3, 0.02, -0.02):
            lift, drag = lift_and_drag(model, data, alpha, speed)
            # C_L = a sin(alpha) cos(alpha): a third of alpha^2 short of a alpha, twice over.
            assert lift == pytest.approx(q * SLOPE * alpha, rel=alpha**2)
            assert drag == pytest.approx(q * (0.01 + 0.16 * (SLOPE * alpha) ** 2), rel=2 * alpha**2)


def test_lift_falls_behind_the_stall_angle():
    model, data = tail(**DRAG)
    q = 0.5 * DENSITY * AREA * 4.0
    alphas = np.linspace(0.0, np.pi / 2, 400)
    lift, drag = np.array([lift_and_drag(model, data, alpha) for alpha in alphas]).T / q
    best = alphas[lift.argmax()]
    assert 0.8 * STALL < best < STALL + 0.05  # the peak lies where the blend begins to win
    after = lift[(alphas > best) & (alphas < STEEP - 0.01)]  # a plate's own lift grows again, up to 45 degrees
    assert np.all(np.diff(after) < 0.0)
    # An attached fin would still gain there: the published model's lift grows for ever, and that is what is wrong in
    # it.
    assert after[-1] < 0.6 * SLOPE * np.sin(STEEP) * np.cos(STEEP)
    plate = alphas > STEEP
    assert lift[plate] == pytest.approx(1.2 * np.sin(alphas[plate]) * np.cos(alphas[plate]), abs=1e-12)  # a flat plate
    assert drag[plate] == pytest.approx(0.01 + 1.2 * np.sin(alphas[plate]) ** 2, abs=1e-12)
    assert np.all(np.diff(drag) > 0.0)
    # Smooth: the blend's third-order polynomial has a slope of 10 per radian at most.
    assert np.abs(np.diff(lift)).max() < 12.0 * (alphas[1] - alphas[0])


def test_astern_flow_has_its_own_slope_and_still_opposes_the_drift():
    model, data = tail(**DRAG)
    q = 0.5 * DENSITY * AREA * 4.0
    for drift in (0.02, -0.02):
        set_motion(model, data, [-2.0 * np.cos(drift), 2.0 * np.sin(drift), 0, 0, 0, 0])
        X, Y = body_force(model, data)[:2]
        # To the order of alpha^2; the normal force is lift (a) and, one part in 200, the drag's share C_D alpha.
        assert pytest.approx(-q * (0.7 * SLOPE + 0.01) * drift, rel=2 * drift**2 + 1e-3) == Y
        assert X > 0.0  # drag, ahead
    set_motion(model, data, [-2.0, 0, 0, 0, 0, 0])
    assert body_force(model, data)[:2] == pytest.approx([q * 0.01, 0.0], abs=1e-12)


def test_lift_does_no_work_and_drag_only_takes():
    """Whatever the angle and the coefficients: F . v <= 0, and without drag F . v = 0 while flow is attached."""
    random = np.random.default_rng(0)
    lossless, lossless_data = tail(drag=0.0, induced_drag=0.0, normal_drag=0.0, stall_angle=2.0)
    for _ in range(300):
        v = random.uniform(-3.0, 3.0, 3)
        set_motion(lossless, lossless_data, [*v, 0, 0, 0])
        force = body_force(lossless, lossless_data)[:3]
        assert force @ v == pytest.approx(0.0, abs=1e-11)  # rounding of products of 100 W
        assert np.abs(force).max() > 1e-3
    model, data = tail(**DRAG)
    for _ in range(300):
        v = random.uniform(-3.0, 3.0, 3)
        set_motion(model, data, [*v, 0, 0, 0])
        assert body_force(model, data)[:3] @ v < 0.0


def test_flow_at_the_fin_is_local():
    """Rotation moves the fin across the flow: at x the drift is v + x r; roll does it for a fin off the axis."""
    u, at = 2.0, (-0.7, 0.0, 0.2)
    model, data = tail(at=at)
    x, z = at[0], -at[2]
    q = 0.5 * DENSITY * AREA * SLOPE * u
    for v, p, r in ((0.0, 0.0, 0.02), (0.01, 0.0, 0.0), (0.0, 0.05, 0.0), (0.02, -0.03, -0.01)):
        set_motion(model, data, [u, v, 0, p, 0, r])
        Y = -q * (v + x * r - z * p)
        X, *_ = force = body_force(model, data)
        assert force[1] == pytest.approx(Y, rel=1e-3)  # alpha of 0.02
        assert force[3:] == pytest.approx([-z * Y, z * X, x * Y], rel=1e-3, abs=1e-6)


def test_flow_at_the_fin_has_the_current_of_its_place_and_time():
    model, data = tail(at=(-0.7, 0.0, 0.0), **DRAG)
    velocity, derivative = np.array([-1.0, 0.05, 0.1]), np.array([0.01, 0.02, 0.0])
    gradient = np.array([[0.1, 0.0, 0.02], [0.15, -0.1, 0.0], [0.0, 0.0, 0.0]])
    position, time = np.array([3.0, -2.0, 10.0]), 2.5
    set_water(data, velocity, derivative, gradient)
    data.time = time
    set_motion(model, data, [1, 0, 0, 0, 0, 0], position=position)
    found = body_force(model, data)
    water = velocity + derivative * time + gradient @ (position + np.array([-0.7, 0.0, 0.0]))
    set_water(data)
    set_motion(model, data, [1.0 - water[0], -water[1], -water[2], 0, 0, 0])
    assert found == pytest.approx(body_force(model, data), abs=1e-12)  # the same sum in another order


@pytest.mark.parametrize(("rudder", "elevator"), [(0.1, 0.0), (0.0, 0.1)])
def test_remus100_fins_turn_to_starboard_and_dive_for_positive_angles(rudder, elevator):
    """Two fins of slope 0.5 (rudders) or 0.7 (planes) at x = -0.735 m, from rest in attitude at 1.5 m/s."""
    model = remus100()
    data = mujoco.MjData(model)
    command(data, rudder, elevator)
    set_motion(model, data, [1.5, 0, 0, 0, 0, 0])
    force = body_force(model, data)
    command(data)
    set_motion(model, data, [1.5, 0, 0, 0, 0, 0])
    force -= body_force(model, data)
    slope, angle = (0.5, rudder) if rudder else (0.7, elevator)
    lift = 2 * 0.5 * DENSITY * 0.00665 * slope * angle * 1.5**2
    expected = np.zeros(6)
    if rudder:
        expected[[1, 5]] = -lift, 0.735 * lift  # stern to port, bow to starboard
    else:
        expected[[2, 4]] = -lift, -0.735 * lift  # stern up, bow down
    # C_L = a sin cos: alpha^2 = 1 per cent; the drags add their own projections of that size.
    assert force[1:3] == pytest.approx(expected[1:3], rel=0.03, abs=1e-12)
    assert force[4:] == pytest.approx(expected[4:], rel=0.03, abs=0.02)
    assert force[0] < 0.0


def test_a_deflected_fin_stalls_at_its_angle_to_the_flow_not_to_the_hull():
    """A rudder of 0.2 rad in a drift that meets it head-on has no lift."""
    model = remus100()
    data = mujoco.MjData(model)
    normal = []
    for rudder in (0.2, -0.2):
        command(data, rudder)
        set_motion(model, data, [1.5 * np.cos(0.2), 1.5 * np.sin(0.2), 0, 0, 0, 0])
        fin = data.body("rudder_upper")
        axes = TURN @ fin.xmat.reshape(3, 3)
        velocity = np.array([1.5 * np.cos(0.2), 1.5 * np.sin(0.2), 0.0])
        normal.append(abs(velocity @ axes[:, 1]))
    assert min(normal) == pytest.approx(0.0, abs=1e-12)
    assert max(normal) == pytest.approx(1.5 * np.sin(0.4), rel=1e-12)
