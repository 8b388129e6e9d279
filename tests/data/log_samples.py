"""Logs of a made-up vehicle whose truth, errors and contacts are known in closed form, and the tables of its groups."""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from auvsim.base.frames import euler_to_quaternion, rotation, wrap
from auvsim.base.reading import Reading
from auvsim.data.log import Log
from auvsim.data.recorder import Recorder
from auvsim.data.variables import Group, Variable, run_groups, vehicle_groups

DOCK_DEPTH = 5.0
DOCK_HEADING = 0.6
CURRENT = np.array([0.2, -0.15, 0.0])
PHASES = ("search", "homing", "approach", "final", "docked", "go_around", "aborted")
ATTRIBUTES = {"scenario": "vehicle: remus100\nname: Strömung\n", "seed": 7, "trial": 0}
GROUP_ATTRIBUTES = {
    "vehicles/remus100": {
        "model": "remus100",
        "nose": 0.8,
        "estimator": "ekf",
        "controller": "torpedo",
        "mission": "docking",
        "dock": "dock",
    },
    "structures/dock": {
        "model": "dock",
        "north": 0.0,
        "east": 0.0,
        "depth": DOCK_DEPTH,
        "heading": DOCK_HEADING,
        "mouth_radius": 0.75,
        "throat_radius": 0.15,
        "cone_length": 1.0,
        "throat_length": 0.7,
    },
}
SENSORS = {
    "compass": ({"value": Variable(("rpy",), "float64", "rad", "heading, pitch, roll", "body to NED")}, {}),
    "depth": ({"value": Variable(("down",), "float64", "m", "depth", "NED")}, {"down": 1}),
    "feedback": (
        {"value": Variable(("channel",), "float64", "rad, rad/s", "fin angles, shaft speed", "fin hinges")},
        {"channel": 5},
    ),
    "usbl": (
        {
            "value": Variable(("packet",), "float64", "m, rad", "transponder, dock's attitude and depth", "dock"),
            "lost": Variable((), "bool", "1", "whether the packet never arrived"),
            "outlier": Variable((), "bool", "1", "whether the fix was drawn as an outlier"),
        },
        {"packet": 7},
    ),
}
DOCKING = {
    "attempt": Variable((), "int8", "1", "number of the docking attempt, from 1"),
    "along_track": Variable((), "float64", "m", "estimated distance along the dock axis, < 0 before", "dock"),
    "cross_track": Variable((), "float64", "m", "estimated distance to starboard of the dock axis", "dock"),
}
DEMANDS = {
    "rudder": Variable((), "float64", "rad", "commanded rudder, positive turns to starboard", "body"),
    "elevator": Variable((), "float64", "rad", "commanded elevator, positive dives", "body"),
    "shaft_speed": Variable((), "float64", "rad/s", "commanded propeller shaft speed"),
}
CHANNELS = {"rudder_upper": "rad", "rudder_lower": "rad", "stern_port": "rad", "stern_starboard": "rad"}
CHANNELS["shaft"] = "rad/s"
STATES = {"north": "m", "east": "m", "heading": "rad", "u": "m/s", "v": "m/s", "r": "rad/s"}
STATES |= {"current_north": "m/s", "current_east": "m/s"}
# Along and cross track [m]: past the dock at the first attempt, into it at the second.
GO_AROUND = [(-290, 40), (-180, 18), (-90, 5), (-30, 2.2), (6, 2.0), (40, 20), (30, 70), (-40, 90), (-110, 60)]
GO_AROUND += [(-125, 15), (-80, 1), (-30, 0.1), (-0.5, 0.05)]


class SampleTruth(NamedTuple):
    """A vehicle's state, in the attributes that a recorder reads."""

    time: float
    position: np.ndarray
    quaternion: np.ndarray
    attitude: np.ndarray
    nu: np.ndarray
    current: np.ndarray
    actuators: np.ndarray


def groups() -> dict[str, Group]:
    """Groups of the made-up vehicle by their names below it."""
    return vehicle_groups(sensors=SENSORS, mission=(PHASES, DOCKING), demands=DEMANDS, channels=CHANNELS, states=STATES)


def recorder(path=None, vehicles=("remus100",)) -> Recorder:
    """A recorder of one or more vehicles of that kind; those after the first have no dock."""
    own = {f"vehicles/{name}": GROUP_ATTRIBUTES["vehicles/remus100"] for name in vehicles}
    attributes = {**own, "structures/dock": GROUP_ATTRIBUTES["structures/dock"]}
    for name in vehicles[1:]:
        attributes[f"vehicles/{name}"] = {**own[f"vehicles/{name}"], "dock": "", "mission": "track"}
    return Recorder(run_groups(dict.fromkeys(vehicles, groups())), ATTRIBUTES, attributes, path)


def truth(time, position, attitude=(0.0, 0.0, DOCK_HEADING), velocity=(1.5, 0.0, 0.0), current=(0.0, 0.0, 0.0)):
    """A truth; the velocity is over ground in NED [m/s]."""
    nu = np.zeros(6)
    nu[:3] = rotation(*attitude).T @ np.asarray(velocity, dtype=float)
    return SampleTruth(
        time=time,
        position=np.asarray(position, dtype=float),
        quaternion=euler_to_quaternion(*attitude),
        attitude=np.asarray(attitude, dtype=float),
        nu=nu,
        current=np.asarray(current, dtype=float),
        actuators=np.array([0.01, -0.02, 0.03, -0.04, 150.0]),
    )


def sample_log(path=None, vehicle="remus100") -> Log:
    """A plausible docking in the second attempt, with consistent estimates."""
    kept = recorder(path, (vehicle,))
    record(kept, vehicle)
    return kept.finish("complete", wall_time=0.6)


def record(kept: Recorder, vehicle: str, waypoints=GO_AROUND, seed=0, speed=1.5) -> None:
    """Records a docking along a spline through waypoints (along, cross track [m])."""
    waypoints = np.asarray(waypoints, dtype=float)
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(waypoints, axis=0).T))])
    path = CubicSpline(lengths, waypoints)
    times = np.arange(0.0, lengths[-1] / speed, 0.1)
    rng = np.random.default_rng(seed)
    truths = [_truth_on(path, t, speed) for t in times]
    for item in truths:
        kept.truth(vehicle, item)
    _mission(kept, vehicle, times, truths)
    _estimates(kept, vehicle, times[::5], truths[::5], rng)
    _fixes(kept, vehicle, times, truths, rng)
    end = times[-1]
    for i, force in enumerate((40.0, 90.0, 30.0)):
        impulse = sum((40.0, 90.0, 30.0)[: i + 1]) * 0.01
        kept.append(f"vehicles/{vehicle}/contact", (end - 0.03 + i * 0.01, force, impulse, "dock"))
    kept.event(end, vehicle, "docked", "latched at 1.5 m/s")
    kept.append("network/messages", (1.0, np.nan, "dock", vehicle, "usbl", 128, "lost"))


def long_run(kept: Recorder) -> Log:
    """The log of a vehicle of which 20 000 truths are recorded, in several packs of rows."""
    for tick in range(20_000):
        kept.truth("remus100", truth(0.1 * tick, (tick, 0, 5)))
    return kept.finish("complete")


def _from_dock(along, cross, down=0.0):
    return rotation(0.0, 0.0, DOCK_HEADING) @ np.array([along, cross, down]) + np.array([0.0, 0.0, DOCK_DEPTH])


def _truth_on(path, time, speed):
    along, cross = path(speed * time)
    slope = path(speed * time, 1) * speed
    velocity = rotation(0.0, 0.0, DOCK_HEADING)[:, :2] @ slope + [0.0, 0.0, 0.02 * np.cos(0.05 * time)]
    heading = np.arctan2(velocity[1] - CURRENT[1], velocity[0] - CURRENT[0])
    position = _from_dock(along, cross, 0.4 * np.sin(0.05 * time) - 2.0 * np.exp(-time / 30.0))
    return truth(time, position, (0.0, 0.03 * np.sin(0.2 * time), heading), velocity, CURRENT)


def _mission(kept, vehicle, times, truths):
    attempt, beyond = 1, False
    for time, item in zip(times, truths, strict=True):
        along, cross, _ = rotation(0.0, 0.0, DOCK_HEADING).T @ (item.position - [0.0, 0.0, DOCK_DEPTH])
        if along > 3.0:
            beyond = True
        if beyond and along < -100.0:
            attempt, beyond = 2, False
        phase = "homing" if along < -120.0 else "approach" if along < -25.0 else "final"
        phase = "search" if time < 20.0 else "go_around" if beyond else phase
        row = (time, PHASES.index(phase), item.attitude[2], DOCK_DEPTH, 1.5, attempt, along, cross)
        kept.append(f"vehicles/{vehicle}/mission", row)
        kept.append(f"vehicles/{vehicle}/command", (time, 0.05 * np.sin(time), 0.02, 150.0))
    row = (times[-1] + 0.1, PHASES.index("docked"), DOCK_HEADING, DOCK_DEPTH, 0.0, attempt, 0.0, 0.0)
    kept.append(f"vehicles/{vehicle}/mission", row)


def _estimates(kept, vehicle, times, truths, rng):
    """Errors are unit Ornstein-Uhlenbeck noise (15 s) times the sigmas that the covariance claims."""
    unit = rng.standard_normal(8)
    decay = np.exp(-0.5 / 15.0)
    for time, item in zip(times, truths, strict=True):
        unit = decay * unit + np.sqrt(1 - decay**2) * rng.standard_normal(8)
        horizontal = 0.2 + 0.01 * np.hypot(*item.position[:2])
        slow = 0.02 + 0.08 * np.exp(-time / 60.0)
        sigma = np.array([horizontal, horizontal, 0.02, 0.04, 0.03, 0.004, slow, slow])
        water = rotation(*item.attitude).T @ item.current
        through = item.nu[[0, 1, 5]] - [water[0], water[1], 0.0]
        mean = np.concatenate([item.position[:2], item.attitude[2:], through, item.current[:2]]) + sigma * unit
        mean[2] = wrap(mean[2])
        position = np.array([mean[0], mean[1], item.position[2] + 0.02])
        row = (time, mean, np.diag(sigma**2), position, mean[2], mean[3:6], mean[6:], time >= 20.0, int(time // 150.0))
        kept.append(f"vehicles/{vehicle}/estimate", row)


def _fixes(kept, vehicle, times, truths, rng):
    for sequence, (time, item) in enumerate(zip(times[30::50], truths[30::50], strict=True)):
        relative = rotation(0.0, 0.0, DOCK_HEADING).T @ (item.position - [0.0, 0.0, DOCK_DEPTH])
        outlier, lost = sequence % 13 == 5, sequence % 11 == 3
        value = relative + 0.003 * np.linalg.norm(relative) * rng.standard_normal(3) + (20.0 if outlier else 0.0)
        stamp = time - 0.04
        packet = np.array([*value, DOCK_HEADING, 0.0, 0.0, DOCK_DEPTH])
        received = np.nan if lost else stamp + 1.5
        kept.reading(vehicle, Reading("usbl", stamp, received, packet, sequence), lost, outlier)
        kept.reading(vehicle, Reading("compass", time, time, np.array([item.attitude[2], 0.0, 0.0]), sequence))
        kept.reading(vehicle, Reading("depth", time, time, item.position[2:], sequence))
        kept.reading(vehicle, Reading("feedback", time, time, np.zeros(5), sequence))
        if not lost:
            nis = 90.0 if outlier else float(rng.chisquare(3))
            row = (received, "usbl", stamp, sequence, not outlier, "gate" if outlier else "", nis)
            kept.append(f"vehicles/{vehicle}/measurements", row)
