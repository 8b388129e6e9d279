"""The feature map of a sonar's frames, laid over each other at their estimated poses: as a picture and as a file."""

import os
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from auvsim.analysis import plan_view, sonar_path
from auvsim.analysis.plots import which_run
from auvsim.analysis.sonar_path import SonarPath
from auvsim.analysis.style import dress, save
from auvsim.base.frames import Array
from auvsim.data import netcdf
from auvsim.data.log import VehicleLog
from auvsim.data.netcdf import Content, Field
from auvsim.data.phases import interpolate
from estimators.map_path.feature_map import FeatureMap, feature_map
from estimators.map_path.frames import SectorGrid

CELL = 0.5  # of the map [m]
UNSEEN = "#b9cdd6"
TRUE, ESTIMATED, CLOSED = "#ffd21f", "#ff2fa8", "#35e0ff"
TALLEST, WIDEST = 11.0, 15.0  # of the picture [in]


class Overlay(NamedTuple):
    """What is drawn over a map besides its keyframes."""

    true: Array  # (n, 2) path, north, east [m]
    closures: Array  # (m, 2, 2) lines between the ends of loop closures, north, east [m]
    label: str  # of those


def sonar_map(log: VehicleLog, path: SonarPath, file: str | os.PathLike[str]) -> None:
    """Writes the picture of a log's map (PNG), with the true path and loop closures.

    Raises:
        InputError: it cannot be written.
    """
    figure = map_figure(path.images, path.poses, path.grid, overlay=overlay(log, path))
    axes = figure.axes[0]
    limits = axes.get_xlim(), axes.get_ylim()
    plan_view.draw_docks(axes, plan_view.docks_of(log))
    axes.set(xlim=limits[0], ylim=limits[1])
    axes.legend(loc="best", fontsize=9.5, framealpha=0.9)
    axes.set_title(f"Feature map by the sonar, {which_run(log)}", fontsize=12)
    save(figure, file)


def overlay(log: VehicleLog, path: SonarPath) -> Overlay:
    """The true path while frames were kept, and the loop closures as lines between the poses of their two frames.

    A frame that is no keyframe stands where it was estimated at the time.
    """
    truth, found, estimate = log["truth"], sonar_path.closures(log), log["estimate"]
    during = (truth["time"] >= path.times[0]) & (truth["time"] <= path.times[-1])
    known = np.isfinite(found.earlier)
    places = dict(zip(path.times.tolist(), path.poses[:, :2], strict=True))
    then = interpolate(found.later[known], estimate["time"], estimate["position"][:, :2])
    ends = [
        (places.get(later, place), places[earlier])
        for later, earlier, place in zip(found.later[known], found.earlier[known], then, strict=True)
        if earlier in places
    ]
    believed = int(log["matching"]["closures"].max(initial=0)) if "matching" in log else 0
    label = f"{believed} loop closures believed" + ("" if known.all() else ", not all drawn")
    return Overlay(truth["position"][during, :2], np.array(ends).reshape(-1, 2, 2), label)


def map_figure(
    images: Sequence[Array] | Array, poses: Array, grid: SectorGrid, *, overlay: Overlay | None = None
) -> Figure:
    """A figure of the map, north up.

    Args:
        images: Frames (rows, columns).
        poses: Where each was taken (k, 3): north, east [m], heading [rad].
        grid: Of the frames.
        overlay: What else is drawn.
    """
    chart = feature_map(images, poses, grid, CELL)
    low, high = np.nanpercentile(chart.image, (2.0, 99.5))
    west, east, south, north = chart.extent
    scale = min((WIDEST - 3.0) / (east - west), (TALLEST - 1.2) / (north - south))  # inches a metre
    figure = Figure(
        figsize=(max(scale * (east - west) + 2.6, 6.5), max(scale * (north - south) + 1.2, 5.0)), layout="constrained"
    )
    axes = figure.add_subplot()
    axes.set_facecolor(UNSEEN)
    colours = axes.imshow(chart.image, origin="lower", extent=chart.extent, cmap="gray", vmin=low, vmax=high)
    bar = figure.colorbar(colours, ax=axes, shrink=0.6, extend="both", pad=0.02)
    bar.set_label("mean filtered echo [-]; blue: not seen", fontsize=10.0)
    if overlay is not None:
        axes.plot(overlay.true[:, 1], overlay.true[:, 0], color=TRUE, lw=2.4, label="true path")
        if len(overlay.closures):
            lines = list(overlay.closures[:, :, ::-1])
            axes.add_collection(LineCollection(lines, colors=CLOSED, lw=0.8, label=overlay.label, zorder=3))
    label = f"estimated path, {len(poses)} frames"
    axes.plot(poses[:, 1], poses[:, 0], ".-", color=ESTIMATED, lw=0.9, ms=4.5, label=label)
    axes.plot(poses[0, 1], poses[0, 0], "o", mfc="white", mec="black", ms=7, ls="", label="first frame", zorder=5)
    axes.set(xlim=(west, east), ylim=(south, north))
    axes.legend(loc="best", fontsize=9.5, framealpha=0.9)
    dress(axes, "Feature map by the sonar", "east [m]", "north [m]")
    axes.grid(visible=False)
    _rose(axes)
    return figure


def _rose(axes: Axes) -> None:
    """An arrow to the north in the upper left corner."""
    arrow = {"arrowstyle": "-|>", "color": "black", "lw": 2.0, "mutation_scale": 16}
    box = {"boxstyle": "round,pad=0.25", "fc": "white", "ec": "none", "alpha": 0.8}
    axes.annotate("", xy=(0.05, 0.985), xytext=(0.05, 0.93), xycoords="axes fraction", arrowprops=arrow, zorder=8)
    axes.text(0.05, 0.915, "N", transform=axes.transAxes, ha="center", va="top", fontsize=12, fontweight="bold",
              bbox=box, zorder=8)  # fmt: skip


def save_map(log: VehicleLog, path: SonarPath, file: str | os.PathLike[str]) -> None:
    """Writes the map and the keyframes' path (NetCDF, groups `map` and `path`).

    Raises:
        InputError: it cannot be written.
    """
    netcdf.save(file, content(log, path))


def content(log: VehicleLog, path: SonarPath) -> Content:
    """The map on its coordinates by CF conventions, and pose, attitude and covariance of each keyframe."""
    chart = feature_map(path.images, path.poses, path.grid, CELL)
    attributes: dict[str, Any] = {"Conventions": "CF-1.10", "title": f"Feature map, {which_run(log)}"}
    for name in ("latitude", "longitude"):  # of the datum, if the scenario has them
        if name in log.log.attributes:
            attributes[f"datum_{name}"] = log.log.attributes[name]
    return Content({"map": _map_fields(chart), "path": _path_fields(log, path)}, {"": attributes})


def _map_fields(chart: FeatureMap) -> dict[str, Field]:
    rows, columns = chart.image.shape
    south, west = chart.origin
    return {
        "north": _axis("north", south + chart.cell * np.arange(rows), "Y", "projection_y_coordinate"),
        "east": _axis("east", west + chart.cell * np.arange(columns), "X", "projection_x_coordinate"),
        "echo": _field(("north", "east"), chart.image, "1", "mean filtered echo; NaN where nothing was seen"),
        "frames": _field(("north", "east"), chart.counts.astype(np.int32), "1", "frames that saw the cell"),
    }


def _path_fields(log: VehicleLog, path: SonarPath) -> dict[str, Field]:
    along = ("time",)
    tilt = sonar_path.tilt(log, path.times)
    fields = {
        "time": _field(along, path.times, "s", "stamp of the keyframe"),
        "north": _field(along, path.poses[:, 0], "m", "north of the datum"),
        "east": _field(along, path.poses[:, 1], "m", "east of the datum"),
        "depth": _field(along, sonar_path.depth(log, path.times), "m", "estimated depth"),
        "roll": _field(along, tilt[:, 0], "rad", "roll by the compass, not filtered"),
        "pitch": _field(along, tilt[:, 1], "rad", "pitch by the compass, not filtered"),
        "heading": _field(along, path.poses[:, 2], "rad", "heading, clockwise from north"),
        "covariance": _field(
            ("time", "axis", "axis_column"), path.covariances, "m2, m rad, rad2", "of north, east, heading"
        ),
    }
    return fields


def _field(dimensions: tuple[str, ...], values: NDArray[Any], units: str, meaning: str) -> Field:
    return Field(dimensions, np.ascontiguousarray(values), {"units": units, "long_name": meaning})


def _axis(name: str, values: Array, letter: str, standard: str) -> Field:
    meaning = f"{name} of the datum, middle of the cell"
    return Field((name,), values, {"units": "m", "long_name": meaning, "axis": letter, "standard_name": standard})
