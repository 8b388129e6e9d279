"""The report of a campaign's folder, from Python and by `auvsim report`."""

from pathlib import Path

import pytest

from auvsim import cli
from auvsim.base.errors import InputError
from auvsim.campaign import plan, report
from auvsim.campaign.folder import Folder

PLAN = {"name": "three trials", "seed": 7, "trials": 3, "variants": {"a": {}, "b": {}}}
SUMMARY = {"docked": True, "attempts": 1, "failure_reason": None, "crossings": [], "estimate": {}, "time": 300.0}


def campaign(path: Path, trials: int) -> Folder:
    """A folder with the first trials of both variants; those of the second fail by an error."""
    made = Folder(path, plan.parse(PLAN))
    made.save_state()
    made.save_plan()
    for trial in range(trials):
        scenario = {"current.speed": 0.1 * trial, "current.direction_deg": 10.0, "dock.heading_deg": 0.0}
        common = {"trial": trial, "seed": 7, "run": {"wall_time": 0.5}, "scenario": scenario}
        error = {"type": "ValueError", "message": "wrong & bad", "traceback": "Traceback"}
        made.save({"variant": "a", "summary": SUMMARY, "error": None, **common}, None)
        made.save({"variant": "b", "summary": None, "error": error, **common}, None)
    return made


def test_report_is_made_of_what_the_folder_holds(tmp_path: Path) -> None:
    """Two of three trials are done: the report says so, with the commands that replay them."""
    made = campaign(tmp_path, 2)
    path = report.write(tmp_path)
    assert path == tmp_path / "report.html"
    text = path.read_text(encoding="utf-8")
    assert "<h1>three trials</h1>" in text
    assert "2 trials are still to be run" in text
    assert "a docks in 2 of 2 trials" in text
    assert "error: ValueError" in text
    assert "wrong &amp; bad" in text
    for name in ("a", "b"):
        for trial in (0, 1):
            assert made.replay_command(name, trial) in text
    assert {entry.name for entry in tmp_path.iterdir()} == {"plan.yaml", "campaign.json", "trials", "report.html"}


def test_report_is_the_same_each_time(tmp_path: Path) -> None:
    """Bit for bit."""
    campaign(tmp_path, 3)
    first = report.write(tmp_path).read_bytes()
    assert report.write(tmp_path).read_bytes() == first


def test_command_makes_the_report_again(tmp_path: Path) -> None:
    """`auvsim report DIR` needs nothing but the folder."""
    campaign(tmp_path, 1)
    assert cli.main(["report", str(tmp_path)]) == 0
    assert (tmp_path / "report.html").is_file()


@pytest.mark.parametrize("case", ["missing", "empty", "only a plan", "no trial", "unwritable"])
def test_what_cannot_be_reported_is_one_line(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2, the place and the reason, and no report."""
    folder = tmp_path / "campaign"
    if case != "missing":
        folder.mkdir()
    if case == "only a plan":
        (folder / "plan.yaml").write_text("trials: 3")
    if case == "no trial":
        campaign(folder, 0)
    if case == "unwritable":
        campaign(folder, 1)
        (folder / "report.html").mkdir()
    before = list(tmp_path.rglob("*"))
    with pytest.raises(InputError, match=str(folder)):
        report.write(folder)
    assert cli.main(["report", str(folder)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("auvsim: ")
    assert str(folder) in said
    assert said.count("\n") == 1
    assert not (folder / "report.html").is_file()
    assert case == "unwritable" or list(tmp_path.rglob("*")) == before
