"""The remus100 against the published Python model of it (reference runs in data/), and what that model has wrong.

Neither is sea-trial truth: the comparison checks code. Where the two must differ the test says which is right.
"""

import csv
from pathlib import Path

import mujoco
import numpy as np
import pytest
from bodies import acceleration, command, motion, remus100, set_motion, set_water
from scipy.spatial.transform import Rotation

DATA = Path(__file__).parent / "data"
with (DATA / "steady_state.csv").open() as file:
    ROWS = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
STRAIGHT = [row for row in ROWS if row["delta_r_deg"] == row["delta_s_deg"] == 0]
TURNS = [row for row in ROWS if row["delta_r_deg"]]
DIVES = [row for row in ROWS if row["delta_s_deg"]]


def name(row):
    return f"{row['n_rpm']:.0f} rpm, rudder {row['delta_r_deg']:g}, plane {row['delta_s_deg']:g}"


def steady(rpm, rudder_deg=0.0, plane_deg=0.0, water=(0.0, 0.0, 0.0)):
    """Attitude (3, 3), nu through the water (6,), sink rate through the water and yaw rate, after a minute."""
    model = remus100()
    data = mujoco.MjData(model)
    set_water(data, water)
    command(data, np.radians(rudder_deg), np.radians(plane_deg), rpm)
    set_motion(model, data, [1.0 + water[0], water[1], water[2], 0, 0, 0], position=[0, 0, 20])
    mujoco.mj_step(model, data, 6000)
    _, rotation, nu = motion(model, data)
    nu[:3] -= rotation.T @ water
    # d(psi)/dt = (q sin(roll) + r cos(roll)) / cos(pitch)
    _, pitch, roll = Rotation.from_matrix(rotation).as_euler("ZYX")
    rate = (nu[4] * np.sin(roll) + nu[5] * np.cos(roll)) / np.cos(pitch)
    return rotation, nu, (rotation @ nu[:3])[2], rate


@pytest.mark.parametrize("row", [row for row in STRAIGHT if row["n_rpm"] >= 500], ids=name)
def test_straight_speed(row):
    """Within 5 per cent, as asked of it; measured 0.7 per cent at 500 rpm and 0.1 per cent from 800 rpm on.

    The reference's linear damping, which fades with exp(-3 U), is what is left at the low end.
    """
    _, nu, *_ = steady(row["n_rpm"])
    assert np.linalg.norm(nu[:3]) == pytest.approx(row["speed"], rel=0.01)


@pytest.mark.parametrize("row", TURNS, ids=name)
def test_turn(row):
    """To starboard for a positive rudder, and of the reference's size.

    The reference drops the Munk moment and has one strip of cross-flow drag too many, so drag limits its turns: its
    radius falls with the 0.74th power of the rudder, ours with the 0.9th. They meet at 5 degrees; elsewhere within 35
    per cent.
    """
    _, nu, _, rate = steady(row["n_rpm"], row["delta_r_deg"])
    assert rate > 0.0
    assert nu[1] < 0.0  # drifts out of the turn, to port
    assert np.hypot(nu[0], nu[1]) / rate == pytest.approx(row["turn_radius_horizontal_m"], rel=0.35)
    _, mirrored, _, other = steady(row["n_rpm"], -row["delta_r_deg"])
    assert other == pytest.approx(-rate, rel=0.02)  # but for the propeller's torque, which rolls it
    assert mirrored[0] == pytest.approx(nu[0], rel=1e-3)


def test_turn_radius_at_five_degrees_lies_between_the_two_published_ones():
    """40.4 m in the Python port, 26.6 m in its MATLAB sister, at 1525 rpm."""
    _, nu, _, rate = steady(1525, 5.0)
    assert 26.0 < np.hypot(nu[0], nu[1]) / rate < 41.0


@pytest.mark.parametrize("row", DIVES, ids=name)
def test_dive(row):
    """Down for a positive stern plane, up for a negative one.

    Within 10 per cent, measured 7 to 8: the moments of Munk and of the stabilisers at the angle of attack, which the
    reference lacks.
    """
    _, _, sink, _ = steady(row["n_rpm"], 0.0, row["delta_s_deg"])
    assert sink == pytest.approx(row["z_dot"], rel=0.1)
    _, _, rise, _ = steady(row["n_rpm"], 0.0, -row["delta_s_deg"])
    assert rise == pytest.approx(-row["z_dot"], rel=0.1)


def test_start_from_rest():
    """Surge at 1525 rpm from rest, through shaft lag and added mass: 0.3 per cent of the final speed at every instant.

    Measured 0.2: 5 mm/s of linear damping in the reference.
    """
    times, surge = np.loadtxt(DATA / "straight_1525_from_rest.csv", delimiter=",", skiprows=1, unpack=True)
    model = remus100(integrator="RK4")
    data = mujoco.MjData(model)
    set_motion(model, data, np.zeros(6))
    command(data, rpm=1525.0, at_once=False)
    found = [0.0]
    for _ in times[1:]:
        mujoco.mj_step(model, data, 20)
        found.append(motion(model, data)[2][0])
    assert times[1] == pytest.approx(20 * model.opt.timestep)
    assert np.array(found) == pytest.approx(surge, abs=0.003 * 2.5536)


@pytest.mark.parametrize("current", [0.5, -0.5], ids=["following", "head"])
def test_speed_through_the_water_does_not_change_in_a_current(current):
    """Ours is right: the published model takes the propeller's advance over ground and changes by -9 and +9 %."""
    _, still, *_ = steady(1525)
    _, nu, *_ = steady(1525, water=(current, 0.0, 0.0))
    assert nu == pytest.approx(still, abs=1e-9)


def test_a_vertical_current_carries_the_vehicle():
    """Ours is right: the published model drops the vertical component."""
    depths = []
    for down in (0.0, 0.2):
        model = remus100()
        data = mujoco.MjData(model)
        set_water(data, (0.0, 0.0, down))
        command(data, rpm=1000.0)
        set_motion(model, data, [1.6, 0, down, 0, 0, 0], position=[0, 0, 20])
        mujoco.mj_step(model, data, 3000)
        depths.append(motion(model, data)[0][2])
    assert depths[1] - depths[0] == pytest.approx(0.2 * 30.0, abs=1e-9)


@pytest.mark.parametrize("speed", [0.8, 1.54, 2.5])
def test_straight_course_is_stable(speed):
    """Sway-yaw and heave-pitch eigenvalues have negative real parts; Prestero's totals give +1.02 1/s at 1.54 m/s.

    Without weight, whose righting moment would help pitch; central differences of step 1e-5 of a smooth function of
    order 1.
    """
    model = remus100()
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    step = 1e-5
    for pair in ((1, 5), (2, 4)):
        jacobian = np.empty((2, 2))
        for column, index in enumerate(pair):
            change = []
            for sign in (1, -1):
                command(data)
                nu = np.array([speed, 0, 0, 0, 0, 0], dtype=float)
                nu[index] += sign * step
                set_motion(model, data, nu)
                change.append(acceleration(model, data)[list(pair)])
            jacobian[:, column] = (change[0] - change[1]) / (2 * step)
        eigenvalues = np.linalg.eigvals(jacobian)
        assert eigenvalues.real.max() < -0.5 * speed  # measured -0.66 and -1.76 per metre run
