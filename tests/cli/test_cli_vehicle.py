"""`auvsim vehicle`: the numbers it prints are those of the models, and bad input is one line."""

import math

import numpy as np
import pytest

from auvsim.analysis import vehicle_page
from auvsim.cli import main
from auvsim.physics.planar_fit import Level
from auvsim.simulation import hover_trials, sea_trials
from auvsim.vehicles import library, model_files


@pytest.fixture(scope="module")
def remus():
    return sea_trials.run("remus100")


@pytest.fixture(scope="module")
def rov():
    return hover_trials.run("bluerov2_heavy")


def test_speeds_are_those_at_which_thrust_is_drag(remus):
    """And the fastest is the published 2.5 m/s at 1525 rpm, to 5 % (README)."""
    level = Level("remus100", 1026.0)
    for shaft, speed in remus.speeds[[2, -1]]:
        assert level.evaluate(speed, 0.0, 0.0, 0.0, shaft)[0] == pytest.approx(0.0, abs=1e-6)
    assert remus.speeds[-1, 1] == pytest.approx(2.5, rel=0.05)


def test_a_turning_circle_is_that_of_its_own_rate(remus):
    """Steady diameter is 2 U / r; advance and tactical diameter are those of a circle reached with a lag."""
    for turn in remus.turns:
        found = turn.figures
        speed = remus.cruise * (1.0 - 0.01 * found["speed_loss"])
        rate = math.radians(found["steady_yaw_rate_deg"])
        assert found["steady_diameter"] == pytest.approx(2.0 * speed / rate, rel=0.01)
        assert 0.5 < found["advance"] / found["steady_diameter"] < 0.7
        span = np.ptp(turn.track[:, 1])
        assert span == pytest.approx(found["steady_diameter"], rel=0.02)
    assert remus.turns[1].figures["steady_diameter"] < 0.6 * remus.turns[0].figures["steady_diameter"]


def test_zigzag_dive_and_stop_are_read_off_their_series(remus):
    time, heading, rudder = remus.zigzag_series.T
    first = int(np.argmax(rudder < 0.0))
    assert heading[first] >= math.radians(10.0) > heading[first - 2]
    turned = heading[first : int(np.argmax(time > time[first] + 4.0))].max() - heading[first]
    assert remus.zigzag["first_overshoot_deg"] == pytest.approx(math.degrees(turned), abs=0.01)
    late = remus.dive_series[remus.dive_series[:, 0] > remus.dive_time]
    assert np.abs(late[:, 1] - 5.0).max() <= 0.5
    for stop, ends in ((remus.astern, 0.0), (remus.coasting, 0.5 * remus.cruise)):
        assert stop.speeds[-1, 1] <= ends < stop.speeds[-2, 1]
        assert stop.distance == pytest.approx(np.trapezoid(stop.speeds[:, 1], stop.speeds[:, 0]), rel=0.02)
    assert remus.roll < 0.0  # the propeller's torque, to port


def test_speed_against_force_ends_where_a_thruster_is_full(rov):
    """Ahead 13.7 u + 141 u^2 along the whole curve; beyond its end the thrusters are too weak."""
    ahead = rov.axes[0].curve
    assert ahead[:, 0] == pytest.approx(13.7 * ahead[:, 1] + 141.0 * ahead[:, 1] ** 2, abs=1e-6)
    level = Level("bluerov2_heavy", 1026.0)
    for factor, fits in ((0.999, True), (1.002, False)):
        nu = np.zeros(6)
        nu[0] = factor * ahead[-1, 1]
        shares = library.vehicle("bluerov2_heavy").actuation.shares(-level.resistance(nu))
        assert bool(shares.max() <= 1.0) is fits


def test_it_holds_until_its_thrusters_are_full(rov):
    speeds, errors, shares = rov.holding.T
    assert np.all(np.diff(shares) > 0.0)
    assert errors[speeds <= 0.4].max() < 0.01
    assert 0.0 < rov.stopping_distance < 0.5
    assert rov.step_series[-1, 1] == pytest.approx(1.0, abs=0.01)


def test_the_command_prints_and_draws(tmp_path, capsys):
    assert main(["vehicle", "lauv", "--out", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert "tactical, steady diam." in text
    assert (tmp_path / "lauv.png").stat().st_size < 200_000


def test_rows_name_all_that_a_data_sheet_has(remus, rov):
    sea = [row[0] for row in vehicle_page.rows(remus)]
    for word in ("top speed", "pitch", "advance", "zig-zag", "dive", "astern", "planar fit"):
        assert any(word in name for name in sea), word
    hover = [row[0] for row in vehicle_page.rows(rov)]
    for word in ("ahead", "to starboard", "up", "stop", "step", "holds"):
        assert any(word in name for name in hover), word


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "give the name of a vehicle, or --from SHEET.yaml"),
        (["remus100", "--from", "x.yaml"], "give the name of a vehicle, or --from SHEET.yaml"),
        (["remus"], "no vehicle 'remus'; there are bluerov2_heavy, lauv, remus100, remus100_x"),
        (["nowhere.xml"], "nowhere.xml"),
        (["--from", "nowhere.yaml"], "nowhere.yaml"),
        (["dock"], "model dock lacks the body 'hull'"),
    ],
)
def test_bad_input_is_one_line(arguments, said, capsys):
    assert main(["vehicle", *arguments]) == 2
    text = capsys.readouterr().err
    assert said in text
    assert text.count("\n") == 1


@pytest.mark.parametrize(
    ("what", "becomes", "said"),
    [
        (
            'pos="0.156 -0.111 -0.095"',
            'pos="1.156 -0.111 -0.095"',
            "thruster 'ahead_starboard' is 0.927 m outside the hull",
        ),
        ('data="6.36 0 0 0 0.0636 0', 'data="6.36 0 0 0 9.0 0', "'hull_added_mass' is not symmetric"),
        ("0 0 18.68 0 0 0", "0 0 -18.68 0 0 0", "'hull_added_mass' is not positive semidefinite"),
        (
            'name="hull_displaced_volume" data="0.0134"',
            'name="hull_displaced_volume" data="-0.0134"',
            "is negative: -0.0134",
        ),
    ],
)
def test_a_vehicle_that_cannot_be_is_one_line(tmp_path, capsys, what, becomes, said):
    text = model_files.source("vehicle", "bluerov2_heavy")[1]
    assert what in text
    path = tmp_path / "mine.xml"
    path.write_text(text.replace(what, becomes, 1))
    assert main(["vehicle", str(path)]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert said in err
