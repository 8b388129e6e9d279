"""Machines that are not as they should be: no OpenGL, a dead display, nowhere to write, no terminal."""

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

import auvsim
from auvsim.base.compiled import choose_cache
from auvsim.base.renderer import answers, choose_renderer
from auvsim.cli import report

HOME = Path(auvsim.__file__).parent.parent
ALL = {"libEGL.so.1", "libGL.so.1", "libOSMesa.so.8"}


def command(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess:
    """`python -m auvsim` in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "auvsim", *arguments],
        capture_output=True, text=True, cwd=folder, check=False,
        env={**os.environ, "PYTHONPATH": str(HOME), **environment},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("given", "libraries", "display", "set_to", "says"),
    [
        ({"MUJOCO_GL": "foo"}, ALL, False, "disable", "MUJOCO_GL=foo is unknown; set it to egl, osmesa or glfw"),
        ({"MUJOCO_GL": "osmesa"}, ALL - {"libOSMesa.so.8"}, False, "disable", "MUJOCO_GL=osmesa needs libOSMesa.so.8"),
        ({"MUJOCO_GL": "osmesa"}, ALL, False, "osmesa", ""),
        ({"MUJOCO_GL": "egl"}, {"libGL.so.1"}, False, "disable", "MUJOCO_GL=egl needs libEGL.so.1, which cannot"),
        ({"MUJOCO_GL": "egl"}, set(), False, "disable", "MUJOCO_GL=egl needs libEGL.so.1 and libGL.so.1"),
        ({"MUJOCO_GL": "EGL"}, ALL, False, "EGL", ""),
        ({"MUJOCO_GL": "glfw"}, set(), False, "glfw", ""),
        ({"DISPLAY": ":9"}, ALL, False, "egl", "no X server answers at DISPLAY=:9; unset DISPLAY"),
        ({"DISPLAY": ":9"}, set(), False, "disable", "no X server answers at DISPLAY=:9; unset DISPLAY"),
        ({"DISPLAY": ":9"}, ALL, True, None, ""),
        ({}, ALL, False, "egl", ""),
        ({}, {"libEGL.so.1"}, False, "disable", ""),
    ],
)
def test_what_cannot_draw_is_turned_off(given, libraries, display, set_to, says) -> None:
    """MuJoCo could not even be imported with it; what can is left as it is."""
    environment = dict(given)
    note = choose_renderer(environment, libraries.__contains__, lambda _: display)
    assert environment.get("MUJOCO_GL") == set_to
    assert note.startswith(says)
    assert bool(note) == bool(says)


def test_a_display_is_one_that_answers(tmp_path) -> None:
    """A socket that listens, on this machine or by its address; no other, and no text that is no display."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1] - 6000
        if port > 0:
            assert answers(f"127.0.0.1:{port}.0")
    assert not answers(f"127.0.0.1:{max(port, 1)}.0")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("\0/tmp/.X11-unix/X7361")
        server.listen()
        assert answers(":7361")
    assert not answers(":7361")
    assert not answers("nonsense")


def test_runs_with_an_opengl_that_does_not_exist(tmp_path) -> None:
    """Everything but drawing works, and drawing says why it does not."""
    done = command(tmp_path, "dock", "--no-video", "--duration", "2", "--out", "run", MUJOCO_GL="foo")
    assert done.returncode == 0, done.stderr
    done = command(tmp_path, "video", "run/trial.nc", "--still", "x.png", MUJOCO_GL="foo")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert done.stderr.strip().endswith("MUJOCO_GL=foo is unknown; set it to egl, osmesa or glfw, or unset it")


@pytest.mark.parametrize(
    ("writable", "kept"),
    [("__pycache__", False), (".cache", False), ("nothing", True)],
)
def test_a_temporary_cache_where_nothing_can_be_written(writable: str, kept: bool) -> None:
    """Only then; in a folder that nobody else can write to."""
    environment = {"HOME": "/home/of/nobody"}
    note = choose_cache(environment, lambda folder: writable in str(folder))
    assert bool(note) == kept == ("NUMBA_CACHE_DIR" in environment)
    if kept:
        folder = Path(environment["NUMBA_CACHE_DIR"])
        assert str(folder) in note
        assert folder.stat().st_mode & 0o777 == 0o700
    chosen = {"NUMBA_CACHE_DIR": "/mine"}
    assert choose_cache(chosen, lambda folder: False) == ""
    assert chosen == {"NUMBA_CACHE_DIR": "/mine"}


def test_a_folder_of_somebody_elses_is_no_cache(tmp_path, monkeypatch) -> None:
    """One that others may write to could hold their code."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    taken = tmp_path / f"auvsim-compiled-{os.getuid()}"
    taken.mkdir()
    taken.chmod(0o777)
    environment: dict[str, str] = {}
    choose_cache(environment, lambda folder: False)
    assert Path(environment["NUMBA_CACHE_DIR"]) not in (taken, tmp_path)
    assert Path(environment["NUMBA_CACHE_DIR"]).is_dir()


@pytest.mark.slow  # compiles everything once
def test_a_corrupt_cache_is_named(tmp_path) -> None:
    """The folder and what to delete, in one line."""
    run = ("dock", "--no-video", "--duration", "2", "--out", "run")
    assert command(tmp_path, *run, NUMBA_CACHE_DIR=str(tmp_path / "cache")).returncode == 0
    for index in (tmp_path / "cache").rglob("*.nbi"):
        index.write_bytes(index.read_bytes()[:40])
    done = command(tmp_path, *run, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    line = done.stderr.splitlines()[-1]
    assert done.returncode in (0, 1)
    if done.returncode:
        assert f"compiled code in {tmp_path / 'cache'}" in line
        assert "delete its .nbi and .nbc files" in line
        assert "Traceback" not in done.stderr


def test_lines_where_there_is_no_terminal(monkeypatch, capsys) -> None:
    """One in each half minute, not one in each call."""
    now = [100.0]
    monkeypatch.setattr(report.time, "monotonic", lambda: now[0])
    with report.StudyProgress() as progress:
        for second in range(100):
            now[0] = 100.0 + second
            progress(second, 100.0)
    assert capsys.readouterr().err.splitlines() == ["study: 30%", "study: 60%", "study: 90%"]
