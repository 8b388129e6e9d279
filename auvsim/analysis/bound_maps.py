"""Maps of the least error with which a place can be known: colours with contours, blind regions, vehicles, ellipses."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.patches import Ellipse as EllipsePatch
from matplotlib.patches import Patch
from numpy.typing import NDArray

from auvsim.analysis.style import dress
from auvsim.base.frames import Array
from estimators.core.information import Ellipse

COLOURS = "viridis_r"
LEVELS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)  # of contours [m]
ARROW = ((0.0, 1.0), (-0.65, -0.85), (0.0, -0.45), (0.65, -0.85), (0.0, 1.0))  # right and up, heading north
MOST_LEVELS = 7
STEPS = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)  # of contours within a decade, where few LEVELS fit


@dataclass(frozen=True, kw_only=True, slots=True)
class BoundMap:
    """The bound on a grid."""

    north: Array  # (m,) [m]
    east: Array  # (n,) [m]
    bound: Array  # (m, n) least rms error of the place [m]; infinite or NaN where there is none


class Symbol(NamedTuple):
    """A vehicle or beacon on a map."""

    label: str
    north: float  # [m]
    east: float  # [m]
    heading: float | None = None  # clockwise from north [rad]; None: it has none, as a beacon
    colour: str = "#d62728"
    marker: str = "^"  # of those without a heading


class Region(NamedTuple):
    """A part of a map that is marked by dots."""

    label: str
    inside: NDArray[np.bool_]  # (m, n) on the map's grid


class MapEllipse(NamedTuple):
    """An error ellipse on a map."""

    north: float  # of its centre [m]
    east: float
    ellipse: Ellipse
    colour: str = "#222222"


def sample(bound: Callable[[Array], Array], north: Array, east: Array) -> BoundMap:
    """The bound on a grid.

    Args:
        bound: (k, 2) north and east [m] -> least rms errors (k,) [m].
        north: (m,) [m], ascending.
        east: (n,) [m], ascending.
    """
    points = np.stack(np.meshgrid(north, east, indexing="ij"), axis=-1)
    values = bound(points.reshape(-1, 2)).reshape(points.shape[:2])
    return BoundMap(north=north, east=east, bound=values)


def draw(
    axes: Axes,
    shown: BoundMap,
    *,
    title: str,
    blind: float = math.inf,
    limits: tuple[float, float] | None = None,
    symbols: Sequence[Symbol] = (),
    ellipses: Sequence[MapEllipse] = (),
    ellipse_scale: float = 1.0,
    regions: Sequence[Region] = (),
    quantity: str = "least rms position error [m]",
) -> None:
    """Draws a map of the bound, east to the right and north up, with a colour bar and a legend.

    Args:
        axes: Of a figure with room for a colour bar.
        shown: The bound on a grid.
        title: Of the axes.
        blind: Bound [m] from which a place counts as blind and is hatched; those without a bound always are.
        limits: Of the colours [m]; by default the least bound and its 98 % quantile.
        symbols: Vehicles and beacons.
        ellipses: Error ellipses.
        ellipse_scale: By which ellipses are enlarged, so that they can be seen; the legend says so.
        regions: Parts that are marked.
        quantity: What the colour bar shows.
    """
    east, north = np.meshgrid(shown.east, shown.north)
    seen = np.isfinite(shown.bound) & (shown.bound < blind)
    values = np.ma.masked_array(shown.bound, ~seen)
    handles: list[Any] = []
    if seen.any():
        low, high = limits or (float(values.min()), float(np.quantile(shown.bound[seen], 0.98)))
        high = max(high, 1.001 * low)
        mesh = axes.pcolormesh(east, north, values, norm=LogNorm(low, high), cmap=COLOURS, shading="gouraud")
        if np.ma.is_masked(values):  # gouraud shading needs all corners
            mesh.remove()
            mesh = axes.pcolormesh(east, north, values, norm=LogNorm(low, high), cmap=COLOURS, shading="nearest")
        bar = axes.figure.colorbar(mesh, ax=axes, extend="max", pad=0.02)
        bar.set_label(quantity, fontsize=10.5)
        levels = _levels(low, high)
        bar.set_ticks(levels, labels=[f"{level:g}" for level in levels], minor=False)
        bar.ax.minorticks_off()
        lines = axes.contour(east, north, values, levels=levels, colors="white", linewidths=0.9)
        axes.clabel(lines, fmt=lambda level: f"{level:g}", fontsize=8.5)
    if not seen.all():
        region = np.where(seen, 0.0, 1.0)
        axes.contourf(east, north, region, levels=(0.5, 1.5), colors=["#dddddd"], hatches=["////"], zorder=1.5)
        what = f"blind: above {blind:.3g} m" if math.isfinite(blind) else "blind: no bound"
        handles.append(Patch(facecolor="#dddddd", edgecolor="#222222", hatch="////", label=what))
    for region in regions:
        if np.any(region.inside):
            inside = np.where(region.inside, 1.0, 0.0)
            axes.contourf(east, north, inside, levels=(0.5, 1.5), colors="none", hatches=["oo"], zorder=1.6)
            handles.append(Patch(facecolor="none", edgecolor="#222222", hatch="oo", label=region.label))
    for e in ellipses:
        if math.isfinite(e.ellipse.major):
            axes.add_patch(_patch(e, ellipse_scale))
    if any(math.isfinite(e.ellipse.major) for e in ellipses):
        enlarged = "" if ellipse_scale == 1.0 else f", enlarged {ellipse_scale:g} times"
        line = {"marker": "o", "ls": "", "mfc": "none", "mec": ellipses[0].colour, "ms": 9}
        handles += axes.plot([], [], label=f"error ellipse{enlarged}", **line)
    handles += _draw_symbols(axes, symbols)
    axes.set_aspect("equal")
    axes.set(xlim=(shown.east[0], shown.east[-1]), ylim=(shown.north[0], shown.north[-1]))
    dress(axes, title, "east [m]", "north [m]")
    if handles:
        axes.legend(
            handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3, fontsize=9.0, frameon=False
        )


def _levels(low: float, high: float) -> list[float]:
    """Round contour levels between two bounds: a few, however near to each other these are."""
    inside = [level for level in LEVELS if low <= level <= high]
    if len(inside) >= 3:
        return inside[:: math.ceil(len(inside) / MOST_LEVELS)]
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    fine = [round(step * 10.0**k, 9) for k in decades for step in STEPS]
    inside = [level for level in fine if low <= level <= high]
    inside = inside[:: math.ceil(len(inside) / MOST_LEVELS) or 1]
    return inside if len(inside) >= 2 else [float(f"{v:.6g}") for v in np.linspace(low, high, 4)]


def _patch(e: MapEllipse, scale: float) -> EllipsePatch:
    # Matplotlib turns counter-clockwise from east, a bearing clockwise from north.
    return EllipsePatch(
        (e.east, e.north), 2.0 * scale * e.ellipse.major, 2.0 * scale * e.ellipse.minor,
        angle=90.0 - math.degrees(e.ellipse.bearing), fill=False, ec=e.colour, lw=1.6, zorder=6,
    )  # fmt: skip


def _draw_symbols(axes: Axes, symbols: Sequence[Symbol]) -> list[Any]:
    """Each symbol, pointing where it heads; one legend entry a label."""
    handles, named = [], set()
    for s in symbols:
        marker: Any = s.marker if s.heading is None else _arrow(s.heading)
        label = None if s.label in named else s.label
        line = axes.plot(s.east, s.north, ls="", marker=marker, ms=11, mfc=s.colour, mec="white", label=label, zorder=7)
        if label is not None:
            handles += line
            named.add(label)
    return handles


def _arrow(heading: float) -> Array:
    """Vertices of a marker that points along a heading."""
    c, s = math.cos(heading), math.sin(heading)
    return np.array(ARROW) @ np.array([[c, -s], [s, c]])
