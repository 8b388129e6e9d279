"""Trial logs of made-up vehicles whose truth, errors and contacts are known in closed form."""

import numpy as np
from scipy.interpolate import CubicSpline

from auvsim.base.frames import euler_to_quaternion, rotation, wrap
from auvsim.base.reading import Reading
from auvsim.data.log import PHASES, TrialLog
from auvsim.data.recorder import LogWriter
from auvsim.physics.truth import Truth

DOCK_DEPTH = 5.0
DOCK_HEADING = 0.6
NOSE = 0.8
CURRENT = np.array([0.2, -0.15, 0.0])
ATTRIBUTES = {
    "scenario": "vehicle: remus100\nname: Strömung\n",
    "seed": 7,
    "trial": 0,
    "dock_depth": DOCK_DEPTH,
    "dock_heading": DOCK_HEADING,
    "vehicle_nose": NOSE,
}
# Along and cross track [m]: past the dock at the first attempt, into it at the second.
GO_AROUND = [(-290, 40), (-180, 18), (-90, 5), (-30, 2.2), (6, 2.0), (40, 20), (30, 70), (-40, 90), (-110, 60)]
GO_AROUND += [(-125, 15), (-80, 1), (-30, 0.1), (-0.5, 0.05)]
STRAIGHT = [(-300, 30), (-200, 15), (-100, 3), (-40, 0.2), (-0.5, 0.1)]


def empty_log(status: str = "interrupted") -> TrialLog:
    """A log in which nothing was ever logged."""
    return LogWriter(attributes=ATTRIBUTES, fins=4).finish(status, wall_time=0.5)


def writer() -> LogWriter:
    """A recorder with the attributes above."""
    return LogWriter(attributes=ATTRIBUTES, fins=4)


def truth(time, position, attitude=(0.0, 0.0, DOCK_HEADING), velocity=(1.5, 0.0, 0.0), current=(0.0, 0.0, 0.0)):
    """A truth; the velocity is over ground in NED [m/s]."""
    nu = np.zeros(6)
    nu[:3] = rotation(*attitude).T @ np.asarray(velocity, dtype=float)
    return Truth(
        time=time,
        position=np.asarray(position, dtype=float),
        quaternion=euler_to_quaternion(*attitude),
        attitude=np.asarray(attitude, dtype=float),
        nu=nu,
        current=np.asarray(current, dtype=float),
        fins=np.zeros(4),
        shaft_speed=150.0,
    )


def from_dock(along, cross, down=0.0):
    """NED position (3,) of a point in the dock's frame."""
    return rotation(0.0, 0.0, DOCK_HEADING) @ np.array([along, cross, down]) + np.array([0.0, 0.0, DOCK_DEPTH])


def trial_log(waypoints=STRAIGHT, seed=0, speed=1.5) -> TrialLog:
    """A plausible trial along a spline through waypoints (along, cross track [m]) with consistent estimates."""
    waypoints = np.asarray(waypoints, dtype=float)
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(waypoints, axis=0).T))])
    path = CubicSpline(lengths, waypoints)
    times = np.arange(0.0, lengths[-1] / speed, 0.1)
    rng = np.random.default_rng(seed)
    log = writer()
    truths = [_truth_on(path, t, speed) for t in times]
    for item in truths:
        log.truth(item)
    _guidance(log, times, truths)
    _estimates(log, times[::5], truths[::5], rng)
    _fixes(log, times, truths, rng)
    end = times[-1]
    for i, force in enumerate((40.0, 90.0, 30.0)):
        log.append("contact", (end - 0.03 + i * 0.01, force, sum((40.0, 90.0, 30.0)[: i + 1]) * 0.01))
    log.event(end, "docked", "latched at 1.5 m/s")
    return log.finish("complete", wall_time=0.6)


def _truth_on(path, time, speed):
    along, cross = path(speed * time)
    slope = path(speed * time, 1) * speed
    velocity = rotation(0.0, 0.0, DOCK_HEADING)[:, :2] @ slope + [0.0, 0.0, 0.02 * np.cos(0.05 * time)]
    heading = np.arctan2(velocity[1] - CURRENT[1], velocity[0] - CURRENT[0])
    position = from_dock(along, cross, 0.4 * np.sin(0.05 * time) - 2.0 * np.exp(-time / 30.0))
    return truth(time, position, (0.0, 0.03 * np.sin(0.2 * time), heading), velocity, CURRENT)


def _guidance(log, times, truths):
    attempt, beyond = 1, False
    for time, item in zip(times, truths, strict=True):
        along, cross, _ = rotation(0.0, 0.0, DOCK_HEADING).T @ (item.position - [0.0, 0.0, DOCK_DEPTH])
        if along > 3.0:
            beyond = True
        if beyond and along < -100.0:
            attempt, beyond = 2, False
        distance = -along
        phase = "homing" if distance > 120.0 else "approach" if distance > 25.0 else "final"
        phase = "search" if time < 20.0 else "go_around" if beyond else phase
        heading = item.attitude[2]
        log.append("guidance", (time, PHASES.index(phase), attempt, heading, DOCK_DEPTH, 1.5, along, cross))
        log.append("command", (time, 0.05 * np.sin(time), 0.02, 150.0))
    log.append("guidance", (times[-1] + 0.1, PHASES.index("docked"), attempt, DOCK_HEADING, DOCK_DEPTH, 0.0, 0.0, 0.0))


def _estimates(log, times, truths, rng):
    """Errors are unit Ornstein-Uhlenbeck noise (15 s) times the sigmas that the covariance claims."""
    unit = rng.standard_normal(8)
    decay = np.exp(-0.5 / 15.0)
    for time, item in zip(times, truths, strict=True):
        unit = decay * unit + np.sqrt(1 - decay**2) * rng.standard_normal(8)
        along = np.hypot(*item.position[:2])
        horizontal = 0.2 + 0.01 * along
        slow = 0.02 + 0.08 * np.exp(-time / 60.0)
        sigma = np.array([horizontal, horizontal, 0.02, 0.04, 0.03, 0.004, slow, slow])
        error = sigma * unit
        water = rotation(*item.attitude).T @ item.current
        position = item.position + np.array([error[0], error[1], 0.02])
        velocity = item.nu[[0, 1, 5]] - [water[0], water[1], 0.0] + error[3:6]
        row = (time, position, wrap(item.attitude[2] + error[2]), velocity, item.current[:2] + error[6:8])
        log.append("estimate", (*row, np.diag(sigma**2), int(time // 150.0), time >= 20.0))


def _fixes(log, times, truths, rng):
    for sequence, (time, item) in enumerate(zip(times[30::50], truths[30::50], strict=True)):
        relative = rotation(0.0, 0.0, DOCK_HEADING).T @ (item.position - [0.0, 0.0, DOCK_DEPTH])
        outlier, lost = sequence % 13 == 5, sequence % 11 == 3
        value = relative + 0.003 * np.linalg.norm(relative) * rng.standard_normal(3) + (20.0 if outlier else 0.0)
        stamp = time - 0.04
        packet = np.array([*value, DOCK_HEADING, 0.0, 0.0, DOCK_DEPTH])
        received = np.nan if lost else stamp + 1.5
        log.reading(Reading("usbl", stamp, received, packet, sequence), lost=lost, outlier=outlier)
        log.reading(Reading("compass", time, time, np.array([item.attitude[2], 0.0, 0.0]), sequence))
        log.reading(Reading("depth", time, time, item.position[2:], sequence))
        log.reading(Reading("feedback", time, time, np.zeros(5), sequence))
