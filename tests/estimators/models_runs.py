"""A simulated unicycle among beacons, and a vehicle of constant velocity with a DVL: truth and measurements."""

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from estimators.core.filter import ModelFilter
from estimators.core.history import History
from estimators.core.models import sensors
from estimators.core.models.motion import Motion, constant_velocity, unicycle, with_current, with_error
from estimators.core.models.process import MotionProcess
from estimators.core.types import Array, Gaussian, Measurement

BEACONS = {"a": (45.0, 5.0, 0.0), "b": (-30.0, 35.0, 0.0), "c": (-10.0, -50.0, 0.0), "d": (20.0, -20.0, 0.0)}
STEP = 0.2  # [s]
SPEED_SIGMA, TURN_SIGMA = 0.05, 0.01  # white errors of odometry at each step [m/s, rad/s]
RANGE_SIGMA, BIAS_SIGMA = 0.3, 3.0  # [m]


@cache
def motion() -> Motion:
    """A unicycle with a range bias of each beacon."""
    found = unicycle()
    for name in BEACONS:
        found = with_error(found, f"bias_{name}", "m")
    return found


@cache
def process() -> MotionProcess:
    density = {"speed": SPEED_SIGMA**2 * STEP, "turn_rate": TURN_SIGMA**2 * STEP}
    return MotionProcess(
        motion(),
        {"north": 1e-6, "east": 1e-6, "heading": 1e-8, **{f"bias_{name}": 1e-6 for name in BEACONS}},
        input_noise=density,
    )


@cache
def ranges() -> dict[tuple[str, str], sensors.Sensor]:
    return {("range", name): sensors.range_to(motion(), place, bias=f"bias_{name}") for name, place in BEACONS.items()}


@dataclass
class Run:
    times: Array  # (k,)
    truth: Array  # (k, 7)
    inputs: list[tuple[float, float]]  # odometry, from each time to the next
    measurements: list[Measurement]
    belief: Gaussian  # at the start


def simulate(seed: int, duration: float = 120.0, bias: float = BIAS_SIGMA, outliers: float = 0.0) -> Run:
    """A winding course; each beacon answers about once a second, at times of its own."""
    rng = np.random.default_rng(seed)
    count = round(duration / STEP)
    biases = bias * rng.standard_normal(len(BEACONS))
    deviations = np.array([1.0, 1.0, 0.1, *[max(bias, 1e-3)] * len(BEACONS)])
    truth, inputs = np.empty((count + 1, 3)), []
    truth[0] = (5.0, -5.0, rng.uniform(-3.0, 3.0))
    for k in range(count):
        speed, turn = 1.0, 0.15 * math.sin(0.05 * STEP * k + seed)
        inputs.append((speed + SPEED_SIGMA * rng.standard_normal(), turn + TURN_SIGMA * rng.standard_normal()))
        middle = truth[k, 2] + 0.5 * STEP * turn
        truth[k + 1] = truth[k] + STEP * np.array([speed * math.cos(middle), speed * math.sin(middle), turn])
    measurements = []
    for number, (name, place) in enumerate(BEACONS.items()):
        for k in range(1 + number, count, 5):
            distance = math.dist(truth[k, :2], place[:2]) + biases[number] + RANGE_SIGMA * rng.standard_normal()
            if rng.random() < outliers:
                distance += rng.uniform(5.0, 40.0)
            measurements.append(measured("range", [distance], RANGE_SIGMA, STEP * k, name, k))
    full = np.column_stack((truth, np.tile(biases, (count + 1, 1))))
    mean = np.array([*truth[0], *np.zeros(len(BEACONS))]) + np.array([1, 1, 0.1, 0, 0, 0, 0]) * rng.standard_normal(7)
    belief = Gaussian(mean=mean, covariance=np.diag(deviations**2))
    measurements.sort(key=lambda m: m.stamp)
    return Run(STEP * np.arange(count + 1), full, inputs, measurements, belief)


def measured(kind, value, sigma, stamp, source="", sequence=None, received=None, parameters=()) -> Measurement:
    value = np.array(value, dtype=float)
    return Measurement(
        kind=kind, value=value, covariance=np.diag(np.broadcast_to(np.square(sigma), value.shape)).copy(), stamp=stamp,
        received=stamp if received is None else received, source=source, sequence=sequence, parameters=parameters,
    )  # fmt: skip


def estimated(run: Run, filter_: ModelFilter, keep: float = 1e6) -> tuple[Array, Array, History]:
    """Means (k, n), covariances (k, n, n) at the ticks, with measurements delivered as received."""
    history = History(filter_, step=float(run.times[1]), keep=keep, verdicts=lambda state: state.verdicts)
    waiting = sorted(run.measurements, key=lambda m: m.received)
    means, covariances, given = [], [], 0
    for k, time in enumerate(run.times.tolist()):
        history.append(time, run.inputs[k - 1] if k else run.inputs[0])
        while given < len(waiting) and waiting[given].received <= time + 1e-9:
            history.insert(waiting[given])
            given += 1
        state = history.replay()
        means.append(state.belief.mean)
        covariances.append(state.belief.covariance)
    return np.array(means), np.array(covariances), history


def rms(means: Array, truth: Array, begin: int = 0) -> float:
    """Horizontal [m]."""
    return float(np.sqrt(np.mean(np.sum((means - truth[:, : means.shape[1]])[begin:, :2] ** 2, axis=1))))


VELOCITY_NOISE = {"north": 1e-4, "east": 1e-4, "heading": 1e-6, "surge": 1e-4, "sway": 1e-4, "yaw_rate": 1e-5,
                  "current_north": 1e-7, "current_east": 1e-7}  # fmt: skip
SIGMAS = {"compass": 0.02, "gyro": 0.003, "dvl": 0.02, "water": 0.03, "fix": 1.5}


@cache
def body_motion() -> Motion:
    """A vehicle whose velocity is a random walk, in a current."""
    return with_current(constant_velocity(turning=True))


@cache
def body_process() -> MotionProcess:
    return MotionProcess(body_motion(), VELOCITY_NOISE)


@cache
def body_sensors() -> dict[str, sensors.Sensor]:
    motion = body_motion()
    return {
        "compass": sensors.compass(motion),
        "gyro": sensors.gyro(motion),
        "dvl": sensors.dvl(motion),
        "water": sensors.dvl(motion, track="water"),
        "fix": sensors.fix(motion),
    }


def body_run(seed: int, duration: float = 400.0, step: float = 0.5, faster: float = 0.0) -> Run:
    """Compass and gyro at each step, DVL each second, fixes each 10 s; `faster` is gained from 120 s to 180 s [m/s]."""
    rng = np.random.default_rng(seed)
    process, count = body_process(), round(duration / step)
    mean, deviations = np.array([0, 0, rng.uniform(-3, 3), 1.0, 0, 0, 0, 0]), [2, 2, 0.05, 0.1, 0.05, 0.02, 0.3, 0.3]
    belief = Gaussian(mean=mean, covariance=np.diag(np.square(deviations)))
    x = mean + deviations * rng.standard_normal(8)
    truth, taken = [x], []
    for k in range(1, count + 1):
        Q = process.covariance(x, (), step)
        x = process.evaluate(x, (), step) + np.linalg.cholesky(Q + 1e-18 * np.eye(8)) @ rng.standard_normal(8)
        x[3] += faster * step / 60.0 if 120.0 < step * k <= 180.0 else 0.0
        truth.append(x)
        for kind, every in (("compass", 1), ("gyro", 1), ("dvl", 2), ("water", 2), ("fix", 20)):
            if k % every == 0:
                model = body_sensors()[kind]
                empty = measured(kind, np.zeros(model.size), SIGMAS[kind], step * k, sequence=k)
                value = model.evaluate(x, empty) + SIGMAS[kind] * rng.standard_normal(model.size)
                taken.append(replace(empty, value=value))
    return Run(step * np.arange(count + 1), np.array(truth), [()] * count, taken, belief)
