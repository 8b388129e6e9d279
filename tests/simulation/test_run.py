"""Whole closed-loop trials: replay, what the estimator is told, bad links, go-arounds, rates, memory."""

import math
import subprocess
import sys
from collections.abc import Mapping
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvsim.analysis import summary
from auvsim.base.reading import Reading
from auvsim.data import log
from auvsim.data.log import VehicleLog
from auvsim.data.phases import phase_at, phase_stretches
from auvsim.missions.docking import dock_frame
from auvsim.missions.docking.dock_frame import nose_position
from auvsim.missions.docking.guidance import Phase
from auvsim.navigation import registry
from auvsim.navigation.navigator import NavigatorSetup
from auvsim.physics import planar_fit
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import ProgressState, Simulation
from auvsim.simulation.run import run as run_scenario
from auvsim.simulation.sensor_settings import rated
from auvsim.vehicles import library
from auvsim.vehicles.actuation import Commands

LATCHED = 1.28923  # where the shipped dock holds the nose [m]


def plan(seed: int, **pinned: object) -> scenario.Scenario:
    """Trial 0 of the default plan with some values pinned."""
    return scenario.parse(sampling.draw(sampling.merge(sampling.default_plan(), pinned), seed))


def run_trial(settled: scenario.Scenario, **options: Any) -> VehicleLog:
    """Runs a scenario of one vehicle."""
    return run_scenario(settled, **options).vehicle()


def run(seed: int, **pinned: object) -> VehicleLog:
    """Runs trial 0 of the default plan with some values pinned."""
    return run_trial(plan(seed, **pinned), seed=seed)


def summarise(trial: VehicleLog) -> SimpleNamespace:
    """The summary of a trial."""
    return SimpleNamespace(**summary.summarise(trial))


def in_dock_frame(trial: VehicleLog, position: np.ndarray) -> np.ndarray:
    """Places seen from the trial's dock."""
    assert trial.structure is not None
    return dock_frame.in_dock_frame(trial.structure, position)


def events(trial: VehicleLog) -> list[tuple[str, str]]:
    """Kind and text of each event."""
    return list(zip(trial["event"]["kind"].tolist(), trial["event"]["text"].tolist(), strict=True))


@pytest.fixture(scope="module")
def docked() -> VehicleLog:
    """A trial that docks at its first attempt, from close by and with the default noises."""
    return run(11, vehicle={"start": {"range": 230.0, "bearing_deg": 20.0}})


def test_replays_bit_for_bit() -> None:
    """The same scenario and seed give the same arrays; another seed or another trial number other noises."""
    short = plan(5, duration=40.0)
    first = run_scenario(short, seed=5)
    assert log.differences(first, run_scenario(short, seed=5)) == []
    noisy = {f"vehicles/remus100/sensors/{name}/value" for name in ("compass", "depth", "usbl")}
    for other in (run_scenario(short, seed=6), run_scenario(short, seed=5, trial=1)):
        different = log.differences(first, other)
        assert {*noisy, "vehicles/remus100/sensors/usbl/time", "vehicles/remus100/truth/position"} <= set(different)
        assert "vehicles/remus100/sensors/feedback/time" not in different


def noises(trial: VehicleLog) -> dict[str, np.ndarray]:
    """The errors of each sensor of a log, from the truth of the same ticks."""
    truth = trial["truth"]
    at = {name: np.searchsorted(truth["time"], trial[name]["time"]) for name in ("compass", "depth", "feedback")}
    turn = trial["compass"]["value"] - truth["attitude"][at["compass"]][:, ::-1]
    actuators = truth["actuators"]
    return {
        "compass": np.angle(np.exp(1j * turn)),
        "depth": trial["depth"]["value"] - truth["position"][at["depth"], 2:],
        "feedback": trial["feedback"]["value"] - actuators[at["feedback"]],
        "usbl": np.c_[trial["usbl"]["time"], trial["usbl"]["value"][:, 3:], trial["usbl"]["outlier"]],
    }


LOSSES = {"acoustics": {"dropout_probability": 0.9}}


@pytest.mark.parametrize(
    ("changed", "pinned"),
    [
        ("usbl", {"sensors": {"usbl": {"outlier_probability": 0.5, "noise_scale": 3.0}}}),
        ("compass", {"sensors": {"compass": {"heading_noise_deg": 3.0}}}),
        ("depth", {"sensors": {"depth": {"noise": 0.2}}}),
        ("depth", {"sensors": {"depth": {"rate": 5.0}}}),
        ("usbl", {"sensors": {"usbl": {"interval": 2.0}}}),
        ("feedback", {"sensors": {"feedback": {"fin_noise_deg": 1.0}}}),
        ("", LOSSES),
    ],
)
def test_a_change_to_one_sensor_changes_no_other_noise(changed: str, pinned: Mapping) -> None:
    """Although the vehicle then goes elsewhere, the errors of all other sensors stay what they were."""
    # Noise is drawn in blocks: in 100 s every sensor at 10 Hz takes more than one.
    before, after = run(8, duration=100.0), run(8, duration=100.0, **pinned)
    assert "vehicles/remus100/truth/position" in log.differences(before.log, after.log)
    errors, others = noises(before), noises(after)
    for sensor in errors:
        if sensor != changed:
            np.testing.assert_allclose(others[sensor], errors[sensor], atol=1e-12)  # rounding of truth plus noise
    if changed:
        assert not np.array_equal(others[changed], errors[changed])
    else:
        assert after["usbl"]["lost"].mean() > 0.5


def delivered(trial: VehicleLog, start: float, end: float) -> list[Reading]:
    """The readings of a log that arrived in (start, end], tick by tick in the order of the loop."""
    found = []
    for order, sensor in enumerate(("compass", "depth", "feedback", "usbl")):
        group = trial[sensor]
        for k in np.flatnonzero((group["received"] > start) & (group["received"] <= end)):
            received = float(group["received"][k])
            reading = Reading(sensor, float(group["time"][k]), received, group["value"][k], int(group["sequence"][k]))
            tick = math.ceil(received * 10.0 - 1e-6)  # a packet is taken at the next control tick
            found.append((tick, order, received, reading))
    return [reading for *_, reading in sorted(found, key=lambda item: item[:3])]


def test_the_estimate_is_a_function_of_the_readings(docked: VehicleLog) -> None:
    """A new estimator fed with the log's readings alone gives the log's estimates, bit for bit."""
    again = scenario.from_yaml(str(docked.log.attributes["scenario"]))
    name, vehicle = again.lone
    navigator = registry.build(
        NavigatorSetup(
            vehicle=name,
            settings=vehicle.estimator,
            parameters=planar_fit.fit_planar_model("remus100", 1.0).parameters,
            actuation=library.vehicle("remus100").actuation,
            period=0.5,
            rates=dict(rated(vehicle.sensors)),
            usbl=vehicle.sensors.usbl,
            dock=again.structures["dock"].pose,
        )
    )
    estimate, before = docked["estimate"], 0.0
    for k, time in enumerate(estimate["time"].tolist()):
        new = navigator.update(time, delivered(docked, before, time), (), Commands(math.nan, math.nan, math.nan))
        assert new.position.tobytes() == estimate["position"][k].tobytes()
        assert new.covariance.tobytes() == estimate["covariance"][k].tobytes()
        before = time


OWN = """
import numpy as np
from auvsim.navigation.estimate import PLANAR_STATES, Estimate

given, told, said = [], [], []

class Last:
    states = PLANAR_STATES

    def __init__(self):
        self.reset()

    def reset(self):
        self.place, self.heading = None, 0.0

    def update(self, time, readings, messages, commands):
        told.append((time, tuple(readings), commands))
        for reading in readings:
            if reading.sensor == "compass":
                self.heading = float(reading.value[0])
            if reading.sensor == "usbl":
                x, y, _, psi = reading.value[:4]
                self.place = (x * np.cos(psi) - y * np.sin(psi), x * np.sin(psi) + y * np.cos(psi))
        north, east = self.place or (0.0, 0.0)
        estimate = Estimate(
            time=time,
            position=np.array([north, east, 20.0]),
            heading=self.heading,
            velocity=np.array([1.0, 0.0, 0.0]),
            current=np.zeros(2),
            covariance=np.zeros((8, 8)),
            initialised=self.place is not None,
        )
        said.append(estimate)
        return estimate

def factory(setup):
    given.append(setup)
    return Last()
"""


def test_an_estimator_of_ones_own_drives_the_trial(tmp_path, monkeypatch) -> None:
    """It gets a set-up, readings and commands, nothing else and nothing early; guidance steers by it."""
    (tmp_path / "last_fix.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    mine = plan(9, duration=60.0, estimator={"factory": "last_fix:factory"})
    trial = run_trial(mine, seed=9)
    import last_fix  # pyright: ignore[reportMissingImports]

    (setup,) = last_fix.given
    assert (setup.vehicle, setup.settings, setup.period) == ("remus100", {}, 0.5)
    assert setup.parameters == planar_fit.fit_planar_model("remus100", 1.0).parameters
    times = [time for time, _, _ in last_fix.told]
    assert times == trial["estimate"]["time"].tolist()
    assert len(times) == 120
    before = 0.0
    for time, readings, commands in last_fix.told:
        assert type(commands) is Commands
        assert all(type(reading) is Reading and reading.stamp <= reading.received <= time for reading in readings)
        expected = delivered(trial, before, time)
        assert [(r.sensor, r.sequence) for r in readings] == [(r.sensor, r.sequence) for r in expected]
        before = time
    for k, estimate in enumerate(last_fix.said):
        np.testing.assert_array_equal(trial["estimate"]["position"][k], estimate.position)
    # Guidance's own reckoning starts from these estimates: along and cross track of the nose at their times.
    assert trial.structure is not None
    guidance, heading = trial["mission"], trial.structure.heading
    fixed = [e for e in last_fix.said if e.initialised]
    at = np.searchsorted(guidance["time"], [e.time for e in fixed])
    along = [e.position[0] * math.cos(heading) + e.position[1] * math.sin(heading) for e in fixed]
    # The nose is 0.8 m from the origin, the dock's reported axis within some tenths of a degree of the true one.
    np.testing.assert_allclose(guidance["along_track"][at], along, atol=0.8 + 300.0 * math.radians(1.5))
    assert len({e.position[0] for e in fixed}) > 5


def test_interrupted_keeps_the_log_up_to_there() -> None:
    """Ctrl-C between two ticks: everything until then, and an event that says so."""

    def interrupt(state: ProgressState) -> None:
        if state.time > 20.0:
            raise KeyboardInterrupt

    trial = run_trial(plan(3), seed=3, progress=interrupt)
    assert trial.log.attributes["status"] == "interrupted"
    assert events(trial)[-1] == ("interrupted", "stopped by the user")
    for group in ("truth", "mission", "command", "compass"):
        assert trial[group]["time"][-1] == pytest.approx(24.0, abs=1e-9)  # progress comes every 6 s
    assert summarise(trial).failure_reason == "interrupted"


def test_progress_tells_where_the_vehicle_is() -> None:
    """Ten times a simulated minute: time, limit, phase and true range."""
    states: list[ProgressState] = []
    trial = run_trial(plan(3, duration=30.0), seed=3, progress=states.append)
    assert [state.time for state in states] == pytest.approx([6.0, 12.0, 18.0, 24.0, 30.0])
    assert {state.duration for state in states} == {30.0}
    at = np.searchsorted(trial["truth"]["time"], [state.time for state in states])
    ranges = np.linalg.norm(in_dock_frame(trial, trial["truth"]["position"])[at], axis=1)
    assert [state.range for state in states] == pytest.approx(ranges.tolist())
    assert states[-1].phase == "homing"


def test_diverged_keeps_the_log_up_to_there() -> None:
    """A physics step of half a second is beyond the stability of the fins' servos."""
    slow = {name: {"rate": 2.0} for name in ("compass", "depth", "feedback")}
    settled = plan(3, rates={"physics": 2.0, "control": 2.0, "log": 2.0}, sensors=slow)
    trial = run_trial(settled, seed=3, check_step=False)
    assert trial.log.attributes["status"] == "diverged"
    kind, text = events(trial)[-1]
    assert (kind, text.split(" at ")[0]) == ("diverged", "diverged")
    assert np.isfinite(trial["truth"]["position"]).all()
    assert summarise(trial).failure_reason == "diverged"


def test_what_the_estimator_refuses_is_named_in_the_log() -> None:
    """Packets that arrive twice, and outliers: an event for each, with its reason, as many as it counts."""
    often = {"usbl": {"outlier_probability": 0.3}}
    trial = run(5, duration=150.0, sensors=often, acoustics={"duplicate_probability": 0.5})
    texts = [text for kind, text in events(trial) if kind == "refused"]
    counts = dict.fromkeys(("duplicate", "outlier"), 0)
    for text in texts:
        number, _, reason = text.partition(" ")
        counts[reason.split(": ")[1]] += int(number)
    assert min(counts.values()) > 0
    # An outlier that is taken after all, because others agree with it, is counted back.
    assert sum(counts.values()) >= trial["estimate"]["refused"][-1]
    rises = np.flatnonzero(np.diff(trial["estimate"]["refused"], prepend=0) > 0)
    told = {
        time for time, kind in zip(trial["event"]["time"], trial["event"]["kind"], strict=True) if kind == "refused"
    }
    assert set(trial["estimate"]["time"][rises]) <= told


def test_control_waits_for_the_first_readings() -> None:
    """With a depth gauge at 1 Hz nothing is commanded in the first second, and the trial goes on as started."""
    trial = run(4, duration=10.0, sensors={"depth": {"rate": 1.0}})
    assert trial["command"]["time"][0] == pytest.approx(1.0)
    assert trial["mission"]["time"][0] == pytest.approx(1.0)
    # Times are ticks, not sums of steps.
    np.testing.assert_allclose(trial["compass"]["time"], np.arange(1, 101) / 10.0, rtol=1e-15)


def test_other_rates() -> None:
    """50 Hz physics, 5 Hz control, 1 Hz filter and log: every stream at its rate, and it docks."""
    rates = {"physics": 50.0, "control": 5.0, "filter": 1.0, "log": 1.0}
    sensors = {"compass": {"rate": 5.0}, "depth": {"rate": 1.0}, "feedback": {"rate": 5.0}}
    trial = run(12, rates=rates, sensors=sensors, vehicle={"start": {"range": 230.0, "bearing_deg": 0.0}})
    assert summarise(trial).docked
    wanted = {"truth": 1.0, "estimate": 1.0, "mission": 5.0, "command": 5.0, "compass": 5.0, "depth": 1.0}
    for group, rate in wanted.items():
        np.testing.assert_allclose(np.diff(trial[group]["time"]), 1.0 / rate, atol=1e-9)
    assert (trial["contact"]["time"] * 50.0 % 1.0 + 1e-6) % 1.0 == pytest.approx(0.0, abs=1e-5)


def test_docked_is_docked(docked: VehicleLog) -> None:
    """The whole of a good trial: its phases, the latch, and what follows it."""
    phases = [kind for kind, _ in events(docked) if kind != "refused"]
    assert phases == ["homing", "approach", "final", "docked"]
    assert all(text for _, text in events(docked))
    phases = docked["mission"]["phase"]
    assert [int(phase) for phase, _, _ in phase_stretches(phases)] == [0, 1, 2, 3, 4]
    found = summarise(docked)
    assert (found.docked, found.attempts, found.failure_reason) == (True, 1, None)
    assert docked["truth"]["time"][-1] == pytest.approx(found.time + 5.0, abs=0.11)  # the aftermath, and a tick
    assert found.miss_distance is not None
    assert found.miss_distance < 0.75  # the mouth's radius


def test_a_latched_vehicle_stays_latched() -> None:
    """A minute after docking, in a cross current: nose on its place, at rest, and the verdict unchanged."""
    pinned = {"vehicle": {"start": {"range": 230.0, "bearing_deg": 0.0}}, "dock": {"heading_deg": 90.0}}
    loop = Simulation(plan(13, current={"kind": "uniform", "speed": 0.3, "direction_deg": 0.0}, **pinned), 13)
    while not loop.over:
        loop.step()
    end = loop.time
    while loop.time < end + 60.0:
        loop.step()
    trial = loop.log.finish("complete", wall_time=1.0).vehicle()
    after = trial["truth"]["time"] > end
    nose = in_dock_frame(trial, nose_position(trial))[after]
    # The latch is a soft weld, 0.15 s: in 0.3 m/s across it gives by some centimetres.
    np.testing.assert_allclose(nose, np.tile([LATCHED, 0.0, 0.0], (len(nose), 1)), atol=0.05)
    assert np.abs(trial["truth"]["nu"][after, :3]).max() < 0.02
    assert set(trial["mission"]["phase"][trial["mission"]["time"] > end]) == {Phase.DOCKED}
    assert [kind for kind, _ in events(trial)].count("docked") == 1


@pytest.mark.parametrize("seed", [21, 22, 23])
@pytest.mark.parametrize(
    "pinned",
    [
        {"acoustics": {"dropout_probability": 0.4}},
        {"sensors": {"usbl": {"outlier_probability": 0.1}}},
        {"acoustics": {"late_probability": 0.3}},
    ],
    ids=["drop-outs", "outliers", "out of order"],
)
def test_docks_over_a_bad_link(pinned: Mapping, seed: int) -> None:
    """40 % drop-outs, 10 % outliers, 30 % out of order: docked within three attempts, and the link was that bad."""
    trial = run(seed, **pinned)
    usbl, found = trial["usbl"], summarise(trial)
    assert found.docked, found.failure_text
    arrived = ~usbl["lost"]
    # Some sixty packets: 40 % +- 6 %, 10 % +- 4 %, 30 % +- 6 %, three deviations allowed.
    if "sensors" in pinned:
        assert 0.0 < usbl["outlier"].mean() < 0.22
    elif "late_probability" in pinned["acoustics"]:
        assert sum(b < a for a, b in pairwise(usbl["received"][arrived].tolist())) >= 5
    else:
        assert 0.2 < usbl["lost"].mean() < 0.6


def funnel_clearance(trial: VehicleLog) -> np.ndarray:
    """Horizontal distance of the hull's axis from the funnel, as wide as its mouth and 2 m long, at each truth [m]."""
    nose, origin = (in_dock_frame(trial, place) for place in (nose_position(trial), trial["truth"]["position"]))
    distances = []
    for place in (nose, origin, 2.0 * origin - nose):
        along, cross = place[:, 0], place[:, 1]
        distances.append(np.hypot(along - np.clip(along, 0.0, 2.0), np.maximum(np.abs(cross) - 0.75, 0.0)))
    return np.min(distances, axis=0)


@pytest.mark.parametrize("angle", [90.0, -90.0])
@pytest.mark.parametrize("start", [96.0, 102.0])
def test_goes_around_when_the_current_turns_before_the_dock(start: float, angle: float) -> None:
    """A following current of 0.5 m/s that turns across in the last metres: missed, seen, round, docked."""
    trial = run(
        7,
        dock={"heading_deg": 0.0},
        vehicle={"start": {"range": 260.0, "bearing_deg": 0.0, "heading_deg": 0.0, "depth": 20.0}},
        current={
            "kind": "turning", "speed": 0.5, "direction_deg": 0.0, "angle_deg": angle, "start": start, "end": start + 10
        },
    )  # fmt: skip
    found = summarise(trial)
    assert found.docked
    assert found.attempts == 2
    (reason,) = [text for kind, text in events(trial) if kind == "go_around"]
    assert reason.startswith(("would miss the entrance by ", "entrance passed "))
    assert reason.endswith("; attempt 2 follows")
    # From the break-off on, no nearer than it already was (beside the dock), and without touching it.
    around = phase_at(trial, trial["truth"]["time"]) == Phase.GO_AROUND
    clearance = funnel_clearance(trial)[around]
    assert clearance.min() > min(2.0, clearance[0] - 0.5)
    assert not (phase_at(trial, trial["contact"]["time"]) == Phase.GO_AROUND).any()


def test_a_dock_whose_gauge_is_metres_wrong_is_met_all_the_same() -> None:
    """The downward part of the fixes says where the dock is, whatever depth it reports of itself."""
    trial = run(
        2,
        sensors={"usbl": {"dock_depth_bias": 6.0}},
        vehicle={"start": {"range": 230.0, "bearing_deg": 0.0}},
    )
    reported = trial["usbl"]["value"][:, 6].mean() - 20.0
    assert 2.5 < abs(reported) < 15.0  # this seed's draw: clear of the dock, in the water
    found = summarise(trial)
    assert (found.docked, found.attempts) == (True, 1)
    assert abs(found.vertical) < 0.5


MEMORY = """
import re
from auvsim.simulation import run, sampling, scenario
plan = scenario.parse(sampling.draw(sampling.default_plan(), 7))
assert run.run(plan, seed=7).attributes["status"] == "complete"
print(re.search(r"VmHWM:\\s+(\\d+) kB", open("/proc/self/status").read())[1])
"""


@pytest.mark.skipif(sys.platform != "linux", reason="/proc is Linux's")
def test_memory_of_a_trial() -> None:
    """A whole trial in a process of its own, with everything it imports: less than 500 MB at its peak.

    Of the process's own memory; `ru_maxrss` would start from what pytest held when it forked.
    """
    done = subprocess.run([sys.executable, "-c", MEMORY], capture_output=True, text=True, check=True)
    assert int(done.stdout) * 1024 < 500e6  # kilobytes
