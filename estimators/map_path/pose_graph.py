"""A pose graph over sonar frames: edges over several baselines, and loop closures where lanes come near each other."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from estimators.core.types import Array
from estimators.map_path.closures import consistent, path_covariance
from estimators.map_path.graph import Edge, GraphSolution, optimise
from estimators.map_path.likelihood import Matcher, Prepared
from estimators.map_path.matching import LEAST_CELLS, POINTS, Match, Search, match, quadratic
from estimators.map_path.poses import between, compose

FARTHEST = 10.0  # that a match may lie from the predicted pose, in limits of the search; its peak is no match then


@dataclass(frozen=True, kw_only=True, slots=True)
class GraphSettings:
    """What a pose graph is made of. Covariances are diagonal, of forward, starboard [m] and turn [rad]."""

    lags: tuple[int, ...] = (1, 2, 4, 8)  # frames apart that are searched for a match
    refined: tuple[int, ...] = tuple(range(1, 13))  # frames apart that are compared once more about the solution
    rounds: int = 3  # times that is done; 0: never
    chain: tuple[float, float, float] = (0.2, 0.2, np.radians(0.6))  # of the path given from frame to frame, deviations
    drift: tuple[float, float, float] = (0.05, 0.05, np.radians(0.08))  # what such a path gathers a frame, deviations
    match_prior: tuple[float, float, float] = (0.1, 0.1, np.radians(0.5))  # added to that where a match is searched
    search: Search = Search(limits=(0.75, 0.75, np.radians(4.0)))  # noqa: RUF009 - immutable
    closure_search: Search = Search(limits=(4.0, 4.0, np.radians(5.0)))  # noqa: RUF009
    closure_gap: int = 40  # frames between the two of a closure at least
    closure_distance: float = 8.0  # between the poses of the two at most [m]
    closure_spacing: int = 2  # frames from one attempt to the next
    closure_support: int = 5  # frames about the earlier one that are matched at once
    closure_ratio: float = 25.0  # least log-likelihood of a closure against no relation
    covariance_factor: float = 1.5  # of a match: pairs of one frame share its noise


class PathGraph(NamedTuple):
    """The graph's solution and what it is made of."""

    solution: GraphSolution
    edges: tuple[Edge, ...]
    closures: tuple[Edge, ...]  # those believed
    candidates: tuple[Edge, ...]  # all that were found


def solve(
    matcher: Matcher,
    frames: Sequence[Prepared | None],
    path: Array,
    prior: Array,
    *,
    settings: GraphSettings | None = None,
    fixes: Sequence[tuple[int, Array, Array]] = (),
    close_loops: bool = True,
) -> PathGraph:
    """The most probable poses of frames.

    Args:
        matcher: Compares two frames; its model's `together` is the number of frames that show the same floor.
        frames: One for each pose; None where there was none that could be used.
        path: Poses (n, 3) of a filter, from which it starts.
        prior: Covariance (3, 3) of the first pose.
        settings: What it is made of.
        fixes: As of `graph.optimise`.
        close_loops: Whether frames of different lanes are matched.
    """
    settings = settings or GraphSettings()
    edges = _chain(path, settings)
    solution = optimise(path, edges, prior, fixes=fixes)
    for lag in settings.lags:  # each is searched about what the shorter ones say
        edges += _neighbours(matcher, frames, solution.poses, lag, settings)
        solution = optimise(solution.poses, edges, prior, fixes=fixes)
    for _ in range(settings.rounds):
        edges = _chain(path, settings) + _refined(matcher, frames, solution.poses, settings)
        solution = optimise(solution.poses, edges, prior, fixes=fixes)
    if not close_loops:
        return PathGraph(solution, tuple(edges), (), ())
    candidates = _candidates(matcher, frames, solution.poses, settings)
    believed = consistent(candidates, solution.poses, np.diag(np.square(settings.drift)))
    closures = tuple(candidates[k] for k in believed)
    if closures:
        solution = optimise(solution.poses, [*edges, *closures], prior, fixes=fixes)
    return PathGraph(solution, tuple(edges), closures, tuple(candidates))


def _chain(path: Array, settings: GraphSettings) -> list[Edge]:
    relatives, covariance = between(path[:-1], path[1:]), np.diag(np.square(settings.chain))
    return [Edge(k, k + 1, relative, covariance) for k, relative in enumerate(relatives)]


def _neighbours(
    matcher: Matcher, frames: Sequence[Prepared | None], path: Array, lag: int, settings: GraphSettings
) -> list[Edge]:
    """Edges of frames that are some frames apart, searched about what the path says."""
    edges = []
    prior = np.diag(np.square(settings.drift) * lag + np.square(settings.match_prior))
    for k in range(lag, len(path)):
        earlier, later = frames[k - lag], frames[k]
        if earlier is None or later is None:
            continue
        relative = between(path[k - lag], path[k])
        found = match(matcher, later, [earlier], relative[None], prior, settings.search)
        if isinstance(found, Match) and (np.abs(found.offset) <= FARTHEST * np.array(settings.search.limits)).all():
            edges.append(edge(k - lag, k, relative, found, settings.covariance_factor))
    return edges


def _refined(matcher: Matcher, frames: Sequence[Prepared | None], path: Array, settings: GraphSettings) -> list[Edge]:
    """Edges of all pairs of frames some way apart, of the log-likelihood's gradient at the path: a step of scoring.

    The curvature of a pair is the mean over pairs as far apart, by the cells shared (Fisher's scoring). With its own
    one a pair of faint frames has no peak, or one of the noise; so it has its share of the sum over all pairs, whose
    peak is sharp.
    """
    spacing, edges = np.array(settings.search.fine), []
    for lag in settings.refined:
        compared = []
        for k in range(lag, len(path)):
            earlier, later = frames[k - lag], frames[k]
            relative = between(path[k - lag], path[k])
            cells = matcher.shared_cells(relative)
            if earlier is not None and later is not None and np.count_nonzero(cells) >= LEAST_CELLS:
                values = matcher.log_likelihood(later, earlier, compose(relative, POINTS * spacing), cells)
                compared.append((k, relative, np.count_nonzero(cells), *quadratic(values, spacing)[1:]))
        mean = sum(each[4] for each in compared) / max(sum(each[2] for each in compared), 1)
        if not compared or np.linalg.eigvalsh(mean)[0] <= 0.0:
            continue
        for k, relative, count, gradient, _ in compared:
            covariance, turned = np.linalg.inv(count * mean), _turn(relative[2])
            measured = compose(relative, covariance @ gradient)
            edges.append(Edge(k - lag, k, measured, turned @ covariance @ turned.T))
    return edges


def edge(first: int, second: int, relative: Array, found: Match, factor: float) -> Edge:
    """A match as an edge: its covariance turned from the later frame's axes into the earlier's."""
    turned = _turn(relative[2])
    return Edge(first, second, compose(relative, found.offset), factor * turned @ found.covariance @ turned.T)


def _turn(angle: float) -> Array:
    """Matrix (3, 3) from the axes of a pose turned by an angle [rad] to those it was turned from."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _candidates(
    matcher: Matcher, frames: Sequence[Prepared | None], poses: Array, settings: GraphSettings
) -> list[Edge]:
    """Closures whose match is far better than no relation, not yet compared with each other."""
    found, ahead = [], matcher.grid.ahead + 0.5 * sum(matcher.grid.ranges)
    looked_at = poses[:, :2] + ahead * np.stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])), axis=1)
    for k in range(settings.closure_gap, len(poses), settings.closure_spacing):
        past = slice(0, k - settings.closure_gap + 1)
        distances = np.hypot(*(looked_at[past] - looked_at[k]).T)
        nearest = int(np.argmin(distances))
        later = frames[k]
        if later is None or distances[nearest] > settings.closure_distance:
            continue
        half = settings.closure_support // 2
        support = [j for j in range(max(nearest - half, 0), nearest + half + 1) if frames[j] is not None and j < k]
        if not support:
            continue
        relative, drift = between(poses[nearest], poses[k]), np.diag(np.square(settings.drift))
        turn = _turn(relative[2]).T
        prior = turn @ path_covariance(poses, nearest, k, np.zeros(3), relative, drift) @ turn.T
        prior = prior + np.diag(np.square(settings.match_prior))
        relatives = between(poses[support], poses[k])
        earlier = [frames[j] for j in support]
        got = match(matcher, later, earlier, relatives, prior, settings.closure_search)  # pyright: ignore
        if isinstance(got, Match) and got.log_likelihood >= settings.closure_ratio:
            found.append(edge(nearest, k, relative, got, settings.covariance_factor))
    return found
