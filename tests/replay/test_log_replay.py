"""Replays: a trial's own estimator bit for bit, what-ifs that are what they say, innovations, smoothing, tables."""

import csv
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.data import log as logs
from auvsim.data.log import Log
from auvsim.replay import judgement, tables, trial_logs
from auvsim.replay.recording import Recording
from auvsim.replay.run import replay
from auvsim.replay.what_if import WhatIf, changed
from auvsim.sensors.depth import Depth
from auvsim.simulation import scenario
from auvsim.simulation.run import run

ROUGH = {"duplicate_probability": 0.2, "late_probability": 0.2, "dropout_probability": 0.1}
RANGES = {
    "range_a": {"kind": "range", "beacon": [70.0, 15.0, 38.0], "rate": 0.5},
    "range_b": {"kind": "range", "beacon": [-50.0, 60.0, 38.0], "rate": 0.5},
    "range_c": {"kind": "range", "beacon": [-25.0, -75.0, 38.0], "rate": 0.5},
}
CASES: dict[str, dict[str, Any]] = {
    "late and twice": {"acoustics": ROUGH},
    "regular, late and twice": {"acoustics": ROUGH, "estimator": {"kind": "regular_ekf"}},
    "imm, all aids": {
        "estimator": {"kind": "imm"},
        "sensors": {"dvl": {"enabled": True}, "gyro": {"enabled": True}, **RANGES},
    },
    "ranges only": {"sensors": {"usbl": {"enabled": False}, **RANGES}},
    "no dock's model": {"estimator": {"kind": "dead_reckoning"}, "sensors": {"dvl": {"enabled": True}}},
}


def trial(pinned: dict[str, Any], seed: int = 3, duration: float = 70.0) -> Log:
    """A run of a start askew, 130 m from the dock, in a current."""
    start = {"range": 130.0, "bearing_deg": 35.0, "heading_deg": 70.0, "depth": 17.0}
    values = {
        "duration": duration,
        "vehicle": {"start": start},
        "dock": {"north": 40.0, "east": -25.0, "heading_deg": 20.0},
        "current": {"kind": "uniform", "speed": 0.2, "direction_deg": 100.0},
    }
    return run(scenario.parse(values | pinned), seed=seed)


def recorded(log: Log, folder: Path) -> Recording:
    """The log through its file."""
    logs.write(log, folder / "trial.nc")
    (found,) = trial_logs.recordings(folder / "trial.nc")
    return found


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return recorded(trial(CASES["late and twice"]), tmp_path_factory.mktemp("plain"))


@pytest.mark.parametrize("case", CASES)
def test_unchanged_it_gives_the_trials_own_estimates_bit_for_bit(case: str, tmp_path: Path):
    """Estimates, covariances, counts and the fate of every measurement."""
    found = recorded(trial(CASES[case]), tmp_path)
    (again,) = replay(found)
    assert again.estimates[-1].initialised
    assert judgement.same(again) == []


def test_faulty_readings_are_refused_in_a_replay_as_in_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    measure, count = Depth.measure, iter(range(10_000))

    def faulty(self: Depth, truth: Any, world: Any) -> Any:
        reading = measure(self, truth, world)
        return reading._replace(value=np.array((math.nan,))) if next(count) in (100, 101) else reading

    monkeypatch.setattr(Depth, "measure", faulty)
    log = trial({})
    texts = log.groups["event"]["text"].tolist()
    assert "readings of depth: not finite" in texts
    assert "depth is heard again; 2 readings refused" in texts
    (again,) = replay(recorded(log, tmp_path))
    assert judgement.same(again) == []
    assert judgement.judge(again).sensors[1].sensor == "depth"
    assert judgement.judge(again).sensors[1].refused == 2


def test_losses_are_the_share_that_was_asked_for_and_grow_with_it(plain: Recording):
    """Of compass readings, of which there are many: within four binomial deviations; those of 20 % are lost at 40 %."""

    def kept(drop: float) -> set[int]:
        given = changed(plain, WhatIf(drop=drop, sensors=("compass",), seed=4))
        return {a.reading.sequence for a in given.arrivals if a.reading.sensor == "compass"}

    n = len(kept(0.0))
    for share in (0.2, 0.4):
        assert abs(len(kept(share)) / n - (1.0 - share)) < 4.0 * math.sqrt(share * (1.0 - share) / n)
    assert kept(0.4) < kept(0.2)
    assert kept(0.2) == kept(0.2)


def test_delays_and_outliers_are_what_they_say(plain: Recording):
    """Only packets are changed: each comes 5 s later, wrong by 10 to 30 m, the dock's attitude as it was."""
    given = changed(plain, WhatIf(delay=5.0, outliers=1.0, seed=1))
    before = {(a.reading.sensor, a.reading.received): a.reading for a in plain.arrivals}
    sizes = []
    for arrival in given.arrivals:
        reading = arrival.reading
        if reading.sensor != "usbl":
            assert reading is before[reading.sensor, reading.received]
            continue
        was = before["usbl", min((r for s, r in before if s == "usbl"), key=lambda r: abs(r + 5.0 - reading.received))]
        assert reading.stamp == was.stamp
        assert reading.value[3:].tolist() == was.value[3:].tolist()
        sizes.append(float(np.linalg.norm(reading.value[:3] - was.value[:3])))
        assert arrival.delivery is not None
        assert arrival.delivery.received == reading.received
        assert arrival.delivery.message.payload.reading.value is reading.value
    assert min(sizes) >= 10.0
    assert max(sizes) <= 30.0
    assert np.ptp(sizes) > 5.0
    (late,) = replay(changed(plain, WhatIf(delay=5.0)))
    first = min(a.reading.received for a in plain.arrivals if a.reading.sensor == "usbl")
    started = next(e.time for e in late.estimates if e.initialised)
    assert first + 5.0 <= started < first + 5.5 + 1e-9


def test_unknown_sensor_is_named(plain: Recording):
    with pytest.raises(InputError, match=r"no readings of 'sonar'; there are compass, depth, feedback, usbl"):
        changed(plain, WhatIf(drop=0.5, sensors=("sonar",)))


def test_innovations_have_the_nis_that_the_filter_found(tmp_path: Path):
    """Those of packets that come in order, found from the delay buffer afterwards, are those by which it judged.

    By a filter of one mode: where several are weighed, innovations are linearised about their mean.
    """
    pinned = {"acoustics": {"late_probability": 0.0}, "estimator": {"kind": "augmented_ekf"}}
    (found,) = replay(recorded(trial(pinned), tmp_path))
    nis = {(o.kind, o.stamp): o.nis for e in found.estimates for o in e.outcomes if o.accepted}
    compared = 0
    for one in found.innovations:
        m = one.measurement
        if one.accepted and math.isfinite(nis.get((m.kind, m.stamp), math.nan)) and m.kind == "usbl":
            value = one.residual @ np.linalg.solve(one.covariance, one.residual)
            assert value == pytest.approx(nis[m.kind, m.stamp], rel=1e-6, abs=1e-9)
            compared += 1
    assert compared > 5
    stamps = [one.measurement.stamp for one in found.innovations if one.measurement.kind == "compass"]
    assert stamps == sorted(set(stamps))  # each once, in order


def test_smoothing_lowers_the_error(tmp_path: Path):
    """What came later helps, the current most, which is not known at first; the last estimate has nothing after it."""
    squares = np.zeros(2)
    for seed in range(3, 9):
        pair = replay(recorded(trial(CASES["late and twice"], seed), tmp_path), smooth=True)
        filtered, smoothed = (judgement.judge(one) for one in pair)
        assert smoothed.quality is not None
        assert filtered.quality is not None
        assert (smoothed.quality.position_rms or math.inf) < (filtered.quality.position_rms or 0.0)
        squares += np.square([smoothed.quality.current_rms or math.inf, filtered.quality.current_rms or 0.0])
        last = [one.replayed.estimates[-1] for one in (filtered, smoothed)]
        assert last[0].position.tolist() == last[1].position.tolist()
        assert smoothed.sensors == ()
    assert squares[0] < 0.5**2 * squares[1]  # rms over all six


def test_another_estimator_keeps_what_it_shares_with_the_trials_own(plain: Recording):
    """Settings of the model carry over; a log of format 3 holds the new estimates, and can be read."""
    (found,) = replay(plain, "imm")
    assert found.estimator == "imm"
    log = judgement.as_log(found)
    changes = logs.differences(plain.vehicle.log, log)  # pyright: ignore[reportOptionalMemberAccess]
    assert all("estimat" in change or "measurements" in change for change in changes)
    assert log.vehicle().attributes["estimator"] == "imm"
    with pytest.raises(InputError, match="no estimator 'ekf'"):
        replay(plain, "ekf")
    with pytest.raises(InputError, match="cannot be smoothed"):
        replay(plain, "paper", smooth=True)


def own_factory(setup: Any) -> Any:
    """An estimator of a user's own that knows the depth alone."""
    from auvsim.navigation.estimate import Estimate

    def update(time: float, readings: Any, messages: Any, commands: Any) -> Estimate:
        depth = next((r.value[0] for r in readings if r.sensor == "depth"), math.nan)
        return Estimate(
            time=time, position=np.array((1.0, 2.0, depth)), heading=0.0, velocity=np.zeros(3), current=np.zeros(2),
            covariance=np.diag((4.0, 9.0)), initialised=True, mean=np.array((1.0, 2.0)),
        )  # fmt: skip

    return SimpleNamespace(states={"north": "m", "east": "m"}, update=update, reset=lambda: None)


def test_a_factory_of_ones_own(plain: Recording):
    (found,) = replay(plain, f"{__name__}:own_factory")
    judged = judgement.judge(found)
    truth = plain.vehicle["truth"]["position"][:, :2]  # pyright: ignore[reportOptionalSubscript]
    away = truth[np.searchsorted(plain.vehicle["truth"]["time"], plain.times)]  # pyright: ignore[reportOptionalSubscript]
    expected = np.mean(((1.0 - away[:, 0]) ** 2 / 4.0 + (2.0 - away[:, 1]) ** 2 / 9.0) / 2.0)
    assert judged.quality is not None
    assert judged.quality.nees_per_dof == pytest.approx(expected, rel=1e-6)
    with pytest.raises(InputError, match="keeps no delay buffer"):
        replay(plain, f"{__name__}:own_factory", smooth=True)


def table(path: Path, noise: float = 0.5, seed: int = 0) -> Any:
    """A circle of 20 m radius at 1.5 m/s, 300 s long, with a fix every 10 s; its true position by time."""
    generator = np.random.default_rng(seed)
    rate = 1.5 / 20.0
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(
            ["time [s]", "heading [deg]", "r [deg/s]", "dvl_u [m/s]", "dvl_v [m/s]", "north [m]", "east [m]"]
        )
        for k in range(3001):
            t = 0.1 * k
            psi = 0.4 + rate * t
            at = (20.0 * math.sin(psi), -20.0 * math.cos(psi))
            fix = [f"{x + noise * generator.normal():.4f}" for x in at] if k % 100 == 50 else ["", ""]
            dvl = [1.5 + 0.01 * generator.normal(), 0.01 * generator.normal()] if k % 2 == 0 else ["", ""]
            heading = math.degrees(psi + 0.02 * generator.normal()) % 360.0
            writer.writerow([f"{t:.1f}", heading, math.degrees(rate + 1e-3 * generator.normal()), *dvl, *fix])

    def place(t: float) -> np.ndarray:
        psi = 0.4 + rate * t
        return np.array((20.0 * math.sin(psi), -20.0 * math.cos(psi)))

    return place


def test_a_table_of_ones_own_through_dead_reckoning(tmp_path: Path):
    """Better than its fixes by far, and consistent: NEES over seeds, at three times each, in its interval."""
    values, errors = [], []
    for seed in range(8):
        place = table(tmp_path / "own.csv", seed=seed)
        ((recording,), _) = tables.recordings(tmp_path / "own.csv")
        (found,) = replay(recording)
        for e in found.estimates[200::150]:
            error = e.position[:2] - place(e.time)
            values.append(error @ np.linalg.solve(e.horizontal_covariance, error) / 2.0)
            errors.append(error)
    assert math.sqrt(np.mean(np.square(errors)) * 2.0) < 0.5  # fixes: 0.71
    # Velocities are believed to change at random more than they do here: too large a covariance, never too small.
    assert 0.05 < np.mean(values) < 1.5
    sensors = {s.sensor: s for s in judgement.judge(found).sensors}
    assert sensors["fix"].refused == 0
    assert sensors["fix"].nis < sensors["fix"].nis_interval[1]
    assert len(sensors["dvl_bottom"].residual_rms) == 2


def test_a_table_without_a_rudder_is_none_for_identification_but_can_be_replayed(tmp_path: Path):
    from auvsim.identification import readers

    table(tmp_path / "own.csv")
    with pytest.raises(InputError, match="no column is the rudder"):
        readers.read([tmp_path / "own.csv"])
    ((recording,), _) = tables.recordings(tmp_path / "own.csv")
    assert {a.reading.sensor for a in recording.arrivals} == {"compass", "gyro", "dvl", "fix"}
