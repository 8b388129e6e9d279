"""Picture of the feature map: a sonar's frames laid over each other at their estimated poses, with the path."""

import os
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from auvsim.analysis.style import dress, save
from auvsim.base.frames import Array
from estimators.map_path.feature_map import feature_map
from estimators.map_path.frames import SectorGrid

CELL = 0.5  # of the map [m]


def sonar_map(images: Sequence[Array], poses: Array, grid: SectorGrid, path: str | os.PathLike[str]) -> None:
    """Writes the picture (PNG).

    Args:
        images: frames (rows, columns).
        poses: where each was taken (k, 3): north, east [m], heading [rad].
        grid: of the frames.
        path: of the picture.

    Raises:
        InputError: it cannot be written.
    """
    save(map_figure(images, poses, grid), path)


def map_figure(images: Sequence[Array], poses: Array, grid: SectorGrid) -> Figure:
    """The figure that `sonar_map` writes; north is up."""
    chart = feature_map(images, poses, grid, CELL)
    low, high = np.nanpercentile(chart.image, (2.0, 99.5))
    figure = Figure(figsize=(10.0, 10.0), layout="constrained")
    axes = figure.add_subplot()
    axes.set_facecolor("#888888")
    colours = axes.imshow(chart.image, origin="lower", extent=chart.extent, cmap="gray", vmin=low, vmax=high)
    figure.colorbar(colours, ax=axes, label="mean filtered echo [-]; grey: not seen", shrink=0.7)
    axes.plot(poses[:, 1], poses[:, 0], color="#ffb000", lw=1.3, label=f"estimated path, {len(poses)} frames")
    axes.plot(poses[0, 1], poses[0, 0], "o", mfc="white", mec="black", ms=7, ls="", label="first frame")
    axes.legend(loc="upper left", fontsize=10.0)
    dress(axes, "Feature map by the sonar", "east [m]", "north [m]")
    axes.grid(visible=False)
    return figure
