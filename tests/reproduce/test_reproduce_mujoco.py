"""Paper 1's study on MuJoCo's truth: its runs, its scores, and the tables that set it beside the planar truth."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread
from scipy.stats import chi2

from auvsim import cli
from auvsim.navigation.docking import augmented_ekf
from auvsim.physics.planar_fit import fit_planar_model
from auvsim.reproduce import paired
from auvsim.reproduce.paper1 import mujoco as paper1_mujoco
from auvsim.reproduce.paper1 import planar as paper1
from auvsim.reproduce.paper1 import study as paper1_study
from auvsim.reproduce.paper1 import truths as paper1_truths
from auvsim.reproduce.paper1.mujoco import NAVIGATORS, ROWS, bound, navigator
from auvsim.reproduce.paper1.mujoco_runs import REACHED, SPEED, RunConditions, simulate, track
from auvsim.reproduce.paper1.products import DOTS
from estimators.docking.noise import REFERENCE_NOISE

SHORT, RUNS, KEYS = ("start", "approach"), 2, ("paper", "augmented", "imm_biases")
NO_BIAS = {"dock_heading_bias_deg": 0.0, "dock_tilt_bias_deg": 0.0, "dock_depth_bias": 0.0}


@pytest.fixture(scope="module")
def study():
    return paper1_mujoco.reproduce(5, rows=SHORT, runs=RUNS, filters=KEYS, jobs=2)


@pytest.fixture(scope="module")
def planar(study):
    """A study on the planar truth that knows one of the rows, with made-up results."""
    rows = {"start": {key: replace(study.results["start"][key], ratio=0.5, nees=1.0) for key in KEYS}}
    curves = paper1.Curves(times=np.zeros(1), errors={}, current=np.zeros((1, 2)), currents={})
    return paper1.Study(
        seed=5, quick=True, runs={"start": 6}, results=rows, bounds={}, batches={}, worst_delivery=0.0, curves=curves
    )


def read(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def fixes(recording):
    return [reading for tick in recording.ticks for reading in tick.readings if reading.sensor == "usbl"]


def test_the_vehicle_circles_the_dock_in_the_current():
    run = simulate(RunConditions(duration=200.0), 3)
    assert run.times == pytest.approx(0.5 * np.arange(1, 401))
    settled = run.states[run.times > 30.0]
    # Within a metre or two of 40 m: the command is 0 only where the autopilot's lag has put it outside.
    assert np.abs(np.hypot(*settled[:, :2].T) - 41.0).max() < 1.5
    bearing = np.unwrap(np.arctan2(settled[:, 1], settled[:, 0]))
    assert (np.diff(bearing) > 0.0).all()  # clockwise
    assert bearing[-1] - bearing[0] > math.radians(150.0)  # 170 s at 0.5 m/s and more
    assert np.hypot(*run.states[:, 6:].T) == pytest.approx(0.5)
    assert settled[:, 3] == pytest.approx(SPEED, abs=0.02)


def test_an_approach_is_straight_and_ends_at_the_dock():
    run = simulate(RunConditions(approach=60.0, duration=300.0), 3)
    distance = np.hypot(*run.states[:, :2].T)
    assert distance[0] == pytest.approx(60.0, abs=0.8)  # 0.5 s on, at up to 1.5 m/s
    # The last tick is up to 0.5 s before that, or 0.1 s after, at up to 1.5 m/s.
    assert REACHED - 0.15 < distance[-1] < REACHED + 0.75
    north, east = run.states[0, :2] / distance[0]
    assert np.abs(run.states[:, :2] @ (-east, north)).max() < 2.0
    assert run.times[-1] < 60.0 / 0.5


def test_conditions_that_differ_in_the_fixes_share_the_way():
    """And that of the filters' belief, which is no part of the truth."""
    way = simulate(RunConditions(duration=60.0), 3)
    lossy = simulate(RunConditions(duration=60.0, acoustics={"dropout_probability": 0.4}), 3)
    weak = simulate(RunConditions(duration=60.0, thrust=1.0 / 1.1), 3)
    assert np.array_equal(way.states, lossy.states)
    assert np.array_equal(way.states, weak.states)
    assert {fix.stamp for fix in fixes(lossy)} < {fix.stamp for fix in fixes(way)}
    believed = fit_planar_model("remus100", SPEED).parameters
    assert way.parameters == believed
    assert weak.parameters == replace(believed, X_nn=1.1 * believed.X_nn)
    assert not np.array_equal(way.states, simulate(RunConditions(duration=60.0), 4).states)


def test_fixes_are_as_at_the_distance_asked_for():
    run = simulate(RunConditions(duration=100.0, fixes_of=12.0, interval=(0.9, 1.1), usbl=NO_BIAS), 3)
    measured = fixes(run)
    assert len(measured) > 80
    delays = [fix.received - fix.stamp for fix in measured]
    assert min(delays) > 1.5 + 0.002 * 12.0 - 0.1
    assert max(delays) < 1.5 + 0.002 * 12.0 + 0.1
    way = np.array([[np.interp(fix.stamp, run.times, column) for column in run.states[:, :2].T] for fix in measured])
    errors = np.array([fix.value[:2] for fix in measured]) + run.usbl.transceiver[:2] - way
    errors = errors[np.array([fix.stamp for fix in measured]) > 1.0].ravel()  # before, there is no tick before
    # The vehicle heels and trims a little, which moves the transponder 0.1 m above its origin, and between ticks the
    # way bends: together below a millimetre of 6.7.
    squares = float(np.sum(errors**2)) / 0.0067**2
    assert chi2.ppf(0.0005, errors.size) < squares < chi2.ppf(0.9995, errors.size)
    assert run.usbl.deviation(40.0) == pytest.approx(0.0067)
    assert navigator("imm_biases", run)._estimator._usbl.deviation(40.0) == pytest.approx(0.0067)


def test_the_compass_is_off_by_what_is_asked_for():
    run = simulate(RunConditions(duration=100.0, compass_bias=math.radians(2.0)), 3)
    errors = []
    for tick in run.ticks:
        reading = next(r for r in reversed(tick.readings) if r.sensor == "compass")
        assert reading.stamp == pytest.approx(tick.time)
        errors.append(reading.value[0] - tick.state[2])
    errors = np.angle(np.exp(1j * np.array(errors)))
    # The mean of 200 errors of 1 degree: 3.3 of its standard deviations.
    assert math.degrees(errors.mean()) == pytest.approx(2.0, abs=3.3 / math.sqrt(len(errors)))


def test_a_filter_that_knows_all_is_consistent_through_the_trials_sensors():
    """On the planar truth, without biases, and with the noise that there is: NEES of the position over seeds."""
    noise, runs = REFERENCE_NOISE, 12
    settings = {
        "position_noise": noise.position, "heading_noise": noise.heading, "velocity_noise": noise.surge,
        "yaw_rate_noise": noise.yaw_rate, "current_noise": noise.current, "dock_heading_deg": 1e-6,
    }  # fmt: skip
    total = 0.0
    for seed in range(runs):
        run = simulate(RunConditions(duration=150.0, planar=True, compass_bias=0.0, usbl=NO_BIAS), seed)
        followed = track(run, augmented_ekf(run.setup("augmented_ekf", **settings)))
        error = (followed.means[-1] - run.states[-1])[:2]
        total += error @ np.linalg.solve(followed.covariances[-1, :2, :2], error)
    assert chi2.ppf(0.0005, 2 * runs) < total < chi2.ppf(0.9995, 2 * runs)


def test_the_study_is_that_of_paired_runs(study):
    """A ratio by hand, in this process, from the runs of the seeds."""
    begin, _ = ROWS["start"].window
    squares = dict.fromkeys(("paper", "imm_biases"), 0.0)
    for k in range(RUNS):
        run = simulate(ROWS["start"].conditions, paired.run_seed(5, k))
        for key in squares:
            means = track(run, navigator(key, run)).means
            counted = (run.times >= begin) & np.isfinite(means[:, 0])
            squares[key] += np.mean(np.sum((means - run.states)[counted, :2] ** 2, axis=1))
    ratio = math.sqrt(squares["imm_biases"] / squares["paper"])
    assert study.results["start"]["imm_biases"].ratio == pytest.approx(ratio, rel=1e-12)  # sums in another order
    assert study.results["start"]["paper"].rms == pytest.approx(math.sqrt(squares["paper"] / RUNS), rel=1e-12)
    assert 0.1 < ratio < 1.0  # in the first minute eq. 11 does not know the current yet


def test_the_bound_is_what_the_compasses_leave():
    """At 200 m, with neither process noise nor anything to tell the dock's compass error by, that error is it.

    The vehicle's compass, which errs more itself, tells a little of it: so the bound lies somewhat below.
    """
    row = replace(ROWS["settled_200"], conditions=replace(ROWS["settled_200"].conditions, duration=150.0))
    rms = math.sqrt(bound(row, 3))
    run = simulate(row.conditions, 3)
    mean_range = math.sqrt(np.mean(np.sum(run.states[run.times >= 100.0, :2] ** 2, axis=1)))
    alone = math.radians(0.3) * mean_range
    assert 0.8 * alone < rms < 1.1 * alone
    small = replace(row, conditions=replace(row.conditions, usbl={"noise": ((100.0, 0.01),)}))
    assert bound(small, 3) < 0.9 * bound(row, 3)  # fixes of a centimetre leave the compass error alone


def test_rows_are_those_of_the_planar_study_and_the_approach():
    assert [*paper1_study.ROWS, "approach"] == list(ROWS)
    assert {name: row.window for name, row in ROWS.items() if "settled" not in name and name != "approach"} == {
        name: row.window for name, row in paper1_study.ROWS.items() if "settled" not in name
    }
    assert NAVIGATORS.keys() == paper1_study.FILTERS.keys()


def test_every_filter_follows(study):
    """Each is made, is told of fixes, and ends where the vehicle is; REG, DLY, CUR within what 0.5 m/s does to them."""
    run = simulate(RunConditions(duration=60.0, compass_bias=0.0), 3)
    last = {key: track(run, navigator(key, run)).errors(run)[-1] for key in NAVIGATORS}
    assert max(last.values()) < 6.0
    assert max(last[key] for key in ("augmented", "augmented_constant", "unscented", "imm", "imm_biases")) < 1.0


def test_a_first_look_has_few_rows_and_filters(monkeypatch):
    seen = {}

    def tasks(rows, counts, seed, scores):
        seen.update(counts=counts, filters=scores.args[0])
        raise KeyboardInterrupt

    monkeypatch.setattr(paper1_mujoco, "score_tasks", tasks)
    for quick in (True, False):
        with pytest.raises(KeyboardInterrupt):
            paper1_mujoco.reproduce(0, quick=quick)
        assert set(seen["counts"]) == set(paper1_mujoco.QUICK if quick else ROWS)
        assert seen["filters"] == (paper1_mujoco.QUICK_FILTERS if quick else tuple(NAVIGATORS))


def test_tables_set_both_truths_side_by_side(study, planar, tmp_path):
    written = paper1_truths.write(planar, study, tmp_path)
    assert [path.name for path in written] == ["study_mujoco.csv", "truths.csv", "truths.png"]
    lines = read(tmp_path / "study_mujoco.csv")
    assert [(x["row"], x["filter"]) for x in lines] == [(r, f) for r in SHORT for f in KEYS]
    for line in lines:
        result = study.results[line["row"]][line["filter"]]
        assert float(line["rms_m"]) == pytest.approx(result.rms, rel=1e-5)  # six digits are written
        assert float(line["ratio_low"]) <= float(line["ratio"]) <= float(line["ratio_high"])
        assert (line["nees_per_dof"] == "") == (line["filter"] == "paper")
    lines = read(tmp_path / "truths.csv")
    assert [(x["row"], x["filter"]) for x in lines] == [(r, f) for r in SHORT for f in DOTS if f in KEYS]
    for line in lines:
        result = study.results[line["row"]][line["filter"]]
        assert float(line["mujoco_nees_per_dof"]) == pytest.approx(result.nees, rel=1e-5)
        assert int(line["mujoco_runs"]) == RUNS
        known = line["row"] in planar.results  # there is no approach on the planar truth
        assert line["planar_ratio"] == ("0.5" if known else "")
        assert line["planar_runs"] == ("6" if known else "")
    picture = imread(tmp_path / "truths.png")
    assert min(picture.shape[:2]) > 250
    assert np.ptp(picture[..., :3]) > 0.9


def test_the_command_runs_the_truth_asked_for(study, tmp_path, monkeypatch, capsys):
    ran = []
    monkeypatch.setattr(paper1_mujoco, "reproduce", lambda *_, **__: ran.append("mujoco") or study)
    monkeypatch.setattr(paper1, "reproduce", lambda *_, **__: pytest.fail("ran"))
    out = tmp_path / "mujoco"
    assert cli.main(["reproduce", "paper1", "--truth", "mujoco", "--out", str(out)]) == 0
    printed, said = capsys.readouterr()
    for name in SHORT:
        line = next(line for line in printed.splitlines() if line.startswith(f" {ROWS[name].title}"))
        for key in ("augmented", "imm_biases"):
            assert f"{study.results[name][key].ratio:.2f}" in line
            assert f"{study.results[name][key].nees:.2f}" in line
    assert "study_mujoco.csv" in said
    assert "planar truth and MuJoCo's" not in printed
    assert [path.name for path in out.iterdir()] == ["study_mujoco.csv"]
    assert ran == ["mujoco"]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ([], ["planar", "mujoco"]),
        (["--quick"], ["planar"]),
        (["--quick", "--truth", "both"], ["planar", "mujoco"]),
        (["--truth", "planar"], ["planar"]),
    ],
)
def test_a_quick_look_leaves_mujoco_out(arguments, expected, tmp_path, monkeypatch):
    ran = []
    monkeypatch.setattr(paper1, "reproduce", lambda *_, **__: ran.append("planar"))
    monkeypatch.setattr(paper1_mujoco, "reproduce", lambda *_, **__: ran.append("mujoco"))
    assert cli.main(["reproduce", "paper1", *arguments, "--out", str(tmp_path)]) == 0
    assert ran == expected


def test_the_printed_table_sets_both_truths_side_by_side(study, planar, capsys):
    from auvsim.cli.papers import paper1 as command

    command.show_mujoco(planar, study)
    printed = capsys.readouterr().out.split("planar truth and MuJoCo's")[1]
    line = next(line for line in printed.splitlines() if line.startswith(f" {ROWS['start'].title}"))
    for key in ("augmented", "imm_biases"):
        assert f"{study.results['start'][key].ratio:.2f}±" in line
        assert f"{study.results['start'][key].nees:.2f}" in line
    assert line.count("0.50±") == 2  # of the planar truth
    line = next(line for line in printed.splitlines() if line.startswith(f" {ROWS['approach'].title}"))
    assert line.split().count("-") == 5
