"""Compiled loops: products of two frames over a fixed set of cells, and the max-plus step of a trellis."""

import math

import numpy as np

from estimators.core.compiling import compiled


@compiled
def _bilinear(image, row, column):
    """Value between four samples; NaN outside."""
    i, j = math.floor(row), math.floor(column)
    if not (0 <= i < image.shape[0] - 1 and 0 <= j < image.shape[1] - 1):
        return math.nan
    a, b = row - i, column - j
    near = image[i, j] + b * (image[i, j + 1] - image[i, j])
    far = image[i + 1, j] + b * (image[i + 1, j + 1] - image[i + 1, j])
    return near + a * (far - near)


@compiled
def products(values, places, fine, scale, origin_row, origin_column, poses):
    """Sums (k,) of `values` (n,) times an upsampled earlier frame at the cells' places seen from relative poses (k, 3).

    `places` (n, 2) [m] are seen from the later frame; `fine` (rows, columns) has `scale` samples a metre, its sample
    (0, 0) at `origin_row`, `origin_column` [m]. Outside it the earlier frame is 0. Bilinear.
    """
    sums = np.zeros(poses.shape[0])
    for k in range(poses.shape[0]):
        c, s = math.cos(poses[k, 2]) * scale, math.sin(poses[k, 2]) * scale
        first, second = (poses[k, 0] - origin_row) * scale, (poses[k, 1] - origin_column) * scale
        for n in range(values.size):
            row = first + c * places[n, 0] - s * places[n, 1]
            seen = _bilinear(fine, row, second + s * places[n, 0] + c * places[n, 1])
            if seen == seen:
                sums[k] += values[n] * seen
    return sums


@compiled
def samples(places, fine, scale, origin_row, origin_column, poses):
    """Values (k, n) of an upsampled earlier frame at the cells' places seen from relative poses (k, 3).

    Arguments as of `products`; 0 outside.
    """
    values = np.zeros((poses.shape[0], places.shape[0]))
    for k in range(poses.shape[0]):
        c, s = math.cos(poses[k, 2]) * scale, math.sin(poses[k, 2]) * scale
        first, second = (poses[k, 0] - origin_row) * scale, (poses[k, 1] - origin_column) * scale
        for n in range(places.shape[0]):
            row = first + c * places[n, 0] - s * places[n, 1]
            seen = _bilinear(fine, row, second + s * places[n, 0] + c * places[n, 1])
            if seen == seen:
                values[k, n] = seen
    return values


@compiled
def square_differences(values, places, fine, scale, origin_row, origin_column, poses):
    """Sums (k,) of squared differences of `values` (n,) from an upsampled earlier frame (paper 5, eq. 4).

    Arguments as of `products`; over the cells that both frames have.
    """
    sums = np.zeros(poses.shape[0])
    for k in range(poses.shape[0]):
        c, s = math.cos(poses[k, 2]) * scale, math.sin(poses[k, 2]) * scale
        first, second = (poses[k, 0] - origin_row) * scale, (poses[k, 1] - origin_column) * scale
        for n in range(values.size):
            row = first + c * places[n, 0] - s * places[n, 1]
            seen = _bilinear(fine, row, second + s * places[n, 0] + c * places[n, 1])
            if seen == seen:
                sums[k] += (values[n] - seen) ** 2
    return sums


@compiled
def max_plus(scores, first, second):
    """Best predecessors on a lattice (a, b) whose log transition is first[i, i'] + second[j, j'].

    Returns (best (a, b), of each node the predecessor's flat index (a, b)).
    """
    a, b = scores.shape
    along = np.empty((a, b))
    along_from = np.empty((a, b), np.int64)
    for i in range(a):  # over the second axis of the predecessors
        for j in range(b):
            best, chosen = -math.inf, 0
            for k in range(b):
                value = scores[i, k] + second[j, k]
                if value > best:
                    best, chosen = value, k
            along[i, j], along_from[i, j] = best, chosen
    result = np.empty((a, b))
    came_from = np.empty((a, b), np.int64)
    for i in range(a):
        for j in range(b):
            best, chosen = -math.inf, 0
            for k in range(a):
                value = along[k, j] + first[i, k]
                if value > best:
                    best, chosen = value, k
            result[i, j] = best
            came_from[i, j] = chosen * b + along_from[chosen, j]
    return result, came_from
