"""What plan views share: docks to scale with a symbol that can be seen, the mean current, limits."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from auvsim.analysis.style import DOCK, WATER, dress
from auvsim.base.frames import Array
from auvsim.data.log import StructureLog, VehicleLog
from auvsim.missions.docking.dock_frame import funnel_outline


def docks_of(log: VehicleLog) -> list[StructureLog]:
    """The structures that a vehicle has to do with: of its mission, or whose USBL serves it."""
    names = {str(log.attributes.get(key, "")): None for key in ("dock", "usbl_structure")}
    return [log.log.structure(name) for name in names if name]


def window(axes: Axes, *points: Array) -> Array:
    """Sets square limits round points (n, 2), east and north; returns the points within -1..1 of them."""
    shown = np.concatenate([*points, np.empty((0, 2))])
    shown = shown[np.isfinite(shown).all(axis=1)]
    low, high = (shown.min(axis=0), shown.max(axis=0)) if len(shown) else (np.zeros(2), np.zeros(2))
    centre, half = (low + high) / 2.0, max(0.56 * float((high - low).max()), 5.0)
    axes.set(xlim=(centre[0] - half, centre[0] + half), ylim=(centre[1] - half, centre[1] + half))
    axes.set_aspect("equal", adjustable="box")
    dress(axes, "Plan view", "east [m]", "north [m]")
    return (shown - centre) / half


def draw_docks(axes: Axes, docks: Sequence[StructureLog]) -> None:
    """Docks, each with the axis on the side from which vehicles come; with their names where there are several."""
    (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
    reach = 2.0 * max(east - west, north - south)
    for index, dock in enumerate(docks):
        names = (None, None) if index else ("dock axis", "dock")
        place = dock.position[1::-1]
        course = np.array([math.sin(dock.heading), math.cos(dock.heading)])  # east, north
        axes.plot(*(place + np.outer((0.0, -reach), course)).T, ":", color=DOCK, lw=1.1, label=names[0])
        walls = [wall @ np.array([course, [course[1], -course[0]]]) for wall in funnel_outline(dock)]
        for wall in walls:
            axes.plot(*(place + wall).T, color=DOCK, lw=2.0, zorder=5)
        # To scale it can be too small to see: a symbol of the same shape, mouth to the approaching vehicle.
        symbol = np.concatenate([walls[0], walls[1][::-1]])
        axes.plot(*place, marker=symbol, mfc="#f0d9c4", mec=DOCK, ms=26, ls="", zorder=2, label=names[1])
        if len(docks) > 1:
            inward = 1.0 if place[0] < (west + east) / 2.0 else -1.0  # so that the name stays inside
            style: dict[str, Any] = {"color": DOCK, "fontsize": 10.5, "fontweight": "bold", "zorder": 7}
            style["ha"] = "left" if inward > 0.0 else "right"
            axes.annotate(dock.name, tuple(place), (14.0 * inward, -14.0), textcoords="offset points", **style)


def draw_current(axes: Axes, flow: Array, shown: Array) -> None:
    """The mean current of (n, 3) [m/s] as an arrow in the corner that the shown points, in -1..1, leave most free."""
    corners = [(x, y) for y in (-0.8, 0.8) for x in (-0.7, 0.7)]
    x, y = min(corners, key=lambda corner: int(np.sum(np.abs(shown - np.array(corner)).max(axis=1) < 0.35)))
    inset = axes.inset_axes((0.5 + 0.5 * x - 0.1, 0.5 + 0.5 * y - 0.07, 0.2, 0.14))
    inset.set_axis_off()
    inset.set(xlim=(-1.0, 1.0), ylim=(-1.0, 1.0), aspect="equal")
    north, east = flow[:, :2].mean(axis=0) if len(flow) else np.zeros(2)
    speed = math.hypot(north, east)
    if speed > 0.0:
        tip = 0.8 * np.array([east, north]) / speed
        arrow = {"arrowstyle": "-|>", "color": WATER, "lw": 2.2, "mutation_scale": 16}
        inset.annotate("", xy=tuple(tip), xytext=tuple(-tip), arrowprops=arrow)
    course = math.degrees(math.atan2(east, north)) % 360.0
    text = f"current {speed:.2f} m/s to {course:.0f}°" if speed > 0.0 else "no current"
    inset.set_title(text, fontsize=9.5, color=WATER, pad=3)
