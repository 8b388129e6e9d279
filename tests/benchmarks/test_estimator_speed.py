"""Time of one node, predict and correct of eight states, beside other libraries doing the same work in the same run.

Run with `pytest tests/benchmarks/test_estimator_speed.py --benchmark-enable`; times are printed, not judged. The others
(`pip install auvsim[compare]`) are handed the same compiled model, so that only the filters themselves are compared.
"""

import math
import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor
from datetime import datetime, timedelta
from functools import partial

import numpy as np
import pytest

from auvsim.reproduce.paper1.runs import Conditions, simulate, track
from auvsim.reproduce.paper1.study import FILTERS
from estimators.core import ekf
from estimators.core.estimator import Estimator
from estimators.core.filter import ModelFilter
from estimators.core.models import sensors
from estimators.core.models.motion import unicycle
from estimators.core.models.process import MotionProcess
from estimators.core.types import Gaussian, Measurement
from estimators.docking.noise import REFERENCE_NOISE
from estimators.docking.sensors import HeadingModel
from estimators.planar.model import PRESTERO, PlanarProcess

PROCESS, HEADING = PlanarProcess(PRESTERO, REFERENCE_NOISE.densities()), HeadingModel()
MEAN = np.array([3.0, -7.0, 0.4, 0.9, -0.06, 0.05, 0.2, -0.3])
INPUT, STEP = (0.08, 0.0), 0.5
VARIANCE = REFERENCE_NOISE.compass**2
SAMPLE = Measurement(
    kind="compass", value=np.array([0.43]), covariance=np.array([[VARIANCE]]), stamp=STEP, received=STEP
)


def covariance():
    root = np.random.default_rng(0).standard_normal((8, 8))
    return 0.01 * (root @ root.T)


def node(belief):
    predicted = ekf.predict(belief, PROCESS, INPUT, STEP)
    return ekf.correct(predicted, SAMPLE, HEADING)[0]


def expected():
    after = node(Gaussian(mean=MEAN, covariance=covariance()))
    return after.mean, after.covariance


def agrees(mean, P):
    # Rounding: other orders of the same operations on elements of order 1.
    assert mean == pytest.approx(expected()[0], rel=1e-9, abs=1e-9)
    assert pytest.approx(expected()[1], rel=1e-8, abs=1e-10) == P


def test_node_here(benchmark):
    belief = Gaussian(mean=MEAN, covariance=covariance())
    after = benchmark(node, belief)
    agrees(after.mean, after.covariance)


def test_node_in_filterpy(benchmark):
    kalman = pytest.importorskip("filterpy.kalman")

    class Planar(kalman.ExtendedKalmanFilter):
        def predict_x(self, u=0):
            self.x = PROCESS.evaluate(self.x, u, STEP)

    other = Planar(dim_x=8, dim_z=1)
    H = HEADING.jacobian(MEAN)

    def other_node():
        other.x, other.P = MEAN, covariance_at_start
        other.F, other.Q = PROCESS.jacobian(MEAN, INPUT, STEP), PROCESS.covariance(MEAN, INPUT, STEP)
        other.predict(INPUT)
        other.update(SAMPLE.value, lambda x: H, HEADING.evaluate, R=SAMPLE.covariance, residual=HEADING.residual)

    covariance_at_start = covariance()
    benchmark(other_node)
    agrees(other.x, other.P)


def test_node_in_stone_soup(benchmark):
    pytest.importorskip("stonesoup")
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.base import TransitionModel
    from stonesoup.predictor.kalman import ExtendedKalmanPredictor
    from stonesoup.types.array import CovarianceMatrix, StateVector
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import ExtendedKalmanUpdater

    class Planar(TransitionModel):
        @property
        def ndim_state(self):
            return 8

        def function(self, state, **kwargs):
            return StateVector(PROCESS.evaluate(flat(state), INPUT, STEP))

        def jacobian(self, state, **kwargs):
            return PROCESS.jacobian(flat(state), INPUT, STEP)

        def covar(self, **kwargs):
            return CovarianceMatrix(PROCESS.covariance(MEAN, INPUT, STEP))

        def rvs(self, *args, **kwargs):
            raise NotImplementedError

        def pdf(self, *args, **kwargs):
            raise NotImplementedError

    def flat(state):
        return np.asarray(state.state_vector, dtype=float).ravel()

    start = datetime(2000, 1, 1)
    before = GaussianState(StateVector(MEAN), CovarianceMatrix(covariance()), timestamp=start)
    compass = LinearGaussian(ndim_state=8, mapping=(2,), noise_covar=CovarianceMatrix(SAMPLE.covariance))
    predictor, updater = ExtendedKalmanPredictor(Planar()), ExtendedKalmanUpdater(compass)
    detection = Detection(
        StateVector(SAMPLE.value), timestamp=start + timedelta(seconds=STEP), measurement_model=compass
    )

    def other_node():
        predicted = predictor.predict(before, timestamp=detection.timestamp)
        return updater.update(SingleHypothesis(predicted, detection))

    after = benchmark(other_node)
    agrees(flat(after), np.asarray(after.covar, dtype=float))


@pytest.mark.parametrize("name", ["paper", "augmented_constant", "unscented", "imm", "imm_biases"])
def test_hundred_seconds_of_a_filter(benchmark, name):
    """200 ticks with delays and replay, all included: 6000 s are sixty times this."""
    run = simulate(Conditions(duration=100.0), 1)
    tracked = benchmark(lambda: track(run, FILTERS[name].make()))
    assert np.isfinite(tracked.means[-1]).all()


def simulated_and_followed(name, duration, seed):
    """Seconds that one run's simulation took, and the filter over it."""
    begin = time.perf_counter()
    run = simulate(Conditions(duration=duration), seed)
    middle = time.perf_counter()
    assert np.isfinite(track(run, FILTERS[name].make()).means[-1]).all()
    return middle - begin, time.perf_counter() - middle


@pytest.mark.parametrize("name", ["augmented_constant", "imm"])
def test_hundred_runs_of_6000_s_on_two_cores(benchmark, name):
    """The whole batch, with the start of its two processes; without --benchmark-enable only a taste of it.

    Ticks are 0.5 s apart, fixes 5 s. `extra_info` has what simulations and filters took of it.
    """
    runs, duration = (100, 6000.0) if benchmark.enabled else (2, 20.0)

    def batch():
        with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
            work = partial(simulated_and_followed, name, duration)
            return np.array(list(pool.map(work, range(runs), chunksize=1)))

    parts = benchmark.pedantic(batch, rounds=1).sum(axis=0) / 2.0
    benchmark.extra_info |= {"simulations [s]": round(parts[0], 1), "filters [s]": round(parts[1], 1)}


BEACONS = {"a": (45.0, 5.0, 0.0), "b": (-30.0, 35.0, 0.0), "c": (-10.0, -50.0, 0.0), "d": (20.0, -20.0, 0.0)}
RANGE_STEP, SPEED_SIGMA, TURN_SIGMA, RANGE_SIGMA = 0.2, 0.05, 0.01, 0.3
PRIOR = Gaussian(mean=np.array([5.0, -5.0, 0.3]), covariance=np.diag([1.0, 1.0, 0.01]))


def range_run(count=600):
    """True positions (k, 2), odometry, and the ranges of each time: a unicycle among beacons, two minutes."""
    rng, x, states, odometry, seen = np.random.default_rng(1), PRIOR.mean, [], [], []
    for k in range(count):
        states.append(x[:2])
        turn = 0.15 * math.sin(0.05 * RANGE_STEP * k)
        odometry.append((1.0 + SPEED_SIGMA * rng.standard_normal(), turn + TURN_SIGMA * rng.standard_normal()))
        near = [name for number, name in enumerate(BEACONS) if k and k % 5 == number]
        distances = [(n, math.dist(x[:2], BEACONS[n][:2]) + RANGE_SIGMA * rng.standard_normal()) for n in near]
        seen.append(distances)
        middle = x[2] + 0.5 * RANGE_STEP * turn
        x = x + RANGE_STEP * np.array([math.cos(middle), math.sin(middle), turn])
    return np.array(states), odometry, seen


def position_rms(means, states):
    return float(np.sqrt(np.mean(np.sum((np.array(means)[100:, :2] - states[100:]) ** 2, axis=1))))


def test_ranges_here(benchmark):
    """A unicycle's odometry and ranges, 600 ticks, delay buffer and fates of measurements included."""
    states, odometry, seen = range_run()
    motion = unicycle()
    noise = {"speed": SPEED_SIGMA**2 * RANGE_STEP, "turn_rate": TURN_SIGMA**2 * RANGE_STEP}
    process = MotionProcess(motion, {"north": 1e-6, "east": 1e-6, "heading": 1e-8}, input_noise=noise)
    models = {("range", name): sensors.range_to(motion, place) for name, place in BEACONS.items()}
    R = np.array([[RANGE_SIGMA**2]])

    def tracked():
        estimator, means = Estimator(ModelFilter(process, models, PRIOR), step=RANGE_STEP), []
        for k in range(len(states)):
            time_ = RANGE_STEP * k
            measurements = [
                Measurement(
                    kind="range", source=n, value=np.array([d]), covariance=R, stamp=time_, received=time_, sequence=k
                )
                for n, d in seen[k]
            ]
            belief = estimator.tick(time_, odometry[max(k - 1, 0)], measurements).belief
            assert belief is not None
            means.append(belief.mean)
        return means

    assert position_rms(benchmark(tracked), states) < 0.3


def test_ranges_in_gtsam(benchmark):
    """The same odometry, ranges, prior and noise in GTSAM's incremental smoother (iSAM2), by its own factors."""
    gtsam = pytest.importorskip("gtsam")
    states, odometry, seen = range_run()
    sigmas = gtsam.noiseModel.Diagonal.Sigmas
    between = sigmas(np.array([RANGE_STEP * SPEED_SIGMA + 5e-4, 5e-4, RANGE_STEP * TURN_SIGMA]))
    ranging, known = gtsam.noiseModel.Isotropic.Sigma(1, RANGE_SIGMA), gtsam.noiseModel.Isotropic.Sigma(2, 1e-6)
    X, L = gtsam.symbol_shorthand.X, gtsam.symbol_shorthand.L
    numbers = {name: number for number, name in enumerate(BEACONS)}

    def tracked():
        smoother, graph, values = gtsam.ISAM2(), gtsam.NonlinearFactorGraph(), gtsam.Values()
        pose, means = gtsam.Pose2(*PRIOR.mean), []
        graph.add(gtsam.PriorFactorPose2(X(0), pose, sigmas(np.sqrt(np.diagonal(PRIOR.covariance)))))
        values.insert(X(0), pose)
        for name, number in numbers.items():
            graph.add(gtsam.PriorFactorPoint2(L(number), np.array(BEACONS[name][:2]), known))
            values.insert(L(number), np.array(BEACONS[name][:2]))
        for k in range(len(states)):
            if k:
                speed, turn = odometry[k - 1]
                half = 0.5 * RANGE_STEP * turn
                way = RANGE_STEP * speed
                moved = gtsam.Pose2(way * math.cos(half), way * math.sin(half), 2.0 * half)
                graph.add(gtsam.BetweenFactorPose2(X(k - 1), X(k), moved, between))
                values.insert(X(k), pose.compose(moved))
            for name, distance in seen[k]:
                graph.add(gtsam.RangeFactor2D(X(k), L(numbers[name]), distance, ranging))
            smoother.update(graph, values)
            graph.resize(0)
            values.clear()
            pose = smoother.calculateEstimatePose2(X(k))
            means.append((pose.x(), pose.y()))
        return means

    assert position_rms(benchmark(tracked), states) < 0.3
