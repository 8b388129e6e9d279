import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from log_samples import ATTRIBUTES, GROUP_ATTRIBUTES, groups, long_run, record, recorder, truth

from auvsim.base.errors import InputError
from auvsim.base.reading import Reading
from auvsim.data import recorder as module
from auvsim.data.log import differences, read
from auvsim.data.recorder import Recorder
from auvsim.data.variables import run_groups

OWN = "vehicles/remus100"


def test_truth_is_copied_when_it_is_logged():
    kept, now = recorder(), truth(1.0, (1.0, 2.0, 3.0), velocity=(1.0, 2.0, 0.5), current=(0.1, 0.2, 0.3))
    kept.truth("remus100", now)
    names = list(groups()["truth"].table)
    before = {name: np.copy(getattr(now, name)) for name in names}
    now.position[:] = now.nu[:] = now.actuators[:] = -1.0  # what a world does that reuses its arrays
    found = kept.finish("complete").vehicle()["truth"]
    assert list(found) == names
    for name, value in before.items():
        np.testing.assert_array_equal(found[name][0], value, err_msg=name)


def test_readings_go_to_their_sensor_with_its_own_columns():
    kept = recorder(vehicles=("auv_1", "auv_2"))
    packet = np.arange(7.0)
    kept.reading("auv_2", Reading("usbl", 1.0, np.nan, packet, 3), True, False)
    kept.reading("auv_1", Reading("compass", 2.0, 2.5, np.array([0.1, 0.2, 0.3]), 4))
    log = kept.finish("complete")
    usbl, compass = log.vehicle("auv_2")["usbl"], log.vehicle("auv_1")["compass"]
    assert np.isnan(usbl["received"]).tolist() == [True]
    assert (usbl["lost"].tolist(), usbl["outlier"].tolist(), usbl["sequence"].tolist()) == ([True], [False], [3])
    assert (usbl["time"].tolist(), usbl["value"].tolist()) == ([1.0], [packet.tolist()])
    assert (compass["time"].tolist(), compass["received"].tolist()) == ([2.0], [2.5])
    assert len(log.vehicle("auv_1")["usbl"]["time"]) == len(log.vehicle("auv_2")["compass"]["time"]) == 0


def test_rows_that_do_not_fit_are_named():
    kept = recorder()
    kept.append(f"{OWN}/command", (0.0, 0.1))
    with pytest.raises(InputError, match=f"'{OWN}/command' has 2 values, not 4: time, rudder"):
        kept.finish("complete")
    kept = recorder()
    kept.reading("remus100", Reading("compass", 0.0, 0.0, np.zeros(2)))
    with pytest.raises(InputError, match=r"'.*sensors/compass/value' should have shape \(1, 3\)"):
        kept.finish("complete")
    kept = recorder()
    kept.reading("remus100", Reading("compass", 0.0, 0.0, np.zeros(2)))
    kept.reading("remus100", Reading("compass", 0.0, 0.0, np.zeros(4)))  # six numbers in all
    with pytest.raises(InputError, match="the rows have different sizes"):
        kept.finish("complete")
    kept = recorder()
    kept.truth("remus100", truth(0.0, (0, 0, 0))._replace(actuators=np.zeros(3)))
    with pytest.raises(InputError, match=f"a row of '{OWN}/truth' should have 25 numbers"):
        kept.finish("complete")
    with pytest.raises(InputError, match="no status 'done'; there are complete"):
        recorder().finish("done")


def test_what_is_missing_is_said_before_the_run(tmp_path: Path):
    tables = run_groups({"remus100": groups()})
    attributes = {name: value for name, value in ATTRIBUTES.items() if name != "seed"}
    with pytest.raises(InputError, match="log: no attribute 'seed'"):
        Recorder(tables, attributes, GROUP_ATTRIBUTES, tmp_path / "log.nc")
    few = {path: group for path, group in tables.items() if not path.endswith("contact")}
    with pytest.raises(InputError, match="log: no group 'vehicles/remus100/contact'"):
        Recorder(few, ATTRIBUTES, GROUP_ATTRIBUTES, tmp_path / "log.nc")
    assert [*tmp_path.iterdir()] == []


# The log of a long run


@pytest.mark.parametrize("packed", [1, 7, 500, 4096])
def test_packing_and_streaming_change_no_bit(packed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Logs kept in memory in one piece, packed in pieces, and streamed to disk, of two vehicles."""
    whole = recorder(vehicles=("auv_1", "auv_2"))
    monkeypatch.setattr(module, "PACKED", 10**9)
    record(whole, "auv_1", waypoints=[(-60, 4), (-30, 1), (-0.5, 0.1)])
    expected = whole.finish("complete")
    monkeypatch.setattr(module, "PACKED", packed)
    path = tmp_path / "log.nc"
    for kept in (recorder(None, ("auv_1", "auv_2")), recorder(path, ("auv_1", "auv_2"))):
        record(kept, "auv_1", waypoints=[(-60, 4), (-30, 1), (-0.5, 0.1)])
        log = kept.finish("complete")
        assert differences(expected, log) == []
        assert log.tables == expected.tables
    assert differences(expected, read(path)) == []
    assert [entry.name for entry in tmp_path.iterdir()] == ["log.nc"]


def test_a_streamed_log_has_no_name_before_it_is_whole(tmp_path: Path):
    path = tmp_path / "log.nc"
    path.write_bytes(b"the older log")
    kept = recorder(path)
    record(kept, "remus100")
    assert path.read_bytes() == b"the older log"
    kept.finish("complete")
    assert len(read(path).vehicle()["truth"]["time"]) > 1000


def test_a_log_that_is_given_up_leaves_nothing(tmp_path: Path):
    with recorder(tmp_path / "log.nc") as kept:
        record(kept, "remus100")
    assert [*tmp_path.iterdir()] == []
    with recorder(tmp_path / "log.nc") as kept:
        record(kept, "remus100")
        kept.finish("complete")
    assert [entry.name for entry in tmp_path.iterdir()] == ["log.nc"]


def test_rows_that_do_not_fit_leave_no_file(tmp_path: Path):
    with recorder(tmp_path / "log.nc") as kept:
        kept.append(f"{OWN}/command", (0.0,))
        with pytest.raises(InputError, match="command' has 1 values"):
            kept.finish("complete")
    assert [*tmp_path.iterdir()] == []


ENDLESS = """
import sys
import numpy as np
from log_samples import recorder, truth
kept = recorder(sys.argv[1])
for tick in range(1_000_000):
    kept.truth("remus100", truth(0.1 * tick, (tick, 0, 5)))
    if tick == 10_000:
        print("streaming", flush=True)
"""


def test_a_killed_run_leaves_nothing_under_its_name(tmp_path: Path):
    path = tmp_path / "log.nc"
    with subprocess.Popen(
        [sys.executable, "-c", ENDLESS, path], env=_environment(), stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "streaming\n"
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    assert not path.exists()
    assert all(".partial" in entry.name for entry in tmp_path.iterdir())


FULL = """
import resource, sys
from log_samples import long_run, recorder
from auvsim.base.errors import InputError
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), int(sys.argv[2])))
try:
    long_run(recorder(sys.argv[1]))
except InputError as error:
    print(error)
"""


@pytest.fixture(scope="module")
def long_size(tmp_path_factory: pytest.TempPathFactory) -> int:
    """Size of the file of `long_run` [bytes]."""
    path = tmp_path_factory.mktemp("whole") / "log.nc"
    long_run(recorder(path))
    return path.stat().st_size


@pytest.mark.parametrize("share", [0.0, 0.001, 0.05, 0.5, 0.9999])
def test_a_full_disk_is_one_line_and_leaves_nothing(share: float, long_size: int, tmp_path: Path):
    """Limits of the file's size that are met at the start, while rows are packed, and when the file is closed."""
    path, limit = tmp_path / "log.nc", int(share * long_size)
    done = subprocess.run(
        [sys.executable, "-c", FULL, path, str(limit)], env=_environment(), capture_output=True, text=True, check=True
    )
    assert done.stdout == f"{path}: cannot be written: File too large\n"
    assert done.stderr == ""
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize("failing", ["fsync", "rename"])
def test_a_log_that_fails_at_the_end_leaves_nothing(failing: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    kept = recorder(tmp_path / "log.nc")
    record(kept, "remus100")
    target, name = (os, "fsync") if failing == "fsync" else (Path, "replace")
    monkeypatch.setattr(target, name, fail)
    with pytest.raises(InputError, match=r"log\.nc: cannot be written: No space left"):
        kept.finish("complete")
    assert [*tmp_path.iterdir()] == []


def test_streaming_where_there_is_no_folder(tmp_path: Path):
    with pytest.raises(InputError, match="cannot be written: No such file or directory"):
        recorder(tmp_path / "none" / "log.nc")


LONG = """
import resource, sys
import numpy as np
from log_samples import recorder, truth
from auvsim.base.reading import Reading
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
kept = recorder(*sys.argv[1:])
item, angles, five = truth(0.0, (1.0, 2.0, 5.0)), np.zeros(3), np.zeros(5)
start = peak()
for tick in range(108_000):
    time = 0.1 * tick
    kept.truth("remus100", item._replace(time=time))
    kept.reading("remus100", Reading("compass", time, time, angles + tick, tick))
    kept.reading("remus100", Reading("depth", time, time, angles[:1] + tick, tick))
    kept.reading("remus100", Reading("feedback", time, time, five + tick, tick))
    kept.append("vehicles/remus100/mission", (time, 1, 0.1 * tick, 5.0, 1.5, 1, 0.0, 0.0))
    kept.append("vehicles/remus100/command", (time, 0.1 * tick, 0.0, 150.0))
log = kept.finish("complete")
assert len(log.vehicle()["truth"]["time"]) == 108_000
print(peak() - start)
"""


@pytest.mark.parametrize("streamed", [False, True])
def test_three_hours_take_less_than_150_mb(streamed: bool, tmp_path: Path):
    """Peak of the resident memory above the start, the finished log included: 10 Hz of truth, sensors and commands."""
    arguments = [str(tmp_path / "log.nc")] if streamed else []
    done = subprocess.run(
        [sys.executable, "-c", LONG, *arguments], env=_environment(), capture_output=True, text=True, check=True
    )
    assert float(done.stdout) < 150.0


def _environment() -> dict[str, str]:
    """Environment of a process that finds this folder and auvsim."""
    here = Path(__file__).parent
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(here), str(here.parents[1])])}
