"""Mixing, merging and doubting of beliefs against the definitions, by sampling and by hand."""

import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import multivariate_normal
from test_ekf import belief, measurement

from estimators.core import ekf, imm, loops, outliers
from estimators.core.errors import ParameterError
from estimators.core.outliers import Outliers
from estimators.core.types import Gaussian
from estimators.docking.sensors import PositionModel

WEIGHTS = np.array([0.3, 0.7])
TRANSITION = np.array([[0.9, 0.1], [0.2, 0.8]])


def mixture_moments(beliefs, weights):
    mean = sum(w * b.mean for w, b in zip(weights, beliefs, strict=True))
    return mean, sum(
        w * (b.covariance + np.outer(b.mean - mean, b.mean - mean)) for w, b in zip(weights, beliefs, strict=True)
    )


def test_merged_moments_are_those_of_the_mixture():
    beliefs = [belief(1), belief(2)]
    mean, covariance = mixture_moments(beliefs, WEIGHTS)
    merged = imm.merge(beliefs, WEIGHTS)
    assert merged.mean == pytest.approx(mean, abs=1e-12)
    assert merged.covariance == pytest.approx(covariance, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("duration", [0.0, 0.1, 5.0, 300.0, 1e5])
@pytest.mark.parametrize("modes", [2, 3, 4])
def test_changes_of_mode_are_the_exponential_of_their_rates(modes, duration):
    generator = np.random.default_rng(modes).uniform(0.0, 0.02, (modes, modes))
    np.fill_diagonal(generator, 0.0)
    np.fill_diagonal(generator, -generator.sum(axis=1))
    found = loops.transition(generator, duration)
    assert found == pytest.approx(expm(duration * generator), abs=1e-11)  # rounding, doubled by each squaring
    assert (found >= 0.0).all()


def test_mixing_follows_bayes_rule():
    beliefs = [belief(3), belief(4)]
    mixed, following = imm.mix(beliefs, WEIGHTS, TRANSITION)
    assert following == pytest.approx([0.3 * 0.9 + 0.7 * 0.2, 0.3 * 0.1 + 0.7 * 0.8])
    for j in range(2):
        origin = WEIGHTS * TRANSITION[:, j] / following[j]
        mean, covariance = mixture_moments(beliefs, origin)
        assert mixed[j].mean == pytest.approx(mean, abs=1e-12)
        assert mixed[j].covariance == pytest.approx(covariance, rel=1e-12, abs=1e-12)
    # What is known in all does not change by mixing.
    before, after = imm.merge(beliefs, WEIGHTS), imm.merge(mixed, following)
    assert after.mean == pytest.approx(before.mean, abs=1e-12)
    assert after.covariance == pytest.approx(before.covariance, rel=1e-12, abs=1e-12)


def test_modes_that_never_change_do_not_mix():
    beliefs = [belief(5), belief(6)]
    mixed, following = imm.mix(beliefs, WEIGHTS, np.eye(2))
    assert following == pytest.approx(WEIGHTS)
    for before, after in zip(beliefs, mixed, strict=True):
        assert after.mean == pytest.approx(before.mean, abs=1e-13)
        assert after.covariance == pytest.approx(before.covariance, abs=1e-13)


def test_headings_on_both_sides_of_south_merge_to_south():
    beliefs = [Gaussian(mean=np.array([0.0, 0.0, psi]), covariance=0.01 * np.eye(3)) for psi in (3.1, -3.1)]
    merged = imm.merge(beliefs, np.array([0.5, 0.5]), (2,))
    assert abs(merged.mean[2]) == pytest.approx(math.pi)
    assert merged.covariance[2, 2] == pytest.approx(0.01 + (math.pi - 3.1) ** 2)


def test_probabilities_follow_bayes_rule_even_where_densities_underflow():
    likelihoods = np.array([0.2, 0.6])
    expected = WEIGHTS * likelihoods / (WEIGHTS @ likelihoods)
    assert imm.update(WEIGHTS, np.log(likelihoods)) == pytest.approx(expected)
    assert imm.update(WEIGHTS, np.log(likelihoods) - 1e5) == pytest.approx(expected)


@pytest.mark.parametrize("offset", [0.1, 1.3, 1.7, 25.0])
def test_doubt_is_the_exact_posterior_s_moments(offset):
    """Every hypothesis' posterior is Gaussian, so that their mixture's moments are known exactly."""
    before = Gaussian(mean=np.zeros(4), covariance=np.diag([0.09, 0.04, 1.0, 1.0]))
    fix, model = measurement([offset, -0.2], 0.05), PositionModel(n=4)
    doubt = Outliers(prior=0.1, deviations=(2.0, 9.0))
    result = outliers.correct(before, fix, model, doubt)
    corrected, innovation = ekf.correct(before, fix, model)
    S = innovation.covariance

    def density(covariance):
        return multivariate_normal(cov=covariance).pdf(innovation.residual)

    sound = 0.9 * density(S)
    wrong = 0.05 * density(S + 4.0 * np.eye(2)) + 0.05 * density(S + 81.0 * np.eye(2))
    p = wrong / (sound + wrong)
    mean, covariance = mixture_moments([before, corrected], [p, 1 - p])
    assert result.probability == pytest.approx(p, rel=1e-9)
    assert result.log_likelihood == pytest.approx(math.log(sound + wrong))
    assert result.belief.mean == pytest.approx(mean, abs=1e-12)
    assert result.belief.covariance == pytest.approx(covariance, abs=1e-12)


def test_no_residual_is_too_large():
    result = outliers.correct(belief(7), measurement([1e200, 0.0], 0.1), PositionModel(), Outliers())
    assert result.probability == 1.0
    assert np.isfinite(result.belief.mean).all()
    assert imm.update(WEIGHTS, [result.log_likelihood] * 2) == pytest.approx(WEIGHTS)


def test_density_of_any_dimension():
    rng = np.random.default_rng(0)
    for m in (1, 2, 3):
        root = rng.standard_normal((m, m))
        S, r = root @ root.T + np.eye(m), rng.standard_normal(m)
        assert outliers.log_density(S, r) == pytest.approx(multivariate_normal(cov=S).logpdf(r))


def test_bad_outliers_are_refused():
    with pytest.raises(ParameterError, match=r"must lie in 0\.\.1"):
        Outliers(prior=1.0)
    with pytest.raises(ParameterError, match="above 0"):
        Outliers(deviations=())


def test_several_beliefs_are_corrected_by_an_angle_as_each_is_alone():
    """Bit for bit, over a whole turn; a covariance that is none is told of the belief that has it."""
    rng = np.random.default_rng(5)
    means = rng.normal(0.0, 1.0, (3, 4)) + np.array((0.0, 0.0, 3.1, 0.0))
    roots = rng.normal(0.0, 1.0, (3, 4, 4))
    covariances = roots @ roots.transpose(0, 2, 1)
    H, value, R = np.array(((0.0, 0.0, 1.0, 0.5),)), np.array((-3.0,)), np.array(((0.02,),))
    moved, less, nis, status = loops.correct_angle_each(means, covariances, H, value, R)
    assert status == loops.OK
    for k in range(3):
        mean, covariance, own, _ = loops.correct_angle(means[k], covariances[k], H, value, R)
        assert (moved[k] == mean).all()
        assert (less[k] == covariance).all()
        assert nis[k] == own
    covariances[1] = -np.eye(4)
    assert loops.correct_angle_each(means, covariances, H, value, R)[3] == loops.NOT_POSITIVE_DEFINITE
