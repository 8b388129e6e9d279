"""What is read off a manoeuvre, from motions whose figures are known in closed form."""

import math

import numpy as np
import pytest
from synthetic import trial_log, writer

from auvsim.base import yaml_text
from auvsim.base.errors import InputError
from auvsim.base.frames import euler_to_quaternion, rotation, wrap
from auvsim.cli import report
from auvsim.data.log import VehicleLog
from auvsim.missions.manoeuvres import metrics
from auvsim.missions.manoeuvres.metrics import Motion
from auvsim.missions.manoeuvres.mission import Manoeuvre
from auvsim.missions.manoeuvres.settings import ManoeuvreMissionSettings, SpiralSettings
from auvsim.physics.truth import Truth

APPROACH, SPEED, RATE = 20.0, 1.5, math.radians(5.0)
RADIUS = SPEED / RATE


def manoeuvre_log(kind: str, heading, *, until: float, current=(0.0, 0.0, 0.0), course: float = 0.0, **manoeuvre):
    """A log at 10 Hz of a vehicle that goes ahead at SPEED through the water, its heading a function of time."""
    settings = ManoeuvreMissionSettings.model_validate({"manoeuvre": {"kind": kind, **manoeuvre}})
    log = writer("manoeuvre", mission_settings=yaml_text.dump(settings.model_dump(mode="json")))
    place = np.array([300.0, 0.0, 10.0])
    for tick in range(round(10.0 * until) + 1):
        time = 0.1 * tick
        yaw, rate = course + heading(time), (heading(time + 1e-4) - heading(time - 1e-4)) / 2e-4
        turn = rotation(0.0, 0.0, yaw)
        nu = np.zeros(6)
        nu[:3], nu[5] = np.array([SPEED, 0.0, 0.0]) + turn.T @ current, rate
        log.truth(
            Truth(
                time=time, position=place, quaternion=euler_to_quaternion(0.0, 0.0, yaw),
                attitude=np.array([0.0, 0.0, wrap(yaw)]), nu=nu, current=np.array(current),
                actuators=np.array([0.0, 0.0, 0.0, 0.0, 100.0]),
            )
        )  # fmt: skip
        log.append("mission", (time, 0, yaw, 10.0, SPEED))
        log.append("command", (time, math.copysign(0.2, rate), 0.0, 100.0))
        middle = rotation(0.0, 0.0, course + heading(time + 0.05))
        place = place + 0.1 * (middle @ (SPEED, 0.0, 0.0) + current)
    return log.finish("complete")


@pytest.mark.parametrize("current", [(0.0, 0.0, 0.0), (0.2, -0.3, 0.0)])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_turning_circle(current, side: float) -> None:
    """Advance and transfer a radius, tactical diameter two, to either side, in any current and on any course."""
    log = manoeuvre_log(
        "circle", lambda t: side * RATE * max(t - APPROACH, 0.0), until=140.0, current=current, course=2.9
    )
    (found,) = metrics.figures(log)
    assert (found.kind, found.start) == ("circle", APPROACH)
    n = found.numbers
    # Midpoint steps of 0.1 s at 5 deg/s put the track off by 1e-5 of the radius; between samples it is a chord.
    for key, value in (("advance", RADIUS), ("transfer", RADIUS), ("tactical_diameter", 2 * RADIUS)):
        assert n[key] == pytest.approx(value, rel=1e-3)
    assert n["steady_diameter"] == pytest.approx(2 * RADIUS, rel=1e-6)
    assert n["steady_yaw_rate_deg"] == pytest.approx(5.0 * side, rel=1e-6)
    assert n["steady_drift_deg"] == pytest.approx(0.0, abs=1e-9)
    assert n["speed_loss"] == pytest.approx(0.0, abs=1e-9)
    assert n["room"] == pytest.approx(2 * RADIUS, rel=1e-3)
    assert n["approach_speed"] == pytest.approx(SPEED)


def test_a_circle_that_was_not_closed_says_only_what_it_knows() -> None:
    """After 100 deg there is an advance, but neither a tactical nor a steady diameter."""
    numbers = metrics.figures(manoeuvre_log("circle", lambda t: RATE * max(t - APPROACH, 0.0), until=40.0))[0].numbers
    assert numbers["advance"] == pytest.approx(RADIUS, rel=1e-3)
    assert numbers["tactical_diameter"] is None
    assert numbers["steady_diameter"] is None


def test_zigzag_overshoots_and_period() -> None:
    """Headings made of parabolas: the rudder changes sides at 10 deg, the heading turns on by what was set."""
    overshoots, rudder, heading, changes = [3.0, 2.0, 1.0, 2.5], [1.0], [0.0], []
    side, step = 1.0, 0.1
    for overshoot in overshoots:  # to 10 deg at 4 deg/s, on to the peak and back through the other side's 10 deg
        while side * heading[-1] < 10.0:
            heading.append(heading[-1] + side * 0.4)
            rudder.append(side)
        switch = heading[-1]
        changes.append(len(rudder))
        rise = np.linspace(0.0, 1.0, 21)[1:]
        heading += (switch + side * overshoot * rise * (2.0 - rise)).tolist()
        side = -side
        rudder += [side] * 20
    heading += [heading[-1] + side * 0.4] * 3  # the last has come back from its peak too
    rudder += [side] * 3
    count = len(heading)
    motion = Motion(
        time=step * np.arange(count), track=np.zeros((count, 2)), heading=np.radians(heading),
        velocity=np.zeros((count, 3)), depth=np.zeros(count), rudder=np.array(rudder), shaft_speed=np.zeros(count),
    )  # fmt: skip
    found = metrics.zigzag(motion, 10.0)
    # The heading is taken from the first sample after the change, a twentieth of the way up the parabola: 10 % less.
    first_rise = 1.0 - (0.05 * (2.0 - 0.05))
    assert found["first_overshoot_deg"] == pytest.approx(3.0 * first_rise)
    assert found["second_overshoot_deg"] == pytest.approx(2.0 * first_rise)
    assert found["mean_overshoot_deg"] == pytest.approx(2.125 * first_rise)
    assert found["initial_turning_time"] == pytest.approx(step * changes[0])
    assert found["period"] == pytest.approx(step * np.mean([changes[2] - changes[0], changes[3] - changes[1]]))


@pytest.mark.parametrize(("off", "swings"), [(2.4, False), (-2.4, False), (2.6, True), (-9.0, True), (12.0, True)])
def test_a_vehicle_that_oscillates_has_no_overshoots(off: float, swings: bool) -> None:
    """It is off its course by more than a quarter of the switching angle when the zig-zag begins."""
    time = np.arange(0.0, 60.0, 0.1)
    heading = off * np.cos(time) + 12.0 * np.sin(0.5 * time)
    count = len(time)
    motion = Motion(
        time=time, track=np.zeros((count, 2)), heading=np.radians(heading), velocity=np.zeros((count, 3)),
        depth=np.zeros(count), rudder=np.sign(np.cos(0.5 * time)), shaft_speed=np.zeros(count),
    )  # fmt: skip
    found = metrics.zigzag(motion, 10.0)
    assert (set(found.values()) == {None}) == swings
    assert metrics.oscillates(motion, 10.0) == swings


def test_an_oscillating_vehicle_is_told(capsys) -> None:
    """In the figures of its log, and on the screen."""
    log: VehicleLog = manoeuvre_log("zigzag", lambda t: 0.2 * math.sin(2.0 * (t - APPROACH) + 1.0), until=60.0)
    (found,) = metrics.figures(log)
    assert found.numbers["first_overshoot_deg"] is None
    report.manoeuvres([found])
    assert "the vehicle oscillates by itself: when the zig-zag began it was" in capsys.readouterr().err


def spiral_motion(settings: SpiralSettings, loop: float) -> Motion:
    """Yaw rates that follow the rudder with a time constant of 1 s, and lag behind by a loop [rad/s] of relays."""
    time = np.arange(0.0, settings.duration - settings.approach, 0.1)
    index = np.minimum((time / settings.hold + 1e-9).astype(int), len(settings.rudders_deg) - 1)
    rudder = np.radians(settings.rudders_deg)[index]
    way = np.where(index <= len(settings.rudders_deg) // 2, 0.5, -0.5)
    steady = 0.4 * rudder + loop * way
    rate = np.empty_like(steady)
    rate[0] = steady[0]
    for k in range(1, len(time)):
        rate[k] = rate[k - 1] + 0.1 * (steady[k - 1] - rate[k - 1])
    velocity = np.c_[np.full(len(time), SPEED), np.zeros(len(time)), rate]
    return Motion(
        time=time, track=np.zeros((len(time), 2)), heading=np.zeros(len(time)), velocity=velocity,
        depth=np.zeros(len(time)), rudder=rudder, shaft_speed=np.zeros(len(time)),
    )  # fmt: skip


@pytest.mark.parametrize("loop", [0.0, 0.01])
def test_spiral_slope_and_loop(loop: float) -> None:
    """The slope of the steady turns, and the width of the loop of a vehicle that remembers."""
    settings = SpiralSettings(hold=30.0)
    found = metrics.spiral(settings, spiral_motion(settings, loop))
    # 22.5 s after a step of 0.02 rad/s and less, exp(-22.5) of it is left.
    assert found["slope"] == pytest.approx(0.4, abs=1e-7)
    assert found["loop_deg"] == pytest.approx(math.degrees(loop), abs=1e-6)
    assert found["residual_yaw_rate_deg"] == pytest.approx(math.degrees(0.5 * loop), abs=1e-6)


def test_a_docking_trial_is_no_manoeuvre() -> None:
    """It is told apart by its mission; its figures are refused."""
    docking = trial_log()
    assert not metrics.is_manoeuvre(docking)
    with pytest.raises(InputError, match="the mission of 'remus100' is docking, not a manoeuvre"):
        metrics.figures(docking)


def test_an_interrupted_manoeuvre_has_no_figures_of_what_did_not_begin() -> None:
    """Stopped in the approach: nothing; the log is still one of a manoeuvre."""
    log: VehicleLog = manoeuvre_log("zigzag", lambda t: 0.0, until=10.0)
    assert metrics.is_manoeuvre(log)
    assert metrics.figures(log) == []
    found = Manoeuvre.metrics(log)
    assert {key: value for key, value in found.items() if value is not None} == {"finished": False, "manoeuvres": []}


@pytest.mark.parametrize("form", ["mission_settings", "old scenario"])
def test_what_was_done_is_read_from_logs_of_any_format(form: str) -> None:
    """New logs say it of the vehicle; those of formats 1 and 2 in their scenario alone."""
    text = "manoeuvre: {kind: spiral, rudder_deg: 8.0, step_deg: 4.0, hold: 11.0}\n"
    recorder = writer(
        "manoeuvre", **({"mission_settings": f"kind: manoeuvre\n{text}"} if form == "mission_settings" else {})
    )
    log = recorder.finish("complete")
    if form == "old scenario":
        log.log.attributes["scenario"] = f"duration: 400.0\nvehicle: {{model: remus100}}\n{text}"
    found = metrics.settings(log)
    assert found == SpiralSettings(rudder_deg=8.0, step_deg=4.0, hold=11.0)
    assert found.duration == 20.0 + 9 * 11.0


def test_settings_that_cannot_be_read_are_bad_input() -> None:
    log = writer("manoeuvre", mission_settings="manoeuvre: {kind: spiral, hold: fast}").finish("complete")
    with pytest.raises(InputError, match=r"mission of 'remus100'.*hold"):
        metrics.settings(log)
    with pytest.raises(InputError, match=r"mission of 'remus100'.*manoeuvre"):
        metrics.settings(writer("manoeuvre", mission_settings="kind: manoeuvre").finish("complete"))


def test_columns_are_what_the_mission_gives() -> None:
    """Of a sequence each from the first manoeuvre that has it; a circle after a zig-zag has its own advance."""
    parts = [{"kind": "straight", "duration": 40.0, "approach": 10.0}, {"kind": "circle", "duration": 100.0}]
    log = manoeuvre_log("sequence", lambda t: RATE * max(t - 60.0, 0.0), until=139.9, parts=parts)
    found = Manoeuvre.metrics(log)
    assert found.keys() - {"manoeuvres"} == Manoeuvre.columns.keys() == {"finished", *metrics.LABELS}
    assert [part["kind"] for part in found["manoeuvres"]] == ["straight", "circle"]
    assert found["advance"] == found["manoeuvres"][1]["advance"] == pytest.approx(RADIUS, rel=1e-3)
    assert found["duration"] == found["manoeuvres"][0]["duration"] == pytest.approx(30.0)
    assert not found["finished"]  # at 139.9 s of 140
    assert metrics.LABELS["advance"] == "advance [m]"
