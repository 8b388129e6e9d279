"""Segments: sensitivities, elimination of first states, and whole fits against independent ones."""

import cmath
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares

from auvsim.base.errors import InputError
from auvsim.identification import compiled
from auvsim.identification.fit import DEFAULT_FREE, NO_NUISANCES, Nuisances, free_indices, with_values
from auvsim.identification.segment_problem import Problem
from auvsim.identification.segments import SegmentOptions, fit_segments
from auvsim.identification.simulated import SHEETS, Vessel, simulate
from auvsim.identification.states import smoothed
from estimators.planar.model import PARAMETER_NAMES, PRESTERO

PARAMETERS = replace(PRESTERO, X_prop=0.0, X_nn=4e-3, X_nu=-0.15, X_uu=-6.0)  # with a propeller
VESSEL = Vessel(parameters=PARAMETERS)
FREE = ("X_uu", "X_nn", "Y_uv", "N_ur", "N_dd")


def problem(run, free, options=None, length=2.0, start=PARAMETERS):
    options = options or SegmentOptions()
    states = [smoothed(run.record, start, options.nuisances.vector())]
    return Problem([run.record], start, free, options, length, states)


def expected(state, nuisances, p, inputs, step, parts=1):
    """What the channels show (n, 8): a motion and measurements written anew, in plain numbers."""
    q = SimpleNamespace(**dict(zip(PARAMETER_NAMES, p.tolist(), strict=True)))
    cn, ce, gyro, compass, misalignment, scale = nuisances.tolist()
    M = np.array([[q.m - q.Y_vd, q.m * q.x_g - q.Y_rd], [q.m * q.x_g - q.N_vd, q.I_z - q.N_rd]])
    (a, b), (c, e) = np.linalg.inv(M).tolist()

    def slope(x, d, n):
        _, _, psi, u, v, r = x
        X = q.X_uu * u * abs(u) + (q.X_vr + q.m) * v * r + (q.X_rr + q.m * q.x_g) * r * r + q.X_dd * u * u * d * d
        X += q.X_prop + q.X_nn * n * abs(n) + q.X_nu * abs(n) * u
        Y = q.Y_vv * v * abs(v) + q.Y_rr * r * abs(r) + q.Y_uv * u * v + (q.Y_ur - q.m) * u * r + q.Y_dd * u * u * d
        N = q.N_vv * v * abs(v) + q.N_rr * r * abs(r) + q.N_uv * u * v + (q.N_ur - q.m * q.x_g) * u * r
        N += q.N_dd * u * u * d
        over = complex(u, v) * cmath.exp(1j * psi) + complex(cn, ce)
        return over.real, over.imag, r, X / (q.m - q.X_ud), a * Y + b * N, c * Y + e * N

    def moved(x, k, h):
        return [value + h * rate for value, rate in zip(x, k, strict=True)]

    shown, x, h = [], state.tolist(), step / parts
    log = (1.0 + scale) * cmath.exp(-1j * misalignment)
    for d, n in inputs.tolist():
        water = complex(x[3], x[4])
        ground = (water + complex(cn, ce) * cmath.exp(-1j * x[2])) * log
        water = water * log
        shown.append([x[0], x[1], x[2] + compass, water.real, water.imag, x[5] + gyro, ground.real, ground.imag])
        for _ in range(parts):  # Runge and Kutta
            k1 = slope(x, d, n)
            k2 = slope(moved(x, k1, h / 2.0), d, n)
            k3 = slope(moved(x, k2, h / 2.0), d, n)
            k4 = slope(moved(x, k3, h), d, n)
            total = [(p + 2.0 * q + 2.0 * r + s) / 6.0 for p, q, r, s in zip(k1, k2, k3, k4, strict=True)]
            x = moved(x, total, h)
    return np.array(shown)


def test_motion_and_measurements_equal_independent_ones():
    run = simulate(VESSEL, "zigzag", 1, 6.0)
    p = problem(run, FREE, length=math.inf)
    nuisances = np.array([[0.3, -0.2, 0.01, 0.03, 0.05, 0.04]])
    state = np.array([[1.0, 2.0, 0.7, 1.1, -0.05, 0.1]])
    residuals = p.at(p.start.vector()[p.indices], nuisances, [state]).residuals[0]
    shown = expected(state[0], nuisances[0], PARAMETERS.vector(), run.record.inputs, 0.1, parts=8)
    there = np.isfinite(run.record.measured)
    wanted = (run.record.measured - shown) / run.record.deviations
    # Runge and Kutta's error of 0.1 s steps at a yaw eigenvalue of 1.4 1/s, (0.14)^5 / 120 a step, over 60 of them; in
    # units of deviations that go down to 2.8e-4.
    assert there.sum() > 200
    assert residuals[there] == pytest.approx(wanted[there], abs=0.02)


def test_forward_sensitivities_equal_finite_differences():
    run = simulate(VESSEL, "multisine", 2, 4.0)
    free = tuple(name for name in PARAMETER_NAMES if name not in ("X_prop", "X_u"))
    p = problem(run, free, length=math.inf)
    own = np.array([[0.3, -0.2, 0.01, 0.03, 0.05, 0.04]])
    values, state = p.start.vector()[p.indices], np.array([[1.0, 2.0, 0.7, 1.1, -0.05, 0.1]])
    unknowns = np.concatenate([state[0], values, own[0]])

    def weighted(w):
        point = p.at(w[6 : 6 + len(free)], w[None, 6 + len(free) :], [w[None, :6]])
        return point.residuals[0][np.isfinite(run.record.measured)], point

    e, point = weighted(unknowns)
    columns = []
    for j in range(len(unknowns)):
        step = np.zeros(len(unknowns))
        step[j] = 1e-5 * max(abs(unknowns[j]), 0.1)
        columns.append((weighted(unknowns - step)[0] - weighted(unknowns + step)[0]) / (2.0 * step[j]))
    J = np.array(columns).T  # of what is expected, weighted
    H = np.triu(J.T @ J)
    found = np.triu(point.normal_equations[0][0][0]) - np.diag(np.concatenate([HELD, np.zeros(len(unknowns) - 6)]))
    scale = np.sqrt(np.diag(H))
    scale[scale == 0.0] = 1.0
    # Central differences: truncation some (1e-5)^2, rounding 1e-16 / 1e-5; both far below.
    assert found / np.outer(scale, scale) == pytest.approx(H / np.outer(scale, scale), abs=1e-6)
    descent = point.normal_equations[0][1][0] / scale / np.linalg.norm(e)
    away = np.concatenate([HELD * (p.cuts[0].held[0] - state[0]), np.zeros(len(unknowns) - 6)])
    assert descent == pytest.approx((J.T @ e + away) / scale / np.linalg.norm(e), abs=1e-6)


HELD = np.array([1e-4, 1e-4, 1.0, 1.0, 1.0, 1.0])  # information that holds a first state


def test_elimination_equals_the_full_normal_equations():
    """Two records, segments of both: a step of all unknowns at once by a dense solve."""
    runs = [simulate(VESSEL, kind, 3, 8.0) for kind in ("zigzag", "multisine")]
    options = SegmentOptions(nuisances=SHEETS)
    states = [smoothed(run.record, PARAMETERS, SHEETS.vector()) for run in runs]
    p = Problem([run.record for run in runs], PARAMETERS, FREE, options, 2.0, states)
    point = p.at(p.start.vector()[p.indices], p.nuisances, [cut.held for cut in p.cuts])
    k = len(FREE)
    H, g, back_substitution = p.reduced(point, 0.0)
    step = np.linalg.solve(H, g)
    width = len(g) + sum(6 * len(cut.held) for cut in p.cuts)
    full, gradient = np.zeros((width, width)), np.zeros(width)
    at = len(g)
    for r, (blocks, descents) in enumerate(point.normal_equations):
        own = np.concatenate([np.arange(k), np.arange(k + 6 * r, k + 6 * r + 6)])
        for block, descent in zip(blocks, descents, strict=True):
            places = np.concatenate([np.arange(at, at + 6), own])
            full[np.ix_(places, places)] += np.triu(block) + np.triu(block, 1).T
            gradient[places] += descent
            at += 6
        trust = 1.0 / SHEETS.vector() ** 2
        full[own[k:], own[k:]] += trust
        gradient[own[k:]] -= trust * point.nuisances[r]
    scale = np.sqrt(np.diag(full))
    whole = np.linalg.solve(full / np.outer(scale, scale), gradient / scale) / scale
    deviations = np.sqrt(np.diag(np.linalg.inv(full / np.outer(scale, scale)))) / scale
    assert step / deviations[: len(g)] == pytest.approx(whole[: len(g)] / deviations[: len(g)], abs=1e-9)
    firsts = [matrix[:, :, -1] - matrix[:, :, np.r_[:k, k : k + 6]] @ np.r_[step[:k], step[k + 6 * r : k + 6 * r + 6]]
              for r, matrix in enumerate(back_substitution)]  # fmt: skip
    together = np.concatenate([first.ravel() for first in firsts])
    assert together / deviations[len(g) :] == pytest.approx(whole[len(g) :] / deviations[len(g) :], abs=1e-9)


def test_a_small_fit_has_scipys_optimum():
    """SciPy's least squares with finite differences, on the motion and measurements written anew."""
    run = simulate(replace(VESSEL, errors=NO_NUISANCES), "zigzag", 4, 12.0)
    free, options = ("X_uu", "N_dd"), SegmentOptions(length=6.0, nuisances=NO_NUISANCES, tolerance=1e-10)
    fit = fit_segments([run.record], with_values(PARAMETERS, free, [-3.0, 9.0]), free, options)
    cuts = problem(run, free, options, 6.0).cuts[0]
    held = smoothed(run.record, with_values(PARAMETERS, free, [-3.0, 9.0]), np.zeros(6))[cuts.bounds[:-1], :6]
    there = np.isfinite(run.record.measured)

    def residuals(w):
        p = with_values(PARAMETERS, free, w[:2]).vector()
        parts = []
        for s, (a, b) in enumerate(zip(cuts.bounds[:-1], cuts.bounds[1:], strict=True)):
            state = w[2 + 6 * s : 8 + 6 * s]
            e = run.record.measured[a:b] - expected(state, np.zeros(6), p, run.record.inputs[a:b], 0.1)
            parts += [(e / run.record.deviations)[there[a:b]], np.sqrt(HELD) * (held[s] - state)]
        return np.concatenate(parts)

    first = np.concatenate([fit.values * (1.02, 0.99), held.ravel()])
    other = least_squares(residuals, first, x_scale="jac", xtol=1e-10, ftol=1e-10, gtol=1e-10)
    # Both stop where half a sum of squares would change by some 1e-10 of a deviation's square, or 1e-10 of itself.
    assert (other.x[:2] - fit.values) / fit.deviations == pytest.approx([0.0, 0.0], abs=1e-3)
    assert fit.cost == pytest.approx(other.cost, rel=1e-9)
    information = np.linalg.inv(other.jac.T @ other.jac)[:2, :2]
    assert fit.deviations == pytest.approx(np.sqrt(np.diag(information)), rel=1e-4)  # forward differences of 1e-8


def test_intervals_hold_the_truth():
    """Short form of the study: sixty intervals of twelve seeds; by chance more than seven miss in one of 100 runs."""
    free = ("X_uu", "Y_uv", "N_uv", "N_ur", "N_dd")
    vessel = replace(VESSEL, surge=0.9)
    options, scores = SegmentOptions(nuisances=SHEETS), []
    for seed in range(100, 112):
        run = simulate(vessel, "multisine", seed, 60.0)
        fit = fit_segments([run.record], PARAMETERS, free, options)
        assert fit.converged
        scores.append((fit.values - [getattr(PARAMETERS, name) for name in free]) / fit.deviations)
    inside = np.abs(scores) < 1.96
    assert inside.sum() >= 53
    # Not because the intervals are too wide: the pooled mean square of 60 normal deviates is 1 +- 0.18.
    assert 0.5 < np.mean(np.square(scores)) < 1.6


def test_large_noise_of_the_first_states_does_not_bias():
    """Velocities ten times noisier and fixes rare: each second-long segment hardly shows where it begins."""
    noisy = replace(VESSEL, deviations=(0.5, 0.5, 0.02, 0.2, 0.2, 0.005, 0.2, 0.2))
    free, scores = ("Y_uv", "N_ur", "N_dd"), []
    for seed in range(200, 212):
        run = simulate(noisy, "zigzag", seed, 60.0)
        fit = fit_segments([run.record], PARAMETERS, free, SegmentOptions(length=5.0, nuisances=SHEETS))
        scores.append((fit.values - [getattr(PARAMETERS, name) for name in free]) / fit.deviations)
    # The mean of twelve unbiased estimates is 0 +- 0.29; three parameters.
    assert np.abs(np.mean(scores, axis=0)).max() < 1.0


@pytest.mark.parametrize("seed", [5, 6, 7])
@pytest.mark.parametrize("factor", [5.0, 0.0])
def test_wrong_starts_come_to_the_same_fit(factor, seed):
    run = simulate(VESSEL, "multisine", seed, 100.0)
    free = DEFAULT_FREE
    truth = np.array([getattr(PARAMETERS, name) for name in free])
    sides = np.random.default_rng(seed + 1).choice([-1.0, 1.0], len(free))
    start = with_values(PARAMETERS, free, truth * (factor**sides if factor else 0.0))
    right, other = (fit_segments([run.record], s, free) for s in (PARAMETERS, start))
    assert right.converged
    assert other.converged
    # Both stop where a step would change half the sum of squares by 1e-4, 0.014 deviations.
    assert np.abs(other.values - right.values) / right.deviations == pytest.approx(0.0, abs=0.05)
    assert other.improved
    assert other.start_cost > 2.0 * other.cost


def test_current_and_biases_are_found():
    run = simulate(VESSEL, "turns", 7, 200.0)
    fit = fit_segments([run.record], PARAMETERS, FREE, SegmentOptions(nuisances=SHEETS))
    errors = (fit.nuisances[0] - run.nuisances) / fit.nuisance_deviations[0]
    assert np.abs(errors).max() < 3.5  # six normal deviates; beyond in one of 400 seeds
    assert (fit.nuisance_deviations[0, :2] < 0.01).all()  # 40 fixes and 1000 logged velocities
    known = replace(run.record, current=run.nuisances[:2])
    again = fit_segments([known], PARAMETERS, FREE, SegmentOptions(nuisances=SHEETS))
    assert again.nuisances[0, :2] == pytest.approx(run.nuisances[:2])
    assert (again.nuisance_deviations[0, :2] == 0.0).all()


@pytest.mark.parametrize(
    "channels", [("north", "east", "heading"), ("heading", "yaw_rate"), ("heading", "surge", "sway"),
                 ("heading", "yaw_rate", "ground_surge", "ground_sway")],
)  # fmt: skip
def test_channels_may_be_missing(channels):
    """The yaw moment of the rudder is found from any of them; what they do not show stays at no accuracy."""
    from auvsim.identification.records import MEASURED

    run = simulate(VESSEL, "zigzag", 8, 120.0)
    there = np.isin(MEASURED, channels)
    record = replace(run.record, measured=np.where(there, run.record.measured, np.nan))
    fit = fit_segments([record], with_values(PARAMETERS, ("N_dd",), [9.0]), ("N_dd",), SegmentOptions(length=10.0))
    assert abs(fit.values[0] - PARAMETERS.N_dd) < 4.0 * fit.deviations[0]
    assert fit.deviations[0] < 1.0
    assert np.isnan(fit.residual_rms[~there]).all()
    assert fit.samples == np.isfinite(record.measured).sum()


def test_what_no_data_show_has_no_accuracy():
    run = simulate(VESSEL, "zigzag", 9, 30.0)
    straight = replace(run.record, inputs=run.record.inputs * (0.0, 1.0))
    fit = fit_segments([straight], PARAMETERS, ("X_dd", "X_nn"))
    assert math.isinf(fit.deviations[0])
    assert fit.values[0] == PARAMETERS.X_dd
    assert math.isfinite(fit.deviations[1])


def test_signs_are_kept():
    """X_uu, on its own at the wrong sign of its loss with the shaft, ends on the limit and the rest fits around it."""
    run = simulate(replace(VESSEL, parameters=replace(PARAMETERS, X_nu=0.1)), "multisine", 10, 60.0)
    fits = [
        fit_segments([run.record], PARAMETERS, ("X_uu", "X_nn", "X_nu"), SegmentOptions(signs=signs))
        for signs in (False, True)
    ]
    assert fits[0].parameters.X_nu == pytest.approx(0.1, abs=4.0 * fits[0].deviations[2])
    assert fits[1].parameters.X_nu == 0.0
    assert fits[1].converged
    fixed = fit_segments([run.record], replace(PARAMETERS, X_nu=0.0), ("X_uu", "X_nn"))
    assert fits[1].values[:2] == pytest.approx(fixed.values, rel=1e-3)  # the same optimum on the limit


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_a_robust_loss_bears_outliers(loss):
    run = simulate(VESSEL, "multisine", 11, 60.0)
    measured = run.record.measured.copy()
    wrong = np.random.default_rng(0).random(measured.shape) < 0.05
    measured[wrong] += 30.0 * np.broadcast_to(run.record.deviations, measured.shape)[wrong]
    record = replace(run.record, measured=measured)
    plain, robust = (fit_segments([record], PARAMETERS, FREE, SegmentOptions(loss=way)) for way in ("squares", loss))
    errors = [
        np.abs((fit.values - [getattr(PARAMETERS, n) for n in FREE]) / robust.deviations) for fit in (plain, robust)
    ]
    assert errors[0].max() > 5.0
    assert errors[1].max() < 4.0


def test_a_weak_prior_holds_what_data_do_not():
    """At one speed thrust and drag are one: without a prior their sum alone is known, with it both stay near."""
    run = simulate(VESSEL, "turns", 12, 60.0)
    free = ("X_uu", "X_nn", "X_nu")
    loose, held = (fit_segments([run.record], PARAMETERS, free, SegmentOptions(prior=prior)) for prior in (None, 0.3))
    size = np.abs([getattr(PARAMETERS, name) for name in free])
    assert (held.deviations <= 0.3 * size).all()
    assert (loose.deviations > 1.5 * held.deviations).any()
    one = fit_segments([run.record], PARAMETERS, free, SegmentOptions(prior=0.3, prior_on=("X_nu",)))
    assert one.deviations[2] <= 0.3 * size[2]
    assert (one.deviations[:2] > held.deviations[:2]).all()  # the data alone tell these


def test_bad_input_is_refused():
    run = simulate(VESSEL, "zigzag", 13, 20.0)
    with pytest.raises(InputError, match=r"no parameter of the planar model 'Y_xx'"):
        fit_segments([run.record], PARAMETERS, ("Y_xx",))
    with pytest.raises(InputError, match="each once"):
        fit_segments([run.record], PARAMETERS, ("Y_uv", "Y_uv"))
    with pytest.raises(InputError, match="no record"):
        fit_segments([], PARAMETERS)
    with pytest.raises(InputError, match="inertia"):
        fit_segments([run.record], replace(PARAMETERS, I_z=-10.0))
    with pytest.raises(InputError, match="nothing was measured"):
        fit_segments([replace(run.record, measured=np.full((200, 8), np.nan))], PARAMETERS)
    with pytest.raises(InputError, match="inputs must be finite"):
        fit_segments([replace(run.record, inputs=np.full((200, 2), np.nan))], PARAMETERS)
    with pytest.raises(InputError, match="no loss 'l1'"):
        fit_segments([run.record], PARAMETERS, FREE, SegmentOptions(loss="l1"))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="length must be positive"):
        fit_segments([run.record], PARAMETERS, FREE, SegmentOptions(length=-1.0))


def test_same_records_same_fit():
    run = simulate(VESSEL, "zigzag", 14, 20.0)
    first, again = (fit_segments([run.record], PARAMETERS, FREE) for _ in range(2))
    assert (first.values == again.values).all()
    assert (first.covariance == again.covariance).all()


def test_the_loops_know_every_parameter():
    assert free_indices(PARAMETER_NAMES).tolist() == list(range(len(PARAMETER_NAMES)))
    assert compiled.segments() is compiled.segments()
    assert Nuisances().vector().shape == (6,)
