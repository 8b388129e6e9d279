"""Navigation over whole runs: errors beside dead reckoning's, consistency, bad and late frames, replay."""

import math
from dataclasses import replace

import numpy as np
import pytest

from auvsim.reproduce.paper5 import study
from auvsim.reproduce.paper5.methods import METHODS, START, follow, frame_model
from auvsim.reproduce.paper5.scenes import GRID, SATURATION, Conditions, arc, simulate
from estimators.core.types import Gaussian
from estimators.map_path.dynamic_programming import PathFilter
from estimators.map_path.landmarks import LandmarkFilter
from estimators.map_path.likelihood import Matcher
from estimators.map_path.particles import ParticlePathFilter
from estimators.map_path.poses import compose, increments
from estimators.map_path.trellis import ErrorLattice
from estimators.map_path.window import WindowFilter

FILTERS = [PathFilter, WindowFilter, ParticlePathFilter, LandmarkFilter]
BASE = arc(Conditions())


def made(kind, run, **options):
    start = Gaussian(mean=run.poses[0], covariance=START)
    return kind(Matcher(GRID, frame_model(run.conditions)), start, saturation=SATURATION, **options)


@pytest.fixture(scope="module")
def scores():
    """Scores of two runs, straight and arc, of seeds of their own."""
    methods = ("dead_reckoning", "dp", "window", "particles", "graph", "landmarks")
    found = {}
    for name in ("straight", "arc"):
        runs = [simulate(study.ROWS[name].conditions, 7_000 + k) for k in range(2)]
        found[name] = [{m: study.score(run, METHODS[m](run)) for m in methods} for run in runs]
    return found


@pytest.mark.parametrize("name", ["straight", "arc"])
def test_errors_beside_those_of_dead_reckoning(scores, name):
    """The study's limits, with half as much again for two runs only."""
    results = {
        m: study.summarise([s[m] for s in scores[name]], [s["dead_reckoning"] for s in scores[name]])
        for m in scores[name][0]
    }
    for method, limit in {"dp": 0.45, "window": 0.15, "particles": 0.2, "graph": 0.2, "landmarks": 0.4}.items():
        assert results[method].ratio < 1.5 * limit, method
    assert results["window"].rms < 0.6 * results["dp"].rms


def test_the_window_says_how_far_it_is_off(scores):
    """NEES of the pose at the end over four runs: 12 degrees of freedom, 99.9 % of chi-square, half as much again for
    the model's sake."""
    values = [s["window"].nees for name in scores for s in scores[name]]
    assert 0.2 < np.mean(values) < 1.5 * 2.74


def test_the_path_is_consistent_with_what_the_filter_says_at_the_end():
    """The last pose of the backtracked path is the belief's, and a flat prior is per-frame maximisation."""
    run = simulate(replace(BASE, duration=12), 31)
    track, estimator = follow(run, made(PathFilter, run))
    path = estimator.nodes[-1].state.path()
    np.testing.assert_allclose(path[-1][1], track.poses[-1], atol=1e-9)
    assert [time for time, _ in path] == [float(k) for k in range(1, 13)]
    lagged = estimator.nodes[-1].state.path(lag=4)
    np.testing.assert_array_equal([p for _, p in lagged], [p for _, p in path[-4:]])
    _, estimator = follow(run, made(PathFilter, run, flat=True))
    chosen = estimator.nodes[-1].state.path()
    # By hand: each frame's own best node.
    matcher, lattice = Matcher(GRID, frame_model(run.conditions)), ErrorLattice()
    ready, pose = [matcher.prepare(f.intensity) for f in run.frames], run.poses[0]
    for k, u in enumerate(run.inputs):
        moved = increments([u], lattice.errors)
        cells = matcher.shared_cells(increments([u], np.zeros((1, 2)))[0])
        best = int(np.argmax(matcher.log_likelihood(ready[k + 1], ready[k], moved, cells)))
        pose = compose(pose, moved[best])
        np.testing.assert_allclose(chosen[k][1], pose, atol=1e-9)


def test_unseen_heading_error_stays():
    """No sonar sees the heading at the start: its variance is never reduced, and swings the position."""
    run = simulate(replace(BASE, duration=20), 32)
    covariance = np.diag([1e-4, 1e-4, math.radians(2.0) ** 2])
    for kind in (PathFilter, WindowFilter):
        start = Gaussian(mean=run.poses[0], covariance=covariance)
        track, _ = follow(run, kind(Matcher(GRID, frame_model(run.conditions)), start))
        assert track.covariances[-1][2, 2] >= 0.999 * covariance[2, 2]
        distance = math.hypot(*(run.poses[-1, :2] - run.poses[0, :2]))
        swing = track.covariances[-1][0, 0] + track.covariances[-1][1, 1]
        assert swing > 0.9 * (distance * math.radians(2.0)) ** 2


@pytest.mark.parametrize("kind", FILTERS)
def test_bad_frames_are_skipped_counted_named_and_survived(kind):
    """Of 30 frames one each is empty, not finite, saturated, of a wrong size, missing; errors stay far below 10 m."""
    run = simulate(replace(BASE, duration=30), 33)
    frames = list(run.frames)
    z = frames[0].intensity
    bad = {5: np.zeros_like(z), 9: np.full_like(z, np.inf), 13: np.full_like(z, SATURATION), 17: z[:, :-3]}
    for k, intensity in bad.items():
        frames[k] = replace(frames[k], intensity=intensity)
    del frames[21]
    track, _ = follow(replace(run, frames=tuple(frames)), made(kind, run))
    named = {r: n for r, n in track.refused.items() if r not in ("no_peak", "outlier")}
    # A constant frame is empty, saturated or not.
    assert named == {"empty": 2, "not_finite": 1, "wrong_size": 1}
    assert np.hypot(*(track.poses - run.poses)[-1, :2]) < 6.0
    assert np.isfinite(track.covariances).all()


@pytest.mark.parametrize("kind", FILTERS)
def test_late_frames_give_what_prompt_ones_give(kind):
    """Delivered 1.4 s late, two of them in reverse, the last state is that of prompt delivery bit for bit."""
    run = simulate(replace(BASE, duration=14), 34)
    late = [replace(f, received=f.stamp + (1.4 if k in (3, 7, 8) else 0.0)) for k, f in enumerate(run.frames)]
    late[7] = replace(late[7], received=9.9)
    prompt, _ = follow(run, made(kind, run))
    delayed, _ = follow(replace(run, frames=tuple(late)), made(kind, run))
    np.testing.assert_array_equal(delayed.poses[-1], prompt.poses[-1])
    assert not np.array_equal(delayed.poses[3], prompt.poses[3])
    too_late = [replace(f, received=f.stamp + 9.0) if k == 4 else f for k, f in enumerate(run.frames)]
    track, _ = follow(replace(run, frames=tuple(too_late)), made(kind, run))
    assert track.refused["too_old"] == 1


def test_surfacing_learns_the_errors_of_odometry():
    """With fixes every 60 s the error after 240 s is metres, dead reckoning's is tens."""
    run = simulate(Conditions(duration=240, snr=0.0), 35)
    track = METHODS["gps_60"](run)
    end, alone = (np.hypot(*(poses - run.poses)[-1, :2]) for poses in (track.poses, run.dead_reckoning))
    assert end < 8.0 < alone
