"""Plans: the trials they mean, and that what is wrong is said in one line before anything runs."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from auvsim import cli
from auvsim.base.errors import InputError
from auvsim.campaign import plan
from auvsim.cli import options
from auvsim.simulation import sampling, scenario

VARIANTS = {"fast": {"guidance": {"approach_speed": 1.6}}, "imm": {"estimator": {"kind": "imm"}}}


def drawn(values: dict) -> dict:
    """What the default plan draws, of definite values."""
    start = values["vehicle"]["start"]
    return {**start, **values["current"], "dock": values["dock"]["heading_deg"]}


def test_a_trial_is_that_of_auvsim_dock(tmp_path: Path) -> None:
    """Trial k of a plan is `auvsim dock --seed S --trial k` with what its variant pins."""
    (tmp_path / "pins.yaml").write_text("estimator: {kind: imm}\nduration: 900.0\n")
    found = plan.parse({"seed": 6, "trials": 9, "base": {"duration": 900.0}, "variants": VARIANTS})
    for trial in (0, 7):
        by_hand = options.scenario(tmp_path / "pins.yaml", None, {}, seed=6, trial=trial)
        assert scenario.parse(found.values("imm", trial)) == by_hand


@pytest.mark.parametrize("kind", ["independent", "latin_hypercube", "sobol"])
def test_variants_see_the_same_draws(kind: str) -> None:
    """All that is drawn is the same in each variant, and no two trials are alike."""
    found = plan.parse({"seed": 2, "trials": 8, "sampling": kind, "variants": VARIANTS})
    trials = [[drawn(found.values(name, trial)) for trial in range(8)] for name in VARIANTS]
    assert trials[0] == trials[1]
    assert len({each["range"] for each in trials[0]}) == 8
    assert found.values("fast", 0)["guidance"]["approach_speed"] == 1.6
    assert found.values("imm", 0)["estimator"]["kind"] == "imm"


def test_stratified_values_have_their_distributions() -> None:
    """Of five kinds, by their own laws; a hypercube of 200 fits far better than 200 independent draws would."""
    laws = {
        "range": ({"uniform": [250, 350]}, stats.uniform(250, 100)),
        "bearing_deg": ({"normal": [3, 20]}, stats.norm(3, 20)),
        "depth": ({"truncated_normal": [15, 10, 10, 30]}, stats.truncnorm(-0.5, 1.5, 15, 10)),
        "speed": ({"log_uniform": [0.5, 2]}, stats.loguniform(0.5, 2)),
    }
    base = {"vehicle": {"start": {key: leaf for key, (leaf, _) in laws.items()}}, "control": {}}
    found = plan.parse({"trials": 200, "sampling": "latin_hypercube", "base": base})
    starts = [found.values("all", trial)["vehicle"]["start"] for trial in range(200)]
    for key, (_, law) in laws.items():
        # One value in each of 200 equal parts: the distribution is met within 1/200 everywhere.
        assert stats.kstest([start[key] for start in starts], law.cdf).statistic <= 1.0 / 200.0 + 1e-9


def test_a_grid_is_taken_in_turn() -> None:
    """All combinations as often; a point may be a distribution or a whole kind; its keys are columns."""
    grid = {
        "current": [{"kind": "uniform", "speed": 0.2}, {"kind": "gust", "intensity": {"uniform": [0.1, 0.2]}}],
        "acoustics.dropout_probability": [0.0, 0.1, 0.5],
    }
    found = plan.parse({"trials": 12, "grid": grid})
    values = [found.values("all", trial) for trial in range(12)]
    pairs = [(each["current"]["kind"], each["acoustics"]["dropout_probability"]) for each in values]
    assert pairs[:6] == [(kind, p) for kind in ("uniform", "gust") for p in (0.0, 0.1, 0.5)]
    assert pairs[6:] == pairs[:6]
    assert {"current.kind", "current.speed", "current.intensity", "acoustics.dropout_probability"} <= set(found.drawn)
    intensities = [each["current"]["intensity"] for each in values if each["current"]["kind"] == "gust"]
    assert all(0.1 <= x <= 0.2 for x in intensities)
    assert len(set(intensities)) == 6


def test_columns_are_what_differs() -> None:
    """What is drawn, and apart from it what variants pin."""
    found = plan.parse({"variants": {**VARIANTS, "still": {"current": {"speed": 0.0}}}})
    assert "vehicle.start.range" in found.drawn
    assert "current.speed" in found.drawn  # of the other two
    assert found.compared == ("guidance.approach_speed", "estimator.kind")


def test_a_written_plan_is_the_same_plan(tmp_path: Path) -> None:
    """The text of a plan is whole: it does not need the file that it was based on."""
    (tmp_path / "base.yaml").write_text("current: {kind: uniform, speed: 0.4, direction_deg: {choice: [0, 90]}}\n")
    (tmp_path / "mine.yaml").write_text("base: base.yaml\ntrials: 4\nseed: 3\nvariants: {a: {}, b: {duration: 60}}\n")
    first = plan.load(str(tmp_path / "mine.yaml"))
    (tmp_path / "else").mkdir()
    (tmp_path / "else" / "plan.yaml").write_text(first.to_yaml())
    again = plan.load(str(tmp_path / "else"))
    assert again == first
    assert again.identity() == first.identity()
    assert first.settings.name == "mine"
    assert [again.values("b", k) for k in range(4)] == [first.values("b", k) for k in range(4)]


def test_what_trials_there_are_is_the_identity() -> None:
    """More trials or another time limit make no other campaign; another seed, base, grid or variant does."""
    first = plan.parse({"trials": 4})
    for same in ({"trials": 40}, {"timeout": 5.0}, {"keep": "all"}, {"name": "other"}, {"stop": {"width": 0.1}}):
        assert plan.parse({"trials": 4, **same}).identity() == first.identity()
    for other in ({"seed": 1}, {"base": {"duration": 50.0}}, {"variants": VARIANTS}, {"sampling": "sobol"}):
        assert plan.parse({"trials": 4, **other}).identity() != first.identity()
    cube = {"sampling": "latin_hypercube"}  # here each trial depends on how many there are
    assert plan.parse({"trials": 4, **cube}).identity() != plan.parse({"trials": 5, **cube}).identity()


WRONG = {
    "trails: 5": "wrong.yaml:1: trails: unknown key; did you mean trials?",
    "trials: 0": "wrong.yaml:1: trials: 0 should be greater than or equal to 1",
    "grid: {current.speed: []}": "wrong.yaml:1: grid.current.speed: no values; give some",
    "grid: {current.sped: [0.1]}\ntrials: 1": "wrong.yaml:1: current.sped: unknown key; did you mean current.speed?",
    "trials: 10\ngrid: {current.speed: [0, 0.1, 0.2]}": "wrong.yaml:1: trials: 10 is no multiple of the 3 points",
    "grid: {current: [{}], current.speed: [0]}": "wrong.yaml:1: grid.current: another key of the grid is above",
    "grid: {duration: [9.0]}\nvariants:\n  a: {duration: 8.0}": "wrong.yaml:1: grid.duration: variant 'a' pins it too",
    "variants: {}": "wrong.yaml:1: variants: none; leave the key out",
    "variants:\n  a/b: {}": "wrong.yaml:2: variants.a/b: a name is made of letters, digits",
    "variants:\n  a:\n    estimator: {factori: imm}": "wrong.yaml:3: estimator.factori: unknown key; did you mean",
    "base:\n  duration: fast": "wrong.yaml:2: duration: fast should be a valid number",
    "base:\n  duration: {uniform: [9, 1]}": "wrong.yaml:2: duration: {uniform: [9, 1]}: low must not exceed high",
    "base:\n  dock: {choice: [{depth: 20}, {depth: {normal: [1]}}]}": "wrong.yaml:2: dock.depth: {normal: [1]}: needs",
    "base: nowhere.yaml": "nowhere.yaml: cannot be read",
    "success: docks": "wrong.yaml:1: success: no column that is true or false 'docks'; there are docked, docked_first",
    "success: attempts": "wrong.yaml:1: success: no column that is true or false 'attempts'; there are docked",
    "success: {metric: docked, below: 1}": "wrong.yaml:1: success: no column of numbers 'docked'; there are attempts",
    "success: 5": "wrong.yaml:1: success: 5 should be a mapping",
    "base:\n  mission: {kind: 'nowhere:Class'}": "wrong.yaml: mission 'nowhere:Class': ModuleNotFoundError",
    "sampling: halton": "wrong.yaml:1: sampling: halton should be 'independent', 'latin_hypercube' or 'sobol'",
    "stop: {width: 1.5}": "wrong.yaml:1: stop.width: 1.5 should be less than 1",
    "- 5": "wrong.yaml: a plan is a mapping",
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong_is_said_in_one_line(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """Exit code 2, file and line, what would be right; no folder is left."""
    monkeypatch.chdir(tmp_path)
    Path("wrong.yaml").write_text(text + "\n")
    assert cli.main(["campaign", "wrong.yaml"]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"auvsim: {WRONG[text]}")
    assert error.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["wrong.yaml"]


def test_the_shipped_plan() -> None:
    """By its name: three estimators in the same 200 trials."""
    found = plan.load("navigators")
    assert found.settings.trials == 200
    assert len(found.variants) == 3
    assert len({found.values(name, 0)["estimator"]["kind"] for name in found.variants}) == 3
    with pytest.raises(
        InputError,
        match=r"no plan 'navigator': .*shipped \(docking_edges, .*leader_follower, navigators, remus100_water, ",
    ):
        plan.load("navigator")


def test_every_choice_of_a_plan_is_a_column() -> None:
    """Keys below what is chosen, and of distributions in it; a list is one value."""
    values = {"x": {"choice": [{"kind": "a", "y": {"uniform": [0, 1]}}, {"kind": "b", "z": [1, 2]}]}, "w": 5}
    assert list(dict.fromkeys(sampling.varied(values))) == ["x.kind", "x.y", "x.z"]
    assert {key for key, _ in sampling.distributions(values)} == {"x", "x.y"}
    nested = {"x": {"choice": [1.0, {"uniform": [0, 1]}]}}
    assert set(sampling.varied(nested)) == {"x"}
    assert {key for key, _ in sampling.distributions(nested)} == {"x", "x.choice"}
    assert all(np.isfinite(sampling.draw(nested, 0, 0, quantiles={"x": 0.9, "x.choice": u})["x"]) for u in (0.0, 0.5))
