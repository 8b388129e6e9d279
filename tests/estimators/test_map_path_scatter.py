"""How far matches scatter, learnt from frames, and errors of scale, skew and turn that relief puts into frames."""

import math
from dataclasses import replace

import numpy as np
import pytest

from auvsim.reproduce.paper5.methods import START, follow, frame_model
from auvsim.reproduce.paper5.scenes import GRID, Conditions, arc, point_frame, simulate
from estimators.core.types import Gaussian
from estimators.map_path import poses
from estimators.map_path.dynamic_programming import PathFilter
from estimators.map_path.frames import SectorGrid, SonarFrame
from estimators.map_path.likelihood import FrameModel, Matcher, Prepared
from estimators.map_path.matching import Match, Search, match, score_covariance
from estimators.map_path.odometry import ARM, OdometryNoise
from estimators.map_path.poses import Input
from estimators.map_path.window import Relation, Window, WindowFilter, _scatter

PRIOR = np.diag(np.square((0.2, 0.2, 0.03)))


def matches(run, factor=1.0):
    """Errors (k, 3) of matches with frames 1, 2 and 4 s before, searched about the truth; covariances; scatter (k,)."""
    model = replace(frame_model(run.conditions), together=3)
    matcher = Matcher(GRID, model)
    ready = [matcher.prepare(factor * f.intensity) for f in run.frames]
    found = []
    for k in range(4, len(ready)):
        before = [k - 1, k - 2, k - 4]
        relatives = poses.between(run.poses[before], run.poses[k])
        each = match(matcher, ready[k], [ready[j] for j in before], relatives, PRIOR, Search(), True)
        if isinstance(each, Match):
            found.append((each.offset, each.covariance, each.scatter))
    return tuple(np.array(part) for part in zip(*found, strict=True))


def nees(offsets, covariances):
    return float(np.mean(np.einsum("ni,nij,nj->n", offsets, np.linalg.inv(covariances), offsets)) / 3.0)


def test_scatter_makes_matches_of_frames_that_no_model_describes_consistent():
    """The array's echoes have a new phase each ping: taken for point frames they scatter far beyond the likelihood."""
    run = simulate(arc(Conditions(duration=40, snr=6.0, frames="array")), 61)
    offsets, covariances, scatter = matches(run)
    factor = math.exp(np.mean(np.log(scatter)))
    assert nees(offsets, covariances) > 1.5
    # 37 matches of three components: 0.13 in deviation, and what neighbouring ones share.
    assert nees(offsets, factor * covariances) == pytest.approx(1.0, abs=0.4)


def test_scatter_is_about_one_where_the_model_is_right():
    """Frames of the model at 0 dB; the Gaussian field is an approximation of point features."""
    _, _, scatter = matches(simulate(arc(Conditions(duration=20)), 62))
    assert math.exp(np.mean(np.log(scatter))) == pytest.approx(1.0, abs=0.25)


def test_scatter_makes_up_for_a_wrong_unit():
    """Frames a times as large: the likelihood and its curvature are a^2 as large, the gradient's covariance a^4."""
    run = simulate(arc(Conditions(duration=8, snr=12.0)), 63)
    (_, one, scatter), (_, two, doubled) = matches(run), matches(run, 2.0)
    np.testing.assert_allclose(doubled[0] / scatter[0], 4.0, rtol=0.2)  # the peaks differ by what the prior moves them
    np.testing.assert_allclose(one[0] / two[0], 4.0, rtol=0.3)


def test_the_covariance_of_the_gradient_is_the_double_sum_over_cells():
    """Term by term over all pairs of cells, on a small grid, with two earlier frames."""
    grid = SectorGrid(cell=0.5, shape=(9, 13), ranges=(0.5, 4.4), half_sector=1.2)
    matcher, rng = Matcher(grid, FrameModel(point_spread=0.4)), np.random.default_rng(64)
    later, *earlier = (matcher.prepare(rng.normal(size=grid.shape)) for _ in range(3))
    relatives, spacing = np.array([[0.3, 0.1, 0.02], [0.5, -0.1, -0.04]]), np.array([0.12, 0.12, 0.01])
    cells = [matcher.shared_cells(relative) for relative in relatives]
    offset = np.array([0.04, -0.03, 0.01])
    chosen = list(zip(earlier, relatives, cells, strict=True))

    def summed(step):
        """By the log-likelihood of frames of a single cell each: m at every cell."""
        image = np.zeros(grid.shape)
        for frame, relative, shared in chosen:
            for cell in np.flatnonzero(shared):
                one = np.zeros(grid.shape)
                row, column = np.argwhere(grid.seen)[cell]
                one[row, column] = 1.0
                pose = poses.compose(relative, offset + step)[None]
                (value,) = matcher.log_likelihood(Prepared(one, one), frame, pose, shared)
                image[row, column] += value
        return image

    slopes = np.array([(summed(h) - summed(-h)) / (2.0 * h.sum()) for h in np.diag(spacing)])
    y, m = np.where(grid.seen, later.values, 0.0), summed(np.zeros(3))
    expected = np.zeros((3, 3))
    places = np.argwhere(np.ones(grid.shape, dtype=bool))
    for row, column in places:
        for other_row, other_column in places:
            down, right = other_row - row, other_column - column
            a = y[max(0, -down) : 9 - max(0, down), max(0, -right) : 13 - max(0, right)]
            b = y[max(0, down) : 9 + min(0, down), max(0, right) : 13 + min(0, right)]
            like = np.sum(a * b) / np.count_nonzero(grid.seen)
            expected += like * np.outer(slopes[:, row, column], slopes[:, other_row, other_column])
    r = np.corrcoef(y[m != 0.0], m[m != 0.0])[0, 1]
    share = np.sum(y * m) ** 2 / (np.sum(m**2) * np.sum(y[m != 0.0] ** 2))
    assert share == pytest.approx(r**2, abs=0.05)  # frames have no mean
    found = score_covariance(matcher, later, chosen, offset, spacing)
    np.testing.assert_allclose(found, (1.0 - share) * expected, rtol=1e-9)


def test_scatter_is_a_geometric_mean_over_the_frames_that_were_matched():
    frames = [Prepared(np.zeros(1), np.zeros(1), s) for s in (np.nan, 8.0, np.nan, 0.5)]
    assert _scatter(frames, 2.0) == pytest.approx(2.0)
    assert _scatter(frames, 16.0) == pytest.approx(4.0)
    assert _scatter(frames[:1], np.nan) == 1.0


def test_what_relief_does_to_relative_poses_by_differences():
    """A scale of 1 %, a skew and a turn, by hand in the earlier pose's axes and turned into the later one's."""
    earlier, later = np.array([2.0, -1.0, 0.4]), np.array([4.5, 1.0, 1.3])
    mean = np.concatenate((later, np.zeros(5), earlier))
    relation = Relation.of_pose(Gaussian(mean=mean, covariance=np.eye(11)), 8, [8])
    (moved,) = relation.relatives
    errors = np.array([0.01, 0.02, 0.003])
    shown = relation.relatives[0] + relation.by_relief()[0] @ errors
    away, aside = math.hypot(*moved[:2]), math.atan2(moved[1], moved[0])
    distance, bearing = math.hypot(*shown[:2]), math.atan2(shown[1], shown[0])
    assert distance == pytest.approx(away * math.hypot(1.01, 0.02))
    assert bearing - aside == pytest.approx(math.atan2(0.02, 1.01))
    assert shown[2] - moved[2] == pytest.approx(0.003 * away)
    c, s = math.cos(moved[2]), math.sin(moved[2])
    turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ relation.by_relief()[0]
    np.testing.assert_allclose(relation.by_relief(later_axes=True)[0], turned, atol=1e-12)


def test_relief_keeps_its_variance():
    """A Gauss-Markov process begun in its steady state stays in it; without relief there are five states."""
    noise = OdometryNoise()
    process, start = noise.process(0.02, 15.0), noise.start(Gaussian(mean=np.zeros(3), covariance=START), 0.02)
    _, P, _ = process.propagate(start.mean, start.covariance, (1.5, 0.1), 30.0)
    np.testing.assert_allclose(np.sqrt(np.diagonal(P)[5:]), (0.02, 0.02, 0.02 / ARM), rtol=1e-3)
    assert noise.start(Gaussian(mean=np.zeros(3), covariance=START)).mean.size == 5


def test_the_window_learns_a_scale_of_frames_from_good_odometry():
    """Frames show all as 4 % farther on than odometry says, which has an error of 1 %."""
    scale, rng = 0.04, np.random.default_rng(65)
    features = rng.uniform((-25.0, -25.0), (60.0, 25.0), (430, 2))
    shown = np.column_stack((1.5 * (1.0 + scale) * np.arange(20.0), np.zeros((20, 2))))
    noise = OdometryNoise(speed_bias=0.015, speed=0.01)
    start = Gaussian(mean=np.zeros(3), covariance=START)
    filter_ = WindowFilter(
        Matcher(GRID, FrameModel().scaled(12.0)),
        start,
        noise=noise,
        window=Window(scatter=True, relief=0.05, relief_time=1e4),
    )
    images = [point_frame(features, pose, 12.0, rng) for pose in shown]
    frames = tuple(SonarFrame(stamp=float(k), intensity=z, geometry=GRID, sequence=k) for k, z in enumerate(images))
    run = replace(simulate(Conditions(duration=19), 66), inputs=(Input(1.5, 0.0, 1.0),) * 19, frames=frames)
    track, estimator = follow(run, filter_)
    state = estimator.nodes[-1].state
    assert state is not None
    belief = state.belief
    deviation = math.sqrt(belief.covariance[5, 5])
    assert belief.mean[5] == pytest.approx(scale, abs=3.0 * deviation)
    assert deviation < 0.015
    assert track.poses[-1, 0] == pytest.approx(1.5 * 19, abs=3.0 * math.sqrt(belief.covariance[0, 0]))


def test_the_trellis_is_given_no_more_than_frames_bear_out():
    """In another unit the path and its covariance stay the same, of frames that scatter; in the likelihood's eyes four
    times as much is known, which without `scatter` it believes."""
    run = simulate(arc(Conditions(duration=12, snr=6.0, frames="array")), 67)
    matcher, start = Matcher(GRID, frame_model(run.conditions)), Gaussian(mean=run.poses[0], covariance=START)
    doubled = replace(run, frames=tuple(replace(f, intensity=2.0 * f.intensity) for f in run.frames))
    (one, _), (two, estimator) = (follow(r, PathFilter(matcher, start, scatter=True)) for r in (run, doubled))
    np.testing.assert_allclose(two.poses, one.poses, atol=1e-9)
    np.testing.assert_allclose(two.covariances, one.covariances, rtol=1e-6)
    state = estimator.nodes[-1].state
    assert state is not None
    assert state.scatter[1] == 12
    plain = follow(doubled, PathFilter(matcher, start))[0]
    assert np.trace(plain.covariances[-1][:2, :2]) < 0.5 * np.trace(one.covariances[-1][:2, :2])


def test_the_window_believes_matches_no_more_than_they_scatter():
    """Over array frames the variance of the position is larger, by less than matches scatter as odometry tells, too."""
    run = simulate(arc(Conditions(duration=12, snr=6.0, frames="array")), 68)
    matcher, start = Matcher(GRID, frame_model(run.conditions)), Gaussian(mean=run.poses[0], covariance=START)
    traces = []
    for window in (Window(), Window(scatter=True)):
        track, estimator = follow(run, WindowFilter(matcher, start, window=window))
        traces.append(np.trace(track.covariances[-1][:2, :2]))
    state = estimator.nodes[-1].state
    assert state is not None
    factor = _scatter(state.frames, np.nan)
    assert factor > 1.5
    assert 1.2 < traces[1] / traces[0] < factor
