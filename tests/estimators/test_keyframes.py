"""Keyframes: the same as the window where there are none, loops that close, closures that do not agree with others."""

import numpy as np
import pytest

from auvsim.reproduce.paper5.methods import START, frame_model
from auvsim.reproduce.paper5.scenes import GRID, SATURATION, Conditions, arc, simulate
from estimators.core.estimator import Estimator
from estimators.core.types import Gaussian, Measurement
from estimators.map_path.keyframes import MARK, MARKED, KeyframeFilter, Keyframes
from estimators.map_path.likelihood import Matcher
from estimators.map_path.odometry import OdometryNoise
from estimators.map_path.poses import Input
from estimators.map_path.window import Window, WindowFilter

TURN = np.radians(9.0)  # a circle of 40 s: the second round sees the floor of the first from the same side


def followed(filter_, run):
    """The last state and estimated poses of a run."""
    estimator, frames = Estimator(filter_, step=1.0, keep=3.0), {round(f.stamp): f for f in run.frames}
    poses = []
    for k in range(len(run.poses)):
        u = run.inputs[k - 1][:2] if k else (0.0, 0.0)
        poses.append(estimator.tick(float(k), u, [frames[k].measurement()] if k in frames else []).belief.mean[:3])
    return estimator.history.state, np.array(poses)


def filters(run, **options):
    noise, matcher = OdometryNoise(), Matcher(GRID, frame_model(run.conditions))
    start = noise.start(Gaussian(mean=run.poses[0], covariance=START))
    keyframes = KeyframeFilter(
        matcher, noise.process(), {}, lambda nodes, k: (start, ()), saturation=SATURATION, **options
    )
    return WindowFilter(matcher, Gaussian(mean=run.poses[0], covariance=START), saturation=SATURATION), keyframes


@pytest.fixture(scope="module")
def rounds():
    """A round and a half of a circle, 60 s, at +6 dB."""
    motion = (Input(1.5, TURN, 1.0),) * 60
    return simulate(Conditions(snr=6.0), 8_100, motion)


def test_without_keyframes_it_is_the_window():
    """The same numbers of a run with frames that turn."""
    run = simulate(arc(Conditions(duration=20)), 8_000)
    window, keyframes = filters(run)
    first, second = followed(window, run)[1], followed(keyframes, run)[1]
    np.testing.assert_allclose(second, first, atol=1e-9)


def test_each_third_frame_is_matched_and_weighs_by_the_factor_of_its_covariance(rounds):
    """Of others there is no innovation; ten times the covariance makes the position less sure, by less than that."""
    spreads = []
    for factor in (1.0, 10.0):
        window = Window(kept=4, lags=(1, 3), interval=3, covariance_factor=factor)
        estimator = Estimator(filters(rounds, window=window)[1], step=1.0, keep=3.0)
        for k in range(10):
            result = estimator.tick(
                float(k), rounds.inputs[k - 1][:2] if k else (0.0, 0.0), [rounds.frames[k].measurement()]
            )
            assert [np.isfinite(o.nis) for o in result.outcomes] == [k > 0 and k % 3 == 0]
        spreads.append(np.trace(result.belief.covariance[:2, :2]) - np.trace(START[:2, :2]))
    assert 1.3 * spreads[0] < spreads[1] < 10.0 * spreads[0]


def test_frames_that_are_kept_have_their_numbers_and_stamps(rounds):
    state, _ = followed(filters(rounds, keyframes=Keyframes(spacing=7, closures=False))[1], rounds)
    assert state.numbers == (*range(0, 49, 7), *range(49, 61))
    assert state.stamps == tuple(float(k) for k in state.numbers)
    assert state.whole.mean.size == 5 + 3 * len(state.numbers)


def test_a_marked_pose_stays_in_the_state_and_moves_with_what_is_learnt(rounds):
    """It is the vehicle's at its time, with its covariances; it outlives the window; a second mark is not taken."""
    estimator = Estimator(filters(rounds, keyframes=Keyframes(spacing=7, closures=False))[1], step=1.0, keep=3.0)
    marks = [
        Measurement(kind=MARK, value=np.zeros(1), covariance=np.eye(1), stamp=stamp, received=stamp)
        for stamp in (3.0, 5.0)
    ]
    then = None
    for k in range(25):
        u = rounds.inputs[k - 1][:2] if k else (0.0, 0.0)
        estimator.tick(float(k), u, [rounds.frames[k].measurement(), *(m for m in marks if m.stamp == k)])
        state = estimator.history.state
        if k == 3:
            n, then = state.size, state.mark[1]
            # The frame of the same time may come after it, and corrects both alike but for the match's own part.
            whole = state.whole
            np.testing.assert_allclose(whole.mean[n : n + 3], whole.mean[:3], atol=1e-9)
            np.testing.assert_allclose(whole.covariance[n : n + 3, :n], whole.covariance[:3, :n], atol=1e-9)
    assert state.mark[0] == 3.0
    assert state.numbers == (MARKED, 0, 7, *range(13, 25))
    assert len(state.poses) == len(state.numbers) == len(state.frames) == len(state.stamps)
    assert not np.array_equal(state.mark[1], then)
    assert np.hypot(*(state.mark[1] - then)[:2]) < 0.2  # what a few frames tell of a pose 4.5 m from the start


def test_a_second_round_closes_loops_and_mends_the_whole_path(rounds):
    """Errors of the path at the end, against truth: smaller with closures, and the covariance of the pose too."""
    found = {}
    for close in (False, True):
        state, _ = followed(filters(rounds, keyframes=Keyframes(gap=30, closures=close))[1], rounds)
        off = state.poses[:, :2] - rounds.poses[list(state.numbers), :2]
        found[close] = state, float(np.sqrt((off**2).sum(axis=1).mean()))
    assert found[False][0].closed == 0
    assert found[True][0].closed >= 10
    assert found[True][1] < found[False][1]
    size = [np.trace(found[c][0].belief.covariance[:2, :2]) for c in (False, True)]
    assert size[1] < 0.7 * size[0]


def test_a_closure_that_agrees_with_no_other_is_not_believed(rounds):
    """Of four, one displaced by 3 m is left out."""
    filter_ = filters(rounds, keyframes=Keyframes(gap=30, closures=True))[1]
    state, _ = followed(filter_, rounds)
    closures = [c for number in state.numbers[-8:] for c in [_candidate(filter_, state, number)] if c is not None]
    closures = closures[:4]
    assert len(closures) == 4
    wrong = closures[1]._replace(measured=closures[1].measured + np.array((3.0, 0.0, 0.0)))
    assert filter_._agreeing(state, [closures[0], wrong, *closures[2:]]) == [0, 2, 3]


def _candidate(filter_, state, number):
    """The closure that the exact poses of the state would show, of a frame in it."""
    from estimators.map_path.keyframes import Closure
    from estimators.map_path.poses import between

    earlier = state.numbers[2]
    relative = between(state.poses[2], state.poses[state.numbers.index(number)])
    return Closure(number, (earlier,), relative[None], np.ones(1), np.diag((0.01, 0.01, 1e-4)))
