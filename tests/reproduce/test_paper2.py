"""The study of paper 2 in a short form: what it prints and writes, its physics, and that it can be repeated."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest

from auvsim import cli
from auvsim.reproduce.paper2 import acceptance, physical, products, study
from auvsim.reproduce.paper2.filters import METHODS, TIMES, follow
from auvsim.reproduce.paper2.runs import (
    CURRENT,
    CYCLE,
    NOISES,
    TRACKS,
    Conditions,
    Errors,
    measured,
    planar_motion,
    simulate,
)
from auvsim.reproduce.paper2.scores import score, summarise
from estimators.core.odometry_bounds import observability

COUNTS = {"nominal": 4, "coarse": 2, "matched": 2}
LEFT_OUT = ("followerweave", "close", "far", "turn_5", "turn_45", "held")


@pytest.fixture(scope="module")
def short():
    """A study of few runs a row."""
    rows = {name: replace(row, quick_runs=COUNTS.get(name, 1)) for name, row in study.ROWS.items()}
    rows = {name: row for name, row in rows.items() if name not in LEFT_OUT}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "ROWS", rows)
        patch.setattr(study, "run_tasks", lambda tasks, jobs, progress: {task.key: task.work() for task in tasks})
        patch.setattr(study, "BOUND_RUNS", 4)
        yield study.reproduce(3, quick=True, mujoco=False)


def test_the_weave_is_the_specifications():
    motion = planar_motion(Conditions())
    assert motion.follower[-1] == pytest.approx((5600.0, 1800.0), abs=60.0)
    distance = np.hypot(*(motion.follower - motion.leader).T)
    assert (distance.min(), distance.max()) == pytest.approx((97.0, 307.0), abs=1.5)


@pytest.mark.parametrize("name", TRACKS)
def test_rank_of_each_geometry_is_as_said(name):
    motion = planar_motion(Conditions(tracks=name))
    off = np.column_stack((motion.follower - motion.leader, np.zeros(len(motion.leader))))[::CYCLE]
    found = observability(np.arange(0.0, CYCLE * len(off), CYCLE), off[None])
    assert found.rank[0] == TRACKS[name].rank
    if name == "weave":
        assert found.condition[0] == pytest.approx(8.5, abs=0.5)
    if name == "far":
        assert found.condition[0] == pytest.approx(258.0, rel=0.35)  # its track is not given in full


def test_noise_is_what_its_set_says():
    noise, run = NOISES["nominal"], simulate(Conditions(), 11)
    motion = planar_motion(Conditions())
    assert run.inputs[:, 0].std() == pytest.approx(noise.speed, rel=0.05)
    assert (run.inputs[:, 2] - motion.through_water[:, 2]).std() == pytest.approx(noise.heading, rel=0.05)
    off = np.array([m.value[0] - np.hypot(*(run.truth[k, :2] - run.leader[k])) for k, m in run.packets.items()])
    assert off.std() == pytest.approx(noise.range, rel=0.12)
    matched = simulate(Conditions(noise="matched"), 11).inputs
    added = (matched[:, :2] - (2.0, 0.0)).reshape(-1, CYCLE, 2).sum(axis=1)
    assert added.std() == pytest.approx(2.0, rel=0.08)
    assert simulate(Conditions(), 11).inputs == pytest.approx(run.inputs, abs=0.0)


def test_losses_change_no_other_draw():
    all_heard, half = simulate(Conditions(), 12), simulate(Conditions(loss=0.5), 12)
    assert 0.3 < len(half.packets) / len(all_heard.packets) < 0.7
    assert all(np.array_equal(half.packets[k].value, all_heard.packets[k].value) for k in half.packets)


def test_errors_are_those_of_their_names():
    motion, noise = planar_motion(Conditions()), NOISES["clean"]
    wrong = Errors(compass_bias=0.03, speed_scale=0.05, sound_speed=0.01, clock_drift=1e-6)
    right, off = (measured(motion, noise, 1, errors=e) for e in (Errors(), wrong))
    assert off.inputs[:, 0] == pytest.approx(1.05 * right.inputs[:, 0])
    assert off.inputs[:, 2] - right.inputs[:, 2] == pytest.approx(0.03)
    for second in (0, 800, 2400):
        expected = right.packets[second].value[0] / 1.01 + 1500.0 * 1e-6 * second
        assert off.packets[second].value[0] == pytest.approx(expected)


def test_states_for_what_is_wrong_keep_the_bank_consistent():
    """Planar truth, 12 seeds: NEES far above 1 without the states, about 1 with them."""
    motion, noise = planar_motion(Conditions()), NOISES["nominal"]
    errors, extra = study.TOGETHER
    runs = [measured(motion, noise, 60 + k, errors=errors) for k in range(12)]
    without, with_them = (
        summarise([score(run, follow(run, METHODS["bank"], states)) for run in runs]) for states in ({}, extra)
    )
    assert without.nees > 4.0
    assert 0.5 < with_them.nees < 1.7
    assert with_them.rms < 0.8 * without.rms


def test_scores_are_of_the_times_they_name():
    run = simulate(Conditions(), 13)
    followed = follow(run, METHODS["reckoning"])
    found = score(run, followed)
    assert math.sqrt(found.final) == pytest.approx(np.hypot(*CURRENT) * TIMES[-1], rel=0.02)
    assert found.current_500 == pytest.approx(np.hypot(*CURRENT))
    assert found.peak == pytest.approx(np.hypot(*CURRENT) * 496.0, rel=0.05)
    both = summarise([found, found._replace(late=4.0 * found.late, final=0.0)])
    assert both.rms == pytest.approx(math.sqrt(2.5 * found.late))
    assert both.lost == 0.5


def test_study_names_what_fails(short):
    judged = {(v.row, v.quantity): v for v in acceptance.verdicts(short)}
    assert judged["nominal", "final rms, dead reckoning / paper"].met
    assert judged["parallel", "flagged as rank 2: share of runs"].met
    assert judged["oblique", "flagged as rank 3: share of runs"].met
    assert judged["nominal", "flagged in the weave: share of runs"].met
    claims = {c.claim: c for c in acceptance.claims(short)}
    assert not claims["the current converges within 0 to 500 s (matched)"].holds
    assert not claims["eq. 1 adds up N + 1 samples"].holds
    assert not claims["P is the covariance of the error"].holds


def test_bounds_are_those_of_the_specification(short):
    for noise, late, final in (("nominal", 1.13, 0.65), ("coarse", 2.84, 1.71), ("matched", 13.6, 9.43)):
        assert short.bounds[noise] == pytest.approx((late, final), rel=0.05)
    assert short.bounds["loss_60"][0] == pytest.approx(1.50, rel=0.15)  # few draws of losses


def test_batch_is_no_worse_than_the_bank(short):
    for noise in acceptance.NOISES:
        assert short.results[noise]["batch"].rms < short.results[noise]["bank"].rms


def test_files_are_written_and_hold_the_study(short, tmp_path):
    written = products.write(short, tmp_path)
    assert {path.name for path in written} == {
        "study.csv", "acceptance.csv", "claims.csv", "figure2.png", "figure3.png", "figure4.png", "figure5.png",
        "loss.png", "p1.png",
    }  # fmt: skip
    with (tmp_path / "study.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if (row["row"], row["filter"]) == ("nominal", "bank of 49")]
    assert float(rows[0]["rms_m"]) == pytest.approx(short.results["nominal"]["bank"].rms, rel=1e-4)


def test_command_prints_tables(short, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(study, "reproduce", lambda *args, **kwargs: short)
    monkeypatch.setattr(products, "write", lambda done, out: [])
    assert cli.main(["reproduce", "paper2", "--quick", "--seed", "3", "--truth", "planar", "--out", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    for text in ("paper 2: the study, quick, seed 3", "bank of 49", "its claims", "what to reach"):
        assert text in out


def test_the_vehicle_in_mujoco_weaves_as_planned():
    seconds = 160
    motion = physical.motion(2, seconds)
    asked = planar_motion(Conditions()).through_water[:seconds, 2]
    assert np.abs(motion.through_water[20:, 2] - asked[20:]).max() < math.radians(6.0)  # lag of the autopilot
    assert motion.through_water[20:, 0] == pytest.approx(2.0, abs=0.05)
    c, s = np.cos(motion.through_water[:, 2]), np.sin(motion.through_water[:, 2])
    u, v = motion.through_water[:, :2].T
    reckoned = motion.follower[0] + np.cumsum(np.stack((c * u - s * v, s * u + c * v), axis=1) + CURRENT, axis=0)
    assert reckoned == pytest.approx(motion.follower[1:], abs=0.1)  # what is measured adds up to what was travelled
    assert motion.depth == pytest.approx(10.0, abs=0.5)


@pytest.mark.slow
def test_full_study_reaches_what_it_is_to_reach():
    """Every verdict, on a seed that nothing was chosen on."""
    done = study.reproduce(23)
    missed = [f"{v.row}: {v.quantity} {v.measured:.3g}" for v in acceptance.verdicts(done) if not v.met]
    assert not missed
