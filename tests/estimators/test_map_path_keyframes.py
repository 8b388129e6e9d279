"""Closures between frames of any heading: what echoes from near sides do to them, and how far each is believed."""

import numpy as np
import pytest

from estimators.core.models.motion import unicycle, with_error
from estimators.core.models.process import MotionProcess
from estimators.core.types import Gaussian
from estimators.map_path.frames import SectorGrid
from estimators.map_path.keyframes import KeyframeFilter, Keyframes, KeyframeState
from estimators.map_path.likelihood import FrameModel, Matcher
from estimators.map_path.poses import between, compose
from estimators.map_path.window import rearranged

GRID = SectorGrid(cell=0.25, shape=(72, 120), ranges=(1.0, 18.0), half_sector=np.radians(60.0))
MATCHER = Matcher(GRID, FrameModel(density=0.1, amplitude=1.0, point_spread=0.4, noise=0.3))
PROCESS = MotionProcess(with_error(unicycle(), "nearer", "m"), {"north": 1e-4, "east": 1e-4})
EARLIER, LATER = np.array((3.0, -2.0, 0.4)), np.array((8.5, 12.0, 0.4 - np.radians(100.0)))  # look at one place
NEARER = 0.5
FILTER = KeyframeFilter(
    MATCHER, PROCESS, {}, lambda *_: None, keyframes=Keyframes(gap=1, support=1, covariance_factor=2.0), nearer=3
)


def image(pose: np.ndarray, nearer: float) -> np.ndarray:
    """Points on the floor as seen from a pose, each nearer along its heading."""
    rng = np.random.default_rng(3)
    points = np.column_stack((rng.uniform((-5.0, -20.0), (28.0, 24.0), (110, 2)), np.zeros(110)))
    seen = between(pose, points)[:, :2] - (nearer, 0.0)
    away = GRID.centres[:, :, None, :] - seen
    return np.exp(-0.5 * (away**2).sum(axis=3) / 0.4**2).sum(axis=2) * GRID.seen


def state(believed: float, poses: tuple[np.ndarray, ...] = (EARLIER, LATER)) -> KeyframeState:
    """Of frames from these poses, of which the vehicle is at the last; all as they truly are, and `nearer` so large."""
    mean = np.concatenate((poses[-1], [believed], *poses))
    deviations = (0.1, 0.1, 0.02, 0.2, *((0.1, 0.1, 0.02) * len(poses)))
    whole = Gaussian(mean=mean, covariance=np.diag(np.square(deviations)))
    frames = tuple(MATCHER.prepare(image(pose, NEARER)) for pose in poses)
    # The vehicle's pose is that of the last frame, not another one.
    rows = np.array((*range(mean.size - 3), 0, 1, 2))
    numbers = tuple(range(len(poses)))
    return KeyframeState(rearranged(whole, rows), frames, numbers=numbers, stamps=numbers, count=len(poses))


def test_a_closure_from_another_side_shows_where_the_vehicle_is_once_nearer_is_known() -> None:
    """Turned by 100 degrees a match is moved by 0.77 m; the residual is that, and none at the right value."""
    right = state(NEARER)
    closure = FILTER._matched(right, [0], 1.0)
    assert closure is not None
    moved = between(between(EARLIER, LATER), closure.measured[0])
    # Few features are seen by both, and some by one only at the edge: such a match errs by a sixth of a cell.
    turn = np.radians(100.0)
    assert moved[:2] == pytest.approx(NEARER * np.array((1.0 - np.cos(turn), -np.sin(turn))), abs=0.04)
    H, residual = FILTER._innovation(right, closure)
    assert residual == pytest.approx(np.zeros(3), abs=0.04)
    _, all_of_it = FILTER._innovation(state(0.0), closure)
    assert all_of_it - residual == pytest.approx(NEARER * H[:, 3], abs=1e-9)


def test_the_match_is_looked_for_where_it_is_expected() -> None:
    """Believed to be known, it is found; 1.5 m off, which is beyond the reach of the search, it is not."""
    narrow = state(NEARER)
    narrow = narrow._replace(whole=Gaussian(mean=narrow.whole.mean, covariance=1e-4 * narrow.whole.covariance))
    found = FILTER._matched(narrow, [0], 1.0)
    assert found is not None
    assert FILTER._innovation(narrow, found)[1] == pytest.approx(np.zeros(3), abs=0.04)
    wrong = narrow.whole.mean.copy()
    wrong[3] += 2.0
    lost = FILTER._matched(narrow._replace(whole=Gaussian(mean=wrong, covariance=narrow.whole.covariance)), [0], 1.0)
    assert lost is None or np.abs(FILTER._innovation(narrow, lost)[1]).max() > 0.5


def test_what_is_not_known_of_nearer_widens_the_search() -> None:
    """All poses are known and `nearer` is 1 m wrong, two and a half of its deviations: the match shows that error."""
    start = state(NEARER - 1.0)
    variances = np.full(start.whole.mean.size, 1e-6)
    variances[3] = 0.4**2
    closure = FILTER._matched(
        start._replace(whole=Gaussian(mean=start.whole.mean, covariance=np.diag(variances))), [0], 1.0
    )
    assert closure is not None
    H, residual = FILTER._innovation(start, closure)
    assert residual == pytest.approx(H[:, 3], abs=0.04)


def test_only_keyframes_that_look_near_the_same_place_are_matched() -> None:
    """These two look at places 8.6 m apart."""
    looked_at = [compose(pose, np.array((9.5, 0.0, 0.0)))[:2] for pose in (EARLIER, LATER)]
    apart = float(np.hypot(*(looked_at[1] - looked_at[0])))
    for distance, count in ((apart - 0.1, 0), (apart + 0.1, 1)):
        filter_ = KeyframeFilter(
            MATCHER, PROCESS, {}, lambda *_: None, keyframes=Keyframes(gap=1, support=1, distance=distance), nearer=3
        )
        assert len(filter_._candidates(state(NEARER))) == count


def test_alike_and_other_headings_are_matched_apart() -> None:
    """Two keyframes look at the same place as the last frame, one from its side: two closures, the other's is doubted.

    In the shared place both are matched alike but for the factor, so of one pair both covariances are compared.
    """
    beside = compose(LATER, np.array((-0.6, 1.1, 0.1)))
    kept = state(NEARER, (EARLIER, beside, LATER))
    closures = FILTER._candidates(kept)
    assert [closure.earlier for closure in closures] == [(1,), (0,)]
    settings = FILTER._keyframes
    for closure, factor in zip(closures, (settings.covariance_factor, settings.other_factor), strict=True):
        plain = FILTER._matched(kept, [closure.earlier[0]], 1.0)
        assert plain is not None
        np.testing.assert_allclose(closure.covariance, factor * plain.covariance)
    assert [c.later for c in closures] == [2, 2]
    far = compose(LATER, np.array((-30.0, 0.0, 0.0)))
    assert FILTER._candidates(state(NEARER, (far, LATER))) == []
