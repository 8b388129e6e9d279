"""Paper 4 of few runs: numbers that theory gives, what runs must show whatever their number, and the command itself."""

import csv
import math

import numpy as np
import pytest

from auvsim.cli import main
from auvsim.reproduce.paper4 import claims, line, runs, study, uwb
from auvsim.reproduce.paper4.formations import FORMATIONS, GOOD, TABLE2, TABLE3
from auvsim.reproduce.paper4.runs import Case
from estimators.formation import observability


def test_formations_are_those_of_table_1():
    """All heads are north; distances and S1 as printed, S2 as it is."""
    for f, leaders in FORMATIONS.items():
        r = np.linalg.norm(leaders, axis=1)
        assert r == pytest.approx(
            np.array((1.0, 1.0, 2.0 if f in (3, 4, 8, 9) else 1.0)) * (1000 if f < 6 else 100), rel=2e-4
        )
    s1 = {f: claims.geometry(f, 1.0).s1 for f in FORMATIONS}
    assert [s1[f] for f in (1, 2, 5)] == pytest.approx([2.25, 2.25, 2.0], abs=1e-3)
    assert [s1[f] for f in (3, 4, 8, 9)] == pytest.approx([0.0] * 4, abs=1e-12)
    assert [claims.geometry(f, 1.0).s2 for f in (3, 4, 5)] == pytest.approx([3.0, 0.0, 1.64], abs=1e-3)
    assert TABLE2[3][0] == TABLE3[4.0][2]  # both tables have that cell


def test_claims_of_theory_are_reproduced():
    found = {(c.where, c.claim[:12]): c for c in claims.theory()}
    assert "1.71 V/r" in found["p_i, below eq. 14", "(f_x cos^2 -"].found
    assert "7.4e-03 (F6" in found["eq. 15", "row operatio"].found
    assert "0.198" in found["eq. 29", "det B = 1 / "].found
    assert "0.296 m2" in found["eq. 26, 28", "the bound of"].found
    assert "11.42 deg and 2.86 deg" in found["sec. 4", "5 m aside at"].found
    assert claims.identity() < 1e-9
    unit = [observability.condition_paper(claims.geometry(3, v)) for v in (1.0, 60.0)]
    assert unit == pytest.approx([0.0009, 0.052], abs=5e-4)


def test_a_run_is_the_same_among_any_number():
    few, many = runs.noise(3, 2, 50, 3), runs.noise(3, 5, 80, 3)
    np.testing.assert_array_equal(few.inputs[:, 1], runs.noise(3, 5, 50, 3).inputs[:, 1])
    assert not np.array_equal(many.inputs[:, 0], many.inputs[:, 1])
    assert many.inputs[..., 0].std() == pytest.approx(0.3, rel=0.1)
    assert many.inputs[..., 1].std() == pytest.approx(math.radians(5.0), rel=0.1)


def test_a_truth_that_wanders_leaves_the_line():
    """Eq. 2 read literally: the follower itself drifts off its station, and off a line that told nothing."""
    case = Case(leaders=FORMATIONS[8], speed=1.0, variance=4.0, duration=400.0)
    noise = runs.noise(5, 20, case.steps, 3)
    wandering = Case(leaders=case.leaders, speed=1.0, variance=4.0, duration=400.0, wanders=True)
    kept, wandered = (runs.a_rms(runs.follow(c, noise, "ekf")).mean() for c in (case, wandering))
    assert wandered != pytest.approx(kept, rel=0.05)


def test_good_formations_do_not_know_distance_and_worst_ones_do():
    results = {f: study.cell(study.Key(1.0, 1.0, 4.0, f), 6, 10)["ekf"] for f in (1, 3, 6, 8)}
    assert results[1].a_rms / results[6].a_rms == pytest.approx(1.0, abs=0.03)
    assert results[3].a_rms / results[8].a_rms > 1.2  # 1.8 of 100 runs
    for f in GOOD[:1]:
        assert results[f].rms / study.steady_bound(study.Key(1.0, 1.0, 4.0, f)) == pytest.approx(1.0, abs=0.04)


def test_a_line_a_little_aside_is_worse_than_none():
    """The mirror trap: 5 m to one side is worse than on the line, and the filter says the contrary."""
    on, aside, far = (line.trapped("one side", offset, 8, 16) for offset in (0.0, 5.0, 50.0))
    assert aside.rms > 1.2 * on.rms
    assert aside.claimed < on.claimed
    assert aside.nees > 2.0
    assert far.rms == pytest.approx(far.bound, rel=0.1)
    assert line.trapped("alternate sides", 5.0, 8, 16).nees < 1.6


def test_cars_with_a_heading_bias_are_better_across_than_along():
    biased, straight = (uwb.experiment(bias, 9, 60) for bias in (10.0, 0.0))
    assert biased.gain > 0.2
    assert 0.7 < biased.probability <= 1.0
    assert straight.gain < 0.0  # without one there is nothing to drift across the line
    assert biased.cars["right angle"].a_rms.mean() < biased.cars["worst 2"].a_rms.mean()


def test_another_truth_is_refused_in_one_line(capsys, tmp_path):
    assert main(["reproduce", "paper4", "--truth", "mujoco", "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "planar" in error


@pytest.mark.slow
def test_the_command_reproduces_the_paper(capsys, tmp_path):
    """The quick form: all tables and figures, and what it is to reach."""
    assert main(["reproduce", "paper4", "--quick", "--seed", "3", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "paper 4, Table 3" in printed
    assert "misprint" in printed
    with (tmp_path / "table3.csv").open() as file:
        ratios = [float(row["ratio_7.5_s"]) for row in csv.DictReader(file)]
    assert len(ratios) == 30
    assert {p.name for p in tmp_path.glob("*.png")} == {
        "figure2.png", "figures6_10.png", "figure11.png", "figure14.png", "tables.png", "line.png",
    }  # fmt: skip
