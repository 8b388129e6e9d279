"""Compiled loops of map matching: products of two frames over a fixed set of cells, and the max-plus step of a trellis."""

import math

import numpy as np

from estimators.core.compiling import compiled


@compiled
def products(values, places, fine, scale, origin_row, origin_column, poses):
    """Sums (k,) of `values` (n,) times an upsampled earlier frame at the cells' places seen from relative poses (k, 3).

    `places` (n, 2) [m] are seen from the later frame; `fine` (rows, columns) has `scale` samples a metre, its sample
    (0, 0) at `origin_row`, `origin_column` [m]. Outside it the earlier frame is 0. Bilinear.
    """
    rows, columns = fine.shape
    sums = np.zeros(poses.shape[0])
    for k in range(poses.shape[0]):
        c, s = math.cos(poses[k, 2]) * scale, math.sin(poses[k, 2]) * scale
        first = (poses[k, 0] - origin_row) * scale
        second = (poses[k, 1] - origin_column) * scale
        total = 0.0
        for n in range(values.size):
            row = first + c * places[n, 0] - s * places[n, 1]
            column = second + s * places[n, 0] + c * places[n, 1]
            i, j = int(math.floor(row)), int(math.floor(column))
            if 0 <= i < rows - 1 and 0 <= j < columns - 1:
                a, b = row - i, column - j
                near = fine[i, j] + b * (fine[i, j + 1] - fine[i, j])
                far = fine[i + 1, j] + b * (fine[i + 1, j + 1] - fine[i + 1, j])
                total += values[n] * (near + a * (far - near))
        sums[k] = total
    return sums


@compiled
def square_differences(values, places, fine, scale, origin_row, origin_column, poses):
    """As `products`, of squares of the differences instead (paper 5, eq. 4), over the cells that both frames have."""
    rows, columns = fine.shape
    sums = np.zeros(poses.shape[0])
    for k in range(poses.shape[0]):
        c, s = math.cos(poses[k, 2]) * scale, math.sin(poses[k, 2]) * scale
        first = (poses[k, 0] - origin_row) * scale
        second = (poses[k, 1] - origin_column) * scale
        total = 0.0
        for n in range(values.size):
            row = first + c * places[n, 0] - s * places[n, 1]
            column = second + s * places[n, 0] + c * places[n, 1]
            i, j = int(math.floor(row)), int(math.floor(column))
            if 0 <= i < rows - 1 and 0 <= j < columns - 1:
                a, b = row - i, column - j
                near = fine[i, j] + b * (fine[i, j + 1] - fine[i, j])
                far = fine[i + 1, j] + b * (fine[i + 1, j + 1] - fine[i + 1, j])
                difference = values[n] - (near + a * (far - near))
                total += difference * difference
        sums[k] = total
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
