"""The ways of navigating that paper 5's study compares, each from the odometry, frames and fixes of a run to a path."""

import math
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from auvsim.reproduce.paper5.scenes import SATURATION, Conditions, Run
from estimators.core.estimator import Estimator
from estimators.core.filter import ModelFilter
from estimators.core.models.sensors import fix
from estimators.core.types import Array, Gaussian, Measurement
from estimators.map_path import pose_graph
from estimators.map_path.dynamic_programming import PathFilter
from estimators.map_path.landmarks import LandmarkFilter
from estimators.map_path.likelihood import FrameModel, Matcher, Weighting
from estimators.map_path.odometry import MOTION, OdometryNoise
from estimators.map_path.particles import ParticlePathFilter
from estimators.map_path.window import Window, WindowFilter

KEEP = 6.0  # age up to which frames are used [s]
START = np.diag(np.square((0.01, 0.01, 1e-4)))  # the study is about drift: the start is known [m, m, rad]
FLOOR_SPREAD = 0.2  # assumed of frames of the ray-cast sonar, less than a cell [m]
FLOOR_SNR = 9.5  # assumed of the same: a tenth of the variance is the floor's [dB]
# Relief, over an altitude, moves echoes aside and nearer; how much of that lasts was chosen on other seeds.
FLOOR_WINDOW = Window(scatter=True, relief=0.0065, relief_time=40.0)
SEEN = 12  # frames that show a place, about
GPS_DEVIATION = 2.0  # of a fix, each axis [m]


@dataclass(frozen=True, kw_only=True, slots=True)
class Track:
    """What a method made of a run."""

    poses: Array  # (k, 3)
    covariances: Array  # (k, 3, 3) of the poses; NaN where a method says none
    refused: Mapping[str, int]  # frames not used, by reason
    seconds: float  # of processor time


def frame_model(conditions: Conditions, weighting: Weighting = "field") -> FrameModel:
    """The statistics that the methods assume: the true ones; of the array's frames those of point frames of variance 1.

    The array's frames have neither a Gaussian point spread nor white noise, and no method is told what they have. Nor
    are those of the ray-cast sonar: of them the point spread and its share of the variance are assumed.
    """
    if conditions.frames == "floor":
        model = FrameModel(point_spread=FLOOR_SPREAD, weighting=weighting).scaled(FLOOR_SNR)
    else:
        model = FrameModel(density=conditions.density, weighting=weighting).scaled(conditions.snr)
    if conditions.frames == "point":
        return model
    features = model.density * math.pi * model.point_spread**2 * model.amplitude**2
    scale = 1.0 / math.sqrt(model.noise**2 + features)
    return replace(model, amplitude=model.amplitude * scale, noise=model.noise * scale)


def follow(run: Run, estimator_filter, fixes: Mapping[int, Measurement] | None = None) -> tuple[Track, Estimator]:
    """A filter over a run, frames and fixes delivered when they arrive; and the estimator as it is at the end."""
    estimator = Estimator(estimator_filter, step=1.0, keep=KEEP)
    waiting = [frame.measurement() for frame in run.frames] if fixes is None else list(fixes.values())
    poses, covariances, refused = [], [], Counter()
    begin = time.process_time()
    for k in range(len(run.poses)):
        arrived = [m for m in waiting if m.received <= k]
        waiting = [m for m in waiting if m.received > k]
        estimate = estimator.tick(float(k), run.inputs[k - 1][:2] if k else (), arrived)
        assert estimate.belief is not None
        poses.append(estimate.belief.mean[:3])
        covariances.append(estimate.belief.covariance[:3, :3])
        refused.update(o.reason for o in estimate.outcomes if not o.accepted)
    seconds = time.process_time() - begin
    track = Track(poses=np.array(poses), covariances=np.array(covariances), refused=dict(refused), seconds=seconds)
    return track, estimator


def _matcher(run: Run, weighting: Weighting = "field") -> Matcher:
    return Matcher(run.grid, frame_model(run.conditions, weighting))


def _start(run: Run) -> Gaussian:
    return Gaussian(mean=run.poses[0], covariance=START)


def dead_reckoning(run: Run) -> Track:
    """Odometry alone."""
    none = np.full((len(run.poses), 3, 3), math.nan)
    return Track(poses=run.dead_reckoning, covariances=none, refused={}, seconds=math.nan)


def path(run: Run, weighting: Weighting = "field", flat: bool = False) -> Track:
    """Dynamic programming; the path is what it is at the end, the covariance what it was on the way."""
    matcher, scatter = _matcher(run, weighting), weighting == "field" and not flat
    filter_ = PathFilter(matcher, _start(run), flat=flat, saturation=SATURATION, scatter=scatter)
    track, estimator = follow(run, filter_)
    state = estimator.nodes[-1].state
    assert state is not None
    poses = track.poses.copy()
    for stamp, pose in state.path():
        poses[round(stamp)] = pose
    return replace(track, poses=poses)


def graph(run: Run) -> Track:
    """The pose graph, from the path of dynamic programming; without loop closures, as no place is seen again."""
    first, begin = path(run), time.process_time()
    matcher = Matcher(run.grid, replace(frame_model(run.conditions), together=SEEN))
    frames = {round(f.stamp): matcher.prepare(f.intensity) for f in run.frames}
    ready = [frames.get(k) for k in range(len(run.poses))]
    solved = pose_graph.solve(matcher, ready, first.poses, START, close_loops=False).solution
    covariances = np.full_like(first.covariances, math.nan)
    covariances[-1] = solved.covariance(-1)
    seconds = first.seconds + time.process_time() - begin
    return Track(poses=solved.poses, covariances=covariances, refused=first.refused, seconds=seconds)


def surfacing(run: Run, interval: int) -> Track:
    """Odometry with a GPS fix of the position every so many seconds; the filter learns odometry's errors from them."""
    rng = np.random.default_rng(round(1e6 * abs(run.poses[0, 2])))
    R = GPS_DEVIATION**2 * np.eye(2)
    fixes = {
        k: Measurement(
            kind="gps",
            value=run.poses[k, :2] + GPS_DEVIATION * rng.standard_normal(2),
            covariance=R,
            stamp=float(k),
            received=float(k),
        )
        for k in range(interval, len(run.poses), interval)
    }
    noise = OdometryNoise()
    gps = fix(MOTION)
    return follow(run, ModelFilter(noise.process(), {"gps": gps}, noise.start(_start(run))), fixes)[0]


def window(run: Run) -> Track:
    """Frame to window; over a floor with relief, that is a part of the state."""
    settings = FLOOR_WINDOW if run.conditions.frames == "floor" else Window(scatter=True)
    return follow(run, WindowFilter(_matcher(run), _start(run), window=settings, saturation=SATURATION))[0]


def _filtered(make, run: Run, weighting: Weighting = "field") -> Track:
    return follow(run, make(_matcher(run, weighting), _start(run), saturation=SATURATION))[0]


METHODS: dict[str, Callable[[Run], Track]] = {
    "dead_reckoning": dead_reckoning,
    "literal": partial(path, weighting="literal"),
    "per_frame": partial(path, flat=True),
    "dp_point": partial(path, weighting="point"),
    "dp": path,
    "window": window,
    "particles": partial(_filtered, ParticlePathFilter),
    "graph": graph,
    "landmarks": partial(_filtered, LandmarkFilter, weighting="point"),
    "gps_60": partial(surfacing, interval=60),
    "gps_120": partial(surfacing, interval=120),
}
TITLES = {
    "dead_reckoning": "dead reckoning",
    "literal": "DP, likelihood as printed",
    "per_frame": "each frame by itself",
    "dp_point": "DP, matched filter",
    "dp": "DP",
    "window": "frame to window",
    "particles": "particle filter",
    "graph": "pose graph",
    "landmarks": "EKF-SLAM",
    "gps_60": "GPS every 60 s",
    "gps_120": "GPS every 120 s",
}
