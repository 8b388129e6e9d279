"""Files of a floor's bound: the map with the planned way as PNG, everything as NetCDF."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from auvsim.analysis.floor_bound import STEP, FloorBound
from auvsim.analysis.style import dress, legend, save
from auvsim.data import netcdf
from auvsim.data.netcdf import Content, Field

RED = "#d62728"
SCALE, TICKS = (0.01, 1.0), (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)  # of the colours, the same for all floors [m]
MOST = 700  # points along a side that are drawn; more would not be seen


def write(found: FloorBound, holds: float, folder: Path) -> list[Path]:
    """Writes floor.png and floor.nc; `holds` is the deviation up to which a match counts [m].

    Raises:
        InputError: If one of them cannot be written.
    """
    picture, data = folder / "floor.png", folder / "floor.nc"
    save(figure(found, holds), picture)
    netcdf.save(data, content(found))
    return [picture, data]


def figure(found: FloorBound, holds: float) -> Figure:
    """The bound and the depth over the floor, with the planned way; hatched where matching does not hold."""
    figure = Figure(figsize=(15.0, 8.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    every = math.ceil(max(found.bound.shape) / MOST)
    north, east = found.north[::every], found.east[::every]
    bound, depth = found.bound[::every, ::every], found.depth[::every, ::every]
    mesh = left.pcolormesh(
        east, north, np.minimum(bound, 1e6), norm=LogNorm(*SCALE), cmap="viridis_r", shading="nearest"
    )
    bar = figure.colorbar(mesh, ax=left, pad=0.02, shrink=0.85, extend="both")
    bar.set_label("least standard deviation of a match [m]", fontsize=10.5)
    bar.set_ticks(TICKS, labels=[f"{tick:g}" for tick in TICKS])
    bar.ax.axhline(holds, color=RED, lw=2.0)
    fails = np.where(bound > holds, 1.0, 0.0)
    if fails.any():
        left.contourf(east, north, fails, levels=(0.5, 1.5), colors="none", hatches=["///"], zorder=2)
    seen = found.sight
    dress(left, f"One match of frames {seen.apart:.3g} m apart, along its worst axis", "east [m]", "north [m]")
    mesh = right.pcolormesh(east, north, depth, cmap="Blues", shading="nearest")
    bar = figure.colorbar(mesh, ax=right, pad=0.02, shrink=0.85)
    bar.set_label("depth [m]", fontsize=10.5)
    bar.ax.invert_yaxis()
    dress(right, "Depth of the floor", "east [m]", "north [m]")
    for axes in (left, right):
        axes.plot(found.way[:, 1], found.way[:, 0], color=RED, lw=1.4, zorder=6)
        axes.grid(visible=False)
        axes.set_aspect("equal")
        axes.set(xlim=(east[0], east[-1]), ylim=(north[0], north[-1]))
    entries: dict[str, Any] = {"planned way": right.get_lines()[0]} if np.isfinite(found.along).any() else {}
    if fails.any():
        entries[f"above {holds:g} m: does not hold"] = Patch(facecolor="none", edgecolor="black", hatch="///")
    if entries:
        legend(figure, entries)
    figure.suptitle(
        f"Where matching will hold, from {seen.altitude:g} m above the floor: up to {holds:g} m on "
        f"{float((found.bound <= holds).mean()):.0%} of it", fontsize=13,
    )  # fmt: skip
    return figure


def content(found: FloorBound) -> Content:
    """Everything, on coordinates by CF conventions, as a file that describes itself."""

    def field(dimensions: tuple[str, ...], values: NDArray[Any], units: str, meaning: str, **more: str) -> Field:
        return Field(dimensions, np.ascontiguousarray(values), {"units": units, "long_name": meaning, **more})

    place = ("north", "east")
    deep = "sea_floor_depth_below_mean_sea_level"
    floor = {
        "north": field(
            ("north",), found.north, "m", "north of the datum", axis="Y", standard_name="projection_y_coordinate"
        ),
        "east": field(
            ("east",), found.east, "m", "east of the datum", axis="X", standard_name="projection_x_coordinate"
        ),
        "bound": field(place, found.bound, "m", "least standard deviation of a match; infinite where nothing tells"),
        "depth": field(place, found.depth, "m", "depth of the sea floor", standard_name=deep),
    }
    way = {
        "distance": field(("distance",), STEP * np.arange(len(found.along)), "m", "along the planned way"),
        "north": field(("distance",), found.stations[:, 0], "m", "north of the datum"),
        "east": field(("distance",), found.stations[:, 1], "m", "east of the datum"),
        "bound": field(("distance",), found.along, "m", "the bound there; NaN off the floor"),
    }
    seen = found.sight
    attributes: dict[str, Any] = {
        "altitude": seen.altitude, "apart": seen.apart, "overlap": seen.overlap, "slope_gain": seen.gains.slope,
        "strength_gain": seen.gains.strength,
    }  # fmt: skip
    return Content({"floor": floor, "way": way}, {"": {"Conventions": "CF-1.10"}, "floor": attributes})
