"""The bound of a mission before it is run: planned ways, campaigns at stations of the map, blind and mirror regions."""

import math

import numpy as np
import pytest

from auvsim import cli
from auvsim.analysis import mission_bound_files
from auvsim.analysis.mission_bounds import FollowerBound, mission_bounds
from auvsim.analysis.mission_plan import sources, told_error, way
from auvsim.base.errors import InputError
from auvsim.data import netcdf
from auvsim.simulation import building
from auvsim.simulation.loading import load_scenario
from estimators.core.history import Node
from estimators.core.models.odometry import SPACE, OdometryNoise
from estimators.motion_radius.bank import BankFilter
from estimators.motion_radius.ranges import leader_range

STATIONS = ((-100.0, -100.0), (100.0, -180.0), (0.0, 100.0), (250.0, -300.0), (-250.0, 50.0))
END = 1490.0  # of both tracks [s]
CURRENT = 0.7071 * np.array((math.cos(math.pi / 4.0), math.sin(math.pi / 4.0)))


def heading(t, swing, phase=0.0, amplitude=40.0, course=8.0):
    return math.radians(course) + math.radians(amplitude) * np.sin(2.0 * math.pi * t / swing + phase)


def walked(begin, headings):
    steps = 2.0 * np.stack((np.cos(headings), np.sin(headings)), axis=1) + CURRENT
    return np.array(begin) + np.vstack((np.zeros(2), np.cumsum(steps, axis=0)))


def mean_square(start, seed, amplitudes=(40.0, 40.0), side=7, noises=(2e-2, 1.0), course=8.0):
    """Mean squared position error of a run after 500 s: written apart from the plan, from the scenario's own numbers.

    DVL 0.02 m/s at 2 Hz and compass 1 deg at 10 Hz, averaged over a second; constant errors of both; ranges of timing
    noise, each 8 s, to where the leader's filter of fixes takes it to be.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(END)
    own_heading = heading(t, 300.0, math.pi / 2.0, amplitudes[0])
    own = walked((10.0, -100.0), own_heading)
    leader = walked(start, heading(t, 500.0, amplitude=amplitudes[1], course=course))
    scale = math.hypot(0.002, 0.001) * rng.standard_normal()
    bias = math.hypot(math.radians(math.hypot(0.5, 0.3)), 0.001) * rng.standard_normal()
    offset, drift = 0.15 * rng.standard_normal(), 3e-5 * rng.standard_normal()
    noise = OdometryNoise(
        forward=noises[0] ** 2 / 2.0, starboard=noises[0] ** 2 / 2.0, heading=math.radians(noises[1]) ** 2 / 10.0
    )
    ahead = (1.0 + scale) * 2.0 + math.sqrt(noise.forward) * rng.standard_normal(len(t))
    starboard = math.sqrt(noise.starboard) * rng.standard_normal(len(t))
    compass = own_heading + bias + math.sqrt(noise.heading) * rng.standard_normal(len(t))
    deviations = {
        "north": 3.0, "east": 3.0, "current_north": 0.5, "current_east": 0.5, "range_offset": 0.15, "range_drift": 3e-5,
        "speed_scale": math.hypot(0.002, 0.001), "compass_bias": math.hypot(math.radians(math.hypot(0.5, 0.3)), 0.001),
    }  # fmt: skip
    believed = own[0] + 3.0 * rng.standard_normal(2)
    prior = SPACE.belief({"north": believed[0], "east": believed[1]}, deviations)
    bank = BankFilter(prior, noise, side=side, memory=70.0)
    state = bank.start([Node(0.0, (), [], True)], 0)
    sigma, errors = 1500.0 * 125e-6, leaders_errors(rng)
    squares = []
    for k in range(len(t)):
        state = bank.predict(state, (ahead[k], starboard[k], compass[k]), 1.0)
        second = k + 1
        if second % 8 == 4 and second > 10 and rng.random() > 0.05:
            off = math.hypot(*(own[second] - leader[second]), 2.0)
            r = off + offset + drift * second + sigma * rng.standard_normal()
            told = (*(leader[second] + errors[second]), 12.0)
            m = leader_range(
                r, told, deviation=sigma, leader_deviation=math.sqrt(0.14), stamp=float(second), depth=10.0
            )
            state = bank.correct(state, float(second), [m])
        if second > 500 and second % 8 == 4:
            squares.append(float(((state.belief.mean[:2] - own[second]) ** 2).sum()))
    return np.mean(squares)


def leaders_errors(rng):
    """Errors (t, 2) [m] of a filter of fixes of 1 m each 10 s and a random walk, as the scenario's leader has it."""
    error, P, found = np.zeros(2), 1e6, []
    for second in range(int(END) + 1):
        error, P = error + math.sqrt(2e-3) * rng.standard_normal(2), P + 2e-3
        if second % 10 == 0 and second > 0:
            K = P / (P + 1.0)
            error, P = (1.0 - K) * error + K * rng.standard_normal(2), (1.0 - K) * P
        found.append(error)
    return np.array(found)


@pytest.fixture(scope="module")
def planned() -> FollowerBound:
    (found,) = mission_bounds(load_scenario("leader_follower"), span=800.0, side=17, after=500.0)
    return found


def at(found, start):
    """Indices of the station nearest to a start, and that station."""
    i, j = (int(np.abs(axis - x).argmin()) for axis, x in zip((found.north, found.east), start, strict=True))
    return (i, j), (found.north[i], found.east[j])


def test_a_planned_way_is_the_tracks_own_law():
    scenario = load_scenario("leader_follower")
    found = way(scenario, "follower", building.current(scenario, 0))
    expected = walked((10.0, -100.0), heading(np.arange(END), 300.0, math.pi / 2.0))
    assert found.places[: len(expected)] == pytest.approx(
        expected, abs=0.01
    )  # the scenario gives the current with four digits
    assert found.depths[-1] == 10.0


def test_what_is_told_errs_as_the_leaders_filter_says_and_lasts_as_long_as_that_remembers():
    """Of a filter of fixes in the steady state: P (P + q T) / R = q T, P after a fix; independently summed here."""
    leader, times = load_scenario("leader_follower").vehicles["leader"], np.arange(12.0, 4000.0, 8.0)
    told = told_error(leader, times)
    variance, error = [], 0.0
    for kept, added in zip(told.kept, told.added, strict=True):
        error = kept**2 * error + added
        variance.append(error)
    q, R = 2e-3 * 10.0, 1.0
    after = 0.5 * (-q + math.sqrt(q * q + 4.0 * q * R))
    assert variance[0] == pytest.approx(R + 2e-3 * 2.0)  # the first fix is all it has
    assert min(variance[-25:]) == pytest.approx(after, rel=1e-6)
    assert max(variance[-25:]) == pytest.approx(after + 2e-3 * 8.0, rel=1e-6)
    gain = after / R
    assert np.prod(told.kept[-50:]) == pytest.approx((1.0 - gain) ** 40, rel=1e-9)  # 400 s: 50 packets, 40 fixes
    assert told.density == pytest.approx(10.0)


@pytest.mark.parametrize("runs", [16, pytest.param(300, marks=pytest.mark.slow)])
def test_campaigns_at_five_stations_reach_the_map(planned, runs):
    """To reach is 0.95 to 1.25 of the map; a station's rms spreads by 9 % over 16 runs, by 2 % over 300."""
    slack, ratios = 2.5 * 0.36 / math.sqrt(runs), []
    for k, start in enumerate(STATIONS):
        place, station = at(planned, start)
        rms = math.sqrt(np.mean([mean_square(station, 5000 + 400 * k + run) for run in range(runs)]))
        ratios.append(rms / planned.settled[place])
        assert 0.95 - slack < ratios[-1] < 1.25 + slack, f"{station}: {rms} m"
    assert 0.95 - 0.4 * slack < np.mean(ratios) < 1.25
    assert not planned.blind.any()
    assert planned.rank.min() == 4


def test_blind_regions_are_blind():
    """On constant courses the map marks every station, and a campaign there comes nowhere near the bound."""
    keys = {name: {"mission": {"pattern": {"amplitude_deg": 0.0}}} for name in ("leader", "follower")}
    keys["leader"]["mission"]["pattern"]["course_deg"] = 20.0
    (found,) = mission_bounds(load_scenario("leader_follower", vehicles=keys), side=5, span=800.0, after=500.0, draws=0)
    assert found.blind.all()
    assert found.rank.max() == 3
    start = (found.north[0], found.east[0])
    rms = math.sqrt(np.mean([mean_square(start, 900 + run, (0.0, 0.0), course=20.0) for run in range(6)]))
    assert rms > 3.0 * found.settled[0, 0]


def test_mirror_regions_are_where_a_way_that_hardly_bends_meets_its_image():
    def bound(amplitude):
        keys = {name: {"mission": {"pattern": {"amplitude_deg": amplitude, "course_deg": course}}}
                for name, course in (("leader", 20.0), ("follower", 8.0))}  # fmt: skip
        scenario = load_scenario("leader_follower", vehicles=keys)
        return mission_bounds(scenario, side=9, span=800.0, after=500.0, blind=1e6, draws=0)[0]

    straight, bent, weaving = bound(0.0), bound(1.0), bound(40.0)
    assert (straight.mirror > 0.02).mean() > 0.9  # no range tells the two apart; where they are one there is no second
    assert bent.rank.min() == 4
    assert 0.03 < bent.mirrored.mean() < 0.5
    assert not weaving.mirrored.any()
    i, j = np.argwhere(bent.mirrored)[0]
    start = (bent.north[i], bent.east[j])
    rms = math.sqrt(np.mean([mean_square(start, 900 + run, (1.0, 1.0), course=20.0) for run in range(8)]))
    assert rms > 2.5 * bent.settled[i, j]


def test_a_beacon_and_a_dock_are_moved_too():
    reckons = {"dvl": {"enabled": True}}
    keys = {"auv_3": {"sensors": {**reckons, "pole": {"kind": "range", "beacon": [30.0, 20.0, 5.0]}}}}
    scenario = load_scenario("three_vehicles", vehicles=keys)
    assert [s.name for s in sources(scenario, "auv_3", {})] == ["pole", "west"]
    (dock,) = mission_bounds(scenario, moved="west", side=5)
    assert dock.start == (-40.0, -180.0)
    assert not dock.blind.any()
    (beacon,) = mission_bounds(scenario, moved="pole", side=5)
    # The dock's fixes hold wherever the beacon stands, and a beacon only helps.
    alone = mission_bounds(load_scenario("three_vehicles", vehicles={"auv_3": {"sensors": reckons}}), side=5)[0]
    nominal, _ = at(alone, alone.start)
    assert (beacon.settled <= alone.settled[nominal] * 1.3).all()


def test_more_losses_and_more_noise_raise_the_bound():
    values = []
    for network, dvl in (({}, {}), ({"dropout_probability": 0.6}, {}), ({}, {"water_noise": [0.2, 0.2, 0.01]})):
        keys = {"follower": {"sensors": {"dvl": dvl}}}
        scenario = load_scenario("leader_follower", vehicles=keys, network=network)
        values.append(mission_bounds(scenario, side=5, span=500.0)[0].settled)
    assert (values[1] > values[0]).all()
    assert (values[2] > values[0]).all()


def test_files_hold_what_was_computed(planned, tmp_path):
    picture, data = mission_bound_files.write(planned, tmp_path)
    assert picture.stat().st_size > 50_000
    fields = netcdf.load(data).groups["bound"]
    assert np.array_equal(fields["position"].values, planned.position)
    assert fields["position"].dimensions == ("north", "east", "time")
    assert fields["current"].attributes["units"] == "m/s"


def test_command_prints_a_line_for_each_follower(tmp_path, capsys):
    assert cli.main(["bound", "leader_follower", "--side", "5", "--out", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "follower" in out
    assert "4 of 4" in out
    assert {path.name for path in tmp_path.iterdir()} == {"bound_follower.png", "bound_follower.nc"}


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["leader_follower", "--side", "1"], "--side 1 must lie in 2 .. 301"),
        (["leader_follower", "--move", "moon"], "--move moon: nobody ranges to it; they do to leader"),
        (["leader_follower", "--span", "-5"], "--span -5 must lie in 1 .. 100000 m"),
        (["leader_follower", "--span", "inf"], "--span inf must lie in"),
        (["leader_follower", "--blind", "inf"], "--blind inf must be a finite number"),
        (["leader_follower", "--after", "1e6"], "--after 1e+06 must lie in"),
        (["dock_by_ranges"], "no vehicle on a track ranges to anything"),
        (["leader_follower", "--vehicles.follower.sensors.dvl.enabled", "false"], "a bound needs a DVL"),
        (["nowhere"], "no scenario 'nowhere'"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, reason, tmp_path, capsys):
    assert cli.main(["bound", *arguments, "--out", str(tmp_path / "new")]) == 2
    error = capsys.readouterr().err
    assert reason in error
    assert len(error.strip().splitlines()) == 1
    assert not (tmp_path / "new").exists()


def test_a_way_that_is_not_known_before_is_refused():
    scenario = load_scenario("three_vehicles")
    with pytest.raises(InputError, match="needs a track"):
        way(scenario, "auv_1", building.current(scenario, 0))
