"""Manoeuvres: what each asks for at which time, against its definition; and trials that carry them out."""

import math
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from auvsim.base.errors import InputError
from auvsim.data import log
from auvsim.data.log import VehicleLog
from auvsim.missions.docking.dock_frame import to_body
from auvsim.missions.manoeuvres.laws import Order, Steering, binary_sequence, multisine
from auvsim.missions.manoeuvres.settings import ManoeuvreSettings, SpiralSettings
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import run as run_scenario

LIMIT = math.radians(15.0)
DEG = math.pi / 180.0


def steering(course: float = 0.0, rate: float = 10.0, **settings: Any) -> Steering:
    """The steering of a manoeuvre."""
    made = TypeAdapter(ManoeuvreSettings).validate_python(settings)
    return Steering(made, limit=LIMIT, rate=rate, course=course)


def orders(steered: Steering, until: float, heading: float = 0.0) -> list[Order]:
    """Its orders at 10 Hz, the heading standing still."""
    return [steered.order(0.1 * tick, heading) for tick in range(round(10.0 * until))]


def test_the_course_is_held_before_every_manoeuvre() -> None:
    """Until the approach is over there is no rudder of its own."""
    for kind in ("straight", "circle", "zigzag", "multisine", "prbs", "spiral"):
        found = orders(steering(kind=kind, approach=7.0, course=1.0), 7.1)
        assert {(order.course, order.rudder, order.speed) for order in found[:70]} == {(1.0, None, 1.5)}
        assert found[-1].part == kind
        assert (found[-1].rudder is None) == (kind == "straight")


def test_zigzag_switches_on_the_heading_that_it_is_given() -> None:
    """A heading that swings as a sine: the rudder goes over where it passes 10 deg, and not again until the other."""
    steered = steering(kind="zigzag", approach=0.0, course=3.0)
    before, sides = 1.0, []
    for tick in range(2000):
        change = 20.0 * DEG * math.sin(0.05 * tick)
        order = steered.order(0.1 * tick, math.remainder(3.0 + change, 2 * math.pi))  # passes +-180 deg on the way
        assert order.rudder is not None
        assert abs(order.rudder) == pytest.approx(10.0 * DEG)
        side = math.copysign(1.0, order.rudder)
        if side != before:
            sides.append(side)
            assert 10.0 <= -side * change / DEG < 10.0 + 20.0 * 0.05  # one tick of the sine's steepest
        before = side
    assert sides == [(-1.0) ** (k + 1) for k in range(len(sides))]
    assert len(sides) == round(2 * 2000 * 0.05 / (2 * math.pi))  # twice a swing


def test_zigzag_of_20_deg_takes_the_rudder_there_is() -> None:
    """The standard 20/20 with fins of 15 deg: the heading switches at 20 deg, the rudder goes to its limit."""
    assert orders(steering(kind="zigzag", heading_deg=20.0, approach=0.0), 0.1)[0].rudder == pytest.approx(LIMIT)
    free = steering(kind="zigzag", heading_deg=20.0, rudder_deg=5.0, approach=0.0)
    assert orders(free, 0.1)[0].rudder == pytest.approx(5.0 * DEG)


def test_multisine_has_the_spectrum_it_is_asked_for() -> None:
    """Equal lines at the harmonics and nothing else; the peak is the rudder asked for, and no lower."""
    law = multisine(0.02, 0.2, 0.1)
    times = np.arange(5000) / 100.0  # one period of 50 s
    values = np.array([law(time, 0.0) or 0.0 for time in times])
    lines = np.abs(np.fft.rfft(values)) / len(values)
    np.testing.assert_allclose(lines[1:11], lines[1:11].mean(), rtol=0.01)  # the peak is cut by up to 0.3 %
    assert np.abs(np.r_[lines[0], lines[11:]]).max() < 0.01 * lines[1:11].mean()
    assert 0.996 * 0.1 < np.abs(values).max() <= 0.1
    crest = np.abs(values).max() / values.std()
    assert crest < 2.0  # Schroeder (1970): 1.7 and less; of phases zero it would be sqrt(2 * 10) = 4.5


@pytest.mark.parametrize("order", range(3, 12))
def test_binary_sequences_are_as_long_as_can_be(order: int) -> None:
    """Golomb's postulates: balance, and an autocorrelation of one peak, all else -1."""
    sequence = np.array(binary_sequence(order))
    assert set(sequence.tolist()) == {-1, 1}
    assert len(sequence) == 2**order - 1
    assert abs(sequence.sum()) == 1
    for shift in range(1, len(sequence)):
        assert sequence @ np.roll(sequence, shift) == -1


def test_prbs_holds_each_side_for_its_clock() -> None:
    """Every value lasts a whole number of clocks."""
    found = [order.rudder for order in orders(steering(kind="prbs", clock=1.5, approach=3.0), 200.0)]
    rudders = np.array(found[30:], dtype=float)
    assert set(np.round(np.abs(rudders) / DEG, 9)) == {10.0}
    switches = np.flatnonzero(np.diff(rudders)) + 1
    assert (np.diff(switches) % 15 == 0).all()
    assert (rudders[:15] == rudders[0]).all()


def test_spiral_goes_from_one_side_to_the_other_and_back() -> None:
    """Dieudonne's order, each rudder for the time it takes."""
    settings = SpiralSettings(rudder_deg=6.0, step_deg=3.0, hold=5.0, approach=10.0)
    assert settings.duration == 10.0 + 9 * 5.0
    found = orders(steering(**settings.model_dump()), settings.duration)[100:]
    rudders = np.array([order.rudder for order in found]).reshape(9, 50) / DEG
    np.testing.assert_allclose(rudders, np.repeat([[6, 3, 0, -3, -6, -3, 0, 3, 6]], 50, axis=0).T, atol=1e-12)


def test_table_holds_each_point() -> None:
    """Rudder and speed from their times on; a point without speed keeps the one before."""
    points = [
        {"time": 0.0, "rudder_deg": 5.0},
        {"time": 2.0, "rudder_deg": -5.0, "speed": 1.0},
        {"time": 3.0, "rudder_deg": 0.0},
    ]
    found = orders(steering(kind="table", points=points, approach=1.0, duration=6.0), 6.0)
    got = [(round((order.rudder or 0.0) / DEG, 9), order.speed) for order in found[10:]]
    assert got == [(5.0, 1.5)] * 20 + [(-5.0, 1.0)] * 10 + [(0.0, 1.0)] * 20


def test_speed_steps_take_turns() -> None:
    """From the end of the approach on, each for its time, and again from the first."""
    found = orders(steering(kind="circle", speed_steps=[1.0, 2.0], step_time=3.0, approach=2.0), 14.0)
    assert [order.speed for order in found] == [1.5] * 20 + ([1.0] * 30 + [2.0] * 30) * 2


def test_a_sequence_goes_on_from_the_heading_it_has() -> None:
    """Each part with its own approach, on the course on which it begins."""
    parts = [
        {"kind": "straight", "duration": 5.0, "approach": 1.0},
        {"kind": "sequence", "parts": [{"kind": "circle", "duration": 6.0, "approach": 2.0}]},
        {"kind": "zigzag", "duration": 8.0, "approach": 3.0},
    ]
    steered = steering(kind="sequence", parts=parts, course=0.3)
    assert steered.duration == 19.0
    found = [steered.order(float(time), 0.3 + 0.1 * time) for time in range(19)]
    held = [(order.part, round(order.course, 9)) for order in found]
    expected = [("straight: approach", 0.3), ("straight", 0.3), ("circle: approach", 0.8), ("circle", 0.8)]
    expected += [("zigzag: approach", 1.4), ("zigzag", 1.4)]
    assert [entry for k, entry in enumerate(held) if k == 0 or entry != held[k - 1]] == expected
    assert [held.count(entry) for entry in expected] == [1, 4, 2, 4, 3, 5]


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"kind": "zigzag", "rudder_deg": 15.1}, "manoeuvre zigzag: rudder 15.1 deg is beyond the fins' 15 deg"),
        ({"kind": "circle", "rudder_deg": -20.0}, "rudder -20 deg is beyond"),
        ({"kind": "table", "points": [{"time": 0.0, "rudder_deg": 16.0}]}, "rudder 16 deg is beyond"),
        ({"kind": "multisine", "highest": 5.0}, "highest 5 Hz must be below half the control rate, 5 Hz"),
        ({"kind": "prbs", "clock": 0.09}, "clock 0.09 s must be at least a control period, 0.1 s"),
    ],
)
def test_what_cannot_be_steered_is_refused(settings: dict, text: str) -> None:
    """One line with what would be right."""
    with pytest.raises(InputError, match=text):
        steering(**settings)


def parsed(manoeuvre: dict, **pinned: Any) -> scenario.Scenario:
    """The installed plan of a manoeuvre with values pinned."""
    plan = sampling.merge(sampling.manoeuvre_plan(manoeuvre["kind"]), {**pinned, "manoeuvre": manoeuvre})
    return scenario.parse(sampling.draw(plan, 1))


@pytest.mark.parametrize(
    ("manoeuvre", "text"),
    [
        ({"kind": "zigzag", "duration": 0.0}, "manoeuvre.duration: 0.0 should be greater than 0"),
        ({"kind": "zigzag", "duration": 10.0}, "duration is 10 s, it must be more than the approach, 20 s"),
        ({"kind": "zigzag", "duration": 2000.0}, "1200 s is too short for a manoeuvre of 2000 s"),
        ({"kind": "spiral", "step_deg": 5.0}, "step_deg is 5, it must divide twice rudder_deg, 12 deg"),
        ({"kind": "multisine", "lowest": 0.5}, "highest is 0.2 Hz, it must be at least `lowest`, 0.5 Hz"),
        ({"kind": "straight", "speed_steps": [1.0, -1.0]}, "speed_steps are .* they must be positive"),
        ({"kind": "table", "points": [{"time": 1.0, "rudder_deg": 1.0}]}, "must increase, the first being 0"),
        ({"kind": "table", "points": [{"time": 0.0, "rudder_deg": 1.0}, {"time": 280.0, "rudder_deg": 1.0}]}, "after"),
        ({"kind": "loop"}, "no kind 'loop'; there are straight, circle, zigzag"),
    ],
)
def test_bad_settings_are_refused(manoeuvre: dict, text: str) -> None:
    """One line with key and reason."""
    with pytest.raises(InputError, match=text) as error:
        parsed(manoeuvre)
    assert "\n" not in str(error.value)


def run(seed: int = 1, trial: int = 0, **manoeuvre: Any) -> VehicleLog:
    """Carries a manoeuvre out."""
    return run_scenario(parsed(manoeuvre), seed=seed, trial=trial).vehicle()


@pytest.fixture(scope="module")
def zigzag() -> VehicleLog:
    """A zig-zag of a minute and a half."""
    return run(kind="zigzag", duration=90.0)


def test_a_manoeuvre_is_logged_whole(zigzag: VehicleLog) -> None:
    """It ends when it is over, complete, with DVL and gyro at their rates, far from the dock and at its depth."""
    assert zigzag.log.attributes["status"] == "complete"
    truth, guidance = zigzag["truth"], zigzag["mission"]
    assert truth["time"][-1] == pytest.approx(90.0, abs=1e-9)
    assert zigzag.phases == ("manoeuvre",)
    assert set(guidance["phase"].tolist()) == {0}
    event = zigzag["event"]
    told = event["text"][event["kind"] != "refused"].tolist()  # what the estimator refuses is by chance
    assert told == ["zigzag: approach", "zigzag"]
    assert len(zigzag["dvl"]["time"]) == 90 * 5
    assert len(zigzag["gyro"]["time"]) == 90 * 10
    assert len(zigzag["contact"]["time"]) == 0
    assert np.hypot(*truth["position"][:, :2].T).min() > 200.0
    bias = float(np.mean(zigzag["depth"]["value"][:, 0] - truth["position"][1:, 2]))
    # The gauge's depth is held to 10 cm of noise and dive; its bias, of this trial, is not seen.
    np.testing.assert_allclose(truth["position"][:, 2] + bias, 10.0, atol=0.25)


def test_the_rudder_switches_on_the_compass(zigzag: VehicleLog) -> None:
    """Where the measured heading has turned by 10 deg; the truth is off by bias and smoothing."""
    command, compass = zigzag["command"], zigzag["compass"]
    rudder = command["rudder"][command["time"] > 20.05]
    times = command["time"][command["time"] > 20.05]
    assert set(np.round(np.abs(rudder), 12)) == {round(10.0 * DEG, 12)}
    switches = np.flatnonzero(np.diff(np.sign(rudder))) + 1
    assert len(switches) >= 8
    for at in switches:
        near = np.abs(compass["time"] - times[at]) < 0.35  # 7 readings of 1 deg: mean good to 0.4 deg
        turned = np.angle(np.exp(1j * compass["value"][near, 0]).mean())
        # The smoothed heading lags by some tenths of a second at 4 deg/s.
        assert -np.sign(rudder[at]) * turned / DEG == pytest.approx(10.0, abs=2.5)


def test_the_same_seed_gives_the_same_manoeuvre() -> None:
    """Bit for bit; another trial has other noises."""
    first, again = (run(kind="prbs", duration=30.0) for _ in range(2))
    assert log.differences(first.log, again.log) == []
    other = log.differences(first.log, run(kind="prbs", duration=30.0, trial=1).log)
    assert {f"vehicles/remus100/sensors/{name}/value" for name in ("dvl", "gyro", "compass")} <= set(other)


def test_new_sensors_change_nothing_else() -> None:
    """A docking trial with DVL and gyro that no filter uses is, apart from their groups, the trial without them."""
    plan = sampling.merge(sampling.default_plan(), {"duration": 60.0, "estimator": {"use": []}})
    on = sampling.merge(plan, {"sensors": {"dvl": {"enabled": True}, "gyro": {"enabled": True}}})
    without, with_them = (run_scenario(scenario.parse(sampling.draw(values, 4)), seed=4) for values in (plan, on))
    assert "dvl" not in without.vehicle()
    assert "gyro" not in without.vehicle()
    names = [f"vehicles/remus100/sensors/{sensor}" for sensor in ("dvl", "gyro")]
    sensors = {f"{group}/{name}" for group in names for name in ("time", "received", "value", "sequence")}
    assert set(log.differences(without, with_them)) == sensors | {f"{group} (tables)" for group in names} | {"scenario"}


def test_a_speed_beyond_the_propeller_is_refused() -> None:
    """Before anything runs."""
    with pytest.raises(InputError, match="the shaft of 'remus100' cannot hold 4 m/s"):
        run(kind="circle", speed_steps=[1.0, 4.0])


def test_shaft_speed_steps_with_the_speed() -> None:
    """The speeds asked for are reached, open loop, to some per cent."""
    trial = run(kind="straight", speed_steps=[1.0, 1.8], step_time=30.0, duration=80.0)
    truth = trial["truth"]
    through = truth["nu"][:, :3] - to_body(truth["quaternion"], truth["current"])
    for end, speed in ((50.0, 1.0), (80.0, 1.8)):
        settled = (truth["time"] > end - 5.0) & (truth["time"] < end)
        # The planar model that gives the shaft speed is fitted at 1 m/s; its error at 1.8 m/s is below 2 %.
        np.testing.assert_allclose(through[settled, 0], speed, rtol=0.02)
    assert len(set(np.round(trial["command"]["shaft_speed"], 6))) == 3
