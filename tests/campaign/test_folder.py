"""The folder of a campaign: whole files or none, one campaign a folder, and a disk that is really full."""

import json
import resource
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from auvsim.base.errors import InputError
from auvsim.campaign import execution
from auvsim.campaign.folder import Folder, claimed, open_folder
from auvsim.campaign.local import Pool
from auvsim.campaign.plan import Plan

VERSIONS = {"auvsim": "1"}


@pytest.fixture
def begun(planned: Callable[..., Plan], tmp_path: Path) -> Path:
    """A folder with a plan and two finished trials."""
    with claimed(tmp_path / "c", planned(), VERSIONS) as opened:
        opened.state["versions"] = VERSIONS
        opened.save_plan()
        opened.save_state()
        for trial in (0, 1):
            opened.save({"variant": "a", "trial": trial}, b"log" if trial else None)
    return tmp_path / "c"


def test_what_was_saved_is_there(begun: Path) -> None:
    """Records by variant and trial, the log beside; nothing else is left over."""
    opened = open_folder(begun)
    assert [record["trial"] for record in opened.records()] == [0, 1]
    assert opened.read("a", 2) is None
    assert not opened.log_path("a", 0).exists()
    assert opened.log_path("a", 1).read_bytes() == b"log"
    names = {path.name for path in begun.rglob("*") if path.is_file()}
    assert names == {".lock", "plan.yaml", "campaign.json", "000000.json", "000001.json", "000001.nc"}


@pytest.mark.parametrize("content", ["", '{"variant": "a", "tri', "null", '{"variant": "b", "trial": 1}'])
def test_half_a_record_counts_as_none(begun: Path, content: str) -> None:
    """What a power cut may leave is run again."""
    opened = open_folder(begun)
    opened.record_path("a", 1).write_text(content)
    assert opened.read("a", 1) is None
    assert [record["trial"] for record in opened.records()] == [0]


def test_what_a_killed_run_left_goes(begun: Path, planned: Callable[..., Plan]) -> None:
    """Temporary names, wherever they are."""
    left = [begun / ".plan.77.partial.yaml", begun / "trials" / "a" / "000" / ".000002.77.partial.json"]
    for path in left:
        path.write_text("half")
    with claimed(begun, planned(), VERSIONS):
        assert not any(path.exists() for path in left)


def test_one_campaign_a_folder(begun: Path, planned: Callable[..., Plan], tmp_path: Path) -> None:
    """Another plan, other versions, something else, and a second process are refused; nothing is touched."""
    before = {path: path.read_bytes() for path in begun.rglob("*") if path.is_file()}
    pins = planned().settings.variants
    refused = {
        r"c: holds another plan \(seed differs\); give another folder": (begun, planned(seed=5), VERSIONS),
        r"c: holds another plan \(variants\.b\.duration differs\)": (
            begun,
            planned(variants={**pins, "b": {**pins["b"], "duration": 9.0}}),
            VERSIONS,
        ),
        "c: was begun with auvsim 1, and this is 2": (begun, planned(), {"auvsim": "2"}),
        "d: holds something else than a campaign": (tmp_path / "d", planned(), VERSIONS),
        "cannot be written to: it is a file, not a folder": (tmp_path / "d" / "file", planned(), VERSIONS),
        "e: holds something else than a campaign": (tmp_path / "e", planned(), VERSIONS),
    }
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "file").write_text("precious")
    (tmp_path / "e").mkdir()
    (tmp_path / "e" / "plan.yaml").write_text(planned().to_yaml())  # the user's own, where it was not run
    for text, (path, plan, versions) in refused.items():
        with pytest.raises(InputError, match=text), claimed(path, plan, versions):
            pass
    with (
        claimed(begun, planned(), VERSIONS),
        pytest.raises(InputError, match="another process runs this"),
        claimed(begun, planned(), VERSIONS),
    ):
        pass
    assert {path: path.read_bytes() for path in begun.rglob("*") if path.is_file()} == before
    with claimed(begun, planned(trials=400, timeout=9.0), VERSIONS):
        pass  # more trials of the same


def test_what_was_killed_as_it_began_begins_again(planned: Callable[..., Plan], tmp_path: Path) -> None:
    """Nothing was done; what is there is no obstacle."""
    for name in (".lock", "campaign.json", ".plan.77.partial.yaml"):
        (tmp_path / name).touch()
    with claimed(tmp_path, planned(), VERSIONS) as opened:
        assert opened.state == {}


def test_a_new_folder_that_stays_empty_goes(planned: Callable[..., Plan], tmp_path: Path) -> None:
    """What is refused before anything runs leaves nothing."""

    def refuse(path: Path) -> None:
        with claimed(path, planned(), VERSIONS):
            raise InputError("no")

    with pytest.raises(InputError, match="no"):
        refuse(tmp_path / "x" / "y")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 64 KiB, where this process may mount one."""
    path = tmp_path / "disk"
    path.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(path)]
    if not shutil.which("mount") or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("mounting needs root; the next test has a limit instead")
    yield path
    subprocess.run(["umount", "-l", str(path)], check=True)


def test_a_full_disk_loses_nothing(small_disk: Path, planned: Callable[..., Plan], light: None) -> None:
    """It stops with one line; what was finished is whole; with room it goes on and ends as if nothing had been."""
    filler = small_disk / "filler"
    path = small_disk / "c"
    filler.write_bytes(b"x" * 20_000)
    with Pool(2) as pool:
        with pytest.raises(InputError, match="no space left on device; what is finished is kept, the same command"):
            execution.run(planned(trials=30), path, pool)
        finished = {file: json.loads(file.read_bytes()) for file in path.glob("trials/*/*/*.json")}
        assert 0 < len(finished) < 60
        assert not list(path.rglob(".*.partial*"))
        filler.unlink()
        subprocess.run(["mount", "-o", "remount,size=4m", str(small_disk)], check=True)
        done = execution.run(planned(trials=30), path, pool)
    again = {file: json.loads(file.read_bytes()) for file in path.glob("trials/*/*/*.json")}
    assert len(again) == 60
    assert finished.items() <= again.items()  # with the times of the first run: they did not run twice
    assert done.state["complete"]


def test_a_file_that_does_not_fit_is_not_there(planned: Callable[..., Plan], tmp_path: Path) -> None:
    """Where no file may be longer than 300 bytes: the short one stands, of the long one nothing."""
    opened = Folder(tmp_path / "c", planned())
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300, limits[1]))
    try:
        opened.save({"variant": "a", "trial": 0}, None)
        with pytest.raises(InputError, match=r"000001\.json: cannot be written: file too large"):
            opened.save({"variant": "a", "trial": 1, "text": "x" * 1000}, None)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [path.name for path in (tmp_path / "c").rglob("*") if path.is_file()] == ["000000.json"]
