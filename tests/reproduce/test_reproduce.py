"""The command that reproduces paper 1, in a short form: what it prints, what it writes, and that it can be repeated."""

import csv
import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from matplotlib.image import imread

from auvsim import cli
from auvsim.cli.papers import paper1 as command
from auvsim.reproduce.paper1 import acceptance as paper1_acceptance
from auvsim.reproduce.paper1 import planar as paper1
from auvsim.reproduce.paper1 import products as paper1_products
from auvsim.reproduce.paper1.study import FILTERS, ROWS, evaluate

SHORT = ("start", "late")
RUNS = 2
PLANAR = ("--truth", "planar")  # on MuJoCo's truth see test_reproduce_mujoco
FILES = {"study.csv", "acceptance.csv", "table1.csv", "figure6.png", "figure7.png", "study.png"}


@pytest.fixture(scope="module")
def study():
    return paper1.reproduce(5, rows=SHORT, runs=RUNS, jobs=2)


@pytest.fixture
def short(monkeypatch):
    """The command with few rows and runs."""
    monkeypatch.setattr(paper1, "reproduce", partial(paper1.reproduce, rows=SHORT, runs=RUNS))


def settled(study, **changed):
    """The study with a settled row whose filters all have the results of another row, but for `changed` ratios."""
    results = {
        name: replace(result, mean=0.1011, nees=1.0, state_nees=result.state_nees / result.state_nees)  # NaN stays
        for name, result in study.results["late"].items()
    }
    results |= {name: replace(results[name], ratio=ratio) for name, ratio in changed.items()}
    return replace(
        study,
        results=study.results | {"settled_40": results},
        runs=study.runs | {"settled_40": 4},
        bounds={"settled_40": results["augmented_constant"].rms},
        batches={"settled_40": 1.0},
    )


def read(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_command_prints_and_writes_the_study(short, study, tmp_path, capsys):
    out = tmp_path / "new" / "folder"
    assert cli.main(["reproduce", "paper1", *PLANAR, "--seed", "5", "--jobs", "1", "--out", str(out)]) == 0
    printed, said = capsys.readouterr()
    for name in SHORT:
        line = next(line for line in printed.splitlines() if line.startswith(f" {ROWS[name].title}"))
        assert f"{study.results[name]['paper'].rms:.3f}" in line
        for key in ("imm", "imm_biases", "augmented"):
            assert f"{study.results[name][key].ratio:.2f}" in line
    assert "Table 1" in printed
    judged = paper1_acceptance.verdicts(study)
    assert f"{sum(v.met for v in judged)} of {len(judged)} met" in printed
    assert "study.csv" in said
    assert {path.name for path in out.iterdir()} == FILES
    # In one process as in two: the same bytes, so the same numbers.
    again = tmp_path / "again"
    again.mkdir()
    paper1_products.write(study, again)
    for name in FILES:
        assert (again / name).read_bytes() == (out / name).read_bytes()


def test_the_study_is_that_of_paired_runs(study):
    """Ratios by hand from the scores of the seeds."""
    scores = [evaluate(ROWS["late"], paper1.run_seed(5, k), ["paper", "imm"]) for k in range(RUNS)]
    squares = {name: sum(s[name].mean_square for s in scores) for name in ("paper", "imm")}
    # Sums in another order.
    assert study.results["late"]["imm"].ratio == pytest.approx(math.sqrt(squares["imm"] / squares["paper"]), rel=1e-12)
    assert study.results["late"]["paper"].ratio == 1.0


def test_late_delivery_is_prompt_delivery(study):
    assert study.worst_delivery <= 1e-9


def test_another_seed_gives_other_runs(study):
    seeds = {paper1.run_seed(seed, k) for seed in range(3) for k in range(100)}
    assert len(seeds) == 300
    other = evaluate(ROWS["start"], paper1.run_seed(6, 0), ["paper"])["paper"]
    assert other.mean_square != evaluate(ROWS["start"], paper1.run_seed(5, 0), ["paper"])["paper"].mean_square


def test_rows_of_the_same_conditions_share_their_runs():
    keys = [task.key for task in paper1._tasks(0, True, dict.fromkeys(("turn_40", "after_turn"), 3))]
    assert [key for key in keys if key[0] == "scores"] == [("scores", "turn_40", k) for k in range(3)]


def test_tables_hold_every_row_and_filter(study, tmp_path):
    paper1_products.write(settled(study), tmp_path)
    lines = read(tmp_path / "study.csv")
    assert [(x["row"], x["filter"]) for x in lines] == [(r, f) for r in (*SHORT, "settled_40") for f in FILTERS]
    for line in lines:
        result = settled(study).results[line["row"]][line["filter"]]
        assert float(line["rms_m"]) == pytest.approx(result.rms, rel=1e-5)  # six digits are written
        assert float(line["ratio_low"]) <= float(line["ratio"]) <= float(line["ratio_high"])
        # A filter without the current in its covariance claims nothing to be judged by.
        for column in ("nees_per_dof", "state_nees_per_dof"):
            assert (line[column] == "") == (line["filter"] in list(FILTERS)[:6])
        assert (line["bound_m"] == "") == (line["row"] != "settled_40")
    (line,) = read(tmp_path / "table1.csv")
    assert (line["distance_m"], line["paper_mean_m"], line["paper_variance_m2"]) == ("40", "0.1011", "0.0045")
    assert float(line["mean_ratio"]) == pytest.approx(1.0)
    assert {x["met"] for x in read(tmp_path / "acceptance.csv")} <= {"yes", "no"}


@pytest.mark.parametrize("name", ["figure6.png", "figure7.png", "study.png"])
def test_pictures_show_something(study, tmp_path, name):
    paper1_products.write(study, tmp_path)
    picture = imread(tmp_path / name)
    assert min(picture.shape[:2]) > 250
    assert np.ptp(picture[..., :3]) > 0.9


def test_curves_are_of_the_run_in_which_the_current_turns(study):
    curves = study.curves
    before, after = (curves.current[np.searchsorted(curves.times, t)] for t in (119.0, 131.0))
    assert abs(before @ after) < 1e-9  # by 90 degrees
    assert np.linalg.norm(after) == pytest.approx(0.5)
    settled = (curves.times > 90.0) & (curves.times < 120.0)
    rms = {key: float(np.sqrt(np.mean(curves.errors[key][:, settled] ** 2))) for key in paper1.CURVES}
    # Of the full study 20; twenty runs and the remains of the start leave it far above this.
    assert rms["regular_best"] > 5.0 * rms["paper"]


def test_what_is_not_met_is_said_with_its_reason(study):
    good = settled(study, regular_best=20.0, delay_only=18.0, current_only=14.0, augmented_constant=0.83, imm=0.87)
    bad = settled(study, regular_best=4.9, delay_only=18.0, current_only=14.0, augmented_constant=0.83, imm=9.0)
    unmet = [[v for v in paper1_acceptance.verdicts(s) if v.row == "settled_40" and not v.met] for s in (good, bad)]
    assert [v.quantity for v in unmet[0]] == []
    assert [(v.quantity, v.measured, v.accept) for v in unmet[1]] == [
        ("REG* / paper", 4.9, ">= 5"),
        ("IMM / paper", 9.0, "<= 0.93"),
    ]
    assert all(v.reason for v in unmet[1])
    few = paper1_acceptance.verdicts(replace(bad, runs=bad.runs | {"settled_40": 1}))
    assert any("too few" in v.reason for v in few if not v.met)


def test_every_row_has_something_to_reach(study):
    results = {name: settled(study).results["settled_40"] for name in ROWS}
    everything = replace(study, results=results, runs=dict.fromkeys(ROWS, 100), bounds={})
    judged = paper1_acceptance.verdicts(everything)
    assert {v.row for v in judged} == {*ROWS, paper1_acceptance.ALL, paper1_acceptance.DELIVERY}
    assert command.acceptance_table(judged).row_count == len(judged)
    assert {v.accept for v in judged if v.quantity == "IMM+biases / paper"} == {"<= 1.03"}


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["paper1", "--seed", "-1"], "--seed -1 must be 0 or more"),
        (["paper1", "--jobs", "0"], "--jobs 0 must be 1 or more"),
        (["paper1", "--seed", "one"], "seed"),
        (["paper1", "--runs", "3"], "--runs"),
        (["paper1", "--truth", "real"], "mujoco"),
        (["paper9"], "paper1"),
        ([], "reproduce"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, text, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["reproduce", *arguments]) == 2
    printed, said = capsys.readouterr()
    assert printed == ""
    assert said.count("\n") == 1
    assert text in said
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written_to_is_refused_before_the_study(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(paper1, "reproduce", lambda *_, **__: pytest.fail("ran"))
    (tmp_path / "file").write_text("")
    assert cli.main(["reproduce", "paper1", "--out", str(tmp_path / "file")]) == 2
    assert "it is a file, not a folder" in capsys.readouterr().err


def test_an_interrupt_leaves_nothing(tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(paper1, "reproduce", interrupted)
    assert cli.main(["reproduce", "paper1", "--out", str(tmp_path / "out")]) == 130
    assert not list(tmp_path.iterdir())
