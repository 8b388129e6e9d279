"""Where a frame lies relative to earlier ones: the best pose near a predicted one, and its covariance."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from estimators.core.types import Array
from estimators.map_path.likelihood import Matcher, Prepared
from estimators.map_path.poses import compose

LEAST_CELLS = 100  # shared with an earlier frame, fewer and the two are not compared
NO_OVERLAP, NO_PEAK = "no_overlap", "no_peak"  # why a frame cannot be placed


@dataclass(frozen=True, kw_only=True, slots=True)
class Search:
    """The poses that are tried about a predicted one; finer than the point spread, the rest is a quadratic's."""

    steps: tuple[float, float, float] = (0.25, 0.25, np.radians(1.0))  # forward, starboard [m], turn [rad]
    reach: float = 3.0  # of the search, in standard deviations of the prediction
    limits: tuple[float, float, float] = (1.0, 1.0, np.radians(5.0))  # of the search at most
    fine: tuple[float, float, float] = (0.12, 0.12, np.radians(0.6))  # spacing of the points of the quadratic


class Match(NamedTuple):
    """The pose of a frame relative to the predicted one."""

    offset: Array  # (3,) forward, starboard [m], turn [rad] from the predicted pose
    covariance: Array  # (3, 3) of the match alone, without the prediction
    log_likelihood: float  # of the match against that of no relation at all
    weights: Array  # (k,) share of each earlier frame; 0 of those that overlap too little
    scatter: float = np.nan  # by which such frames' matches scatter more than the covariance, squared, if asked


def match(
    matcher: Matcher,
    later: Prepared,
    earlier: Sequence[Prepared],
    relatives: Array,
    prior: Array,
    search: Search,
    scatter: bool = False,
) -> Match | str:
    """The most probable pose near the predicted one; or why there is none, `no_overlap` or `no_peak`.

    Args:
        matcher: Compares two frames.
        later: The frame to be placed.
        earlier: Frames (k of them) that are in place.
        relatives: Its predicted pose (k, 3) relative to each of them.
        prior: Covariance (3, 3) of the predicted pose, in the later frame's axes.
        search: What to try.
        scatter: Whether to say how far such frames' matches scatter, see `score_covariance`.
    """
    cells = [matcher.shared_cells(relative) for relative in relatives]
    counts = np.array([np.count_nonzero(shared) for shared in cells])
    used = np.flatnonzero(counts >= LEAST_CELLS).tolist()
    if not used:
        return NO_OVERLAP

    def likelihood(offsets: Array) -> Array:
        each = [matcher.log_likelihood(later, earlier[k], compose(relatives[k], offsets), cells[k]) for k in used]
        return np.sum(each, axis=0)

    information = np.linalg.inv(prior)
    offsets = _lattice(prior, search)
    posterior = likelihood(offsets) - 0.5 * np.einsum("ni,ij,nj->n", offsets, information, offsets)
    centre = offsets[int(np.argmax(posterior))]
    for _ in range(2):
        value, gradient, curvature = quadratic(likelihood(centre + POINTS * search.fine), np.array(search.fine))
        if np.linalg.eigvalsh(curvature)[0] <= 0.0:
            return NO_PEAK
        best = np.linalg.solve(curvature + information, gradient + curvature @ centre)
        if np.any(np.abs(best - centre) > 3.0 * np.array(search.fine)):
            return NO_PEAK
        peak, centre = centre + np.linalg.solve(curvature, gradient), best
    weights = np.where(counts >= LEAST_CELLS, counts, 0) / counts[used].sum()
    factor = np.nan
    if scatter:
        chosen = [(earlier[k], relatives[k], cells[k]) for k in used]
        factor = _scatter(curvature, score_covariance(matcher, later, chosen, best, np.array(search.fine)))
    return Match(peak, np.asarray(np.linalg.inv(curvature), dtype=np.float64), float(value), weights, factor)


def scatter_at(
    matcher: Matcher, later: Prepared, earlier: Prepared, relative: Array, cells: np.ndarray, search: Search
) -> float:
    """The scatter of a match with one earlier frame at a relative pose (3,) near its peak; NaN if there is none."""
    spacing = np.array(search.fine)
    values = matcher.log_likelihood(later, earlier, compose(relative, POINTS * spacing), cells)
    curvature = quadratic(values, spacing)[2]
    if np.linalg.eigvalsh(curvature)[0] <= 0.0:
        return np.nan
    return _scatter(curvature, score_covariance(matcher, later, [(earlier, relative, cells)], np.zeros(3), spacing))


def _scatter(curvature: Array, score: Array) -> float:
    return float(np.linalg.det(np.linalg.solve(curvature, score)) ** (1.0 / 3.0))


def score_covariance(
    matcher: Matcher,
    later: Prepared,
    earlier: Sequence[tuple[Prepared, Array, np.ndarray]],
    offset: Array,
    spacing: Array,
) -> Array:
    """Covariance (3, 3) of the log-likelihood's gradient at the pose of a match, from the frames themselves.

    The log-likelihood is the sum over cells of the later frame times m, the sum of the earlier ones as seen from there.
    What the later frame has of them is its correlation with m, r; the rest, (1 - r^2) of its power, is as good as
    unrelated, whatever it is: noise, speckle, echoes that changed. With A the later frame's autocorrelation, the
    gradient's covariance is (1 - r^2) sum over cells c, c' of dm(c) A(c - c') dm(c')'. It is the curvature's mean where
    the likelihood's model is right; between two inverses of that it is the match's covariance, even where the model is
    wrong (Huber 1967).

    Args:
        matcher: Compares two frames.
        later: The frame that is placed.
        earlier: Frames in place, the predicted pose (3,) relative to each, and the cells shared with it.
        offset: Pose (3,) found, from the predicted one.
        spacing: Of central differences (3,) [m, m, rad].
    """
    steps = spacing * np.vstack((np.zeros(3), np.eye(3), -np.eye(3)))
    images = np.sum([matcher.seen(e, compose(r, offset + steps), cells) for e, r, cells in earlier], axis=0)
    seen, shape = matcher.grid.seen, tuple(2 * size for size in matcher.grid.shape)
    gradient = np.fft.rfft2((images[1:4] - images[4:]) / (2.0 * spacing[:, None, None]), shape)
    power = np.abs(np.fft.rfft2(np.where(seen, later.values, 0.0), shape)) ** 2 / np.count_nonzero(seen)
    power[:, 1:-1] *= 2.0  # frequencies of which the real transform leaves the conjugates out
    shown, both = images[0] != 0.0, np.vdot(images[0], later.values)
    share = both**2 / (np.vdot(images[0], images[0]) * np.sum(later.values[shown] ** 2))
    flat = gradient.reshape(3, -1)
    sums = np.real((flat.conj() * power.ravel()) @ flat.T)
    return (1.0 - min(float(share), 0.99)) / float(np.prod(shape)) * sums


def _lattice(prior: Array, search: Search) -> Array:
    axes = []
    for deviation, step, limit in zip(np.sqrt(np.diagonal(prior)), search.steps, search.limits, strict=True):
        count = max(1, int(np.ceil(min(search.reach * deviation, limit) / step)))
        axes.append(step * np.arange(-count, count + 1))
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=3).reshape(-1, 3)


# Where the quadratic is fitted, in its spacing.
POINTS = np.stack(np.meshgrid(*[np.array([-1.0, 0.0, 1.0])] * 3, indexing="ij"), axis=3).reshape(-1, 3)
_PAIRS = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
_FIT = np.linalg.pinv(
    np.column_stack((np.ones(27), POINTS, *(POINTS[:, i] * POINTS[:, j] for i, j in _PAIRS)))
)  # coefficients of the quadratic of least squares through the 27 points


def quadratic(values: Array, spacing: Array) -> tuple[float, Array, Array]:
    """Value, gradient (3,) and negative Hessian (3, 3) at the middle of the 27 points."""
    coefficients = _FIT @ values
    curvature = np.zeros((3, 3))
    for (i, j), c in zip(_PAIRS, coefficients[4:], strict=True):
        curvature[i, j] -= c
        curvature[j, i] -= c
    return coefficients[0], coefficients[1:4] / spacing, curvature / np.outer(spacing, spacing)
