"""Products of a sonar's navigation from a log: the path with attitude and covariance, closures, errors without turn."""

import math
from dataclasses import replace
from typing import Any

import h5py
import numpy as np
import pytest
from synthetic import trial_log

from auvsim.analysis import sonar_map, sonar_path, sonar_plots
from auvsim.analysis.summary import summarise
from auvsim.base.frames import Array
from auvsim.data.log import VehicleLog
from auvsim.data.phases import interpolate
from auvsim.navigation.sonar_log import CLOSURES, MATCHING, PATH, TABLES
from estimators.map_path.feature_map import feature_map
from estimators.map_path.poses import rotation_to

ANGLE, DIVE, OFF = 0.04, 40.0, np.array((1.3, -0.8))  # by which the path is turned, when the dive began, where it was
SHAPE = (6, 10)
STAMPS = np.array([DIVE, 44.0, 60.0, 75.0, 90.0, 130.0])


def turned_about_the_dive(places: Array, origin: Array) -> Array:
    """As a vehicle believes that took its dive point for one `OFF` away and its heading for one `ANGLE` too large."""
    c, s = math.cos(ANGLE), math.sin(ANGLE)
    return origin + OFF + (places - origin) @ np.array(((c, s), (-s, c)))


@pytest.fixture(scope="module")
def log() -> VehicleLog:
    """A docking whose estimate is the truth, turned and displaced, with keyframes, two closures and the dive point."""
    made = trial_log()
    whole, truth, rng = made.log, made["truth"], np.random.default_rng(3)
    origin = interpolate(np.array([DIVE]), truth["time"], truth["position"][:, :2])[0]
    estimate = {name: values.copy() for name, values in made["estimate"].items()}
    true = interpolate(estimate["time"], truth["time"], truth["position"])
    estimate["position"] = np.column_stack((turned_about_the_dive(true[:, :2], origin), true[:, 2]))
    count = len(estimate["time"])
    dive = np.where((estimate["time"] < DIVE)[:, None], math.nan, origin + OFF)
    places = interpolate(STAMPS, truth["time"], truth["position"][:, :2])
    headings = interpolate(STAMPS, truth["time"], np.unwrap(truth["attitude"][:, 2])) + ANGLE
    k = len(STAMPS)
    columns: dict[str, dict[str, Any]] = {
        MATCHING: {"time": estimate["time"], "closures": np.arange(count) // 50, "dive": dive},
        CLOSURES: {"time": (130.5, 130.5), "later": (128.0, 130.0), "earlier": (60.0, math.nan)},
        PATH: {
            "time": STAMPS, "frame": STAMPS > DIVE,
            "pose": np.column_stack((turned_about_the_dive(places, origin), headings)),
            "covariance": np.arange(k)[:, None, None] * np.eye(3) + np.eye(3),
            "image": rng.integers(-127, 128, (k, *SHAPE)), "scale": np.linspace(0.01, 0.06, k),
            "cell": np.full(k, 0.5), "nearest": np.full(k, 0.5), "farthest": np.full(k, 2.9),
            "half_sector": np.full(k, 1.0), "ahead": np.full(k, 0.7),
        },
    }  # fmt: skip
    groups, tables = dict(whole.groups), dict(whole.tables)
    groups["vehicles/remus100/estimate"] = estimate
    compass = {name: values.copy() for name, values in made["compass"].items()}
    compass["value"][:, 1:] = (0.11, -0.03)  # pitch, roll
    groups["vehicles/remus100/sensors/compass"] = compass
    for name, table in TABLES.items():
        path = f"vehicles/remus100/{name}"
        groups[path] = {key: np.array(columns[name][key], dtype=v.array_type) for key, v in table.items()}
        tables[path] = dict(table)
    return replace(whole, groups=groups, tables=tables).vehicle()


def test_a_turned_path_has_no_error_left(log: VehicleLog) -> None:
    """Of estimates and of keyframes alike; the angle is that by which they have to be turned back."""
    path = sonar_path.sonar_path(log)
    assert path is not None
    np.testing.assert_allclose(path.images[2], log["path"]["image"][3] * log["path"]["scale"][3])
    assert (path.grid.cell, path.grid.shape, path.grid.ranges) == (0.5, SHAPE, (0.5, 2.9))
    assert (path.grid.half_sector, path.grid.ahead) == (1.0, 0.7)
    live, kept = sonar_path.turned_errors(log), sonar_path.turned_path_errors(log, path)
    for found, times in ((live, log["estimate"]["time"]), (kept, STAMPS[1:])):
        assert found is not None
        np.testing.assert_array_equal(found.times, times[times >= DIVE])
        # the dive point lies between two samples of the truth, 0.1 s apart, of a path that bends by some mm there
        assert np.abs(found.errors).max() < 0.01
        assert found.angle == pytest.approx(-ANGLE, abs=1e-4)
        assert found.rms < 0.01
    raw = sonar_path.path_errors(log, path)
    assert np.hypot(*raw[:, :2].T).max() > 3.0  # a chord of the turn on top of where the dive was believed
    np.testing.assert_allclose(raw[:, 2], ANGLE, atol=1e-9)


def test_the_summary_tells_closures_and_the_turned_error(log: VehicleLog) -> None:
    """A log of another estimator has neither."""
    values = summarise(log)
    assert values["loop_closures"] == log["matching"]["closures"][-1]
    found = sonar_path.turned_errors(log)
    assert found is not None
    assert values["turned_rms"] == found.rms
    assert not {"loop_closures", "turned_rms"} & summarise(trial_log()).keys()


def test_the_rotation_is_the_best_one() -> None:
    """No angle of a fine grid brings a distorted path closer."""
    p = np.array([(0.0, 1.0), (60.0, 2.0), (61.0, 9.0), (3.0, 30.0), (-8.0, 12.0)])
    q = p * (1.03, 0.95) + (0.4, -0.9)
    angles = np.linspace(-0.2, 0.2, 4001)
    sums = [float(np.square(p @ [[math.cos(a), math.sin(a)], [-math.sin(a), math.cos(a)]] - q).sum()) for a in angles]
    assert rotation_to(p, q) == pytest.approx(angles[int(np.argmin(sums))], abs=1e-4)


def test_a_log_without_frames_has_no_path(log: VehicleLog) -> None:
    """Neither one of another estimator nor one that ended before the first keyframe."""
    assert sonar_path.sonar_path(trial_log()) is None
    assert sonar_path.turned_errors(trial_log()) is None
    rows = {name: values[:1] for name, values in log["path"].items()}
    early = replace(log.log, groups={**log.log.groups, "vehicles/remus100/path": rows}).vehicle()
    assert sonar_path.sonar_path(early) is None


def test_lines_of_closures_join_the_two_places(log: VehicleLog) -> None:
    """From where the later frame was estimated to the keyframe; none where one end is not known."""
    path = sonar_path.sonar_path(log)
    assert path is not None
    overlay = sonar_map.overlay(log, path)
    then = interpolate(np.array([128.0]), log["estimate"]["time"], log["estimate"]["position"][:, :2])[0]
    np.testing.assert_allclose(overlay.closures, [(then, path.poses[1, :2])])
    assert overlay.label.endswith("loop closures believed, not all drawn")
    axes = sonar_map.map_figure(path.images, path.poses, path.grid, overlay=overlay).axes[0]
    (drawn,) = axes.collections[0].get_segments()  # pyright: ignore[reportAttributeAccessIssue]
    np.testing.assert_allclose(drawn, [then[::-1], path.poses[1, 1::-1]])


def test_the_file_holds_map_attitude_and_covariance(log: VehicleLog, tmp_path) -> None:
    """As any NetCDF reader sees it: the map on its coordinates, and what is known of each keyframe."""
    path = sonar_path.sonar_path(log)
    assert path is not None
    sonar_map.save_map(log, path, tmp_path / "map.nc")
    chart = feature_map(path.images, path.poses, path.grid, sonar_map.CELL)
    with h5py.File(tmp_path / "map.nc") as file:
        held: Any = {name: {key: value[...] for key, value in file[name].items()} for name in ("map", "path")}  # pyright: ignore
        units = file["map/north"].attrs["units"], file["map/north"].attrs["standard_name"]
    assert units == ("m", "projection_y_coordinate")
    np.testing.assert_array_equal(held["map"]["echo"], chart.image)
    row, column = np.unravel_index(np.nanargmax(chart.image), chart.image.shape)
    assert held["map"]["north"][row] == pytest.approx(chart.origin[0] + 0.5 * row)
    assert held["map"]["east"][column] == pytest.approx(chart.origin[1] + 0.5 * column)
    np.testing.assert_array_equal(held["path"]["heading"], path.poses[:, 2])
    np.testing.assert_array_equal(held["path"]["covariance"], path.covariances)
    truth = log["truth"]
    np.testing.assert_allclose(
        held["path"]["depth"], np.interp(path.times, truth["time"], truth["position"][:, 2]), atol=0.01
    )
    assert held["path"]["roll"] == pytest.approx(-0.03)
    assert held["path"]["pitch"] == pytest.approx(0.11)


def test_the_picture_shows_errors_and_closures(log: VehicleLog) -> None:
    """Raw error at each estimate, keyframes beside it, a tick for each time at which closures were believed."""
    path = sonar_path.sonar_path(log)
    assert path is not None
    position, turned, heading, count = sonar_plots.navigation_figure(log, path).axes
    live, kept = position.get_lines()[:2]
    assert np.size(kept.get_xdata()) == len(STAMPS) - 1
    true = interpolate(np.asarray(live.get_xdata()), log["truth"]["time"], log["truth"]["position"][:, :2])
    estimated = interpolate(np.asarray(live.get_xdata()), log["estimate"]["time"], log["estimate"]["position"][:, :2])
    np.testing.assert_allclose(np.asarray(live.get_ydata()), np.hypot(*(estimated - true).T))
    assert f"turned by {math.degrees(-ANGLE):+.2f}" in turned.texts[0].get_text()
    assert count.get_lines()[0].get_ydata()[-1] == log["matching"]["closures"][-1]  # pyright: ignore
    ticks = [c for c in heading.collections if len(c.get_paths()) == 1 and c.get_linewidth()[0] == 0.8]  # pyright: ignore
    assert len(ticks) == 1
