"""Ctrl-C, which reaches every process of the terminal, ends a campaign with one line, on both engines."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from auvsim import cli
from auvsim.campaign.folder import open_folder

PLAN = "trials: 2000\nvariants: {short: {duration: 20}}\n"


@pytest.mark.parametrize("engine", ["local", "dask"])
def test_ctrl_c_is_one_line(engine: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What is finished is kept and can be reported; nothing but the progress is said before."""
    if engine == "dask":
        pytest.importorskip("distributed", reason="no Dask: pip install 'auvsim[cluster]'")
    (tmp_path / "plan.yaml").write_text(PLAN)
    options = ["plan.yaml", "--out", "c", "--jobs", "1", "--engine", engine]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = subprocess.Popen(
        [sys.executable, "-m", "auvsim", "campaign", *options],
        cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    assert command.stderr is not None
    for line in command.stderr:  # the first trial is done
        assert " done " in line
        break
    os.killpg(command.pid, signal.SIGINT)
    said, told = command.communicate(timeout=60.0)
    assert (command.returncode, said) == (130, "")
    *progress, last = told.splitlines()
    assert all(" done " in line for line in progress)
    assert last == "auvsim: interrupted; what is finished is kept, `auvsim campaign c` goes on"
    done = list(open_folder(tmp_path / "c").records())
    assert 1 <= len(done) < 2000
    assert cli.main(["report", str(tmp_path / "c")]) == 0
    assert f"plan: {len(done)} docking trials" in capsys.readouterr().out
