"""Bounds at many stations: Fisher information of a whole trajectory by brute force, delay, losses, observability."""

import numpy as np
import pytest

from estimators.core.errors import ParameterError
from estimators.core.models.odometry import SPACE, Displacement, OdometryNoise
from estimators.core.odometry_bounds import Sights, Told, at_once, bounds, displacements_between, observability, sampled
from estimators.core.types import Array

NOISE = OdometryNoise(forward=0.01, starboard=0.003, heading=2e-4, position=0.02)
CURRENT = np.array([0.4, -0.25])
START = np.array([30.0, -70.0])
DEVIATIONS = {
    "north": 5.0, "east": 8.0, "current_north": 0.5, "current_east": 0.7, "range_offset": 3.0, "range_drift": 0.01,
    "range_scale": 0.02, "speed_scale": 0.03, "compass_bias": 0.05,
}  # fmt: skip


def mission(k=9, dt=20.0):
    """Times, displacements (k, 6) and a beacon's places (k, 3), lopsided."""
    n = np.arange(k, dtype=np.float64)
    rows = sampled(
        np.column_stack((1.3 + 0.2 * np.cos(n), 0.1 * np.sin(2 * n), 0.4 + 0.5 * np.sin(0.7 * n))), dt, NOISE
    )
    beacon = np.stack((100.0 - 9.0 * n, 40.0 + 25.0 * np.sin(0.5 * n), 6.0 + n), axis=1)
    times: Array = np.asarray(dt * (n + 1.0), dtype=np.float64)
    return times, rows, beacon


def way(rows, errors=None):
    """Places (k, 2) that odometry with errors (scale, bias) and noise (k, 2) comes to, exactly as the model says."""
    states, noise = errors if errors is not None else (np.zeros(9), np.zeros((len(rows), 2)))
    p, places = START + states[:2], []
    for row, w in zip(rows, noise, strict=True):
        c, s = np.cos(states[8]), np.sin(states[8])
        measured = row[1:3]
        true = np.array([c * measured[0] + s * measured[1], c * measured[1] - s * measured[0]]) / (1.0 + states[7])
        p = p + true + row[0] * (CURRENT + states[2:4]) + w
        places.append(p)
    return np.array(places)


def seen(rows, beacon, unknowns, ranges=True, bearings=True):
    """All ranges, then all bearings, of unknowns: nine states at the start, and noise of each displacement."""
    states, noise = unknowns[:9], unknowns[9:].reshape(-1, 2)
    off = way(rows, (states, noise)) - beacon[:, :2]
    times = np.cumsum(rows[:, 0])
    distance = np.hypot(np.hypot(*off.T), beacon[:, 2])
    r = (1.0 + states[6]) * distance + states[4] + states[5] * times
    b = np.arctan2(-off[:, 1], -off[:, 0]) + states[8]
    return np.concatenate(([r] if ranges else []) + ([b] if bearings else []))


def brute_force(rows, beacon, used, output, *, ranges=True, bearings=True, sigma_r=1.5, sigma_b=0.03):
    """Covariance (9, 9) at the sight `output` from the Fisher information of start and all displacement noise."""
    k = len(rows)
    size = 9 + 2 * k

    def derivative(f):
        step, columns = 1e-6, []
        for i in range(size):
            d = np.zeros(size)
            d[i] = step
            columns.append((f(d) - f(-d)) / (2.0 * step))
        return np.array(columns).T

    H = derivative(lambda u: seen(rows, beacon, u, ranges, bearings))
    weights = np.concatenate(
        ([np.where(used, sigma_r**-2, 0.0)] if ranges else [])
        + ([np.where(used, sigma_b**-2, 0.0)] if bearings else [])
    )
    J = H.T @ (weights[:, None] * H)
    J[:9, :9] += np.diag(SPACE.vector(DEVIATIONS) ** -2.0)
    for i, row in enumerate(rows):
        Q = np.array([[row[3], row[4]], [row[4], row[5]]])
        J[9 + 2 * i : 11 + 2 * i, 9 + 2 * i : 11 + 2 * i] += np.linalg.inv(Q)

    def state(u):
        place = way(rows, (u[:9], u[9:].reshape(-1, 2)))[output]
        rest = u[2:9].copy()
        rest[2] += rows[: output + 1, 0].sum() * u[5]
        return np.concatenate((place, rest))

    G = derivative(state)
    return G @ np.linalg.inv(J) @ G.T


def relative(rows, beacon):
    return np.column_stack((way(rows) - beacon[:, :2], beacon[:, 2]))[None, None]


@pytest.mark.parametrize(("ranges", "bearings"), [(True, False), (False, True), (True, True)])
def test_bound_is_the_fisher_information_of_the_whole_trajectory(ranges, bearings):
    times, rows, beacon = mission()
    sights = at_once(
        times, rows, range_deviation=1.5 if ranges else np.inf, bearing_deviation=0.03 if bearings else np.inf
    )
    prior = np.diag(SPACE.vector(DEVIATIONS) ** 2)
    found = bounds(prior, sights, relative(rows, beacon), np.array([3, 8]))[0]
    for place, output in enumerate((3, 8)):
        used = np.arange(len(rows)) <= output
        expected = brute_force(rows, beacon, used, output, ranges=ranges, bearings=bearings)
        scale = np.sqrt(np.diagonal(expected))
        # Central differences of steps of 1e-6 are good to about 1e-8 of their value.
        assert found[place] / np.outer(scale, scale) == pytest.approx(expected / np.outer(scale, scale), abs=2e-6)


def test_bound_of_late_and_lost_sights_is_that_of_what_has_arrived():
    times, rows, beacon = mission()
    arrivals = times + 45.0  # more than two intervals late
    arrivals[[2, 5]] = np.inf
    sights = Sights(times, rows, np.full(9, 1.5**2), np.full(9, np.inf), arrivals[None])
    prior = np.diag(SPACE.vector(DEVIATIONS) ** 2)
    outputs = np.array([0, 4, 8])
    found = bounds(prior, sights, relative(rows, beacon), outputs)[0]
    for place, output in enumerate(outputs):
        expected = brute_force(rows, beacon, arrivals <= times[output], output, bearings=False)
        scale = np.sqrt(np.diagonal(expected))
        assert found[place] / np.outer(scale, scale) == pytest.approx(expected / np.outer(scale, scale), abs=2e-6)


def test_draws_of_losses_are_averaged_and_overtaking_is_refused():
    times, rows, beacon = mission()
    none, lost = times.copy(), np.where(np.arange(9) % 2, times, np.inf)
    prior = np.diag(SPACE.vector(DEVIATIONS) ** 2)
    sights = at_once(times, rows, range_deviation=1.5)
    each = [
        bounds(prior, sights._replace(arrivals=a[None]), relative(rows, beacon), np.array([8])) for a in (none, lost)
    ]
    both = bounds(prior, sights._replace(arrivals=np.array([none, lost])), relative(rows, beacon), np.array([8]))
    assert both == pytest.approx(0.5 * (each[0] + each[1]), rel=1e-12)
    assert each[1][0, 0, 0, 0] > each[0][0, 0, 0, 0]
    late = times + 30.0
    late[3] = late[4] + 1.0
    with pytest.raises(ParameterError, match="must ascend"):
        bounds(prior, sights._replace(arrivals=late[None]), relative(rows, beacon), np.array([8]))


def test_information_is_averaged_over_truths():
    times, rows, beacon = mission(k=1)
    one = relative(rows, beacon)
    other = one + np.array([15.0, -40.0, 0.0])
    prior = np.diag(SPACE.vector(DEVIATIONS) ** 2)
    sights = at_once(times, rows, range_deviation=1.5)
    J = []
    for places in (one, other):
        P = bounds(prior, sights, places, np.array([0]))[0, 0]
        J.append(np.linalg.inv(P))
    both = bounds(prior, sights, np.concatenate((one, other), axis=1), np.array([0]))[0, 0]
    # One sight: the information before it is common, so that averages of J are J of averages. 1e-7: condition of J.
    assert np.linalg.inv(both) == pytest.approx(0.5 * (J[0] + J[1]), rel=1e-6, abs=1e-7)


def test_known_states_stay_known_and_cost_nothing():
    times, rows, beacon = mission()
    few = {name: DEVIATIONS[name] for name in ("north", "east", "current_north", "current_east")}
    prior = np.diag(SPACE.vector(few) ** 2)
    sights = at_once(times, rows, range_deviation=1.5)
    found = bounds(prior, sights, relative(rows, beacon), np.array([8]))[0, 0]
    assert not found[4:].any()
    more = bounds(np.diag(SPACE.vector(DEVIATIONS) ** 2), sights, relative(rows, beacon), np.array([8]))[0, 0]
    assert np.linalg.eigvalsh(more[:4, :4] - found[:4, :4]).min() > -1e-9  # what is unknown never helps


def test_rank_is_two_without_relative_motion_three_on_constant_courses_and_four_in_a_weave():
    t = np.arange(0.0, 2000.0, 8.0)
    still = np.tile((80.0, 50.0, 0.0), (len(t), 1))
    oblique = still + np.outer(t, (0.3, -0.05, 0.0))
    weave = oblique + np.column_stack((60.0 * np.sin(t / 60.0), 90.0 * np.cos(t / 95.0), 0.0 * t))
    found = observability(t, np.array([still, oblique, weave]))
    assert found.rank.tolist() == [2, 3, 4]
    assert found.condition[2] < 30.0
    assert found.condition[1] > 1e8
    # Bearings tell the direction of the relative motion, never its scale, unless the vehicle turns.
    assert observability(t, np.array([still, oblique, weave]), ranges=False, bearings=True).rank.tolist() == [2, 3, 4]


def test_displacements_of_samples_add_up():
    rows = sampled(np.array([(1.0, 0.0, 0.1), (2.0, 0.0, 0.2), (3.0, 0.0, 0.3)]), 1.0, NOISE)
    summed = displacements_between(rows, np.array([1, 3]))
    whole = Displacement()
    for f, h in ((2.0, 0.2), (3.0, 0.3)):
        whole = whole.extended(f, 0.0, h, 1.0, NOISE)
    assert summed[1] == pytest.approx(np.array(whole), rel=1e-12)


def test_told_places_err_from_packet_to_packet():
    """Two leaders in turn whose errors last, without odometry noise: generalised least squares."""
    k, prior = 9, SPACE.vector({"north": 5.0, "east": 8.0, "current_north": 0.5, "current_east": 0.7}) ** 2
    times, rows, beacon = mission(k)
    rows = np.column_stack((rows[:, :3], np.zeros((k, 3))))
    numbers = np.array([0, 1, 0, 0, 1, 1, 0, 1, 0])
    kept, added = np.linspace(0.9, 0.5, k), np.linspace(4.0, 0.3, k)
    relative = np.concatenate((way(rows) - beacon[:, :2], beacon[:, 2:]), axis=1)
    sights = at_once(times, rows, range_deviation=0.4)._replace(told=Told(numbers, kept, added))
    (found,) = bounds(np.diag(prior), sights, relative[None, None], np.array([k - 1]))
    covariance = np.zeros((k, k))  # of an error along one axis, at each sight
    for leader in (0, 1):
        of = np.flatnonzero(numbers == leader)
        variance = 0.0
        for a, i in enumerate(of):
            variance = added[i] + (kept[i] ** 2 * variance if a else 0.0)
            left = 1.0
            covariance[i, i] = variance
            for j in of[a + 1 :]:
                left *= kept[j]
                covariance[i, j] = covariance[j, i] = left * variance
    sight = relative[:, :2] / np.linalg.norm(relative, axis=1, keepdims=True)
    S = 0.16 * np.eye(k) + covariance * (sight @ sight.T)
    H = np.hstack((sight, sight * times[:, None]))
    start = np.linalg.inv(np.diag(1.0 / prior[:4]) + H.T @ np.linalg.solve(S, H))
    F = np.block([[np.eye(2), times[-1] * np.eye(2)], [np.zeros((2, 2)), np.eye(2)]])
    assert found[0, :4, :4] == pytest.approx(F @ start @ F.T, rel=1e-7)
