"""Screens of scalar sensors, particles, covariance intersection, noise re-estimated, robust batch, iterated update."""

import math
from dataclasses import replace

import numpy as np
import pytest
from models_runs import body_process, body_run, body_sensors, estimated, measured, process, ranges, rms, simulate

from estimators.core import batch, ekf, fusion, outliers, tuning
from estimators.core.consistency import nees
from estimators.core.errors import NotFiniteError, ParameterError
from estimators.core.estimator import Estimator
from estimators.core.filter import ModelFilter
from estimators.core.history import History
from estimators.core.models import sensors
from estimators.core.models.motion import constant_velocity, unicycle
from estimators.core.models.process import MotionProcess
from estimators.core.outliers import Outliers
from estimators.core.particle import ParticleFilter, ParticleState, drawn
from estimators.core.screening import Limits, Screen, judge
from estimators.core.types import Gaussian


def judged(limits, values, step=1.0):
    screen = Screen(limits)
    return [screen.judge(step * k, value) for k, value in enumerate(values)]


def test_each_fault_of_a_scalar_sensor_has_its_name():
    depth = Limits(low=-1.0, high=100.0, rate=1.0, noise=0.2, frozen=3.0)
    assert judged(depth, [5.0, math.nan, 5.1, math.inf, 5.2]) == ["", "not_finite", "", "not_finite", ""]
    assert judged(depth, [5.0, 200.0, 5.1, -2.0]) == ["", "impossible", "", "impossible"]
    assert judged(depth, [5.0, 9.0, 5.1, 5.3]) == ["", "spike", "", ""]
    assert judged(depth, [5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.5]) == ["", "", "", "", "frozen", "frozen", ""]
    # Two values that agree against the last good one: that was wrong.
    assert judged(depth, [5.0, 30.0, 30.1, 30.2]) == ["", "spike", "", ""]
    assert judged(depth, [5.0, 30.0, 60.0, 5.2]) == ["", "spike", "spike", ""]
    # After a gap the sensor may be farther away.
    screen = Screen(depth)
    assert [screen.judge(0.0, 5.0), screen.judge(10.0, 14.0), screen.judge(11.0, 12.0)] == ["", "", "spike"]
    assert [screen.judge(10.5, 14.0), screen.judge(math.nan, 14.0)] == ["clock", "not_finite"]
    heading = Limits(rate=0.5, noise=0.05, period=2.0 * math.pi)
    assert judged(heading, [3.1, -3.1, -2.9, 0.5]) == ["", "", "", "spike"]
    with pytest.raises(ParameterError, match="low < high"):
        Limits(low=1.0, high=0.0)


@pytest.mark.parametrize("fault", ["nan", "spike", "frozen", "clock"])
def test_one_fault_of_the_gyro_is_counted_and_hardly_moves_the_estimate(fault):
    run = body_run(21, 60.0)
    limits = {"gyro": Limits(low=-1.0, high=1.0, rate=0.2, noise=0.05, frozen=2.0)}
    broken, held = [], None
    for m in run.measurements:
        if m.kind == "gyro" and 30.0 <= m.stamp < {"spike": 30.5, "frozen": 40.0}.get(fault, 31.0):
            held = m.value if held is None else held
            value = {"nan": [math.nan], "spike": [0.9], "frozen": held, "clock": m.value}[fault]
            m = replace(m, value=np.array(value), stamp=m.stamp - (20.0 if fault == "clock" else 0.0), sequence=None)
        broken.append(m)
    said = []
    for measurements in (run.measurements, broken):
        estimator = Estimator(ModelFilter(body_process(), body_sensors(), run.belief), step=0.5, limits=limits)
        told, waiting, estimate = [], list(measurements), None
        for time in run.times.tolist():
            count = sum(m.received <= time for m in waiting)
            estimate = estimator.tick(time, (), waiting[:count])
            waiting = waiting[count:]
            told += [o.reason for o in estimate.outcomes if not o.accepted]
        said.append((estimate.belief.mean, told, estimate.refused))
    (sound, none, _), (after, told, refused) = said
    name = "not_finite" if fault == "nan" else fault
    assert none == []
    assert set(told) == {name}
    assert refused[name] == len(told) == {"nan": 2, "spike": 1, "frozen": 15, "clock": 2}[fault]
    assert np.abs(after - sound)[:2].max() < 0.1  # a tenth of the fixes' deviation


def test_particles_of_a_linear_problem_have_the_kalman_filters_moments():
    motion = constant_velocity()
    model = MotionProcess(motion, {"velocity_north": 0.02, "velocity_east": 0.02, "north": 1e-3, "east": 1e-3})
    sensor = {"fix": sensors.fix(motion)}
    belief = motion.space.belief({"velocity_north": 1.0}, dict.fromkeys(motion.space.names, 1.0))
    kalman, cloud = (
        History(f, step=1.0, verdicts=lambda s: s.verdicts)
        for f in (ModelFilter(model, sensor, belief), ParticleFilter(model, sensor, drawn(belief, 4000)))
    )
    rng = np.random.default_rng(2)
    for k in range(12):
        fix = measured("fix", np.array([1.1 * k, 0.1 * k]) + rng.standard_normal(2), 1.0, float(k))
        for history in (kalman, cloud):
            history.append(float(k), (), [fix])
            history.replay()
    expected, got = kalman.state.belief, cloud.state.belief
    deviations = np.sqrt(np.diagonal(expected.covariance))
    # 4000 particles, resampled some ten times: a mean errs by a few hundredths of a deviation.
    assert np.abs((got.mean - expected.mean) / deviations).max() < 0.15
    assert np.sqrt(np.diagonal(got.covariance)) / deviations == pytest.approx(np.ones(4), abs=0.12)


def test_particles_keep_two_places_apart_that_two_ranges_allow():
    """Two beacons on a line: the vehicle, or its mirror image; a Kalman filter knows one only."""
    motion = unicycle()
    model = MotionProcess(motion, {"north": 1e-4, "east": 1e-4, "heading": 1e-6})
    places = {"a": (0.0, 0.0, 0.0), "b": (30.0, 0.0, 0.0)}
    sensor = {("range", name): sensors.range_to(motion, place) for name, place in places.items()}
    spread = Gaussian(mean=np.array([15.0, 0.0, 0.0]), covariance=np.diag([100.0, 400.0, 0.01]))
    history = History(ParticleFilter(model, sensor, drawn(spread, 3000)), step=1.0)
    seen = [measured("range", [math.dist((10.0, 12.0), p[:2])], 1.0, 0.0, name) for name, p in places.items()]
    history.append(0.0, (0.0, 0.0), seen)
    state = history.replay()
    east = state.particles[:, 1]
    above = float(state.weights[east > 0.0].sum())
    assert 0.35 < above < 0.65
    assert np.abs(east[np.abs(east) > 5.0]).mean() == pytest.approx(12.0, abs=0.5)
    assert 300 < state.effective < 3001


def test_an_angle_of_particles_is_their_direction_and_nothing_explained_is_an_error():
    state = ParticleState(np.array([[math.pi - 0.1], [-math.pi + 0.1]]), np.array([0.5, 0.5]), 0, (0,))
    assert abs(state.belief.mean[0]) == pytest.approx(math.pi)
    assert state.belief.covariance[0, 0] == pytest.approx(0.01)
    run = simulate(2, 2.0)
    filter_ = ParticleFilter(process(), ranges(), drawn(run.belief, 20))
    history = History(filter_, step=0.2)
    history.append(0.0, (0.0, 0.0))
    first = history.replay()
    with pytest.raises(NotFiniteError, match="no particle explains range"):
        filter_.correct(first, 0.0, [measured("range", [1e4], 0.1, 0.0, "a")])


def test_covariance_intersection_is_consistent_under_any_correlation():
    rng, A, B = np.random.default_rng(3), np.diag([1.0, 9.0]), np.array([[4.0, 1.0], [1.0, 1.0]])
    for correlation in (-0.95, 0.0, 0.95):
        root_a, root_b = np.linalg.cholesky(A), np.linalg.cholesky(B)
        common = rng.standard_normal((4000, 2))
        own = rng.standard_normal((4000, 2))
        errors_a = common @ root_a.T
        errors_b = (correlation * common + math.sqrt(1 - correlation**2) * own) @ root_b.T
        fused = [
            fusion.intersect(Gaussian(mean=a, covariance=A), Gaussian(mean=b, covariance=B))[0]
            for a, b in zip(errors_a[:400], errors_b[:400], strict=True)
        ]
        values = nees(np.array([f.mean for f in fused]), np.array([f.covariance for f in fused]), np.zeros((400, 2)))
        assert values.mean() / 2.0 < 1.1  # never overconfident; 400 samples: a deviation of 0.05
    fused, weight = fusion.intersect(Gaussian(mean=np.zeros(2), covariance=A), Gaussian(mean=np.ones(2), covariance=B))
    assert 0.0 < weight < 1.0
    assert np.linalg.det(fused.covariance) <= min(np.linalg.det(A), np.linalg.det(B))
    same, _ = fusion.intersect(Gaussian(mean=np.ones(2), covariance=A), Gaussian(mean=np.ones(2), covariance=A))
    assert same.covariance == pytest.approx(A)  # nothing is learnt from oneself
    angle, _ = fusion.intersect(
        Gaussian(mean=np.array([3.1]), covariance=np.eye(1)),
        Gaussian(mean=np.array([-3.1]), covariance=np.eye(1)),
        angles=(0,),
        weight=0.5,
    )
    assert abs(angle.mean[0]) == pytest.approx(math.pi, abs=1e-9)
    partial = fusion.intersect_partial(Gaussian(mean=np.zeros(2), covariance=A), np.eye(2), np.ones(2), B, weight)
    assert partial.mean == pytest.approx(fused.mean)
    assert partial.covariance == pytest.approx(fused.covariance)


def test_noise_is_found_again_from_the_innovations():
    """Ranges believed three times too noisy, and one beacon three times too exact."""
    run = simulate(31, 240.0)

    def outcomes(variances):
        scaled = [replace(m, covariance=np.array([[variances[m.kind, m.source]]])) for m in run.measurements]
        filter_, told = ModelFilter(process(), ranges(), run.belief), []
        history = History(filter_, step=0.2, keep=1e6, verdicts=lambda s: s.verdicts)
        for k, time in enumerate(run.times.tolist()):
            history.append(time, run.inputs[k - 1] if k else run.inputs[0])
            for m in (m for m in scaled if abs(m.stamp - time) < 0.1):
                history.insert(m)
            history.replay()
            told += history.outcomes
        return told

    wrong = {("range", name): 0.81 if name != "c" else 0.01 for name in "abcd"}
    found = tuning.variances(outcomes, wrong)
    assert set(found) == set(wrong)
    # 240 ranges each, by the median: a deviation of some 12 %.
    assert list(found.values()) == pytest.approx([0.09] * 4, rel=0.45)
    with pytest.raises(ParameterError, match="no innovations of"):
        tuning.variances(outcomes, {**wrong, ("range", "z"): 1.0} | {("dvl", ""): 1.0})


def test_a_robust_batch_estimate_bears_outliers_and_knows_its_covariance():
    values = []
    for seed in range(41, 44):
        run, sound = simulate(seed, 60.0, outliers=0.1), simulate(seed, 60.0)
        _, _, history = estimated(run, ModelFilter(process(), ranges(), run.belief, gates=0.999))
        guess = np.array([node.state.belief.mean for node in history.nodes])
        plain, robust = (
            batch.solve(history.nodes, run.belief, process(), ranges(), guess, huber=huber, iterations=60)
            for huber in (None, 1.5)
        )
        assert rms(robust.means, run.truth) < 0.7 * rms(plain.means, run.truth)
        assert 0.0 < robust.reweighted.min() < 0.2
        assert (plain.reweighted == 1.0).all()
        _, _, good = estimated(sound, ModelFilter(process(), ranges(), sound.belief))
        guess = np.array([node.state.belief.mean for node in good.nodes])
        solved = batch.solve(good.nodes, sound.belief, process(), ranges(), guess)
        for k in (0, 100, -1):
            values.append(nees(solved.means[k], solved.covariance(k), sound.truth[k], angles=(2,)) / 7.0)
        # At the last node nothing is smoothed: the covariance is the filter's but for the linearisation.
        filtered = good.nodes[-1].state.belief.covariance
        assert np.diagonal(solved.covariance(-1)) == pytest.approx(np.diagonal(filtered), rel=0.1)
    assert 0.4 < np.mean(values) < 1.8  # nine values of seven degrees of freedom, three a run


def test_an_iterated_update_finds_a_place_near_a_beacon():
    """A range of 2 m to a beacon 3 m away, the position known to 2 m: the first tangent is wrong, the last is not."""
    motion = unicycle()
    sensor = sensors.range_to(motion, (0.0, 0.0, 0.0))
    truth, ratio = np.array([2.0, 1.0, 0.0]), []
    rng = np.random.default_rng(5)
    for _ in range(400):
        mean = truth + np.array([1.5, 1.5, 0.0]) * rng.standard_normal(3)
        belief = Gaussian(mean=mean, covariance=np.diag([2.25, 2.25, 1e-6]))
        seen = measured("range", [math.hypot(2.0, 1.0) + 0.02 * rng.standard_normal()], 0.02, 0.0)
        once, innovation = ekf.correct(belief, seen, sensor)
        often, first = ekf.correct_iterated(belief, seen, sensor, iterations=20)
        assert first.nis == innovation.nis
        residuals = [abs(seen.value[0] - sensor.evaluate(b.mean, seen)[0]) for b in (once, often)]
        ratio.append(residuals[1] <= residuals[0] + 1e-9)
    assert np.mean(ratio) > 0.9
    gated, first = ekf.correct_iterated(belief, replace(seen, value=np.array([80.0])), sensor, gate=0.99)
    assert gated is belief
    assert not first.accepted


def test_outliers_may_have_a_deviation_of_each_component():
    belief, model = Gaussian(mean=np.zeros(3), covariance=np.eye(3)), sensors.fix(unicycle())
    probabilities = [
        outliers.correct(
            belief, measured("fix", value, 0.1, 0.0), model, Outliers(prior=0.1, deviations=((30.0, 0.1),))
        ).probability
        for value in ([20.0, 0.0], [0.0, 20.0])
    ]
    assert probabilities[0] > 0.99
    assert probabilities[1] < 0.5  # nothing explains it: the mixture's wider component lies along the other axis
    alike = [
        outliers.correct(belief, measured("fix", [9.0, 2.0], 0.1, 0.0), model, Outliers(deviations=d)).log_likelihood
        for d in ((5.0,), ((5.0, 5.0),))
    ]
    assert alike[0] == pytest.approx(alike[1], rel=1e-12)
    with pytest.raises(ParameterError, match="must be 2, one of each component"):
        outliers.correct(belief, measured("fix", [1.0, 1.0], 1.0, 0.0), model, Outliers(deviations=((1.0, 1.0, 1.0),)))


def test_smoothing_any_filter_improves_on_it():
    run = simulate(51, 60.0)
    estimator = Estimator(ModelFilter(process(), ranges(), run.belief), step=0.2, keep=100.0)
    filtered = []
    for k, time in enumerate(run.times.tolist()):
        arrived = [m for m in run.measurements if abs(m.stamp - time) < 0.1]
        filtered.append(estimator.tick(time, run.inputs[k - 1] if k else run.inputs[0], arrived).belief.mean)
    smoothed = dict(estimator.smoothed())
    means = np.array([smoothed[time].mean for time in run.times.tolist()])
    assert rms(means, run.truth) < 0.8 * rms(np.array(filtered), run.truth)


@pytest.mark.parametrize("correlation", [-1.0, -0.5, 0.0, 0.6, 1.0])
@pytest.mark.parametrize("told", [0.01, 0.5, 2.2])
def test_a_cautious_variance_holds_for_any_correlation(correlation, told):
    """Closed form of the true variance after the correction; at a correlation of 1 it is what the filter says."""
    own = 9.0
    counted = fusion.cautious_variance(own, told)
    gain = own / (own + counted)
    both = correlation * math.sqrt(own * told)
    true = (1.0 - gain) ** 2 * own + gain**2 * told + 2.0 * gain * (1.0 - gain) * both
    assert told <= (1.0 - gain) * own < own
    assert true <= (1.0 - gain) * own * (1.0 + 1e-12)
    if correlation == 1.0:
        assert true == pytest.approx((1.0 - gain) * own)


@pytest.mark.parametrize("told", [2.25, 9.0, 100.0, math.inf, math.nan])
def test_what_is_known_no_better_does_not_count(told):
    assert fusion.cautious_variance(9.0, told) == math.inf


def test_components_are_judged_together_as_each_is_alone():
    """Also where one is refused, not a number, or stamped before the last one."""
    rng = np.random.default_rng(3)
    limits = [Limits(low=-1.0, high=1.0), Limits(), Limits(low=-2.0, high=2.0, rate=3.0, noise=0.1), Limits(high=0.5)]
    together, alone = [Screen(one) for one in limits], [Screen(one) for one in limits]
    seen = set()
    for k in range(400):
        stamp = 0.1 * (k + int(rng.integers(-2, 2))) if k % 50 else math.nan
        values = rng.choice([0.1, -0.2, 0.3, 0.9, 1.5, math.inf, math.nan], 4, p=[0.3, 0.3, 0.1, 0.1, 0.1, 0.05, 0.05])
        reasons = [screen.judge(stamp, value) for screen, value in zip(alone, values.tolist(), strict=True)]
        assert judge(together, stamp, values.tolist()) == next(filter(None, reasons), "")
        seen |= set(reasons)
    assert seen == {"", "not_finite", "impossible", "clock", "spike"}
