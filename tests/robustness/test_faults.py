"""Faults while a command runs: killed, interrupted, a full disk, nowhere to write, a clock that is set.

Whatever happens, a file under its own name is whole, and what a command leaves is what it says.
"""

import ctypes
import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import auvsim
from auvsim.cli import main
from auvsim.data import log
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import run

HOME = Path(auvsim.__file__).parent.parent
CODES = (0, 1, 2, 130)
COMMANDS = {
    "dock": ["dock", "--no-video", "--duration", "900", "--seed", "3"],
    "run": ["run", "three_vehicles", "--no-video"],
    "manoeuvre": ["manoeuvre", "zigzag", "circle"],
    "identify": ["identify", "zigzag.nc"],
    "reproduce": ["reproduce", "paper1", "--quick", "--jobs", "1"],
}


@pytest.fixture(scope="module")
def zigzag(tmp_path_factory) -> bytes:
    """A log to identify from."""
    path = tmp_path_factory.mktemp("log") / "zigzag.nc"
    run(scenario.parse(sampling.draw(sampling.manoeuvre_plan("zigzag"), 1)), seed=1, path=path)
    return path.read_bytes()


def limited(size: int) -> Callable[[], None]:
    """Makes a process whose files cannot grow beyond a size [bytes], as on a full disk."""

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # so that a write fails, as with ENOSPC
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    return limit


def not_almighty() -> None:
    """Takes from root, as which containers run tests, the right to write where permissions forbid it."""
    unignored()
    override, drop_from_bounding_set = 1, 24  # CAP_DAC_OVERRIDE, PR_CAPBSET_DROP; it holds from the next exec on
    if os.getuid() == 0 and ctypes.CDLL(None, use_errno=True).prctl(drop_from_bounding_set, override, 0, 0, 0):
        os._exit(77)


def unignored() -> None:
    """Takes Ctrl-C as from a terminal, also where the tests run in the background."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def begun(folder: Path, name: str, before: Callable[[], None] = unignored, **environment: str) -> subprocess.Popen:
    """A command that has begun in a folder."""
    return subprocess.Popen(
        [sys.executable, "-m", "auvsim", *COMMANDS[name], "--out", "out"],
        cwd=folder, text=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, preexec_fn=before,
        env={**os.environ, "PYTHONPATH": str(HOME), **environment},
    )  # fmt: skip


def ended(process: subprocess.Popen, name: str) -> str:
    """The lines of an ended command on standard error, checked for all that always holds."""
    _, said = process.communicate(timeout=300)
    # Where Ctrl-C came while C code ran Python's, Python ends by the signal itself, of which a shell makes 130 as well.
    code = 128 + signal.SIGINT if process.returncode == -signal.SIGINT else process.returncode
    assert code in CODES, (name, code, said)
    assert "Traceback" not in said
    lines = [line for line in said.splitlines() if line.startswith("auvsim: ")]
    assert len(lines) == (code != 0), said
    return lines[-1] if lines else ""


def check_left(folder: Path, *, partial: bool = False) -> None:
    """Sees that what stands under its own name is whole, and nothing partial is left unless it was killed."""
    for path in (folder / "out").rglob("*.nc"):
        if ".partial" not in path.name:
            assert log.read(path).attributes["status"] in ("complete", "interrupted", "diverged")
    for path in (folder / "out").rglob("*.json"):
        assert path.read_text().endswith("}\n")
    if not partial:
        assert not [*folder.rglob(".*partial*")]


def stop(folder: Path, name: str, number: signal.Signals, after: float) -> tuple[int, str]:
    """Sends a signal after a time [s]; the exit code and what was said."""
    process = begun(folder, name)
    time.sleep(after)
    process.send_signal(number)
    if number is signal.SIGKILL:
        process.communicate(timeout=60)
        return process.returncode, ""
    return process.returncode if process.poll() is not None else 0, ended(process, name)


def moments(name: str, count: int) -> list[float]:
    """Random times to strike at [s], the same for each command each time."""
    return [random.Random(f"{name} {k}").uniform(1.2, 7.0) for k in range(count)]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["ctrl_c", "term"])
def test_a_signal_keeps_what_was_recorded(tmp_path, number: signal.Signals) -> None:
    """The log stands under its name, its status interrupted; exit code 130."""
    process = begun(tmp_path, "run")
    partial: list[Path] = []
    while not partial and process.poll() is None:  # until it records, however busy the machine is
        partial = [*tmp_path.rglob(".*partial*")]
        time.sleep(0.05)
    time.sleep(0.5)
    process.send_signal(number)
    line = ended(process, "run")
    assert process.returncode == 130
    assert line == f"auvsim: interrupted; {Path('out') / 'trial.nc'} holds the run up to there"
    assert log.read(tmp_path / "out" / "trial.nc").attributes["status"] == "interrupted"
    check_left(tmp_path)


def test_a_full_disk_is_one_line(tmp_path) -> None:
    """Of a log that does not fit nothing is left."""
    process = begun(tmp_path, "manoeuvre", limited(30_000), NUMBA_CACHE_DIR=os.environ.get("NUMBA_CACHE_DIR", ""))
    line = ended(process, "manoeuvre")
    assert process.returncode == 2
    assert "cannot be written: File too large" in line
    check_left(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM], ids=["kill", "ctrl_c", "term"])
@pytest.mark.parametrize("name", COMMANDS)
def test_signals_at_random_times(tmp_path, zigzag, name: str, number: signal.Signals) -> None:
    """Five moments each; the next run of the command is not hindered by what is left."""
    for k, after in enumerate(moments(name, 5)):
        folder = tmp_path / str(k)
        folder.mkdir()
        (folder / "zigzag.nc").write_bytes(zigzag)
        stop(folder, name, number, after)
        check_left(folder, partial=number is signal.SIGKILL)


@pytest.mark.slow
@pytest.mark.parametrize("size", [0, 3_000, 30_000, 100_000, 300_000, 1_000_000])
@pytest.mark.parametrize("name", COMMANDS)
def test_a_disk_that_is_full_at_any_file(tmp_path, zigzag, name: str, size: int) -> None:
    """Files that cannot grow beyond a size: one after another the log, a table, a picture fails."""
    (tmp_path / "zigzag.nc").write_bytes(zigzag)
    process = begun(tmp_path, name, limited(size))
    ended(process, name)
    check_left(tmp_path)


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n != "dock")) for n in COMMANDS])
def test_a_folder_that_may_not_be_written(tmp_path, zigzag, name: str) -> None:
    """One line before anything runs."""
    (tmp_path / "zigzag.nc").write_bytes(zigzag)
    tmp_path.chmod(0o500)
    process = begun(tmp_path, name, not_almighty)
    try:
        if process.wait(300) == 77:
            pytest.skip("root cannot be kept from writing here")
        line = ended(process, name)
    finally:
        tmp_path.chmod(0o700)
    assert process.returncode == 2
    assert "cannot be written to" in line
    assert [path.name for path in tmp_path.iterdir()] == ["zigzag.nc"]


def test_a_file_where_the_folder_should_be(tmp_path, monkeypatch, capsys) -> None:
    """One line, and the file is as it was."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out").write_text("mine")
    for name in ("dock", "run", "manoeuvre", "reproduce"):
        assert main([*COMMANDS[name], "--out", "out"]) == 2
        assert "out: cannot be written to: it is a file, not a folder" in capsys.readouterr().err
    assert (tmp_path / "out").read_text() == "mine"


def test_a_clock_that_is_set_back_and_forth(tmp_path, monkeypatch) -> None:
    """Between any two looks at it, by years: the same log, bit for bit, but for the time it took."""
    values = {"duration": 20.0, "vehicle": {"start": {"range": 100.0}}}
    before = run(scenario.parse(values), seed=5, path=tmp_path / "before.nc")
    jumps = random.Random(1)
    monkeypatch.setattr(time, "time", lambda: jumps.uniform(-1e9, 4e9))
    monkeypatch.setattr(time, "time_ns", lambda: jumps.randrange(4 * 10**18))
    after = run(scenario.parse(values), seed=5, path=tmp_path / "after.nc")
    assert log.differences(before, after) == []
    assert log.differences(log.read(tmp_path / "before.nc"), log.read(tmp_path / "after.nc")) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_whose_clock_is_set_back_and_forth(tmp_path, zigzag, name: str) -> None:
    """Between any two looks at the clock, by years, in the command and in its workers: it ends as ever."""
    (tmp_path / "zigzag.nc").write_bytes(zigzag)
    start = tmp_path / "start"
    start.mkdir()
    (start / "sitecustomize.py").write_text(
        "import random, time\n"
        "jumps = random.Random(1)\n"
        "time.time = lambda: jumps.uniform(0.0, 4e9)\n"
        "time.time_ns = lambda: jumps.randrange(4 * 10**18)\n"
    )
    process = begun(tmp_path, name, PYTHONPATH=f"{start}{os.pathsep}{HOME}")
    assert ended(process, name) == ""
    assert process.returncode == 0
    assert [*(tmp_path / "out").rglob("*.*")]
    check_left(tmp_path)
