import dataclasses
import math
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread
from synthetic import (
    CURRENT,
    DOCK,
    DOCK_HEADING,
    GO_AROUND,
    NOSE,
    PHASES,
    empty_log,
    fleet_log,
    trial_log,
    truth,
    writer,
)

from auvsim.analysis.estimates import NEES_INTERVAL, estimate_errors, fix_fates, fixes
from auvsim.analysis.fleet_plots import fleet, fleet_figure
from auvsim.analysis.plots import estimates, estimates_figure, resolved, track, track_figure
from auvsim.analysis.style import DPI, MOST_IN_ROW, SIZE, phase_colour, vehicle_colour
from auvsim.base.errors import InputError
from auvsim.base.frames import rotation
from auvsim.data.log import VehicleLog


@pytest.fixture(scope="module")
def log() -> VehicleLog:
    return trial_log(GO_AROUND)


@pytest.fixture(scope="module")
def way(log: VehicleLog) -> Any:
    figure = track_figure(log)
    figure.draw_without_rendering()
    return figure


@pytest.fixture(scope="module")
def errors(log: VehicleLog) -> Any:
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


def test_a_quantity_that_is_never_known_has_no_panel(log: VehicleLog, errors: Any, monkeypatch: pytest.MonkeyPatch):
    """Without numbers of the current its two panels go, the other five stay."""
    known = estimate_errors(log)
    blank = dataclasses.replace(known, current=np.full_like(known.current, np.nan))
    monkeypatch.setattr("auvsim.analysis.plots.estimate_errors", lambda log: blank)
    titles = [axes.get_title() for axes in estimates_figure(log).axes]
    every = [axes.get_title() for axes in errors.axes]
    assert [title for title in every if title.startswith("Current")] == ["Current north", "Current east"]
    assert titles == [title for title in every if not title.startswith("Current")]


def test_plan_shows_truth_estimate_fixes_and_dock(log: VehicleLog, way: Any):
    plan = panel(way, "Plan view")
    east_north = log["truth"]["position"][:, 1::-1]
    np.testing.assert_array_equal(labelled(plan, "start"), east_north[:1])
    np.testing.assert_array_equal(labelled(plan, "end"), east_north[-1:])
    usbl = log["usbl"]
    np.testing.assert_array_equal(labelled(plan, "USBL fix"), fixes(log)[~usbl["lost"] & ~usbl["outlier"], ::-1])
    assert len(labelled(plan, "outlier")) == np.sum(usbl["outlier"] & ~usbl["lost"]) > 0
    seen = log["estimate"]["initialised"]
    np.testing.assert_array_equal(labelled(plan, "estimate"), log["estimate"]["position"][seen, 1::-1])
    near, far = labelled(plan, "dock axis")  # the axis leads to where vehicles come from
    np.testing.assert_array_equal(near, DOCK[1::-1])
    assert np.arctan2(*(near - far)) == pytest.approx(DOCK_HEADING)
    np.testing.assert_array_equal(labelled(plan, "dock"), DOCK[None, 1::-1])
    fates, places = fix_fates(log), fixes(log)[:, ::-1]
    for reason, text, count in (("outlier", "refused: outlier", 7), ("too_old", "refused: too old", 1)):
        np.testing.assert_array_equal(labelled(plan, text), places[fates == reason])
        assert np.sum(fates == reason) == count
    (west, east), (south, north) = plan.get_xlim(), plan.get_ylim()
    assert (west, south) < tuple(east_north.min(axis=0))
    assert east > east_north[:, 0].max()
    assert north > east_north[:, 1].max()
    assert plan.get_aspect() == 1.0


def test_the_track_is_coloured_by_phase_without_gaps(log: VehicleLog, way: Any):
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


def test_zoom_shows_the_nose_and_the_funnel_to_scale(log: VehicleLog, way: Any):
    zoom = panel(way, "The nose")
    assert zoom.get_xlim() == (-30.0, 4.0)
    assert zoom.get_ylim()[0] > 0.0 > zoom.get_ylim()[1]  # starboard below
    assert zoom.get_aspect() == 1.0
    outlines = [line.get_xydata() for line in zoom.get_lines() if len(line.get_xydata()) == 3]
    starboard = np.array([[0.0, 0.75], [1.03923, 0.15], [1.43923, 0.15]])
    np.testing.assert_allclose(outlines, np.stack([starboard * [1.0, -1.0], starboard]), atol=1e-9)  # rounding
    attitude, body = log["truth"]["attitude"][-1], log["truth"]["position"][-1]
    nose = rotation(0.0, 0.0, DOCK_HEADING).T @ (body + rotation(*attitude) @ [NOSE, 0.0, 0.0] - DOCK)
    ends = np.array([line.get_xydata()[-1] for line in zoom.get_lines() if len(line.get_xydata()) > 99])
    assert np.min(np.linalg.norm(ends - nose[:2], axis=1)) == pytest.approx(0.0, abs=1e-9)  # rounding


def test_depth_is_drawn_downward_with_its_command(log: VehicleLog, way: Any):
    depth = panel(way, "Depth")
    low, high = depth.get_ylim()
    assert low > log["truth"]["position"][:, 2].max() > log["truth"]["position"][:, 2].min() > high
    np.testing.assert_array_equal(labelled(depth, "command")[:, 1], log["mission"]["depth_setpoint"])


def test_error_panels_hold_errors_bands_and_ticks(log: VehicleLog, errors: Any):
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
        claimed = 2.0 * resolved(expected.time[seen], sigma[seen])[1].max()
        assert (band.min(), band.max()) == pytest.approx((-claimed, claimed))
        low, high = axes.get_ylim()
        assert np.mean((error[seen] > low) & (error[seen] < high)) >= 0.98  # single blows may leave the picture
        ticks = [len(collection.get_paths()) for collection in axes.collections[1:3]]
        # The duplicate is no decision on the fix; what came before the start is no refusal.
        assert ticks == [np.sum(~log["usbl"]["lost"]), np.sum(fix_fates(log) != "") + 1]
    labels = [text.get_text() for text in errors.legends[0].get_texts()]
    assert "refused: duplicate, outlier, too old" in labels


def test_nees_is_drawn_with_its_interval(log: VehicleLog, errors: Any):
    axes = panel(errors, "NEES")
    curve = next(line for line in axes.get_lines() if len(line.get_xdata()) > 99)
    np.testing.assert_array_equal(curve.get_ydata(), estimate_errors(log).nees[estimate_errors(log).initialised])
    span = axes.patches[0].get_window_extent().transformed(axes.transData.inverted())
    assert (span.y0, span.y1) == pytest.approx(NEES_INTERVAL)
    assert pytest.approx((0.0506, 7.378), rel=1e-3) == NEES_INTERVAL  # chi-square table, 2 degrees of freedom


def test_every_axis_has_its_unit_and_no_texts_overlap(way: Any, errors: Any):
    together = fleet_figure(fleet_log())
    together.draw_without_rendering()
    for figure in (way, errors, together):
        texts = list(figure.texts)
        for axes in figure.axes:
            assert "[" in axes.get_ylabel() or axes.get_title() == "Phases of the missions"
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
    recorder.estimate(1.5, (np.nan,) * 3, 0.0, (0, 0, 0), (0, 0), np.zeros((8, 8)), 0, True)
    log = recorder.finish("diverged")
    track(log, tmp_path / "track.png")
    estimates(log, tmp_path / "estimates.png")
    assert "diverged" in track_figure(log).get_suptitle()


def test_the_title_tells_the_outcome(log: VehicleLog, way: Any):
    assert way.get_suptitle().startswith("Trial 0, seed 7: docked at 474.4 s, 2 attempts, nose 0.")
    other = dataclasses.replace(empty_log().log, attributes={**empty_log().log.attributes, "trial": 4})
    assert track_figure(other.vehicle()).get_suptitle() == "Trial 4, seed 7: not docked (interrupted), 0 attempts"


def test_phases_of_any_mission_have_names_and_colours():
    """Those of shipped missions their own, others by their number; no two of one mission look alike."""
    phases = ("search", "dive", "listen", "rise")
    colours = [phase_colour(phases, index) for index in range(4)]
    assert colours[0] == phase_colour(PHASES, 0)
    assert len(set(colours)) == 4


def test_a_fleet_is_on_one_page(tmp_path: Path):
    """Every vehicle's track in its colour, all docks at their places, each phase in its bar, errors horizontal."""
    log = fleet_log()
    fleet(log, tmp_path / "fleet.png")
    assert imread(tmp_path / "fleet.png").shape == (round(SIZE[1] * DPI), round(SIZE[0] * DPI), 4)
    figure = fleet_figure(log)
    plan, phases, depths, errors = (panel(figure, t) for t in ("Plan view", "Phases", "Depth", "Horizontal error"))
    for index, name in enumerate(log.vehicles):
        truth_of, colour = log.vehicle(name)["truth"], vehicle_colour(index)
        lines = [line for line in plan.get_lines() if line.get_color() == colour and len(line.get_xydata()) > 1]
        np.testing.assert_array_equal(lines[0].get_xydata(), truth_of["position"][:, 1::-1])
        np.testing.assert_array_equal(depths.get_lines()[index].get_ydata(), truth_of["position"][:, 2])
    docks = [line.get_xydata()[0] for line in plan.get_lines() if line.get_markersize() == 26]
    np.testing.assert_array_equal(docks, [[-200.0, 20.0], [180.0, -30.0]])
    assert {text.get_text() for text in plan.texts} == {"west", "east", "auv_1", "auv_2", "auv_3"}
    np.testing.assert_allclose(errors.get_lines()[2].get_ydata(), 0.5, atol=1e-9)  # 0.3 and 0.4 m, 1.2 m of depth apart
    assert [text.get_text() for text in phases.texts][-1] == "under way"
    bar = phases.patches[-1]
    assert (bar.get_x(), bar.get_x() + bar.get_width()) == pytest.approx((5.0, 119.9))
    first, second, third = figure.get_suptitle().splitlines()[1:]
    assert first.startswith("auv_1: docked at 53.6 s, 1 attempt, nose 0.")
    assert second.startswith("auv_2: docked at 200.9 s, 1 attempt, nose 0.")
    assert third == "auv_3: track not finished (complete), 5.00 m rms off its legs"


def test_one_vehicle_of_a_fleet_has_its_own_pages(tmp_path: Path):
    """Its name in the title; without a dock of its own the distance from its track, and the dock that serves it."""
    third = fleet_log().vehicle("auv_3")
    figure = track_figure(third)
    assert figure.get_suptitle().startswith("Trial 0, seed 7, auv_3: track not finished")
    np.testing.assert_array_equal(labelled(panel(figure, "Plan view"), "dock"), [[-200.0, 20.0]])
    np.testing.assert_array_equal(panel(figure, "Distance to starboard").get_lines()[0].get_ydata(), 0.25)
    estimates(third, tmp_path / "estimates.png")


def test_many_entries_of_a_legend_take_two_rows(way: Any):
    labels = way.legends[0].get_texts()
    assert len(labels) > MOST_IN_ROW
    assert len({round(text.get_window_extent().y0) for text in labels}) == 2


def test_no_folder_is_an_input_error(tmp_path: Path):
    with pytest.raises(InputError, match="cannot be written: No such file"):
        track(empty_log(), tmp_path / "none" / "track.png")


def test_nothing_global_is_touched():
    code = "import sys, auvsim.analysis.plots; assert 'matplotlib.pyplot' not in sys.modules, 'pyplot'"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_claims_that_rise_and_fall_from_tick_to_tick_are_shown_as_their_rms() -> None:
    """Of a pair, level whatever its phase; a step stays where it is, few claims stay as they are."""
    time = 0.5 * np.arange(2701)
    claims = np.where(np.arange(2701) % 2, 0.07, 0.02)
    claims[1500:] += 1.0
    shown_at, shown = resolved(time, claims)
    assert len(shown) <= 2 * 350
    assert (shown_at[0], shown_at[-1]) == (time[0], time[-1])
    before, after = shown[shown_at < 747.0], shown[shown_at > 753.0]
    np.testing.assert_allclose(before, math.sqrt((0.07**2 + 0.02**2) / 2.0))
    np.testing.assert_allclose(after, math.sqrt((1.07**2 + 1.02**2) / 2.0))
    few = resolved(time[:350], claims[:350])
    np.testing.assert_array_equal(few[1], claims[:350])
