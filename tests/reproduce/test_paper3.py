"""The study of paper 3, in a short form: its truths, its statistics, and what the command prints and writes."""

import csv
import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from matplotlib.image import imread

from auvsim import cli
from auvsim.reproduce.paper3 import acceptance, claims, figures, physical, truths, yardsticks
from auvsim.reproduce.paper3 import study as paper3
from auvsim.reproduce.paper3.follow import follow
from auvsim.reproduce.paper3.methods import METHODS
from auvsim.reproduce.paper3.study import ROWS, Runs, ratio
from auvsim.reproduce.paper3.truths import DETECTION, NOISES, SOUND, STEP, Conditions, simulate, undelayed
from estimators.core.types import Measurement
from estimators.path_prediction.messages import Packet, Pulse

SHORT = ("paper_process_weave", "fine_process_weave", "loss_fine_0%", "loss_fine_60%", "shuffled")
FILES = {"study.csv", "acceptance.csv", "claims.csv", "table1.csv", "table2.csv"}
FIGURES = {"figure1.png", "figure2.png", "figure3.png", "loss.png"}


@pytest.fixture(scope="module")
def study():
    return paper3.reproduce(5, rows=SHORT, runs=2, jobs=1)


def runs_with(errors, **changed):
    """Runs with errors (n, 2) at the end."""
    n = len(errors)
    values = dict.fromkeys(Runs._fields, np.ones(n)) | {"final": errors, "relative": errors, "leader": errors}
    return Runs(**(values | {"own": errors, "squares": np.ones((n, 3))} | changed))


def test_sound_travels_between_where_the_leader_was_and_the_follower_is():
    """The implicit equation of the detection holds at each pulse, and the range is that distance and the jitter's."""
    run = simulate(Conditions(noise="paper", scene="curve"), 3, 4)
    pulses = [e for e in run.events if isinstance(e, Pulse)]
    jitters = []
    for pulse in pulses:
        leader, follower = truths.at(run.leader, pulse.emitted), truths.at(run.follower, pulse.detected)
        distance = math.hypot(*(leader - follower)[:2])
        jitter = pulse.detected - pulse.emitted - DETECTION - distance / SOUND
        jitters.append(jitter)
        assert pulse.range == pytest.approx(distance + SOUND * jitter, abs=1e-3)
    assert np.std(jitters) == pytest.approx(0.01, rel=0.25)  # 99 of them
    packets = [e for e in run.events if isinstance(e, Packet)]
    assert np.mean([p.received - p.stamp for p in packets]) == pytest.approx(15.3, abs=0.4)
    arrivals = [e.detected if isinstance(e, Pulse) else e.received for e in run.events]
    assert arrivals == sorted(arrivals)


def test_what_is_noisy_in_each_mode():
    sensor, process = (simulate(Conditions(mode=mode, noise="paper"), 1, 2) for mode in ("sensor", "process"))
    _, motion_l, first_f, motion_f = truths.commands("weave", 1000)
    clean = truths.integrate(first_f, motion_f)
    assert (sensor.follower == clean).all()
    assert (process.odometry == motion_f).all()
    noise = NOISES["paper"].follower
    for drawn in ((sensor.odometry - motion_f)[:, 1], np.diff(process.follower[:, 2]) / STEP - motion_f[:, 1]):
        assert np.var(drawn) == pytest.approx(noise.yaw_rate / STEP, rel=0.15)
    assert np.abs(sensor.leader_own[:, 2] - sensor.leader[:, 2]).max() > 0.02
    assert np.ptp(process.leader_own[:, 2] - np.concatenate(([0.0], np.cumsum(motion_l[:, 1])))) < 1e-9


def test_the_leader_knows_its_error():
    """NEES of its own estimate by the covariance that it broadcasts, over 60 runs of fine noise."""
    squares = []
    for number in range(60):
        run = simulate(Conditions(duration=600.0), 8, number)
        last = run.prompt[-1]
        assert isinstance(last, Packet)
        error = last.pose - truths.at(run.leader, last.stamp)
        squares.append(error @ np.linalg.solve(last.covariance, error) / 3.0)
    assert np.mean(squares) == pytest.approx(1.0, abs=0.35)  # 3.3 deviations


def test_losses_and_their_pairing():
    whole, lossy = (simulate(Conditions(loss=loss), 1, 3) for loss in (0.0, 0.6))
    assert (whole.follower == lossy.follower).all()
    packets, fewer = ([e for e in run.events if isinstance(e, Packet)] for run in (whole, lossy))
    assert 0.25 < len(fewer) / len(packets) < 0.55
    assert {p.number for p in fewer} < {p.number for p in packets}
    assert [e for e in whole.events if isinstance(e, Pulse)] == [e for e in lossy.events if isinstance(e, Pulse)]
    assert len(undelayed(lossy).events) == 2 * 101


def test_ratio_and_its_interval():
    """Of independent errors of known sizes: the ratio, and how often its interval holds the truth."""
    rng, inside = np.random.default_rng(2), 0
    for _ in range(200):
        one, other = (runs_with(s * rng.standard_normal((50, 2))) for s in (3.0, 2.0))
        value, low, high = ratio(one, other)
        assert value == pytest.approx(one.rms / other.rms)
        inside += low < 1.5 < high
    assert inside >= 180  # of 190 expected


def test_verdicts_see_a_wrong_order_and_a_bad_choice(study):
    assert all(v.met for v in acceptance.verdicts(study) if v.row == acceptance.RECURSION)
    errors = np.array([[3.0, 4.0], [0.0, 5.0], [5.0, 0.0]])
    results = {key: runs_with(size * errors) for key, size in (("dr", 4.0), ("ekf", 3.0), ("dekf", 2.5), ("iiru", 2.0))}
    more = {
        key: runs_with(size * errors) for key, size in (("sc", 1.0), ("rt", 1.1), ("oracle", 1.0), ("choosing", 1.2))
    }
    changed = replace(study, results={"paper_process_weave": results | more})
    found = {v.quantity: v for v in acceptance.verdicts(changed)}
    assert found["ekf / iiru"].measured == pytest.approx(1.5)
    assert found["ekf / iiru"].met
    assert not found["choosing / sc, upper bound"].met
    changed = replace(study, results={"paper_process_weave": results | more | {"iiru": runs_with(2.6 * errors)}})
    assert not {v.quantity: v for v in acceptance.verdicts(changed)}["dekf / iiru"].met


def test_no_signed_mean_is_judged(study):
    assert not [v for v in acceptance.verdicts(study) if "signed" in v.quantity or "mean" in v.quantity]


def test_threshold_is_where_ignoring_the_delay_costs_ten_percent(study):
    errors = np.array([[3.0, 4.0], [0.0, 5.0]])
    costs = np.interp(paper3.DELAYS, [1.0, 60.0], [1.0, 1.0 + 59.0 * 0.04])
    results = {
        f"delay_fine_{d:g}": {"ekf": runs_with(c * errors), "rt": runs_with(errors)}
        for d, c in zip(paper3.DELAYS, costs, strict=True)
    }
    assert figures.threshold(replace(study, results=results)) == pytest.approx(3.5)  # 1 s and 0.1 / 0.04
    assert math.isnan(figures.threshold(study))


def test_the_study_is_the_same_in_any_number_of_processes(study):
    again = paper3.reproduce(5, rows=SHORT[2:3], runs=2, jobs=2)
    for key, runs in study.results[SHORT[2]].items():
        assert (runs.final == again.results[SHORT[2]][key].final).all()


def test_claims_name_their_numbers(study):
    found = {claim.claim: claim for claim in claims.claims(study)}
    assert not found["heading is unobservable from ranges (3.1)"].holds
    assert not found["packets come out of order (4.5)"].holds
    assert "0 in 2 runs" in found["packets come out of order (4.5)"].measured
    assert all(any(c.isdigit() for c in claim.measured) for claim in found.values())


def test_the_command_prints_and_writes_the_study(study, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(paper3, "reproduce", lambda *args, **options: study)
    assert cli.main(["reproduce", "paper3", "--seed", "5", "--out", str(tmp_path / "new")]) == 0
    printed, said = capsys.readouterr()
    for name in SHORT:
        assert ROWS[name].title in printed
    judged = acceptance.verdicts(study)
    kept = study.results["loss_fine_60%"]["sc"].rms / study.results["loss_fine_0%"]["sc"].rms
    assert f"60 % of packets lost, fine noise, rms over that without loss: SC-EKF {kept:.2f}" in printed
    assert f"{sum(v.met for v in judged)} of {len(judged)} met" in printed
    assert "study.csv" in said
    assert {path.name for path in (tmp_path / "new").iterdir()} == FILES | FIGURES
    for name in FIGURES:
        assert min(imread(tmp_path / "new" / name).shape[:2]) > 300
    with (tmp_path / "new" / "study.csv").open(newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    line = next(row for row in lines if row["row"] == SHORT[1] and row["method"] == "SC-RT")
    assert float(line["rms_m"]) == pytest.approx(study.results[SHORT[1]]["rt"].rms, rel=1e-5)


def test_the_truth_picks_the_rows(study, monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr(paper3, "reproduce", lambda *args, rows, **options: asked.append(rows) or study)
    for truth in ("mujoco", "planar"):
        assert cli.main(["reproduce", "paper3", "--truth", truth, "--out", str(tmp_path / truth)]) == 0
    assert all(ROWS[name].conditions.carried for name in asked[0])
    assert not any(ROWS[name].conditions.carried for name in asked[1])
    assert {*asked[0], *asked[1]} == {*ROWS}


def test_a_physical_vehicle_goes_where_the_kinematics_lead():
    """Speeds and turns of the course lead through MuJoCo's places; it weaves nearly as asked, at its own speed."""
    conditions = Conditions(scene="weave", mode="sensor", carried=True, duration=320.0)
    run, again, other = (simulate(conditions, 3, number) for number in (0, 4, 1))
    steps = np.hypot(*np.diff(run.follower[50:, :2], axis=0).T)
    assert steps.mean() == pytest.approx(physical.SPEED, rel=0.05)
    swing = np.degrees(np.ptp(run.follower[:300, 2]))
    assert 70.0 < swing < 90.0  # 80 deg, which it follows late and not quite
    assert (run.follower == again.follower).all()  # four ways are shared out among the runs
    assert not (run.odometry == again.odometry).all()
    assert np.abs(run.follower - other.follower).max() > 0.1
    assert math.dist(run.leader[0, :2], run.follower[0, :2]) == pytest.approx(300.0)
    noise = run.odometry[:, 0] - np.hypot(*np.diff(run.follower[:, :2], axis=0).T)
    assert noise.std() == pytest.approx(math.sqrt(NOISES["fine"].follower.speed), rel=0.15)


def test_yardsticks_agree_with_the_oracle_where_nearly_all_is_linear():
    """On a short fine run; the model's derivatives against differences."""
    run = simulate(Conditions(duration=200.0), 6, 2)
    oracle = follow(METHODS["oracle"].make(undelayed(run)), undelayed(run))
    for track in (yardsticks.most_probable(run), yardsticks.particle(run)):
        assert (track.times == oracle.times).all()
        spread = math.sqrt(float(np.sum(oracle.errors[-1] ** 2) / (2.0 * oracle.nees[-1])))  # of its belief, about
        assert np.hypot(*(track.errors[-1] - oracle.errors[-1])) < 0.5 * spread
        assert track.nees[-1] == pytest.approx(oracle.nees[-1], rel=0.5)
        assert track.relative[-1] == pytest.approx(track.errors[-1] - track.leader[-1])
    pair, x, u = yardsticks.Pair(run), np.array([3.0, -4.0, 0.7, 2.0, 5.0, 0.1]), (3.0, 0.02, 2.0, -1.5, 0.4)
    shown = Measurement(
        kind="range", value=np.ones(1), covariance=np.eye(1), stamp=0.0, received=0.0, parameters=(200.0, 90.0)
    )
    model = yardsticks.LeaderRange()
    for k, step in enumerate(1e-4 * np.eye(6)):
        change = (pair.evaluate(x + step, u, 1.0) - pair.evaluate(x - step, u, 1.0)) / 2e-4
        assert pair.jacobian(x, u, 1.0)[:, k] == pytest.approx(change, abs=1e-6)
        change = (model.evaluate(x + step, shown) - model.evaluate(x - step, shown)) / 2e-4
        assert model.jacobian(x, shown)[:, k] == pytest.approx(change, abs=1e-6)
    along = np.array([math.cos(0.7), math.sin(0.7)])
    Q = pair.covariance(x, u, 1.0)
    assert along @ Q[:2, :2] @ along == pytest.approx(run.noise.follower.speed)
    assert np.trace(Q[3:5, 3:5]) == pytest.approx(run.noise.leader.speed + yardsticks.ACROSS)


def test_an_unknown_scene_is_named():
    with pytest.raises(truths.InputError, match="no scene 'zigzag'; there are straight"):
        truths.commands("zigzag", 10)  # pyright: ignore[reportArgumentType]


@pytest.mark.slow
def test_acceptance_on_fresh_seeds():
    """Order at paper noise over 250 runs, consistency at fine noise over 60."""
    rows = [*(f"fine_process_{scene}" for scene in acceptance.OBSERVED), "loss_fine_0%", "loss_fine_60%"]
    run = partial(paper3.reproduce, 77)
    pooled, fine = run(rows=SHORT[:1], runs=250), run(rows=rows, runs=60)
    judged = acceptance.verdicts(replace(fine, results={**fine.results, **pooled.results}))
    assert not [v for v in judged if not v.met]
