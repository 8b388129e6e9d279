"""The share of outliers that a filter learns, and a start that allows for a first fix that is one."""

import math
from dataclasses import replace

import numpy as np
import pytest

from auvsim.reproduce.paper1.runs import TICK, Conditions, follow, simulate, track
from estimators.core.errors import ParameterError
from estimators.core.outliers import Outliers
from estimators.docking.estimator import DockingEstimator, InteractingFilter
from estimators.planar.model import PRESTERO

DOUBT = Outliers(prior=0.05, deviations=(2.0, 15.0))


def test_share_is_the_mean_of_a_beta_distribution():
    """Its density on a grid, prior times likelihood of 7 wrong among 25, has the same mean."""
    doubt = replace(DOUBT, worth=20.0)
    share = np.linspace(0.0, 1.0, 200_001)[1:-1]
    density = share ** (1.0 - 1.0 + 7.0) * (1.0 - share) ** (19.0 - 1.0 + 18.0)  # Beta(1, 19) before
    assert doubt.after(7.0, 25).prior == pytest.approx((share * density).sum() / density.sum(), rel=1e-6)
    assert DOUBT.after(7.0, 25) is DOUBT
    with pytest.raises(ParameterError, match="worth"):
        replace(DOUBT, worth=0.0)


def test_covariance_of_the_chance_of_an_outlier_is_that_of_draws():
    rng = np.random.default_rng(5)
    wrong = rng.random(400_000) < 0.05
    deviations = rng.choice([(2.0, 1.0), (15.0, 4.0)], len(wrong))
    errors = wrong[:, None] * deviations * rng.standard_normal((len(wrong), 2))
    expected = Outliers(prior=0.05, deviations=((2.0, 1.0), (15.0, 4.0))).covariance(2)
    # The variance of a heavy-tailed sum of 20 000 outliers is known to 2 %; five times that.
    assert np.diagonal(expected) == pytest.approx(np.square(errors).mean(axis=0), rel=0.1)
    assert expected[0, 1] == 0.0


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_learns_the_share_of_outliers(share):
    run = simulate(Conditions(duration=1500.0, outliers=share), 81)
    filter_ = InteractingFilter(PRESTERO, outliers=replace(DOUBT, worth=20.0))
    estimator = DockingEstimator(filter_, step=TICK)
    for _ in follow(run, estimator):
        pass
    state = estimator.nodes[-1].state
    assert state.seen > 200
    learned = replace(DOUBT, worth=20.0).after(state.wrong, state.seen).prior
    # A binomial share of n, three deviations, and 20 fixes of prior that pull it by less than 0.02.
    assert learned == pytest.approx(share, abs=3.0 * math.sqrt(share * (1.0 - share) / state.seen) + 0.02)


@pytest.mark.parametrize("seed", range(4))
def test_a_doubtful_start_knows_that_its_first_fix_may_be_wrong(seed):
    run = simulate(Conditions(duration=60.0), 520 + seed)
    first = run.fixes[0]
    wrong = replace(first, position=tuple(np.add(first.position, (12.0, -9.0, 0.0))))
    run = replace(run, fixes=(wrong, *run.fixes[1:]))
    nees = {}
    for doubtful in (False, True):
        tracked = track(run, InteractingFilter(PRESTERO, outliers=DOUBT, doubtful=doubtful))
        known = np.isfinite(tracked.means[:, 0])
        k = int(np.argmax(known))
        error = tracked.means[k, :2] - run.states[k, :2]
        nees[doubtful] = float(error @ np.linalg.solve(tracked.covariances[k, :2, :2], error)) / 2.0
        third = math.ceil(run.fixes[3].received / TICK)
        assert tracked.errors(run)[third:].max() < 1.0  # two good fixes give position and current, as without
    # 15 m of an assumed 2.4 m, 5.7 m2 on each axis: 225 / 5.7 / 2 = 20; of the fix's own noise of 0.5 m, 450.
    assert nees[True] < 22.0 < 100.0 < nees[False]
