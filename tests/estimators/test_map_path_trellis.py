"""The trellis of odometry errors: maxima against exhaustive search, sums against enumeration."""

from itertools import product

import numpy as np
import pytest

from estimators.core.errors import ParameterError
from estimators.map_path.trellis import ErrorLattice, advance, backtrack, mix

TOY = ErrorLattice(speed=0.3, turn_rate=0.02, nodes=(3, 3), speed_walk=0.2, turn_rate_walk=0.011)
LOPSIDED = ErrorLattice(speed=0.25, turn_rate=0.03, nodes=(3, 2), speed_walk=0.11, turn_rate_walk=0.04)


def total(path, likelihoods, lattice, durations):
    """Log probability of a path by the definition, without any factoring of the transition."""
    value = likelihoods[0][path[0]]
    for before, node, step, duration in zip(path, path[1:], likelihoods[1:], durations, strict=False):
        change = lattice.errors[node] - lattice.errors[before]
        walk = np.array([lattice.speed_walk, lattice.turn_rate_walk])
        value += step[node] - 0.5 * np.sum((change / walk) ** 2) / duration
    return value


@pytest.mark.parametrize("lattice", [TOY, LOPSIDED])
@pytest.mark.parametrize("seed", range(6))
def test_the_path_is_that_of_exhaustive_search(lattice, seed):
    rng = np.random.default_rng(seed)
    k = len(lattice.errors)
    durations = [1.0, 2.5]
    likelihoods = [rng.normal(0.0, 2.0, k) for _ in range(3)]
    best = max(product(range(k), repeat=3), key=lambda path: total(path, likelihoods, lattice, durations))
    scores, steps = likelihoods[0], []
    for likelihood, duration in zip(likelihoods[1:], durations, strict=True):
        scores, came_from = advance(scores, likelihood, lattice.transitions(duration))
        steps.append(came_from)
    assert tuple(backtrack(int(np.argmax(scores)), steps)) == best
    assert scores.max() == pytest.approx(total(best, likelihoods, lattice, durations), rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_sums_are_those_over_all_paths(seed):
    """The probability of each last node, by adding up all paths that end there."""
    rng = np.random.default_rng(seed)
    k = len(LOPSIDED.errors)
    likelihoods = [rng.normal(0.0, 1.5, k) for _ in range(3)]
    sums = np.zeros(k)
    for path in product(range(k), repeat=3):
        sums[path[-1]] += np.exp(total(path, likelihoods, LOPSIDED, [1.0, 1.0]))
    weights = likelihoods[0]
    for likelihood in likelihoods[1:]:
        weights = np.log(np.exp(mix(weights, LOPSIDED.transitions(1.0))).sum(axis=1)) + likelihood
    np.testing.assert_allclose(np.exp(weights), sums, rtol=1e-11)


def test_a_flat_prior_judges_each_frame_by_itself():
    rng = np.random.default_rng(3)
    likelihoods = rng.normal(0.0, 1.0, (5, 9))
    flat = (np.zeros((3, 3)), np.zeros((3, 3)))
    scores, steps = likelihoods[0], []
    for likelihood in likelihoods[1:]:
        scores, came_from = advance(scores, likelihood, flat)
        steps.append(came_from)
    assert backtrack(int(np.argmax(scores)), steps) == [int(np.argmax(each)) for each in likelihoods]


def test_axes_reach_the_limits_and_bad_lattices_are_refused():
    speed, turn_rate = LOPSIDED.axes
    np.testing.assert_allclose(speed, [-0.25, 0.0, 0.25])
    np.testing.assert_allclose(turn_rate, [-0.03, 0.03])
    np.testing.assert_allclose(LOPSIDED.errors[1], [-0.25, 0.03])
    with pytest.raises(ParameterError, match="above 0"):
        ErrorLattice(speed_walk=0.0)
