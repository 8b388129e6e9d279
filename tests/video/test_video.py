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
from synthetic import CURRENT, DOCK, fleet_log, trial_log, truth, writer

from auvsim import video
from auvsim.base.errors import InputError
from auvsim.base.frames import flip
from auvsim.data import log as logs
from auvsim.missions.docking.dock_frame import nose_position
from auvsim.missions.docking.guidance import Phase
from auvsim.video import overlay, panel
from auvsim.video.cameras import FIELD, MARGIN, Cameras, project
from auvsim.video.canvas import Box, Canvas
from auvsim.video.layer import DOT, Layer, Mark
from auvsim.video.marks import ESTIMATE, FIX, REFUSED, TRUE, Tracks, colour_of
from auvsim.video.motion import PROPELLER_SLOWNESS
from auvsim.video.playback import Playback
from auvsim.video.stage import Stage, layout
from auvsim.video.storyboard import DOCKING, HOLD, LONGEST, RAMP, Frame, looked_at, storyboard

SMALL: dict[str, Any] = {"width": 320, "height": 240}


@pytest.fixture(scope="module")
def log() -> logs.Log:
    """A made-up trial of three minutes that docks, with moving fins and the scenario that its models come from."""
    made_up = trial_log()
    count = len(made_up["truth"]["time"])
    actuators = 0.1 * np.sin(np.arange(5 * count).reshape(count, 5))
    actuators[:, 4] = 150.0
    phase = made_up["mission"]["phase"].copy()
    phase[-20:] = Phase.DOCKED  # for the last 2 s
    return changed(made_up.log, truth={"actuators": actuators}, mission={"phase": phase})


@pytest.fixture(scope="module")
def playback(log: logs.Log) -> Playback:
    return Playback(log)


@pytest.fixture(scope="module")
def movie(log: logs.Log, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[tuple[int, int]]]:
    """A small video at few pictures a second, and what its progress was told."""
    path, told = tmp_path_factory.mktemp("movie") / "docking.mp4", []
    video.render(log, path, fps=5, progress=lambda done, total: told.append((done, total)), **SMALL)
    return path, told


def decoded(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def changed(log: logs.Log, **groups: dict) -> logs.Log:
    """The log with some variables of its vehicles replaced, by the short names of their groups."""
    merged = {name: {**variables, **groups.get(name.split("/")[-1], {})} for name, variables in log.groups.items()}
    return dataclasses.replace(log, groups=merged)


def cut(log: logs.Log, end: float, status: str) -> logs.Log:
    """The log of a trial that ended at a time."""
    groups = {
        name: {key: value[variables["time"] <= end] for key, value in variables.items()}
        for name, variables in log.groups.items()
    }
    return dataclasses.replace(log, groups=groups, attributes={**log.attributes, "status": status})


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


def test_pose_is_that_of_the_log(log: logs.Log, playback: Playback) -> None:
    """The nose of the posed model, through MuJoCo's kinematics, is where the log's state puts it."""
    vehicle = log.vehicle()
    truth, model, data = vehicle["truth"], playback.model, playback.data
    nose = model.site("remus100/nose").id
    shaft = model.joint(model.actuator("remus100/shaft").trnid[0]).qposadr[0]
    for index in (0, 101, len(truth["time"]) - 1):
        playback.pose_model(playback.at(float(truth["time"][index])))
        # Both are the same few products of numbers below 100: rounding only.
        np.testing.assert_allclose(data.site_xpos[nose], flip(nose_position(vehicle))[index], atol=1e-9)
        for fin, name in enumerate(("rudder_upper", "rudder_lower", "plane_port", "plane_starboard")):
            joint = model.joint(f"remus100/{name}")
            assert data.qpos[joint.qposadr[0]] == pytest.approx(truth["actuators"][index, fin], abs=1e-12)
        assert data.qpos[shaft] == pytest.approx(150.0 * truth["time"][index] / PROPELLER_SLOWNESS, abs=1e-9)
    np.testing.assert_allclose(data.site("dock").xpos, flip(DOCK), atol=1e-12)


def test_motion_is_interpolated(log: logs.Log, playback: Playback) -> None:
    """Half way between two samples the vehicle is half way, and turned by the half."""
    truth = log.vehicle()["truth"]
    middle = playback.at(float(truth["time"][200:202].mean())).followed
    np.testing.assert_allclose(middle.position, flip(truth["position"][200:202]).mean(axis=0), atol=1e-9)
    assert middle.heading == pytest.approx(truth["attitude"][200:202, 2].mean(), abs=1e-9)
    assert np.linalg.norm(middle.quaternion) == pytest.approx(1.0, abs=1e-12)


def test_drift_of_the_water_is_the_integral_of_the_current(log: logs.Log, playback: Playback) -> None:
    """A steady current carries specks by its velocity times time."""
    moment = playback.at(20.0).followed
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
    docking = next(
        index for index, frame in enumerate(frames) if playback.at(frame.time).followed.phase == Phase.DOCKED
    )
    assert speeds[docking] == DOCKING
    assert frames[docking].near
    assert not frames[0].near
    assert frames[-1].banner.startswith("docked after")


@pytest.mark.parametrize("slowness", [1.0, 30.0])
def test_videos_are_neither_long_nor_short(log: logs.Log, slowness: float) -> None:
    """A trial of half an hour lasts less than a minute, one of a minute more than eight seconds."""
    vehicle = log.vehicle()
    stretched = changed(
        log, **{name: {"time": vehicle[name]["time"] * slowness} for name in ("truth", "mission", "event")}
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
            layer.begin(moment.time, moment.followed.position)
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
    mouth = playback.docks["dock"].mouth
    around = mouth + 15.0 * np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]])
    whole, last = np.concatenate([playback.first.positions, around]), np.stack([moment.followed.nose, mouth])
    shown = whole if name == "overview" else last
    places = [project(layer.scene, point, box) for point in shown]
    assert all(places)
    offset = np.abs(np.array(places, dtype=float) - [600.0, 500.0]) / [600.0, 500.0]
    assert offset.max() <= MARGIN + 2e-3  # a pixel of 500
    if name == "overview":
        assert offset.max() >= MARGIN - 2e-3
    assert playback.model.vis.global_.fovy == FIELD


def test_refused_fixes_are_red_and_their_reason_is_told(log: logs.Log, playback: Playback) -> None:
    """A mark for each fix that arrived, at its place; after a refusal the legend says why it was refused."""
    vehicle, motion = log.vehicle(), playback.first
    marks = [mark for mark in Tracks.of(motion, TRUE, 1.0, 0.1).marks if mark.kind == DOT]
    usbl = vehicle["usbl"]
    arrived = np.isfinite(usbl["received"]) & (usbl["received"] <= motion.end)
    assert [mark.time for mark in marks] == usbl["received"][arrived].tolist()
    refused = {float(mark.time) for mark in marks if mark.colour == REFUSED}
    decided = vehicle["measurements"]
    of_fixes = (decided["sensor"] == "usbl") & (decided["reason"] != "duplicate") & ~decided["accepted"]
    assert refused == set(decided["time"][of_fixes].tolist())
    assert len(refused) == 4
    assert {mark.colour for mark in marks} == {REFUSED, FIX}
    late = float(usbl["received"][usbl["sequence"] == 9][0])
    assert [playback.latest_refusal(time) for time in (0.0, late - 1.0, late)] == ["", "outlier", "too_old"]
    nothing = {name: values[:0] for name, values in decided.items()}  # as in a log of format 1 or 2
    old = Playback(dataclasses.replace(log, groups={**log.groups, f"vehicles/{vehicle.name}/measurements": nothing}))
    assert set(old.first.received_fixes().reasons.tolist()) == {""}


def test_the_panel_tells_the_error_in_space() -> None:
    """The estimate of the third vehicle is off by 0.3, 0.4 and 1.2 m: 1.3 m."""
    moment = Playback(fleet_log()).at(50.0)
    assert panel.error(moment.vehicles["auv_3"]) == "1.30 m"
    assert panel.error(Playback(fleet_log()).at(1.0).vehicles["auv_1"]) == "no fix yet"
    assert panel.error(Playback(fleet_log()).at(100.0).vehicles["auv_1"]) == "–"  # docked: nothing is estimated


@pytest.fixture(scope="module")
def fleet() -> Playback:
    return Playback(fleet_log())


def test_every_vehicle_and_dock_is_at_its_place(fleet: Playback) -> None:
    """Posed models and structures are where the log has them, each under its own name."""
    fleet.pose_model(fleet.at(40.0))
    for name in fleet.log.vehicles:
        vehicle = fleet.log.vehicle(name)
        expected = flip(nose_position(vehicle))[400]
        np.testing.assert_allclose(fleet.data.site(f"{name}/nose").xpos, expected, atol=1e-9)  # rounding
    for name, place in (("west", (20.0, -200.0, 5.0)), ("east", (-30.0, 180.0, 5.0))):
        np.testing.assert_allclose(fleet.data.site(name).xpos, flip(np.array(place)), atol=1e-12)
        np.testing.assert_allclose(fleet.docks[name].mouth, flip(np.array(place)), atol=1e-12)
        entering = fleet.data.site(f"{name}/latched").xpos - fleet.data.site(name).xpos
        axis = entering / np.linalg.norm(entering)  # through MuJoCo's kinematics
        np.testing.assert_allclose(fleet.docks[name].axis, axis, atol=1e-9)

    assert fleet.docks["west"].heading == pytest.approx(2.0)


def test_a_fleet_is_looked_at_where_it_docks(fleet: Playback) -> None:
    """Slow at each docking with that vehicle in focus; time-lapse again while the first stays in its dock."""
    frames = storyboard(fleet, 25, 20.0)
    by_time = {round(frame.time, 1): frame for frame in frames}
    times = np.array(list(by_time))

    def at(time: float) -> Frame:
        return by_time[times[np.abs(times - time).argmin()]]

    assert (at(53.0).near, at(53.0).focus, at(53.0).speed) == (True, "auv_1", DOCKING)
    assert (at(120.0).near, at(120.0).speed) == (False, 20.0)
    assert (at(200.5).near, at(200.5).focus) == (True, "auv_2")
    assert frames[-1].banner == "auv_1 docked at 54 s, auv_2 docked at 201 s, auv_3 not finished (complete)"
    assert [looked_at(fleet, time) for time in (53.0, 58.0, 120.0, 200.5)] == ["auv_1", "auv_1", None, "auv_2"]
    assert frames[0].banner == "start: 3 vehicles"
    assert any(frame.banner == "auv_1 docked: latched at 1.5 m/s" for frame in frames)


def test_views_of_a_fleet_by_name(fleet: Playback) -> None:
    """Each camera looks at what its name says; the overview has all vehicles and docks in it."""
    cameras, moment = Cameras(fleet, 1.2), fleet.at(30.0, "auv_2")
    for view in ("overview", "follow", "follow:auv_3", "above:auv_1", "dock", "dock:west"):
        cameras.check(view)
    for view, name in (("follow", "auv_2"), ("follow:auv_3", "auv_3"), ("above:auv_1", "auv_1")):
        target = np.array(cameras.aim(view, moment, 0.0).lookat)
        assert np.linalg.norm(target - moment.vehicles[name].position) < 0.2
        assert cameras.looked_at(view, moment) == name
    assert cameras.aim("above:auv_3", moment, 0.0).azimuth == 0.0  # north up, where there is no dock
    assert cameras.dock_in("dock", moment).name == "east"
    assert (cameras.dock_in("dock:west", moment).name, cameras.looked_at("dock:west", moment)) == ("west", "auv_1")
    fleet.pose_model(moment)
    layer = Layer(fleet, [], overview=True)
    mujoco.mjv_updateCamera(fleet.model, fleet.data, cameras.aim("overview", moment, 0.0), layer.scene)
    places = [dock.mouth for dock in fleet.docks.values()]
    places += [motion.positions[index] for motion in fleet.motions.values() for index in (0, -1)]
    assert all(project(layer.scene, place, Box(0, 0, 1200, 1000)) for place in places)


def test_a_fleet_is_drawn_each_vehicle_in_its_colour(fleet: Playback) -> None:
    """In the overview every true track has the colour of its vehicle; beside it each vehicle has a view."""
    with Stage(fleet, 640, 480) as stage:
        picture = stage.picture(Frame(time=110.0, speed=20.0, near=False, banner=""), 0.0)
    main, *beside = layout(640, 480, 4)
    view = picture[: main.height, : main.width]
    for name in fleet.motions:
        assert coloured(view, colour_of(fleet, name)).sum() > 30, name  # a track of some 50 to 300 pixels
    for box in beside:
        part = picture[box.y : box.y + box.height, box.x : box.x + box.width]
        assert part.std() > 4.0
    assert len({colour_of(fleet, name) for name in fleet.motions}) == 3


@pytest.mark.parametrize("mission", ["manoeuvre", "track"])
def test_a_mission_without_a_dock_is_drawn(tmp_path: Path, mission: str) -> None:
    """The vehicle and its track; a camera at a dock that is not there is refused."""
    recorder = writer(mission, dock="", usbl_structure="")
    for time in np.arange(0.0, 30.0, 0.1):
        recorder.truth(truth(time, (1.5 * time, 0.02 * time**2, 12.0), (0.0, 0.0, 0.04 * time)))
        own = (2, 0.5) if mission == "track" else ()
        recorder.append("mission", (time, 0, 0.0, 12.0, 1.5, *own))
    log = recorder.finish("complete").log
    lone = {path: values for path, values in log.group_attributes.items() if "structures" not in path}
    log = dataclasses.replace(log, group_attributes=lone)
    frames = storyboard(Playback(log), 5)
    assert not any(frame.near for frame in frames)
    assert frames[0].banner == "start: depth 12 m"
    video.render(log, tmp_path / "run.mp4", fps=2, **SMALL)
    assert min(picture.std() for picture in decoded(tmp_path / "run.mp4")) > 4.0
    video.still(log, tmp_path / "run.png", **SMALL)
    with pytest.raises(InputError, match="camera 'dock': the log has no dock"):
        video.still(log, tmp_path / "x.png", cameras=("dock",), **SMALL)


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


def test_a_failed_video_leaves_nothing(log: logs.Log, tmp_path: Path) -> None:
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
        ({"cameras": ("dock",) * 5}, "5 cameras: at most 4"),
        ({"cameras": ("follow:auv_1",)}, "camera 'follow:auv_1': follow may be of remus100"),
        ({"cameras": ("dock:remus100",)}, "camera 'dock:remus100': dock may be of dock"),
        ({"cameras": ("overview:dock",)}, "camera 'overview:dock': overview may be of all only"),
    ],
)
def test_bad_options_are_refused(log: logs.Log, tmp_path: Path, options: dict, text: str) -> None:
    """One line that says what would be right, before anything is drawn."""
    with pytest.raises(InputError, match=text):
        video.render(log, tmp_path / "x.mp4", **{**SMALL, **options})
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_bad_input(log: logs.Log, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none/x\.mp4: cannot be written: No such file"):
        video.render(cut(log, 1.0, "interrupted"), tmp_path / "none" / "x.mp4", fps=5, **SMALL)


def broken_logs(log: logs.Log) -> dict[str, logs.Log]:
    """Logs of trials that went otherwise."""
    vehicle = log.vehicle()
    position = vehicle["truth"]["position"].copy()
    position[50:] = np.nan
    far = vehicle["truth"]["position"].copy()
    far[50:] *= 1e6
    lost = {"received": np.full_like(vehicle["usbl"]["received"], np.nan)}
    unseen = {"initialised": np.zeros_like(vehicle["estimate"]["initialised"])}
    return {
        "one state": cut(log, 0.0, "interrupted"),
        "interrupted": cut(log, 6.0, "interrupted"),
        "not finite": changed(log, truth={"position": position}),
        "far off": changed(log, truth={"position": far}),
        "no fixes": changed(log, usbl=lost, estimate=unseen),
    }


@pytest.mark.parametrize("kind", ["one state", "interrupted", "not finite", "far off", "no fixes"])
def test_trials_that_went_otherwise_are_drawn_too(log: logs.Log, tmp_path: Path, kind: str) -> None:
    path = tmp_path / "docking.mp4"
    video.render(broken_logs(log)[kind], path, fps=2, **SMALL)
    pictures = decoded(path)
    assert len(pictures) >= round(2 * HOLD)
    assert min(picture.std() for picture in pictures) > 4.0  # a picture of one colour has 0


def test_nothing_to_draw_is_bad_input(log: logs.Log, tmp_path: Path) -> None:
    nowhere = {"position": np.full_like(log.vehicle()["truth"]["position"], np.nan)}
    with pytest.raises(InputError, match="no finite state of 'remus100': there is nothing to draw"):
        video.render(changed(log, truth=nowhere), tmp_path / "x.mp4")


def test_still(log: logs.Log, tmp_path: Path) -> None:
    """A picture for a page: the size asked for, of moderate size, with the vehicle just before the mouth."""
    path = tmp_path / "still.png"
    video.still(log, path)
    assert matplotlib.image.imread(path).shape[:2] == (720, 1280)
    assert path.stat().st_size <= 300_000
    assert [file.name for file in tmp_path.iterdir()] == ["still.png"]


SCRIPT = """
import sys
from auvsim import video
from auvsim.data import log
try:
    video.render(log.read(sys.argv[1]), sys.argv[2], width=320, height=240, fps=2)
except video.DrawingError as error:
    print(error)
"""


@pytest.mark.parametrize("opengl", [True, False])
def test_another_process(log: logs.Log, tmp_path: Path, opengl: bool) -> None:
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
