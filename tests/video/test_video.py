"""The video shows what the log says: places and attitudes, order and speed, in pictures that can be read."""

import dataclasses
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import av
import matplotlib.image
import mujoco
import numpy as np
import pytest
from synthetic import CURRENT, trial_log

from auvsim import video
from auvsim.base.errors import InputError
from auvsim.base.frames import flip
from auvsim.data import log as logs
from auvsim.missions.docking.dock_frame import nose_position
from auvsim.missions.docking.guidance import Phase
from auvsim.simulation import scenario
from auvsim.video import overlay
from auvsim.video.cameras import FIELD, MARGIN, Cameras, project
from auvsim.video.canvas import Box, Canvas
from auvsim.video.layer import DOT, Layer, Mark
from auvsim.video.marks import ESTIMATE, TRUE
from auvsim.video.playback import Playback
from auvsim.video.stage import Stage, layout
from auvsim.video.storyboard import DOCKING, HOLD, LONGEST, RAMP, Frame, storyboard

SMALL: dict[str, Any] = {"width": 320, "height": 240}


@pytest.fixture(scope="module")
def log() -> logs.TrialLog:
    """A made-up trial of three minutes that docks, with moving fins and the scenario that its models come from."""
    made_up = trial_log()
    count = len(made_up["truth"]["time"])
    fins = 0.1 * np.sin(np.arange(4 * count).reshape(count, 4))
    phase = made_up["guidance"]["phase"].copy()
    phase[-20:] = Phase.DOCKED  # for the last 2 s
    docking = changed(made_up, truth={"fins": fins}, guidance={"phase": phase})
    return logs.TrialLog(docking.groups, {**docking.attributes, "scenario": scenario.to_yaml(scenario.Scenario())})


@pytest.fixture(scope="module")
def playback(log: logs.TrialLog) -> Playback:
    return Playback(log)


@pytest.fixture(scope="module")
def movie(log: logs.TrialLog, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[tuple[int, int]]]:
    """A small video at few pictures a second, and what its progress was told."""
    path, told = tmp_path_factory.mktemp("movie") / "docking.mp4", []
    video.render(log, path, fps=5, progress=lambda done, total: told.append((done, total)), **SMALL)
    return path, told


def decoded(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def changed(log: logs.TrialLog, **groups: dict) -> logs.TrialLog:
    """The log with some variables replaced."""
    merged = {name: {**variables, **groups.get(name, {})} for name, variables in log.groups.items()}
    return dataclasses.replace(log, groups=merged)


def cut(log: logs.TrialLog, end: float, status: str) -> logs.TrialLog:
    """The log of a trial that ended at a time."""
    groups = {
        name: {key: value[variables["time"] <= end] for key, value in variables.items()}
        for name, variables in log.groups.items()
    }
    return logs.TrialLog(groups, {**log.attributes, "status": status})


def coloured(picture: np.ndarray, colour: tuple[float, ...], tolerance: float = 70.0) -> np.ndarray:
    """Where a picture has about that colour (the light changes it a little)."""
    away = picture.astype(float) - 255.0 * np.array(colour[:3])
    return np.linalg.norm(away, axis=-1) < tolerance


def test_a_video_can_be_decoded(movie: tuple[Path, list], playback: Playback) -> None:
    """Count, size and format; no picture is black or empty; nothing temporary stays."""
    path, told = movie
    pictures, frames = decoded(path), storyboard(playback, 5)
    assert len(pictures) == len(frames)
    assert told == [(done, len(frames)) for done in range(1, len(frames) + 1)]
    for picture in pictures:
        assert picture.shape == (SMALL["height"], SMALL["width"], 3)
        main = layout(**SMALL, views=3)[0]
        view = picture[30 : main.height, : main.width]
        assert view.mean() > 30.0  # black would be 0, the colour of the water is 60
        assert view.std() > 4.0  # a picture of one colour has 0
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.pix_fmt) == ("h264", "yuv420p")
        assert float(stream.average_rate or 0) == 5.0
    assert [file.name for file in path.parent.iterdir()] == ["docking.mp4"]


def test_the_panel_changes(movie: tuple[Path, list]) -> None:
    """The numbers of the moment differ from picture to picture, and the phase's colour from start to end."""
    panel = layout(**SMALL, views=3)[1]
    first, middle, last = (decoded(movie[0])[index][: panel.y, panel.x :].astype(int) for index in (0, 20, -1))
    for a, b in ((first, middle), (middle, last)):
        assert (np.abs(a - b).max(axis=-1) > 60).sum() > 30  # a few letters; coding noise stays below 60


def test_both_tracks_are_drawn(playback: Playback) -> None:
    """The overview gains yellow and magenta while the vehicle moves; each is nowhere else in the scene."""
    counts = []
    with Stage(playback, 640, 480, ("overview",)) as stage:
        for time in (playback.start, playback.end):
            picture = stage.picture(Frame(time=time, speed=1.0, near=False, banner=""), 0.0)
            picture[:180, :300] = 0  # the panel and its legend
            counts.append([int(coloured(picture, colour).sum()) for colour in (TRUE, ESTIMATE)])
    (true_before, estimate_before), (true_after, estimate_after) = counts
    # Some 400 pixels of track, 3 and 2 wide, of which the other line and the fixes may hide the most.
    assert true_after > true_before + 100
    assert estimate_before == 0
    assert estimate_after > 100


def test_pose_is_that_of_the_log(log: logs.TrialLog, playback: Playback) -> None:
    """The nose of the posed model, through MuJoCo's kinematics, is where the log's state puts it."""
    truth, model, data = log["truth"], playback.model, playback.data
    nose = model.site(f"{playback.vehicle_name}/nose").id
    for index in (0, 101, len(truth["time"]) - 1):
        playback.pose_model(playback.at(float(truth["time"][index])))
        # Both are the same few products of numbers below 100: rounding only.
        np.testing.assert_allclose(data.site_xpos[nose], flip(nose_position(log))[index], atol=1e-9)
        for fin, name in enumerate(("rudder_upper", "rudder_lower", "plane_port", "plane_starboard")):
            joint = model.joint(f"{playback.vehicle_name}/{name}")
            assert data.qpos[joint.qposadr[0]] == pytest.approx(truth["fins"][index, fin], abs=1e-12)


def test_motion_is_interpolated(log: logs.TrialLog, playback: Playback) -> None:
    """Half way between two samples the vehicle is half way, and turned by the half."""
    truth = log["truth"]
    middle = playback.at(float(truth["time"][200:202].mean()))
    np.testing.assert_allclose(middle.position, flip(truth["position"][200:202]).mean(axis=0), atol=1e-9)
    assert middle.heading == pytest.approx(truth["attitude"][200:202, 2].mean(), abs=1e-9)
    assert np.linalg.norm(middle.quaternion) == pytest.approx(1.0, abs=1e-12)


def test_drift_of_the_water_is_the_integral_of_the_current(log: logs.TrialLog, playback: Playback) -> None:
    """A steady current carries specks by its velocity times time."""
    moment = playback.at(20.0)
    np.testing.assert_allclose(moment.drift, 20.0 * flip(CURRENT), atol=1e-9)


def test_storyboard_keeps_order_and_speed(playback: Playback) -> None:
    """From start to end without going back, with the time-lapse that each picture says, slow where it docks."""
    fps = 25
    frames = storyboard(playback, fps)
    times = np.array([frame.time for frame in frames])
    speeds = np.array([frame.speed for frame in frames])
    assert times[0] == playback.start
    assert times[-1] == playback.end
    assert (np.diff(times) >= 0.0).all()
    told = len(frames) - round(HOLD * fps)
    # Between two pictures the speed-up itself changes, by RAMP a second of the trial: at most that times the step.
    steps = np.diff(times[: told - 1]) * fps
    assert np.abs(steps - speeds[: told - 2]).max() <= 1.01 * RAMP * steps.max() / fps + 0.11
    docking = next(index for index, frame in enumerate(frames) if playback.at(frame.time).phase == Phase.DOCKED)
    assert speeds[docking] == DOCKING
    assert frames[docking].near
    assert not frames[0].near
    assert frames[-1].banner.startswith("docked after")


@pytest.mark.parametrize("slowness", [1.0, 30.0])
def test_videos_are_neither_long_nor_short(log: logs.TrialLog, slowness: float) -> None:
    """A trial of half an hour lasts less than a minute, one of a minute more than eight seconds."""
    stretched = changed(
        log, **{name: {"time": log[name]["time"] * slowness} for name in ("truth", "guidance", "event")}
    )
    frames = storyboard(Playback(stretched), 10)
    assert 8.0 < len(frames) / 10 < LONGEST + HOLD + 0.3  # a picture at either end


def test_projection_finds_what_is_drawn(playback: Playback) -> None:
    """A dot of a colour of its own is found, by its pixels, where `project` says."""
    green = (0.0, 1.0, 0.0, 1.0)
    box = Box(40, 30, 500, 400)
    moment = playback.at(playback.end)
    playback.pose_model(moment)
    cameras = Cameras(playback, box.width / box.height)
    camera = cameras.aim("overview", moment, 0.0)
    with Canvas(playback.model, 640, 480) as canvas:
        for shift in camera.distance * np.array([[0.0, 0.0, 0.05], [0.1, 0.15, 0.0], [-0.2, 0.05, 0.1]]):
            place = np.array(camera.lookat) + shift
            dot = Mark(-math.inf, DOT, 0.008 * camera.distance, place, place, green)
            layer = Layer(playback, [dot], overview=True)
            layer.begin(moment)
            mujoco.mjv_updateCamera(playback.model, playback.data, camera, layer.scene)
            canvas.draw(layer.scene, box)
            rows, columns = np.nonzero(coloured(canvas.read(), green, 120.0))
            found = project(layer.scene, place, box)
            assert found is not None
            # Half a pixel of rounding, one of perspective over the dot, one of its three sides' unequal light.
            assert math.dist(found, (columns.mean(), rows.mean())) < 2.5
    assert project(layer.scene, np.array(camera.lookat) + np.array([0.0, 0.0, 1e4]), box) is None


@pytest.mark.parametrize("name", ["overview", "dock"])
def test_cameras_see_all(playback: Playback, name: str) -> None:
    """The track and 15 m round the dock, or nose and mouth, are within the margin; the track touches it."""
    moment = playback.at(playback.end - 6.0)
    aspect, box = 1.2, Box(0, 0, 1200, 1000)
    playback.pose_model(moment)
    camera = Cameras(playback, aspect).aim(name, moment, 0.0)
    layer = Layer(playback, [], overview=False)
    mujoco.mjv_updateCamera(playback.model, playback.data, camera, layer.scene)
    around = playback.mouth + 15.0 * np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]])
    whole, last = np.concatenate([playback.positions, around]), np.stack([moment.nose, playback.mouth])
    shown = whole if name == "overview" else last
    places = [project(layer.scene, point, box) for point in shown]
    assert all(places)
    offset = np.abs(np.array(places, dtype=float) - [600.0, 500.0]) / [600.0, 500.0]
    assert offset.max() <= MARGIN + 2e-3  # a pixel of 500
    if name == "overview":
        assert offset.max() >= MARGIN - 2e-3
    assert playback.model.vis.global_.fovy == FIELD


def test_water_and_light_touch_no_physics(playback: Playback) -> None:
    """Of what the scenery adds only the sea floor collides, and nothing has mass."""
    model = playback.model
    for body in range(model.nbody):
        if model.body_weldid[body] == 0:  # fixed to the world
            geoms = range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body])
            names = [model.geom(geom).name for geom in geoms if body == 0 and model.geom_contype[geom]]
            assert names in ([], ["sea_floor"])
    assert model.body_mass[0] == 0.0


def test_text_is_as_wide_as_it_says() -> None:
    """Written text changes pixels inside its width only, also where it does not fit into the picture."""
    style = overlay.Style(20.0)
    width = overlay.text_width("123 m", style)
    picture = np.zeros((40, 200, 3), np.uint8)
    overlay.write(picture, "123 m", 50, 30, style)
    columns = np.flatnonzero(picture.any(axis=(0, 2)))
    assert 50 <= columns[0] <= columns[-1] < 50 + width
    rows = np.flatnonzero(picture.any(axis=(1, 2)))
    assert abs(rows[-1] - 29) <= 1  # digits stand on the baseline
    assert abs(rows[-1] - rows[0] + 1 - 0.73 * style.size) < 1.5  # and DejaVu's are 0.73 of the size high
    assert picture.max() == 255
    for x, baseline in ((-20, 30), (180, 30), (50, 5), (50, 44), (-500, 30), (50, -90), (900, 900)):
        overlay.write(picture, "123 m", x, baseline, style)
    cut, whole = np.zeros((2, 40, 200, 3), np.uint8)
    overlay.write(cut, "123 m", -20, 35, style)
    overlay.write(whole, "123 m", 100, 30, style)
    assert np.array_equal(cut[10:, : width - 20], whole[5:-5, 120 : 100 + width])  # cut at the edge, not moved


def test_a_failed_video_leaves_nothing(log: logs.TrialLog, tmp_path: Path) -> None:
    """Whole or absent: what stood there before stays, no part of a new one does."""
    path = tmp_path / "docking.mp4"
    path.write_bytes(b"old")

    def stop(done: int, total: int) -> None:
        if done == 12:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        video.render(log, path, fps=5, progress=stop, **SMALL)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"width": 321}, "width 321: needs an even number"),
        ({"height": 20}, "height 20: needs"),
        ({"speed": 0.5}, "speed 0.5: needs"),
        ({"cameras": ("side",)}, "no camera 'side'; there are above, dock, follow, overview"),
        ({"cameras": ("dock",) * 4}, "4 cameras: at most three"),
    ],
)
def test_bad_options_are_refused(log: logs.TrialLog, tmp_path: Path, options: dict, text: str) -> None:
    """One line that says what would be right, before anything is drawn."""
    with pytest.raises(InputError, match=text):
        video.render(log, tmp_path / "x.mp4", **{**SMALL, **options})
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_bad_input(log: logs.TrialLog, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none/x\.mp4: cannot be written: No such file"):
        video.render(cut(log, 1.0, "interrupted"), tmp_path / "none" / "x.mp4", fps=5, **SMALL)


def broken_logs(log: logs.TrialLog) -> dict[str, logs.TrialLog]:
    """Logs of trials that went otherwise."""
    position = log["truth"]["position"].copy()
    position[50:] = np.nan
    far = log["truth"]["position"].copy()
    far[50:] *= 1e6
    lost = {"received": np.full_like(log["usbl"]["received"], np.nan)}
    unseen = {"initialised": np.zeros_like(log["estimate"]["initialised"])}
    return {
        "one state": cut(log, 0.0, "interrupted"),
        "interrupted": cut(log, 6.0, "interrupted"),
        "not finite": changed(log, truth={"position": position}),
        "far off": changed(log, truth={"position": far}),
        "no fixes": changed(log, usbl=lost, estimate=unseen),
    }


@pytest.mark.parametrize("kind", ["one state", "interrupted", "not finite", "far off", "no fixes"])
def test_trials_that_went_otherwise_are_drawn_too(log: logs.TrialLog, tmp_path: Path, kind: str) -> None:
    path = tmp_path / "docking.mp4"
    video.render(broken_logs(log)[kind], path, fps=2, **SMALL)
    pictures = decoded(path)
    assert len(pictures) >= round(2 * HOLD)
    assert min(picture.std() for picture in pictures) > 4.0  # a picture of one colour has 0


def test_nothing_to_draw_is_bad_input(log: logs.TrialLog, tmp_path: Path) -> None:
    nowhere = {"position": np.full_like(log["truth"]["position"], np.nan)}
    with pytest.raises(InputError, match="nothing to draw"):
        video.render(changed(log, truth=nowhere), tmp_path / "x.mp4")


def test_still(log: logs.TrialLog, tmp_path: Path) -> None:
    """A picture for a page: the size asked for, of moderate size, with the vehicle just before the mouth."""
    path = tmp_path / "still.png"
    video.still(log, path)
    assert matplotlib.image.imread(path).shape[:2] == (720, 1280)
    assert path.stat().st_size <= 300_000
    assert [file.name for file in tmp_path.iterdir()] == ["still.png"]


SCRIPT = """
import sys
from auvsim import log, video
try:
    video.render(log.read(sys.argv[1]), sys.argv[2], width=320, height=240, fps=2)
except video.DrawingError as error:
    print(error)
"""


@pytest.mark.parametrize("opengl", [True, False])
def test_another_process(log: logs.TrialLog, tmp_path: Path, opengl: bool) -> None:
    """It ends without a complaint of OpenGL; without OpenGL it says what to install and how to get the video later."""
    logs.write(cut(log, 2.0, "interrupted"), tmp_path / "trial.nc")
    environment = os.environ | ({} if opengl else {"MUJOCO_GL": "disable"})
    command = [sys.executable, "-c", SCRIPT, str(tmp_path / "trial.nc"), str(tmp_path / "docking.mp4")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=True)
    assert done.stderr == ""
    assert (tmp_path / "docking.mp4").exists() == opengl
    if opengl:
        assert done.stdout == ""
    else:
        assert "apt-get install libegl1 libgl1" in done.stdout
        assert "`auvsim video DIR/trial.nc`" in done.stdout
        assert done.stdout.count("\n") == 1
