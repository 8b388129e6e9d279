"""A mission of the user's own whose class declares something wrong: one line before anything runs; logs are kept."""

import json

import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.campaign import columns, plan
from auvsim.cli import main
from auvsim.missions import contract

BEFORE = [
    ("PhasesText", "phases is 'ahead', not a tuple of names"),
    ("PhasesEmpty", "phases is (), not 1 to 127 names"),
    ("PhasesTwice", "phases is ('ahead', 'ahead'), not 1 to 127 names, each once"),
    ("PhasesNumbers", "phases is (1, 2), not a tuple of names"),
    ("VariablesList", "variables is ['mood'], not a mapping of names to Variable"),
    ("VariablesText", "variables['mood'] is 'float64', not a Variable"),
    ("VariablesName", "variables['a/b'] is Variable("),
    ("VariablesTaken", "variables['phase'] is a variable of every mission; call it otherwise"),
    ("VariablesType", "variables['mood'].dtype is 'float16', not one of float64, int8"),
    ("VariablesSize", "variables['mood'].dimensions is ('moods',), not a tuple of some of ned"),
    ("AftermathText", "aftermath is '2 s', not a time of 0 s or more"),
    ("AftermathNegative", "aftermath is -1.0, not a time of 0 s or more"),
    ("AftermathNan", "aftermath is nan, not a time of 0 s or more"),
    ("ColumnsList", "columns is ['calm'], not a mapping of names to Metric"),
    ("ColumnsText", "columns['calm'] is 'bool', not a mapping of names to Metric"),
    ("ColumnsShort", "columns['calm'] is ('bool', '1'), not a mapping of names to Metric"),
    ("MetricsNone", "metrics is None, not a method metrics(log) -> dict"),
    ("DockText", "dock is 'dock', not one of the set-up's structures, or None"),
    ("EventsTuple", "events is (), not a list"),
]
AFTER = [
    ("GivesNothing", "TypeError: metrics gave a NoneType, not a mapping"),
    ("GivesList", "TypeError: metrics gave a list, not a mapping"),
    ("GivesObject", "TypeError: metrics gave a object, not a plain value"),
    ("GivesStatus", "ValueError: metrics gave 'status', which every summary has"),
    ("GivesEstimate", "ValueError: metrics gave 'estimate', which every summary has"),
    ("Raises", "ZeroDivisionError: of its own"),
]


@pytest.fixture(autouse=True)
def _without_pictures(monkeypatch) -> None:
    """Which take most of the time of so short a run."""
    monkeypatch.setattr("auvsim.cli.products.plots", lambda *_: None)


def sail(tmp_path, name: str) -> int:
    """Runs a second of a scenario with this mission."""
    path = tmp_path / "mine.yaml"
    path.write_text(f"duration: 1\nmission:\n  kind: robustness.missions:{name}\n")
    return main(["run", str(path), "--no-video", "--out", str(tmp_path / "out")])


@pytest.mark.parametrize(("name", "says"), BEFORE)
def test_what_is_declared_wrong_is_refused(tmp_path, capsys, name: str, says: str) -> None:
    """With file, line and key; nothing is left."""
    assert sail(tmp_path, name) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    key = f"{tmp_path / 'mine.yaml'}:2: mission"
    assert line.startswith(f"auvsim: {key}: mission 'robustness.missions:{name}': ")
    assert says in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("name", "says"), AFTER)
def test_metrics_that_cannot_be_had_cost_no_log(tmp_path, capsys, name: str, says: str) -> None:
    """The run is whole, its summary says why there are none; a campaign calls its trial an error."""
    assert sail(tmp_path, name) == 0
    assert (tmp_path / "out" / "trial.nc").is_file()
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert says in summary["metrics_error"]
    assert summary["status"] == "complete"
    assert "no metrics of the mission" in capsys.readouterr().out
    with pytest.raises(InputError, match="its metrics cannot be had"):
        columns.check(f"robustness.missions:{name}", summary)


def test_what_is_right_is_taken(tmp_path) -> None:
    """And counted."""
    assert sail(tmp_path, "Right") == 0
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["calm"] is True


@pytest.mark.parametrize("name", ["ColumnsList", "ColumnsText", "ColumnsShort", "PhasesNumbers"])
def test_a_campaign_refuses_them_too(name: str) -> None:
    """When the plan is read."""
    with pytest.raises(InputError, match=r"mission 'robustness\.missions:\w+': (columns|phases)"):
        plan.parse({"trials": 1, "base": {"mission": {"kind": f"robustness.missions:{name}"}}})


def test_numbers_of_numpy_are_plain() -> None:
    """As JSON wants them."""
    found = contract.metrics({"a": np.int64(3), "b": np.bool_(True), "c": np.float32(0.5), "d": np.arange(2)})
    assert found == {"a": 3, "b": True, "c": 0.5, "d": [0, 1]}
    assert type(found["a"]) is int
    assert type(found["b"]) is bool
