"""Filters of any model: range-only with biases, lateness, sensors that go away, biased and wrong ones, consistency."""

import math
from dataclasses import replace

import numpy as np
import pytest
from models_runs import (
    BEACONS,
    STEP,
    Run,
    body_process,
    body_run,
    body_sensors,
    estimated,
    measured,
    process,
    ranges,
    rms,
    simulate,
)

from estimators.core import batch
from estimators.core.consistency import nees
from estimators.core.errors import ParameterError
from estimators.core.estimator import Estimator
from estimators.core.filter import ModelFilter, at_first
from estimators.core.interacting import InteractingModelFilter
from estimators.core.models import sensors
from estimators.core.models.motion import constant_velocity, unicycle, with_depth
from estimators.core.models.process import MotionProcess
from estimators.core.outliers import Outliers
from estimators.core.particle import ParticleFilter, drawn
from estimators.core.recovery import Readmission, opened
from estimators.core.types import Gaussian


def squares_against_batch(seeds, transform="extended"):
    """Squared errors of the filter and of the batch estimate of all that had come, in the second half of each run."""
    of_filter, of_batch = [], []
    for seed in seeds:
        run = simulate(seed)
        means, _, history = estimated(run, ModelFilter(process(), ranges(), run.belief, transform=transform))
        guess = np.array([node.state.belief.mean for node in history.nodes])
        for k in range(300, 601, 60):
            nodes = [node for node in history.nodes if node.time <= run.times[k] + 1e-9]
            found = batch.solve(nodes, run.belief, process(), ranges(), guess[: len(nodes)])
            of_batch.append(np.sum((found.means[-1] - run.truth[k])[:2] ** 2))
            of_filter.append(np.sum((means[k] - run.truth[k])[:2] ** 2))
    return np.array(of_filter), np.array(of_batch)


def test_ranges_with_a_bias_of_each_beacon_are_as_good_as_the_batch_estimate():
    """Without the biases in the state the error is that of the ranges; with them, that of the most probable way."""
    of_filter, of_batch = squares_against_batch(range(500, 506))
    # Both see the same noise: their ratio scatters far less than either. 1.03 is asked for; over few seeds 1.06.
    assert math.sqrt(of_filter.mean() / of_batch.mean()) < 1.06
    motion = unicycle()
    blind = {("range", name): sensors.range_to(motion, place) for name, place in BEACONS.items()}
    plain = MotionProcess(motion, {"north": 1e-6, "east": 1e-6, "heading": 1e-8}, input_noise={"speed": 5e-4})
    run = simulate(500)
    short = Gaussian(mean=run.belief.mean[:3], covariance=run.belief.covariance[:3, :3])
    means, _, _ = estimated(run, ModelFilter(plain, blind, short))
    assert rms(means, run.truth, 100) > 3.0 * math.sqrt(of_filter.mean())


@pytest.mark.slow
def test_ranges_with_biases_within_three_percent_of_batch_over_forty_seeds():
    of_filter, of_batch = squares_against_batch(range(600, 640))
    assert math.sqrt(of_filter.mean() / of_batch.mean()) < 1.03


def interacting(belief):
    return InteractingModelFilter(
        [body_process(), MotionProcess(body_process().motion, {"surge": 1e-2, "north": 1e-3, "east": 1e-3})],
        body_sensors(),
        lambda nodes, index: (belief, ()),
        switching=((0.0, 0.01), (0.1, 0.0)),
        initial=(0.9, 0.1),
        mixtures={"fix": Outliers(), "dvl": Outliers(prior=0.01, deviations=((1.0, 0.5),))},
        recovery=Readmission(),
    )


LATE = {
    "ranges": lambda run: ModelFilter(process(), ranges(), run.belief),
    "ranges_gated": lambda run: ModelFilter(process(), ranges(), run.belief, gates=0.999),
    "ranges_iterated": lambda run: ModelFilter(process(), ranges(), run.belief, gates=0.99, transform="iterated"),
    "ranges_unscented": lambda run: ModelFilter(process(), ranges(), run.belief, transform="unscented"),
    "ranges_weighed": lambda run: ModelFilter(process(), ranges(), run.belief, mixtures={"range": Outliers()}),
    "particles": lambda run: ParticleFilter(process(), ranges(), drawn(run.belief, 50), tail=0.01),
    "body_gated": lambda run: ModelFilter(body_process(), body_sensors(), run.belief, gates=0.999),
    "body_unscented": lambda run: ModelFilter(body_process(), body_sensors(), run.belief, transform="unscented"),
    "body_interacting": lambda run: interacting(run.belief),
}


@pytest.mark.parametrize("name", LATE)
def test_late_and_shuffled_is_in_order_bit_for_bit(name):
    run = body_run(3, duration=40.0) if name.startswith("body") else simulate(3, duration=40.0, outliers=0.05)
    rng, end = np.random.default_rng(5), float(run.times[-1])
    jittered = [replace(m, stamp=m.stamp - rng.uniform(0.0, 0.4)) for m in run.measurements if m.stamp > 0.5]
    prompt = [replace(m, received=m.stamp) for m in jittered]
    late = [replace(m, received=min(m.stamp + rng.uniform(0.0, 20.0), end)) for m in jittered]
    late = [late[k] for k in rng.permutation(len(late))]
    first, second = (estimated(replace(run, measurements=m), LATE[name](run)) for m in (prompt, late))
    assert (first[0][-1] == second[0][-1]).all()
    assert (first[1][-1] == second[1][-1]).all()
    assert (first[0][len(run.times) // 2] != second[0][len(run.times) // 2]).any()


def test_a_dvl_that_was_away_is_let_in_again():
    """Away for 100 s of 400, in which the vehicle gains 0.6 m/s that its model holds for impossible.

    The filter that was told lets the DVL in at once: it gates all sensors but that.
    """
    others = {"compass": 0.999, "gyro": 0.999, "fix": 0.999}
    squares = {"told": [], "gated": [], "shut out": []}
    for seed in range(40, 46):
        run = body_run(seed, faster=0.6)
        kept = [m for m in run.measurements if m.kind not in ("dvl", "water") or not 100.0 < m.stamp <= 200.0]
        run = replace(run, measurements=kept)
        for name, gates, recovery in (
            ("told", others, Readmission()),
            ("gated", 0.999, Readmission()),
            ("shut out", 0.999, None),
        ):
            filter_ = ModelFilter(body_process(), body_sensors(), run.belief, gates=gates, recovery=recovery)
            means, _, history = estimated(run, filter_)
            squares[name].append(rms(means, run.truth, 400) ** 2)
            if name == "gated":
                assert history.nodes[-1].state.rejected == ()
    told = np.mean(squares["told"])
    assert math.sqrt(np.mean(squares["gated"]) / told) < 1.1
    assert math.sqrt(np.mean(squares["shut out"]) / told) > 1.3  # what the recovery is for


@pytest.mark.parametrize("bias", [1.0, 3.0])
def test_a_gate_under_unknown_biases_is_no_worse_than_no_gate(bias):
    motion = unicycle()
    blind = {("range", name): sensors.range_to(motion, place) for name, place in BEACONS.items()}
    noise = {"speed": 0.05**2 * STEP, "turn_rate": 0.01**2 * STEP}
    plain = MotionProcess(motion, {"north": 1e-6, "east": 1e-6, "heading": 1e-8}, input_noise=noise)
    squares = {None: [], 0.999: []}
    for seed in range(700, 708):
        run = simulate(seed, bias=bias)
        belief = Gaussian(mean=run.belief.mean[:3], covariance=run.belief.covariance[:3, :3])
        for gate, found in squares.items():
            found.append(rms(estimated(run, ModelFilter(plain, blind, belief, gates=gate))[0], run.truth, 50) ** 2)
    assert math.sqrt(np.mean(squares[0.999]) / np.mean(squares[None])) < 1.1


def test_a_gate_keeps_gross_outliers_out():
    squares = {"sound": [], "gated": [], "weighed": [], "ungated": []}
    for seed in range(720, 724):
        run = simulate(seed, outliers=0.1)
        sound = simulate(seed)
        filters = {
            "gated": {"gates": 0.999},
            "weighed": {"mixtures": {"range": Outliers(prior=0.1, deviations=(20.0,))}},
            "ungated": {},
        }
        squares["sound"].append(
            rms(estimated(sound, ModelFilter(process(), ranges(), sound.belief))[0], sound.truth, 100)
        )
        for name, options in filters.items():
            means, _, _ = estimated(run, ModelFilter(process(), ranges(), run.belief, **options))
            squares[name].append(rms(means, run.truth, 100))
    mean = {name: float(np.mean(np.square(values))) for name, values in squares.items()}
    assert mean["gated"] < 2.0 * mean["sound"]  # a tenth of the ranges is lost; other draws of the noise
    assert mean["weighed"] < 2.0 * mean["sound"]
    assert mean["ungated"] > 10.0 * mean["gated"]


COMBINATIONS = {
    "ranges": lambda seed: (run := simulate(seed), ModelFilter(process(), ranges(), run.belief)),
    "ranges_gated": lambda seed: (run := simulate(seed), ModelFilter(process(), ranges(), run.belief, gates=0.999)),
    "ranges_iterated": lambda seed: (
        run := simulate(seed),
        ModelFilter(process(), ranges(), run.belief, transform="iterated"),
    ),
    "body": lambda seed: (run := body_run(seed, 100.0), ModelFilter(body_process(), body_sensors(), run.belief)),
    "body_gated": lambda seed: (
        run := body_run(seed, 100.0),
        ModelFilter(body_process(), body_sensors(), run.belief, gates=0.999),
    ),
    "body_unscented": lambda seed: (
        run := body_run(seed, 100.0),
        ModelFilter(body_process(), body_sensors(), run.belief, transform="unscented"),
    ),
}


def mean_nees(name, seeds):
    """NEES of all states per degree of freedom, at eight times of each run."""
    values = []
    for seed in seeds:
        run, filter_ = COMBINATIONS[name](seed)
        means, covariances, _ = estimated(run, filter_)
        times = np.linspace(len(run.times) // 8, len(run.times) - 1, 8).astype(int)
        values.append(nees(means[times], covariances[times], run.truth[times], angles=(2,)).mean() / means.shape[1])
    return float(np.mean(values))


@pytest.mark.parametrize("name", COMBINATIONS)
def test_consistent_over_a_few_runs(name):
    # Eight states, ten runs of few independent times: a deviation of some 0.08.
    assert 0.75 < mean_nees(name, range(800, 810)) < 1.25


@pytest.mark.slow
@pytest.mark.parametrize("name", COMBINATIONS)
def test_consistent_over_a_hundred_runs(name):
    assert 0.85 < mean_nees(name, range(900, 1000)) < 1.15


def test_two_landmarks_at_one_time_are_no_duplicates_and_unknown_kinds_are_counted():
    motion = unicycle()
    estimator = Estimator(
        ModelFilter(
            MotionProcess(motion, {"north": 1e-3, "east": 1e-3, "heading": 1e-4}),
            {"landmark": sensors.range_and_bearing(motion)},
            motion.space.belief({}, {"north": 1.0, "east": 1.0, "heading": 0.2}),
        ),
        step=1.0,
    )
    places = {"tree": (10.0, 0.0, 0.0), "rock": (0.0, 8.0, 0.0)}
    seen = [
        measured("landmark", [math.hypot(*place[:2]), math.atan2(place[1], place[0])], 0.1, 0.0, name, parameters=place)
        for name, place in places.items()
    ]
    first = estimator.tick(0.0, (0.0, 0.0))
    assert first.belief is not None  # a known start needs no measurement
    estimate = estimator.tick(1.0, (0.0, 0.0), [*seen, seen[0], measured("sonar", [1.0], 1.0, 0.5)])
    assert [(o.source, o.reason) for o in estimate.outcomes] == [
        ("tree", "duplicate"), ("rock", ""), ("tree", ""), ("", "no_model"),
    ]  # fmt: skip
    assert estimate.belief is not None
    assert np.abs(estimate.belief.mean).max() < 1e-9
    assert np.sqrt(np.diagonal(estimate.belief.covariance))[:2].max() < 0.15


def test_a_start_waits_for_the_kinds_it_is_to_wait_for():
    run = body_run(5, 30.0)
    belief = replace(run.belief, covariance=100.0 * run.belief.covariance)
    estimator = Estimator(ModelFilter(body_process(), body_sensors(), at_first(belief, "fix")), step=0.5)
    started = None
    for k, time in enumerate(run.times.tolist()):
        estimate = estimator.tick(time, (), [m for m in run.measurements if k and run.times[k - 1] < m.stamp <= time])
        if started is None and estimate.belief is not None:
            started = time
    assert started == 10.0
    assert estimate.belief is not None
    assert np.linalg.norm((estimate.belief.mean - run.truth[-1])[:2]) < 5.0


def test_what_a_filter_cannot_use_is_said():
    run = simulate(1, 2.0)
    with pytest.raises(ParameterError, match="no transform 'cubature'; there are extended"):
        ModelFilter(process(), ranges(), run.belief, transform="cubature")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="no model of the gated kind 'dvl'; there are range"):
        ModelFilter(process(), ranges(), run.belief, gates={"dvl": 0.99})
    assert isinstance(run, Run)


def reasons(values, recovery, kind="depth", period=1.0):
    """Why a filter that knows a constant depth, north and east of 0 refuses values of noise 0.1; "" if it does not."""
    motion = with_depth(constant_velocity())
    model = MotionProcess(motion, {"north": 1e-4, "east": 1e-4, "depth": 1e-4})
    belief = motion.space.belief({}, {"north": 0.1, "east": 0.1, "depth": 0.1})
    shown = {"depth": sensors.depth(motion), "fix": sensors.fix(motion)}
    estimator = Estimator(ModelFilter(model, shown, belief, gates=0.999, recovery=recovery), step=period)
    estimator.tick(0.0)
    found = []
    for k, value in enumerate(values):
        seen = measured(kind, np.atleast_1d(value), 0.1, period * (k + 1), sequence=k)
        found += [o.reason for o in estimator.tick(period * (k + 1), (), [seen]).outcomes]
    return found


def test_a_source_is_let_in_by_those_that_agree_and_stays_until_it_fits():
    out = "outlier"
    assert reasons([0.0, 5.0, 0.0, 0.0], Readmission()) == ["", out, "", ""]
    assert reasons([9.0, 9.0, 9.0, 18.0, 18.0], Readmission())[:4] == [out, out, "", out]
    # So small a belief follows slowly: let in again and again, though each is outside the gate.
    assert reasons([9.0] * 6, Readmission()) == [out, out, "", "", "", ""]
    assert reasons([9.0, -9.0, 20.0, -20.0, 30.0, -30.0, 40.0], Readmission()) == [out] * 7
    assert reasons([9.0] * 6, None) == [out] * 6
    vectors = [[9.0, 0.0]] * 3
    assert reasons(vectors, Readmission(), "fix") == [out, out, ""]
    assert reasons(vectors, Readmission(), "fix", period=5.0) == [out, "", ""]  # they come slowly
    assert reasons([[9.0, 0.0], [-9.0, 0.0], [9.0, 0.1]], Readmission(), "fix", period=5.0) == [out, out, ""]


def test_opening_makes_the_belief_follow_at_once():
    motion = constant_velocity()
    belief = Gaussian(mean=np.zeros(4), covariance=np.diag([0.01, 0.01, 0.04, 0.04]) + 0.005)
    H, residual = (
        sensors.fix(motion).jacobian(np.zeros(4), measured("fix", [0.0, 0.0], 0.1, 0.0)),
        np.array([5.0, -2.0]),
    )
    after = opened(belief, H, residual)
    S = H @ after.covariance @ H.T
    assert residual @ np.linalg.solve(S, residual) < 1.0
    d = belief.covariance @ H.T @ np.linalg.solve(H @ belief.covariance @ H.T, residual)
    assert pytest.approx(residual) == H @ d
    assert after.covariance - belief.covariance == pytest.approx(np.outer(d, d))
