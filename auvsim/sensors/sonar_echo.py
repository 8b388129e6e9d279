"""Echoes of the sea floor and of objects in an imaging sonar: mean intensities by a horizon scan, compiled.

Lambert's law (backscatter as the sine squared of the grazing angle), spherical spreading and absorption both ways, a
Gaussian beam in elevation, shadows behind what is higher, and a second path by way of the surface.
"""

import math

import numba
import numpy as np

from auvsim.base.frames import Array

BESIDE = 1.2  # widths from the beam's axis in elevation beyond which nothing is heard: 35 dB down


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _bilinear(field, at_north, at_east):
    """Value of a field at a place in cells, and its slopes along both; held beyond the edge."""
    rows, columns = field.shape
    i = min(max(math.floor(at_north), 0), rows - 2)
    j = min(max(math.floor(at_east), 0), columns - 2)
    s, t = min(max(at_north - i, 0.0), 1.0), min(max(at_east - j, 0.0), 1.0)
    a, b, c, d = field[i, j], field[i, j + 1], field[i + 1, j], field[i + 1, j + 1]
    value = (a * (1.0 - t) + b * t) * (1.0 - s) + (c * (1.0 - t) + d * t) * s
    inside_north = 0.0 <= at_north <= rows - 1.0
    inside_east = 0.0 <= at_east <= columns - 1.0
    to_north = ((c - a) * (1.0 - t) + (d - b) * t) if inside_north else 0.0
    to_east = ((b - a) * (1.0 - s) + (d - c) * s) if inside_east else 0.0
    return value, to_north, to_east


@numba.njit(cache=True, nogil=True, error_model="numpy")
def scan(depths, strength, grid, pose, beams, bins, beam, loss, ghost, fan, hits, out):
    """Adds to `out` (beams, bins) the mean intensity of each beam and range, before the receiver's gain.

    Along each beam the floor is walked from near to far. A point is seen where no nearer one stands higher in the
    sonar's eye; it sends back the share of the beam that falls on it.

    Args:
        depths: (n, m) of the sea floor [m].
        strength: (n, m) backscatter; (1, 1) where it is one everywhere.
        grid: (4,) north and east of the first point [m], spacing to north and to east [m].
        pose: (5,) north, east, depth [m], heading and depression of the axis [rad].
        beams: (b,) bearings from the heading, to starboard positive [rad].
        bins: (2,) middle of the first bin, its width [m].
        beam: (2,) width in bearing that a beam stands for, width of the beam in elevation at half power [rad].
        loss: (bins,) share of the power that comes back from each range, spreading and absorption both ways.
        ghost: power of the path by the surface by that of the direct one.
        fan: (2,) angles below the horizon between which `hits` were looked for [rad].
        hits: (b, e) range at which each beam meets an object [m], infinite where it meets none, in the middle of e
            equal parts of the fan from high to low; (b, 0) without objects.
        out: to which it is added.
    """
    number, count = out.shape
    elevations = hits.shape[1]
    north, east, depth, heading, axis = pose
    width = bins[1]
    first = bins[0] - 0.5 * width
    farthest = first + width * count
    wide, high = beam
    sharpness = 8.0 * math.log(2.0) / (high * high)  # of the two-way pattern
    highest, lowest = math.tan(axis - BESIDE * high), math.tan(min(axis + BESIDE * high, 1.55))
    plain = strength.shape[0] == 1
    for b in range(number):
        ahead, aside = math.cos(heading + beams[b]), math.sin(heading + beams[b])
        north_step, east_step = width * ahead / grid[2], width * aside / grid[3]
        at_north, at_east = (north - grid[0]) / grid[2] - 0.5 * north_step, (east - grid[1]) / grid[3] - 0.5 * east_step
        steepest = 1e30  # least depth by distance so far, of what is seen
        for k in range(int(farthest / width)):
            s = (k + 0.5) * width
            at_north += north_step
            at_east += east_step
            floor, to_north, to_east = _bilinear(depths, at_north, at_east)
            h = floor - depth
            slope = h / s
            if slope >= steepest:
                continue  # in the shadow of something nearer
            steepest = slope
            if slope > lowest or slope < highest:
                continue
            distance = math.sqrt(s * s + h * h)
            at = (distance - first) / width
            if at < 0.0 or at >= count:
                continue
            to_north, to_east = to_north / grid[2], to_east / grid[3]
            tilt = to_north * to_north + to_east * to_east + 1.0
            # Sine of the grazing angle, by the root of the tilt: the ray against the surface's normal.
            facing = (h - s * (to_north * ahead + to_east * aside)) / distance
            if facing <= 0.0:
                continue
            below = math.atan(slope)
            if elevations:
                e = int((below - fan[0]) / (fan[1] - fan[0]) * elevations)
                if 0 <= e < elevations and hits[b, e] < distance:
                    continue
            below -= axis
            # Lambert's law on an area of s wide width sqrt(tilt).
            echo = facing * facing * s * wide * width / math.sqrt(tilt) * math.exp(-sharpness * below * below)
            if not plain:
                i = min(max(int(at_north + 0.5), 0), strength.shape[0] - 1)
                j = min(max(int(at_east + 0.5), 0), strength.shape[1] - 1)
                echo *= strength[i, j]
            echo *= loss[int(at)]
            # The step's share of the floor covers this many bins of range, which may straddle two.
            spans = min(abs(s + h * (to_north * ahead + to_east * aside)) / distance, 1.0)
            near, far = max(at - 0.5 * spans, 0.0), min(at + 0.5 * spans, count - 1e-9)
            edge = math.floor(far)
            share = (far - edge) / (far - near) if edge > near and far > near else 1.0
            out[b, edge] += share * echo
            if share < 1.0:
                out[b, edge - 1] += (1.0 - share) * echo
            if ghost > 0.0:
                mirrored = math.sqrt(s * s + (floor + depth) * (floor + depth))
                late = int((0.5 * (distance + mirrored) - first) / width)
                if late < count:
                    out[b, late] += ghost * echo


@numba.njit(cache=True, nogil=True, error_model="numpy")
def hide(depths, grid, pose, beams, width, fan, hits):
    """Makes those `hits` infinite that lie behind the sea floor; arguments as of `scan`, `width` that of a bin."""
    number, elevations = hits.shape
    north, east, depth = pose[0], pose[1], pose[2]
    for b in range(number):
        farthest = 0.0
        for e in range(elevations):
            if hits[b, e] < np.inf:
                farthest = max(farthest, hits[b, e])
        steps = int(farthest / width)
        horizon = np.full(steps + 1, 1e30)  # least depth by distance of the floor before the end of each step
        ahead, aside = math.cos(pose[3] + beams[b]), math.sin(pose[3] + beams[b])
        for k in range(steps):
            s = (k + 0.5) * width
            floor = _bilinear(depths, (north + s * ahead - grid[0]) / grid[2], (east + s * aside - grid[1]) / grid[3])[
                0
            ]
            horizon[k + 1] = min(horizon[k], (floor - depth) / s)
        for e in range(elevations):
            if hits[b, e] < np.inf:
                below = fan[0] + (fan[1] - fan[0]) * (e + 0.5) / elevations
                if math.tan(below) > horizon[int(hits[b, e] * math.cos(below) / width)]:
                    hits[b, e] = np.inf


@numba.njit(cache=True, nogil=True, error_model="numpy")
def spread(mean, weights, out):
    """Mean intensities (beams, bins) as beams of finite width see them.

    Args:
        mean: of infinitely narrow beams.
        weights: (2 w + 1,) power of a beam's neighbours in it, itself in the middle.
        out: (beams, bins), overwritten.
    """
    number, count = mean.shape
    reach = len(weights) // 2
    for b in range(number):
        for k in range(count):
            out[b, k] = 0.0
        for j in range(-reach, reach + 1):
            if 0 <= b + j < number:
                weight = weights[j + reach]
                for k in range(count):
                    out[b, k] += weight * mean[b + j, k]


def pattern(spacing: float, width: float, reach: int = 4) -> Array:
    """Power (2 reach + 1,) that a beam takes from its neighbours, of a uniform line array with a Hann shading.

    Args:
        spacing: between beams [rad].
        width: of a beam at half power [rad].
        reach: number of neighbours on each side.
    """
    x = (
        1.44 * spacing / width * np.arange(-reach, reach + 1)
    )  # a Hann window's main lobe is 1.44 bins wide at half power
    amplitude = np.sinc(x) + 0.5 * (np.sinc(x - 1.0) + np.sinc(x + 1.0))
    power = amplitude**4  # sent and received by the same pattern
    return power / power.sum()
