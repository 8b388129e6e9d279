"""What a log holds of navigation by a sonar besides estimates: loop closures, the dive point, the path at the end.

The path is that of the keyframes given all that was measured until the run ended: pose and covariance of each, and what
it showed, so that the feature map can be made of the log alone.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from auvsim.data.variables import TIME, Group, Table, Variable
from auvsim.navigation.navigator import Navigator
from auvsim.navigation.sonar import SonarNavigator
from estimators.map_path.keyframes import MARKED, KeyframeState
from estimators.map_path.poses import wrapped

MATCHING, CLOSURES, PATH = "matching", "closures", "path"  # groups
SHADES = 127  # of a frame, to each side of 0

TABLES: dict[str, Table] = {
    MATCHING: {
        **TIME,
        "closures": Variable((), "int32", "1", "loop closures believed so far"),
        "dive": Variable(("north_east",), "float64", "m", "where the dive began, as estimated now; NaN before", "NED"),
    },
    CLOSURES: {
        "time": Variable((), "float64", "s", "when a loop closure was believed"),
        "later": Variable((), "float64", "s", "stamp of the frame that closes the loop"),
        "earlier": Variable((), "float64", "s", "stamp of a keyframe that it was matched with"),
    },
    PATH: {
        "time": Variable((), "float64", "s", "stamp of a keyframe, or of the begin of the dive"),
        "frame": Variable((), "bool", "1", "whether a frame was kept there; none is where the dive began"),
        "pose": Variable(("axis",), "float64", "m, m, rad", "north, east, heading given all until the run ended", "NED",
                         labels=("north", "east", "heading")),
        "covariance": Variable(("axis", "axis_column"), "float64", "SI", "covariance of the pose",
                               labels=("north", "east", "heading")),
        "image": Variable(("forward", "starboard"), "int8", "1", "standardised, filtered echo by `scale`", "body"),
        "scale": Variable((), "float64", "1", "echo of image value 1"),
        "cell": Variable((), "float64", "m", "side of the image's cells; its first row is nearest, column to port"),
        "nearest": Variable((), "float64", "m", "least horizontal range that is seen"),
        "farthest": Variable((), "float64", "m", "greatest horizontal range that is seen"),
        "half_sector": Variable((), "float64", "rad", "greatest bearing that is seen, to either side"),
        "ahead": Variable((), "float64", "m", "place of the sonar ahead of the vehicle's origin", "body"),
    },
}  # fmt: skip


class Row(NamedTuple):
    """A row of a group."""

    group: str
    values: tuple[Any, ...]


class SonarLog:
    """Watches a navigator for the log.

    Args:
        navigator: Whose loop closures and path are logged.
    """

    def __init__(self, navigator: SonarNavigator) -> None:
        self._navigator = navigator
        self._links = 0  # logged so far

    @property
    def groups(self) -> dict[str, Group]:
        """The groups in the log."""
        forward, starboard = self._navigator.grid.shape
        sizes = {"axis": 3, "axis_column": 3, "forward": forward, "starboard": starboard}
        return {name: Group(table, sizes if name == PATH else {}) for name, table in TABLES.items()}

    def rows(self, time: float) -> list[Row]:
        """What is new after an update at a time [s]."""
        now = self._state
        links = () if now is None else now.links
        before, self._links = self._links, len(links)
        dive = np.full(2, math.nan) if now is None or now.mark is None else now.mark[1][:2].copy()
        rows = [Row(MATCHING, (time, 0 if now is None else now.closed, dive))]
        return rows + [Row(CLOSURES, (time, *pair)) for pair in links[before:]]

    def path(self) -> list[Row]:
        """The path, when the run ends."""
        state, grid = self._state, self._navigator.grid
        if state is None:
            return []
        geometry = (grid.cell, *grid.ranges, grid.half_sector, grid.ahead)
        rows = []
        for k, (number, stamp, frame) in enumerate(zip(state.numbers, state.stamps, state.frames, strict=True)):
            own = slice(state.size + 3 * k, state.size + 3 * k + 3)
            north, east, heading = state.poses[k]
            scale = max(float(np.abs(frame.values).max()), 1e-12) / SHADES
            image = np.rint(frame.values / scale).astype(np.int8)
            pose = np.array((north, east, wrapped(heading)))
            rows.append(
                Row(PATH, (stamp, number != MARKED, pose, state.whole.covariance[own, own], image, scale, *geometry))
            )
        return rows

    @property
    def _state(self) -> KeyframeState | None:
        state = self._navigator._estimator.history.state
        return state if isinstance(state, KeyframeState) else None


def sonar_log(navigator: Navigator) -> SonarLog | None:
    """What watches a navigator, if it navigates by a sonar."""
    return SonarLog(navigator) if isinstance(navigator, SonarNavigator) else None
