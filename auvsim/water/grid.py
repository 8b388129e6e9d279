"""Currents interpolated on a grid of time, depth and horizontal place."""

from bisect import bisect_right
from typing import Literal

import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.water import grid_file
from auvsim.water.field import Water
from auvsim.water.settings import GridSettings

_NAMES = ("time", "depth", "north", "east")
_UNITS = ("s", "m", "m", "m")


class Grid:
    """A current between the points of a grid, by cubics in each axis: continuous with its derivative and gradient.

    Slopes at the points are those of the parabola through a point and its two neighbours (three points at an edge), so
    the error falls with the third power of the spacing. An axis of two points is linear, of one point constant.

    Args:
        axes: four increasing ones: time [s]; depth, north, east [m].
        velocity: (time, depth, north, east, 3) NED [m/s].
        outside: refuse what lies outside, or hold the value at the edge (its gradient across the edge is then zero).
        start: time on the grid's axis at time zero [s].
    """

    steady_uniform = False

    def __init__(
        self,
        axes: tuple[Array, Array, Array, Array],
        velocity: Array,
        outside: Literal["refuse", "hold"] = "refuse",
        start: float = 0.0,
    ) -> None:
        self._axes = [axis.tolist() for axis in axes]
        self._axes[0] = (axes[0] - start).tolist()
        self._velocity, self._outside = velocity, outside
        self._slopes = [_slopes(axis) for axis in axes]

    @classmethod
    def read(cls, settings: GridSettings, duration: float) -> "Grid":
        """The grid of a file, for a duration [s].

        Raises:
            InputError: the file cannot be used, or ends before the duration and is not to be held.
        """
        found = grid_file.read(settings)
        last = float(found.axes[0][-1]) - settings.start
        if settings.outside == "refuse" and found.axes[0].size > 1 and last < duration:
            text = f"{last:g} s of currents from the start on, {duration:g} s are needed; or set outside: hold"
            raise InputError(f"{settings.file}: {text}")
        return cls(found.axes, found.velocity, settings.outside, settings.start)

    def _weights(self, axis: int, at: float) -> tuple[int, Array]:
        """First point that counts at a coordinate, and the weights (2, n) of value and derivative from it on."""
        points = self._axes[axis]
        if len(points) == 1:
            return 0, np.array([[1.0], [0.0]])
        inside = min(max(at, points[0]), points[-1])
        if inside != at and self._outside == "refuse":
            span = f"{points[0]:g} to {points[-1]:g} {_UNITS[axis]}"
            raise InputError(f"the gridded current has {_NAMES[axis]} {span}, not {at:g}; or set outside: hold")
        i = min(bisect_right(points, inside) - 1, len(points) - 2)
        width = points[i + 1] - points[i]
        s = (inside - points[i]) / width
        basis = np.array(
            [
                [(1 + 2 * s) * (1 - s) ** 2, s * s * (3 - 2 * s), width * s * (1 - s) ** 2, width * s * s * (s - 1)],
                [6 * s * (s - 1) / width, 6 * s * (1 - s) / width, (1 - s) * (1 - 3 * s), s * (3 * s - 2)],
            ]
        )
        if inside != at:
            basis[1] = 0.0
        first = max(0, min(i - 1, len(points) - 4))
        last = min(len(points), first + 4)
        rows = np.zeros((4, last - first))
        rows[0, i - first] = rows[1, i + 1 - first] = 1.0
        rows[2:] = self._slopes[axis][i : i + 2, first:last]
        return first, basis @ rows

    def evaluate(self, time: float, position: Array) -> Water:
        """The water at a time [s] and a position (3,) in NED [m].

        Raises:
            InputError: outside the grid, if `outside` is `refuse`.
        """
        north, east, depth = np.asarray(position, dtype=float).tolist()
        weights, block = [], []
        for axis, at in enumerate((time, depth, north, east)):
            first, weight = self._weights(axis, at)
            weights.append(weight)
            block.append(slice(first, first + weight.shape[1]))
        values = self._velocity[tuple(block)]  # (t, z, n, e, 3)
        # Axis after axis: value and derivative stay in front, the rest shrinks.
        in_east = np.einsum("tznec,ae->atznc", values, weights[3])
        in_north = np.einsum("tznc,an->atzc", in_east[0], weights[2])
        along_east = np.einsum("tznc,n->tzc", in_east[1], weights[2][0])
        in_depth = np.einsum("tzc,az->atc", in_north[0], weights[1])
        time_value, time_slope = weights[0]
        gradient = np.stack(
            [
                np.einsum("tzc,z,t->c", in_north[1], weights[1][0], time_value),
                np.einsum("tzc,z,t->c", along_east, weights[1][0], time_value),
                time_value @ in_depth[1],
            ],
            axis=1,
        )
        return Water(velocity=time_value @ in_depth[0], derivative=time_slope @ in_depth[0], gradient=gradient)


def _slopes(points: Array) -> Array:
    """Matrix (n, n) from values at the points to slopes there."""
    count = points.size
    matrix = np.zeros((count, count))
    for i in range(count if count > 1 else 0):
        first = max(0, min(i - 1, count - 3))
        near = points[first : first + 3]
        for k, own in enumerate(near):  # derivative of Lagrange's polynomial of `own` at point i
            others = np.delete(near, k)
            scale = np.prod(own - others)
            total = sum(np.prod(np.delete(points[i] - others, j)) for j in range(others.size))
            matrix[i, first + k] = total / scale
    return matrix
