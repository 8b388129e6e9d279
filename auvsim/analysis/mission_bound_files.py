"""Files of a mission's bound: maps as PNG, everything as NetCDF."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from auvsim.analysis import bound_maps
from auvsim.analysis.bound_maps import BoundMap, Region, Symbol
from auvsim.analysis.mission_bounds import FollowerBound
from auvsim.analysis.style import save, vehicle_colour
from auvsim.base.frames import Array
from auvsim.data import netcdf
from auvsim.data.netcdf import Content, Field
from estimators.motion_radius.geometry import PROBABLE

GROUP = "bound"  # of the file


def write(found: FollowerBound, folder: Path) -> list[Path]:
    """Writes bound_FOLLOWER.png and bound_FOLLOWER.nc.

    Raises:
        InputError: If one of them cannot be written.
    """
    picture, data = folder / f"bound_{found.follower}.png", folder / f"bound_{found.follower}.nc"
    save(figure(found), picture)
    netcdf.save(data, content(found))
    return [picture, data]


def figure(found: FollowerBound) -> Figure:
    """Maps of the bound of position and current over where the moved one starts, with the planned ways."""
    figure = Figure(figsize=(15.0, 7.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    symbols = [_symbol(found, name, k) for k, name in enumerate(found.ways)]
    if found.moved not in found.ways:
        symbols.append(Symbol(found.moved, *found.start, colour=vehicle_colour(len(found.ways)), marker="s"))
    mirror = [Region(f"mirror: a second solution is more probable than {PROBABLE:.0%}", found.mirrored)]
    unseen = found.blind
    end = found.times[-1]
    shown = (
        (left, found.settled, f"Position, rms after {found.after:.0f} s", "least rms position error [m]"),
        (right, found.current[..., -1], f"Current, after {end:.0f} s", "least rms current error [m/s]"),
    )
    for axes, values, title, quantity in shown:
        grid = BoundMap(north=found.north, east=found.east, bound=np.where(unseen, math.nan, values))
        limits = _limits(grid.bound)
        bound_maps.draw(axes, grid, title=title, symbols=symbols, regions=mirror, quantity=quantity, limits=limits)
        for k, way in enumerate(found.ways.values()):
            axes.plot(way.places[:, 1], way.places[:, 0], color=vehicle_colour(k), lw=1.1, alpha=0.8, zorder=5)
    for m, n in np.argwhere(np.isfinite(found.beyond)).tolist():
        text = f"{found.beyond[m, n]:.3g} m"
        left.text(found.east[n], found.north[m], text, fontsize=8.5, ha="center", va="center", zorder=8, clip_on=True,
                  bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 1.0})  # fmt: skip
    figure.suptitle(
        f"Cramér-Rao bound of {found.follower}, over where {found.moved} starts (blind: rank below 4 or above "
        f"{found.blind_above:g} m; numbers there: what to expect beyond first order)",
        fontsize=13,
    )
    return figure


def content(found: FollowerBound) -> Content:
    """Everything on the grid, as a file that describes itself."""
    place, whole = ("north", "east"), ("north", "east", "time")

    def field(dimensions: tuple[str, ...], values: NDArray[Any], units: str, meaning: str) -> Field:
        return Field(dimensions, np.ascontiguousarray(values), {"units": units, "long_name": meaning})

    what = f"start of {found.moved}"
    fields = {
        "north": field(("north",), found.north, "m", f"{what}, north of the datum"),
        "east": field(("east",), found.east, "m", f"{what}, east of the datum"),
        "time": field(("time",), found.times, "s", "simulated time"),
        "position": field(whole, found.position, "m", "least rms error of the position"),
        "current": field(whole, found.current, "m/s", "least rms error of the current"),
        "settled": field(place, found.settled, "m", f"least rms error of the position after {found.after:g} s"),
        "expected": field(
            place, found.expected, "m", "rms error of the position to expect; NaN where blind and not computed"
        ),
        "rank": field(place, found.rank.astype(np.int32), "1", "how many of position and current are told, of 4"),
        "condition": field(place, found.condition, "1", "largest over smallest singular value of what is told"),
        "mirror": field(place, found.mirror, "1", "probability of a second solution"),
        "blind": field(place, found.blind.astype(np.int32), "1", "1 where the geometry does not tell enough"),
    }
    attributes: dict[str, Any] = {
        "follower": found.follower, "moved": found.moved, "blind_above": found.blind_above, "after": found.after,
        "start_north": found.start[0], "start_east": found.start[1],
    }  # fmt: skip
    return Content({GROUP: fields}, {GROUP: attributes})


def _symbol(found: FollowerBound, name: str, number: int) -> Symbol:
    way = found.ways[name]
    north, east = way.places[0].tolist()
    label = f"{name} (moved), as planned" if name == found.moved else name
    return Symbol(label, north, east, heading=float(way.inputs[0, 2]), colour=vehicle_colour(number))


def _limits(values: Array) -> tuple[float, float] | None:
    seen = values[np.isfinite(values)]
    return (float(seen.min()), float(np.quantile(seen, 0.95))) if seen.size else None
