"""Folders of campaigns from before there were several vehicles, made by the code of then: six trials of a minute."""

import csv
import shutil
from pathlib import Path

from auvsim.campaign import folder, plan, report, table
from auvsim.campaign.folder import Folder, claimed

EARLIER = Path(__file__).parent / "earlier"
PLAN = {
    "name": "before",
    "seed": 4,
    "trials": 3,
    "base": {"duration": 60.0, "estimator": {"factory": "augmented_ekf"}},
    "variants": {"a": {"estimator": {"factory": "imm"}}, "b": {}},
}


NEW = (  # columns
    "estimator.use", "docked_aligned", "final_along", "final_cross", "final_down", "final_angle_deg",
    "approaches", "contacts", "shaft_energy", "way",
    *(f"{name}{phase}" for name in ("relative_rms", "nees_relative")
      for phase in ("", "_search", "_homing", "_approach", "_final", "_go_around", "_aborted")),
)  # fmt: skip


def copied(path: Path) -> Folder:
    """A folder of then, opened."""
    shutil.copytree(EARLIER, path)
    return folder.open_begun(path)


def test_its_table_is_the_same(tmp_path: Path) -> None:
    """Byte for byte but for one name and columns that there were not, which are empty; the report is made."""
    opened = copied(tmp_path / "c")
    table.write(opened)
    before = (EARLIER / "table.csv").read_text()
    assert "estimator.factory" in before.splitlines()[0]
    head, *rows = csv.reader((tmp_path / "c" / "table.csv").read_text().splitlines())
    new = [i for i, name in enumerate(head) if name in NEW or name.startswith(("relative_rms_", "nees_relative_"))]
    kept = [i for i in range(len(head)) if i not in new]
    assert {row[i] for row in rows for i in new} <= {"", "[]"}
    today = "".join(",".join(row[i] for i in kept) + "\n" for row in [head, *rows])
    assert today == before.replace("estimator.factory", "estimator.kind")
    assert "a docks in 0 of 3 trials" in report.write(tmp_path / "c").read_text()


def test_it_goes_on_with_the_plan_of_then_and_that_of_today(tmp_path: Path) -> None:
    """Both are the plan that it holds, where they ask for the limits of time that docking had then."""
    opened = copied(tmp_path / "c")
    kinds = {"a": {"estimator": {"kind": "imm", "use": []}}, "b": {}}  # filters of then used no DVL and no gyro
    today = {**PLAN, "base": {"duration": 60.0, "estimator": {"kind": "augmented_ekf", "use": []}}, "variants": kinds}
    limits = {"guidance": {"fix_timeout": 30.0, "uncertain_timeout": 10.0}}
    for values in (PLAN, today):
        values = {**values, "base": {**values["base"], **limits}}
        with claimed(tmp_path / "c", plan.parse(values), opened.state["versions"]) as found:
            assert all(found.read(name, trial) is not None for name in ("a", "b") for trial in range(3))


def test_what_was_not_kept_of_a_summary_is_derived(tmp_path: Path) -> None:
    """First attempts, and the two parts of the miss: of the first passage of the last attempt."""
    opened = copied(tmp_path / "c")
    record = opened.read("a", 0)
    assert record is not None
    passed = [{"attempt": 1, "cross_track": 9.0, "vertical": 9.0}, {"attempt": 2, "cross_track": 0.3, "vertical": -0.1}]
    passed.append({"attempt": 2, "cross_track": 8.0, "vertical": 8.0})
    record["summary"] |= {"docked": True, "attempts": 2, "crossings": passed}
    (row,) = table.rows_of(record, opened.plan.layout)
    assert (row["docked"], row["docked_first"], row["cross_track"], row["vertical"]) == (True, False, 0.3, -0.1)
    record["summary"] |= {"attempts": 1, "crossings": []}
    (row,) = table.rows_of(record, opened.plan.layout)
    assert (row["docked_first"], row["cross_track"]) == (True, None)
    record |= {"summary": None, "error": {"type": "Died", "message": "why", "traceback": ""}}
    (row,) = table.rows_of(record, opened.plan.layout)
    assert (row["docked"], row["attempts"], row["failure"], row["failure_text"]) == (False, 0, "died", "why")


def test_a_grid_of_estimators_is_read() -> None:
    """By the key of then; a choice among them, too."""
    found = plan.parse({"trials": 4, "grid": {"estimator.factory": ["imm", "paper"]}})
    assert [found.values("all", trial)["estimator"]["kind"] for trial in range(4)] == ["imm", "paper"] * 2
    assert "estimator.kind" in found.drawn
    drawn = plan.parse({"trials": 20, "base": {"estimator": {"factory": {"choice": ["imm", "paper"]}}}})
    assert {drawn.values("all", trial)["estimator"]["kind"] for trial in range(20)} == {"imm", "paper"}
