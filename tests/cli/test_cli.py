"""The command line: what it takes, what it leaves on disk, how it fails. The trial itself is a stand-in here."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import empty_log, trial_log, writer

import auvsim
from auvsim import cli
from auvsim.base.errors import AuvsimError
from auvsim.base.renderer import choose_renderer
from auvsim.cli import options
from auvsim.data.log import read, write
from auvsim.physics import fluid
from auvsim.simulation.sampling import default_plan, draw
from auvsim.simulation.scenario import parse

ALL = {"trial.nc", "summary.json", "track.png", "estimates.png", "docking.mp4"}


class Recorder(SimpleNamespace):
    """What the stand-ins were called with, and what they are to do."""

    scenario: Any = None
    durations: list[float]
    seed: int = -1
    trial: int = -1
    status: str = "complete"
    opengl: bool = True
    error: BaseException | None = None


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> Recorder:
    """Replaces the trial and what draws; metrics and log are the real ones."""
    recorder = Recorder(durations=[])

    class DrawingError(AuvsimError):
        pass

    def run(scenario, *, seed=0, trial=0, progress=None, path=None):
        log = made(scenario, seed, trial, progress)
        if path is not None:
            write(log, path)
        return log

    def made(scenario, seed, trial, progress):
        recorder.scenario, recorder.seed, recorder.trial = scenario, seed, trial
        recorder.durations.append(scenario.duration)
        if recorder.error:
            raise recorder.error
        if progress:
            for t in (0.0, 300.0, 600.0):
                progress(SimpleNamespace(time=t, duration=600.0, phase="homing", range=300.0 - t / 2))
        if recorder.status == "diverged":
            log = writer()
            log.event(1.5, "diverged", "speed 1e+09 m/s at 1.5 s; use a smaller step")
            return log.finish("diverged", wall_time=0.1).log
        return (trial_log() if recorder.status == "complete" else empty_log(recorder.status)).log

    def picture(log, path):
        Path(path).write_bytes(b"picture")

    def render(log, path, *, speed=None, cameras=(), progress=None):
        Path(path).write_bytes(b"half")
        if not recorder.opengl:
            raise DrawingError("no OpenGL")
        if progress:
            progress(1, 2)
        Path(path).write_bytes(b"video")

    import auvsim.analysis.plots
    import auvsim.simulation.run
    import auvsim.video

    monkeypatch.setattr(auvsim.simulation.run, "run", run)
    monkeypatch.setattr(auvsim.analysis.plots, "track", picture)
    monkeypatch.setattr(auvsim.analysis.plots, "estimates", picture)
    monkeypatch.setattr(auvsim.video, "render", render)
    monkeypatch.setattr(auvsim.video, "DrawingError", DrawingError)
    monkeypatch.setattr(fluid, "is_warm", lambda: True)
    return recorder


def files(folder: Path) -> set[str]:
    """Names in a folder."""
    return {path.name for path in folder.iterdir()}


def fails(capsys: pytest.CaptureFixture, *arguments: object) -> str:
    """The one line on standard error of a command that leaves with 2."""
    assert cli.main([str(argument) for argument in arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("auvsim: ")
    assert captured.err.count("\n") == 1
    return captured.err


def test_dock_leaves_whole_files(stand_in: Recorder, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """All five files, nothing temporary; the default scenario of seed 3, trial 2; a table at the end."""
    out = tmp_path / "new" / "out"
    assert cli.main(["dock", "--seed", "3", "--trial", "2", "--out", str(out)]) == 0
    assert files(out) == ALL
    assert (stand_in.seed, stand_in.trial) == (3, 2)
    assert stand_in.scenario == parse(draw(default_plan(), 3, 2))
    assert read(out / "trial.nc").attributes["status"] == "complete"
    assert json.loads((out / "summary.json").read_text())["docked"] is True
    assert "docked" in capsys.readouterr().out


def test_no_video(stand_in: Recorder, tmp_path: Path) -> None:
    """Nothing is drawn, and the video of an earlier trial does not stay beside another's log."""
    (tmp_path / "docking.mp4").write_text("of an earlier trial")
    assert cli.main(["dock", "--no-video", "--out", str(tmp_path)]) == 0
    assert files(tmp_path) == ALL - {"docking.mp4"}


def test_without_opengl(stand_in: Recorder, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """The trial is worth keeping; how to get the video is said."""
    stand_in.opengl = False
    assert cli.main(["dock", "--out", str(tmp_path)]) == 0
    assert files(tmp_path) == ALL - {"docking.mp4"}
    error = capsys.readouterr().err
    assert "apt-get install libegl1 libgl1" in error
    assert f"auvsim video {tmp_path}/trial.nc" in error
    assert "no OpenGL" in fails(capsys, "video", tmp_path / "trial.nc")


def test_first_run_says_that_it_compiles(
    stand_in: Recorder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """A line before, then the whole trial; Ctrl-C while compiling ends the command, not only the compilation."""
    monkeypatch.setattr(fluid, "is_warm", lambda: False)
    assert cli.main(["dock", "--out", str(tmp_path / "out")]) == 0
    assert "compiling hydrodynamics and estimator (this once" in capsys.readouterr().err
    assert stand_in.durations == [30.0, stand_in.scenario.duration]
    stand_in.status = "interrupted"
    assert cli.main(["dock", "--out", str(tmp_path / "other")]) == 130
    assert len(stand_in.durations) == 3
    assert files(tmp_path) == {"out"}


def test_diverged(stand_in: Recorder, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """Exit code 1, the diagnosis, the log up to there and its verdict."""
    stand_in.status = "diverged"
    assert cli.main(["dock", "--out", str(tmp_path)]) == 1
    assert files(tmp_path) == {"trial.nc", "summary.json"}
    assert "speed 1e+09 m/s at 1.5 s; use a smaller step" in capsys.readouterr().err


def test_interrupted(stand_in: Recorder, tmp_path: Path) -> None:
    """Exit code 130; the log up to there is a whole file."""
    stand_in.status = "interrupted"
    assert cli.main(["dock", "--out", str(tmp_path)]) == 130
    assert files(tmp_path) == {"trial.nc"}
    assert read(tmp_path / "trial.nc").attributes["status"] == "interrupted"


def test_interrupted_while_drawing(
    stand_in: Recorder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """What was finished stays, what was begun goes."""

    def interrupt(log, path, **options):
        Path(path).write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules["auvsim.video"], "render", interrupt)
    assert cli.main(["dock", "--out", str(tmp_path)]) == 130
    assert files(tmp_path) == ALL - {"docking.mp4"}


@pytest.mark.parametrize("error", [AuvsimError("no vehicle 'remus'; there are remus100"), KeyboardInterrupt()])
def test_failure_before_the_first_step_leaves_nothing(
    stand_in: Recorder, tmp_path: Path, error: BaseException, capsys: pytest.CaptureFixture
) -> None:
    """New folders go again, old ones stay as they were."""
    stand_in.error = error
    code = 130 if isinstance(error, KeyboardInterrupt) else 2
    assert cli.main(["dock", "--out", str(tmp_path / "a" / "b")]) == code
    assert files(tmp_path) == set()
    (tmp_path / "trial.nc").write_text("of an earlier trial")
    assert cli.main(["dock", "--out", str(tmp_path)]) == code
    assert (tmp_path / "trial.nc").read_text() == "of an earlier trial"


def test_files_and_options_pin(stand_in: Recorder, tmp_path: Path) -> None:
    """An option beats the file, the file beats the plan; the rest is drawn as ever."""
    path = tmp_path / "s.yaml"
    path.write_text("current: {speed: 0.1, direction_deg: 90}\nduration: 1e3\n")
    arguments = "--current.speed 0.2 --vehicle.start.bearing-deg=-30 --sensors.usbl.jitter 0 --estimator a.b:c"
    assert cli.main(["dock", *arguments.split(), str(path), "--seed", "3", "--out", str(tmp_path / "out")]) == 0
    scenario, free = stand_in.scenario, parse(draw(default_plan(), 3))
    assert scenario.water.current.model_dump() == {"kind": "uniform", "speed": 0.2, "direction_deg": 90.0, "down": 0.0}
    assert scenario.duration == 1000.0
    (_, vehicle), (_, unpinned) = scenario.lone, free.lone
    assert vehicle.start.bearing_deg == -30.0
    assert vehicle.start.range == unpinned.start.range
    assert scenario.structures == free.structures
    assert vehicle.sensors.usbl.jitter == 0.0
    assert vehicle.estimator.kind == "a.b:c"


def test_options_may_change_the_kind(stand_in: Recorder, tmp_path: Path) -> None:
    """In any order, whole mappings too, and distributions."""
    out = ["--no-video", "--out", str(tmp_path)]
    for arguments in (
        ["--current.kind", "gust", "--current.intensity", "0.2"],
        ["--current.intensity=0.2", "--current.kind=gust"],
        ["--current", "{kind: gust}", "--current.intensity", "0.2"],
        ["--current", "{kind: gust, intensity: 0.2}"],
    ):
        assert cli.main(["dock", *arguments, *out]) == 0
        assert stand_in.scenario.water.current.model_dump()["intensity"] == 0.2
    assert cli.main(["dock", "--duration.uniform", "[100, 101]", *out]) == 0
    assert 100.0 <= stand_in.scenario.duration <= 101.0


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ("dock --current.sped 1", "no option or scenario key --current.sped; did you mean --current.speed?"),
        ("dock --sede 3", "no option or scenario key --sede; did you mean --seed?"),
        ("dock --curent.speed 1", "did you mean --current.speed?"),
        ("dock --current.speed", "--current.speed needs a value"),
        ("dock --current.speed --seed 3", "--current.speed needs a value"),
        ("dock --current.speed fast", "command line: current.speed: fast should be a valid number"),
        ("dock --current.speed -1", "current.speed: -1 should be greater than or equal to 0 (horizontal speed [m/s])"),
        ("dock --current.speed .nan", "current.speed: .nan should be a finite number"),
        ("dock --current.speed [1", "--current.speed:1: not YAML"),
        ("dock --duration 3 --duration.x 4", "contradicts"),
        ("dock --rates.filter 3", "rates.filter: 3 Hz does not divide the control rate 10 Hz; use 2 or 5 Hz"),
        ("dock --duration.uniform [2,1]", "duration: {uniform: [2, 1]}: low must not exceed high"),
        ("dock --current.kind gust --current.speed 1", "current.speed: unknown key"),
        ("dock --seed x", "Error parsing --seed: invalid literal"),
        ("dock --seed -1", "seed -1, trial 0: both must be whole numbers >= 0"),
        ("dock none.yaml", "none.yaml: cannot be read: No such file"),
        ("dock a.yaml b.yaml", "Unrecognized"),
        ("dok", "Unrecognized options: dok"),
        ("", "Expected one of {dock, "),
        ("video", "Missing from auvsim video: TRIAL.nc"),
        ("video none.nc", "none.nc: no such file"),
        ("scenario --default --duration 3", "takes no file and no keys"),
    ],
)
def test_bad_arguments_are_one_line(
    arguments: str, text: str, capsys: pytest.CaptureFixture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 2, one line, nothing made."""
    monkeypatch.chdir(tmp_path)
    assert text in fails(capsys, *arguments.split())
    assert files(tmp_path) == set()


def test_errors_of_a_file_name_its_line(capsys: pytest.CaptureFixture, tmp_path: Path) -> None:
    """File, line, key, what would be right."""
    path = tmp_path / "s.yaml"
    for text, message in (
        ("vehicle:\n  start:\n    dept: 3\n", "3: vehicle.start.dept: unknown key; did you mean vehicle.start.depth?"),
        ("\n\nsensors: {compass: {rate: 7}}\n", "3: sensors.compass.rate: 7 Hz does not divide the control rate"),
        ("current: {kind: uniform\nspeed: 3", "2: not YAML"),
        ("duration: 1\nduration: 2\n", "2: the key 'duration' is given twice"),
        ("rates:\n", "1: rates: null should be a mapping"),
    ):
        path.write_text(text)
        assert f"auvsim: {path}:{message}" in fails(capsys, "dock", path, "--out", tmp_path / "out")
    assert files(tmp_path) == {"s.yaml"}


@pytest.mark.parametrize("where", ["file", "file/below", "proc"])
def test_unwritable_folder(stand_in: Recorder, where: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """Seen before the trial runs."""
    (tmp_path / "file").touch()
    out = Path("/proc/nowhere") if where == "proc" else tmp_path / where
    assert f"{out}: cannot be written to" in fails(capsys, "dock", "--out", out)
    assert stand_in.scenario is None
    assert files(tmp_path) == {"file"}


@pytest.mark.parametrize(
    ("command", "made"),
    [("video", {"docking.mp4"}), ("plot", {"track.png", "estimates.png"}), ("metrics", {"summary.json"})],
)
def test_made_again_from_the_log_alone(stand_in: Recorder, tmp_path: Path, command: str, made: set[str]) -> None:
    """Each command makes its files beside the log, given the file or its folder."""
    write(trial_log().log, tmp_path / "trial.nc")
    assert cli.main([command, str(tmp_path / "trial.nc")]) == 0
    assert files(tmp_path) == {"trial.nc"} | made
    assert cli.main([command, str(tmp_path)]) == 0
    assert stand_in.scenario is None


@pytest.mark.parametrize("command", ["video", "plot", "metrics"])
def test_truncated_log(tmp_path: Path, capsys: pytest.CaptureFixture, command: str) -> None:
    """Named, and nothing is made."""
    path = tmp_path / "trial.nc"
    write(trial_log().log, path)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    assert str(path) in fails(capsys, command, path)
    assert files(tmp_path) == {"trial.nc"}


def test_scenario_prints_a_plan_that_reads_back(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """The default text used as a file changes nothing; options show in the text."""
    assert cli.main(["scenario", "--default"]) == 0
    path = tmp_path / "default.yaml"
    path.write_text(capsys.readouterr().out)
    assert options.scenario(path, None, {}, 5, 1) == parse(draw(default_plan(), 5, 1))
    assert cli.main(["scenario", str(path), "--current.kind", "turning", "--current.angle_deg", "45"]) == 0
    text = capsys.readouterr().out
    assert "kind: turning\n" in text
    assert "  angle_deg: 45  # angle of the turn" in text


def test_version(capsys: pytest.CaptureFixture) -> None:
    """The package's own."""
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"auvsim {auvsim.__version__}\n"


@pytest.mark.parametrize(
    ("environment", "libraries", "chosen"),
    [
        ({}, {"libEGL.so.1", "libGL.so.1"}, "egl"),
        ({}, {"libEGL.so.1"}, "disable"),
        ({}, set(), "disable"),
    ],
)
def test_renderer(environment: dict[str, str], libraries: set[str], chosen: str | None) -> None:
    """EGL where nothing was chosen, there is no display, and the libraries load; nothing where they do not."""
    choose_renderer(environment, libraries.__contains__)
    assert environment.get("MUJOCO_GL") == chosen


def test_renderer_is_chosen_before_mujoco_is_imported() -> None:
    """MuJoCo looks at the variable only once, when it is imported."""
    code = (
        "import ctypes, os, sys; ctypes.CDLL = lambda name: None\n"
        "from auvsim.cli import main; assert 'mujoco' not in sys.modules\n"
        "class Finder:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'mujoco': print(os.environ.get('MUJOCO_GL')); os._exit(0)\n"
        "sys.meta_path.insert(0, Finder()); main(['dock', '--duration', '1'])"
    )
    environment = {key: value for key, value in os.environ.items() if key not in ("MUJOCO_GL", "DISPLAY")}
    environment["PYTHONPATH"] = os.pathsep.join(sys.path)
    done = subprocess.run([sys.executable, "-uc", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "egl"


def test_help_answers_at_once() -> None:
    """Nothing heavy is imported: MuJoCo, SciPy and NumPy alone would take more than half a second."""
    code = (
        "import sys; from auvsim.cli import main\ntry: main(['--help'])\nexcept SystemExit: pass\nprint(*sys.modules)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert not {"mujoco", "scipy", "numpy", "numba", "casadi", "pydantic", "matplotlib"} & set(done.stdout.split())


def test_broken_pipe_is_quiet() -> None:
    """`auvsim scenario --default | head -1` ends without a traceback."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-m", "auvsim", "scenario", "--default"]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


def test_ctrl_c_before_the_trial(tmp_path: Path) -> None:
    """A real signal to a real process that has not begun to run: 130, and no file."""
    code = (
        "import sys, time\nfrom auvsim.cli import main, options\n"
        "options.scenario = lambda *a: (print('ready', flush=True), time.sleep(60))\n"
        "sys.exit(main(['dock', '--out', sys.argv[1]]))"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    out = tmp_path / "out"
    with subprocess.Popen([sys.executable, "-c", code, out], env=environment, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 130
    assert files(tmp_path) == set()


def test_progress_does_not_slow_the_trial() -> None:
    """A call costs little: the bar is drawn ten times a second at most."""
    from auvsim.cli.report import TrialProgress

    state = SimpleNamespace(time=1.0, duration=600.0, phase="homing", range=300.0)
    with TrialProgress() as progress:
        times = []
        for _ in range(5):
            start = time.perf_counter()
            for _ in range(1000):
                progress(state)
            times.append(time.perf_counter() - start)
    assert np.min(times) < 1000 * 20e-6  # a control tick may cost 100 microseconds in all; 1 is usual here


def test_video_options_reach_the_drawing(
    stand_in: Recorder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """Cameras and speed for the video, a time for the still; a time alone is refused."""
    asked: list[tuple] = []
    drawing = sys.modules["auvsim.video"]
    monkeypatch.setattr(drawing, "render", lambda log, path, **options: asked.append(("render", options)))
    monkeypatch.setattr(
        drawing, "still", lambda log, path, time, **options: asked.append(("still", path, time, options)), raising=False
    )
    assert cli.main(["dock", "--no-video", "--out", str(tmp_path)]) == 0
    log = str(tmp_path / "trial.nc")
    cli.main(["video", log, "--camera", "dock", "follow", "--speed", "10"])
    assert cli.main(["video", log, "--still", str(tmp_path / "one.png"), "--time", "12"]) == 0
    assert asked[0][1]["cameras"] == ("dock", "follow")
    assert asked[0][1]["speed"] == 10.0
    assert asked[1] == ("still", tmp_path / "one.png", 12.0, {"cameras": ()})
    capsys.readouterr()
    assert "--still" in fails(capsys, "video", log, "--time", "12")
