import dataclasses
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread
from synthetic import ATTRIBUTES, CURRENT, DOCK_HEADING, GO_AROUND, NOSE, empty_log, trial_log, truth, writer

from auvsim.analysis.plots import DPI, SIZE, estimates, estimates_figure, track, track_figure
from auvsim.base.errors import InputError
from auvsim.base.frames import rotation
from auvsim.data.log import PHASES, TrialLog
from auvsim.missions.docking.metrics import NEES_INTERVAL, estimate_errors, fixes


@pytest.fixture(scope="module")
def log() -> TrialLog:
    return trial_log(GO_AROUND)


@pytest.fixture(scope="module")
def way(log: TrialLog) -> Any:
    figure = track_figure(log)
    figure.draw_without_rendering()
    return figure


@pytest.fixture(scope="module")
def errors(log: TrialLog) -> Any:
    figure = estimates_figure(log)
    figure.draw_without_rendering()
    return figure


def panel(figure: Any, title: str) -> Any:
    return next(axes for axes in figure.axes if axes.get_title().startswith(title))


def labelled(axes: Any, label: str) -> np.ndarray:
    """Points (n, 2) of the line with a label."""
    return next(line for line in axes.get_lines() if line.get_label() == label).get_xydata()


@pytest.mark.parametrize("plot", [track, estimates])
@pytest.mark.parametrize("make", [empty_log, trial_log])
def test_png_of_the_announced_size(plot: Callable, make: Callable, tmp_path: Path):
    plot(make(), tmp_path / "picture.png")
    picture = imread(tmp_path / "picture.png")
    assert picture.shape == (round(SIZE[1] * DPI), round(SIZE[0] * DPI), 4)
    assert 0.005 < np.mean(picture[..., :3] < 0.9) < 0.9  # neither blank nor blotted out
    assert [entry.name for entry in tmp_path.iterdir()] == ["picture.png"]


def test_plan_shows_truth_estimate_fixes_and_dock(log: TrialLog, way: Any):
    plan = panel(way, "Plan view")
    east_north = log["truth"]["position"][:, 1::-1]
    np.testing.assert_array_equal(labelled(plan, "start"), east_north[:1])
    np.testing.assert_array_equal(labelled(plan, "end"), east_north[-1:])
    usbl = log["usbl"]
    np.testing.assert_array_equal(labelled(plan, "USBL fix"), fixes(log)[~usbl["lost"] & ~usbl["outlier"], ::-1])
    assert len(labelled(plan, "outlier")) == np.sum(usbl["outlier"] & ~usbl["lost"]) > 0
    seen = log["estimate"]["initialised"]
    np.testing.assert_array_equal(labelled(plan, "estimate"), log["estimate"]["position"][seen, 1::-1])
    far = labelled(plan, "dock axis")[1]  # the axis leads to where vehicles come from
    assert np.arctan2(*-far) == pytest.approx(DOCK_HEADING)
    (west, east), (south, north) = plan.get_xlim(), plan.get_ylim()
    assert (west, south) < tuple(east_north.min(axis=0))
    assert east > east_north[:, 0].max()
    assert north > east_north[:, 1].max()
    assert plan.get_aspect() == 1.0


def test_the_track_is_coloured_by_phase_without_gaps(log: TrialLog, way: Any):
    plan = panel(way, "Plan view")
    names = [name.replace("_", " ") for name in PHASES]
    lines = [line for line in plan.get_lines() if line.get_label() in names]
    assert {line.get_label() for line in lines} == {"search", "homing", "approach", "final", "go around"}
    assert len({line.get_color() for line in lines}) == len(lines)
    colours = {line.get_color() for line in lines}
    pieces = [
        line.get_xydata() for line in plan.get_lines() if line.get_color() in colours and len(line.get_xydata()) > 1
    ]
    for before, after in pairwise(pieces):
        np.testing.assert_array_equal(before[-1], after[0])
    assert sum(len(piece) - 1 for piece in pieces) == len(log["truth"]["time"]) - 1


def test_current_arrow_points_where_the_water_flows(way: Any):
    inset = panel(way, "Plan view").child_axes[0]
    arrow = inset.texts[0]
    east, north = np.subtract(arrow.xy, arrow.xyann)
    assert np.arctan2(east, north) == pytest.approx(np.arctan2(CURRENT[1], CURRENT[0]))
    assert inset.get_title() == "current 0.25 m/s to 323°"


def test_zoom_shows_the_nose_and_the_funnel_to_scale(log: TrialLog, way: Any):
    zoom = panel(way, "The nose")
    assert zoom.get_xlim() == (-30.0, 4.0)
    assert zoom.get_ylim()[0] > 0.0 > zoom.get_ylim()[1]  # starboard below
    assert zoom.get_aspect() == 1.0
    outlines = [line.get_xydata() for line in zoom.get_lines() if len(line.get_xydata()) == 3]
    starboard = np.array([[0.0, 0.75], [1.03923, 0.15], [1.63923, 0.15]])
    np.testing.assert_allclose(outlines, np.stack([starboard * [1.0, -1.0], starboard]), atol=1e-9)  # rounding
    attitude, body = log["truth"]["attitude"][-1], log["truth"]["position"][-1]
    nose = rotation(0.0, 0.0, DOCK_HEADING).T @ (body + rotation(*attitude) @ [NOSE, 0.0, 0.0])
    ends = np.array([line.get_xydata()[-1] for line in zoom.get_lines() if len(line.get_xydata()) > 99])
    assert np.min(np.linalg.norm(ends - nose[:2], axis=1)) == pytest.approx(0.0, abs=1e-9)  # rounding


def test_depth_is_drawn_downward_with_its_command(log: TrialLog, way: Any):
    depth = panel(way, "Depth")
    low, high = depth.get_ylim()
    assert low > log["truth"]["position"][:, 2].max() > log["truth"]["position"][:, 2].min() > high
    np.testing.assert_array_equal(labelled(depth, "command")[:, 1], log["guidance"]["depth_command"])


def test_error_panels_hold_errors_bands_and_ticks(log: TrialLog, errors: Any):
    expected = estimate_errors(log)
    seen = expected.initialised
    for title, error, sigma in (
        ("North", expected.position[:, 0], expected.sigma[:, 0]),
        ("Heading", np.degrees(expected.heading), np.degrees(expected.sigma[:, 2])),
        ("Current east", expected.current[:, 1], expected.sigma[:, 7]),
    ):
        axes = panel(errors, title)
        np.testing.assert_array_equal(axes.get_lines()[0].get_ydata(), error[seen])
        band = axes.collections[0].get_paths()[0].vertices[:, 1]
        assert (band.min(), band.max()) == pytest.approx((-2.0 * sigma[seen].max(), 2.0 * sigma[seen].max()))
        low, high = axes.get_ylim()
        assert np.mean((error[seen] > low) & (error[seen] < high)) >= 0.98  # single blows may leave the picture
        ticks = [len(collection.get_paths()) for collection in axes.collections[1:3]]
        assert ticks == [np.sum(~log["usbl"]["lost"]), 3]


def test_nees_is_drawn_with_its_interval(log: TrialLog, errors: Any):
    axes = panel(errors, "NEES")
    curve = next(line for line in axes.get_lines() if len(line.get_xdata()) > 99)
    np.testing.assert_array_equal(curve.get_ydata(), estimate_errors(log).nees[estimate_errors(log).initialised])
    span = axes.patches[0].get_window_extent().transformed(axes.transData.inverted())
    assert (span.y0, span.y1) == pytest.approx(NEES_INTERVAL)
    assert pytest.approx((0.0506, 7.378), rel=1e-3) == NEES_INTERVAL  # chi-square table, 2 degrees of freedom


def test_every_axis_has_its_unit_and_no_texts_overlap(way: Any, errors: Any):
    for figure in (way, errors):
        texts = list(figure.texts)
        for axes in figure.axes:
            assert "[" in axes.get_ylabel()
            texts += [axes.title, axes.xaxis.label, axes.yaxis.label]
            legend = axes.get_legend()
            texts += legend.get_texts() if legend else []
        texts += figure.legends[0].get_texts()
        boxes = [text.get_window_extent() for text in texts if text and text.get_text()]
        page = figure.bbox
        for i, box in enumerate(boxes):
            assert page.x0 <= box.x0, texts[i]
            assert box.x1 <= page.x1, texts[i]
            assert page.y0 <= box.y0, texts[i]
            assert box.y1 <= page.y1, texts[i]
            assert not any(box.overlaps(other) for other in boxes[i + 1 :])


def test_a_diverged_log_can_be_drawn(tmp_path: Path):
    recorder = writer()
    for i, position in enumerate([(-50.0, 3.0, 5.0), (-49.0, 3.0, 5.0), (np.inf, np.nan, -np.inf)]):
        recorder.truth(truth(float(i), position))
    recorder.append("estimate", (1.5, (np.nan,) * 3, 0.0, (0, 0, 0), (0, 0), np.zeros((8, 8)), 0, True))
    log = recorder.finish("diverged")
    track(log, tmp_path / "track.png")
    estimates(log, tmp_path / "estimates.png")
    assert "diverged" in track_figure(log).get_suptitle()


def test_the_title_tells_the_outcome(log: TrialLog, way: Any):
    assert way.get_suptitle().startswith("Trial 0, seed 7: docked at 474.4 s, 2 attempts, nose 0.")
    other = dataclasses.replace(empty_log(), attributes={**empty_log().attributes, **ATTRIBUTES, "trial": 4})
    assert track_figure(other).get_suptitle() == "Trial 4, seed 7: not docked (interrupted), 0 attempts"


def test_no_folder_is_an_input_error(tmp_path: Path):
    with pytest.raises(InputError, match="cannot be written: No such file"):
        track(empty_log(), tmp_path / "none" / "track.png")


def test_nothing_global_is_touched():
    code = "import sys, auvsim.analysis.plots; assert 'matplotlib.pyplot' not in sys.modules, 'pyplot'"
    subprocess.run([sys.executable, "-c", code], check=True)
