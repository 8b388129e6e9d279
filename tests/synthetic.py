"""Logs of made-up vehicles whose truth, errors and contacts are known in closed form."""

import math

import numpy as np
from scipy.interpolate import CubicSpline

from auvsim.acoustics.usbl import Usbl
from auvsim.base.frames import euler_to_quaternion, rotation, wrap
from auvsim.base.reading import Reading
from auvsim.data.log import Log, VehicleLog
from auvsim.data.recorder import Recorder
from auvsim.data.variables import Variable, run_groups, vehicle_groups
from auvsim.missions.docking.guidance import Docking
from auvsim.missions.mission import Mission
from auvsim.missions.registry import MISSIONS
from auvsim.navigation.estimate import PLANAR_STATES
from auvsim.physics.truth import Truth
from auvsim.sensors.registry import SENSORS

DOCK_NORTH, DOCK_EAST, DOCK_DEPTH = 3.0, -7.0, 5.0
DOCK = np.array([DOCK_NORTH, DOCK_EAST, DOCK_DEPTH])  # of the mouth
DOCK_HEADING = 0.6
NOSE = 0.8
CURRENT = np.array([0.2, -0.15, 0.0])
PHASES = Docking.phases
CHANNELS = {
    "rudder_upper": "rad",
    "rudder_lower": "rad",
    "plane_port": "rad",
    "plane_starboard": "rad",
    "shaft": "rad/s",
}
DEMANDS = {"rudder": "rad", "elevator": "rad", "shaft_speed": "rad/s"}
# Of a docking through a full scenario, whose model names the video composes again.
SCENARIO = f"""
structures: {{dock: {{north: {DOCK_NORTH}, east: {DOCK_EAST}, depth: {DOCK_DEPTH}}}}}
vehicles: {{remus100: {{start: {{range: 300.0}}}}}}
water: {{sea_floor: 40.0}}
"""
ATTRIBUTES = {"scenario": SCENARIO, "seed": 7, "trial": 0}
VEHICLE = {
    "model": "remus100", "nose": NOSE, "length": 1.6, "estimator": "made up", "controller": "torpedo", "dock": "dock",
    "usbl_structure": "dock",
}  # fmt: skip
STRUCTURE = {
    "model": "dock", "north": DOCK_NORTH, "east": DOCK_EAST, "depth": DOCK_DEPTH, "heading": DOCK_HEADING,
    "mouth_radius": 0.75, "throat_radius": 0.15, "cone_length": 1.03923, "throat_length": 0.4, "latched": 1.3,
    "transceiver_forward": 0.0, "transceiver_starboard": 0.0, "transceiver_down": 0.0,
}  # fmt: skip
# Along and cross track [m]: past the dock at the first attempt, into it at the second.
GO_AROUND = [(-290, 40), (-180, 18), (-90, 5), (-30, 2.2), (6, 2.0), (40, 20), (30, 70), (-40, 90), (-110, 60)]
GO_AROUND += [(-125, 15), (-80, 1), (-30, 0.1), (-0.5, 0.05)]
STRAIGHT = [(-300, 30), (-200, 15), (-100, 3), (-40, 0.2), (-0.5, 0.1)]


class Writer:
    """Records one vehicle of a log, which may have others."""

    def __init__(self, recorder: Recorder, vehicle: str) -> None:
        self.recorder, self.vehicle = recorder, vehicle

    def append(self, group: str, row) -> None:
        """A row of one of the vehicle's groups."""
        self.recorder.append(f"vehicles/{self.vehicle}/{group}", row)

    def truth(self, item: Truth) -> None:
        """A true state."""
        self.recorder.truth(self.vehicle, item)

    def reading(self, reading: Reading, *extra) -> None:
        """A reading, with its sensor's own columns."""
        self.recorder.reading(self.vehicle, reading, *extra)

    def event(self, time: float, kind: str, text: str) -> None:
        """An event of the vehicle."""
        self.recorder.event(time, self.vehicle, kind, text)

    def phase(self, time: float, name: str, attempt=1, heading=0.0, depth=5.0, speed=1.5, along=0.0, cross=0.0) -> None:
        """A row of a docking."""
        self.append("mission", (time, PHASES.index(name), heading, depth, speed, attempt, along, cross, 0.1, 0.05, 0.0))

    def estimate(self, time, position, heading, velocity, current, covariance, refused=0, initialised=True) -> None:
        """A row of the estimate, whose states are the planar ones."""
        mean = np.array([*position[:2], heading, *velocity, *current], dtype=float)
        views = (np.array(position, dtype=float), heading, np.array(velocity, dtype=float), mean[6:])
        self.append("estimate", (time, mean, covariance, *views, initialised, refused))

    def finish(self, status: str, **options) -> VehicleLog:
        """The vehicle's part of the finished log."""
        return self.recorder.finish(status, **options).vehicle(self.vehicle)


def writers(vehicles: dict[str, dict], structures: dict[str, dict], attributes=ATTRIBUTES) -> dict[str, Writer]:
    """Recorders of several vehicles in one log, by name; their attributes override VEHICLE, structures' STRUCTURE."""
    of_groups = {f"vehicles/{name}": {"mission": "docking", **VEHICLE, **own} for name, own in vehicles.items()}
    groups = {name: _groups(MISSIONS[str(of_groups[f"vehicles/{name}"]["mission"])]) for name in vehicles}
    of_groups |= {f"structures/{name}": {**STRUCTURE, **own} for name, own in structures.items()}
    recorder = Recorder(run_groups(groups), attributes, of_groups)
    return {name: Writer(recorder, name) for name in vehicles}


def _groups(mission: type[Mission]):
    sensors = {
        "compass": ({"value": Variable(("rpy",), "float64", "rad", "heading, pitch, roll")}, {}),
        "depth": ({"value": Variable(("down",), "float64", "m", "depth")}, {"down": 1}),
        "feedback": ({"value": Variable(("channel",), "float64", "rad, rad/s", "actuators")}, {"channel": 5}),
        "usbl": ({"value": Usbl.value, **Usbl.columns}, Usbl.sizes),
        **{name: ({"value": SENSORS[name].value}, SENSORS[name].sizes) for name in ("dvl", "gyro")},
    }
    demands = {name: Variable((), "float64", unit, name) for name, unit in DEMANDS.items()}
    return vehicle_groups(
        sensors=sensors, mission=(mission.phases, mission.variables), demands=demands, channels=CHANNELS,
        states=PLANAR_STATES,
    )  # fmt: skip


def writer(mission: str = "docking", **attributes) -> Writer:
    """A recorder of a lone vehicle."""
    return writers({"remus100": {"mission": mission, **attributes}}, {"dock": {}})["remus100"]


def empty_log(status: str = "interrupted") -> VehicleLog:
    """A log in which nothing was ever logged."""
    return writer().finish(status, wall_time=0.5)


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
        actuators=np.array([0.01, -0.02, 0.03, -0.04, 150.0]),
    )


def from_dock(along, cross, down=0.0, heading=DOCK_HEADING, dock=DOCK):
    """NED position (3,) of a point in a dock's frame."""
    return rotation(0.0, 0.0, heading) @ np.array([along, cross, down]) + dock


def trial_log(waypoints=STRAIGHT, seed=0, speed=1.5) -> VehicleLog:
    """A plausible trial along a spline through waypoints (along, cross track [m]) with consistent estimates."""
    log = writer()
    record(log, waypoints, seed, speed)
    return log.finish("complete", wall_time=0.6)


def record(log: Writer, waypoints=STRAIGHT, seed=0, speed=1.5, dock=DOCK, heading=DOCK_HEADING) -> None:
    """Records such a trial, to a dock at a place."""
    waypoints = np.asarray(waypoints, dtype=float)
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(waypoints, axis=0).T))])
    path = CubicSpline(lengths, waypoints)
    times = np.arange(0.0, lengths[-1] / speed, 0.1)
    rng = np.random.default_rng(seed)
    truths = [_truth_on(path, t, speed, dock, heading) for t in times]
    for item in truths:
        log.truth(item)
    inside = rotation(0.0, 0.0, heading).T @ (np.array([item.position for item in truths]) - dock).T
    _mission(log, times, truths, inside.T)
    _estimates(log, times[::5], truths[::5], rng, dock)
    _fixes(log, times, truths, inside.T, rng, heading)
    end = times[-1]
    for i, force in enumerate((40.0, 90.0, 30.0)):
        log.append("contact", (end - 0.03 + i * 0.01, force, sum((40.0, 90.0, 30.0)[: i + 1]) * 0.01, "dock"))
    log.event(end, "docked", "latched at 1.5 m/s")


def _truth_on(path, time, speed, dock, heading):
    along, cross = path(speed * time)
    slope = path(speed * time, 1) * speed
    velocity = rotation(0.0, 0.0, heading)[:, :2] @ slope + [0.0, 0.0, 0.02 * np.cos(0.05 * time)]
    course = np.arctan2(velocity[1] - CURRENT[1], velocity[0] - CURRENT[0])
    position = from_dock(along, cross, 0.4 * np.sin(0.05 * time) - 2.0 * np.exp(-time / 30.0), heading, dock)
    return truth(time, position, (0.0, 0.03 * np.sin(0.2 * time), course), velocity, CURRENT)


def _mission(log, times, truths, inside):
    attempt, beyond = 1, False
    for time, item, (along, cross, _) in zip(times, truths, inside, strict=True):
        if along > 3.0:
            beyond = True
        if beyond and along < -100.0:
            attempt, beyond = 2, False
        distance = -along
        phase = "homing" if distance > 120.0 else "approach" if distance > 25.0 else "final"
        phase = "search" if time < 20.0 else "go_around" if beyond else phase
        log.phase(time, phase, attempt, item.attitude[2], DOCK_DEPTH, 1.5, along, cross)
        log.append("command", (time, 0.05 * np.sin(time), 0.02, 150.0))
    log.phase(times[-1] + 0.1, "docked", attempt, DOCK_HEADING, DOCK_DEPTH, 0.0)


def _estimates(log, times, truths, rng, dock):
    """Errors are unit Ornstein-Uhlenbeck noise (15 s) times the sigmas that the covariance claims."""
    unit = rng.standard_normal(8)
    decay = np.exp(-0.5 / 15.0)
    for time, item in zip(times, truths, strict=True):
        unit = decay * unit + np.sqrt(1 - decay**2) * rng.standard_normal(8)
        along = np.hypot(*(item.position - dock)[:2])
        horizontal = 0.2 + 0.01 * along
        slow = 0.02 + 0.08 * np.exp(-time / 60.0)
        sigma = np.array([horizontal, horizontal, 0.02, 0.04, 0.03, 0.004, slow, slow])
        error = sigma * unit
        water = rotation(*item.attitude).T @ item.current
        position = item.position + np.array([error[0], error[1], 0.02])
        velocity = item.nu[[0, 1, 5]] - [water[0], water[1], 0.0] + error[3:6]
        row = (time, position, wrap(item.attitude[2] + error[2]), velocity, item.current[:2] + error[6:8])
        log.estimate(*row, np.diag(sigma**2), int(time // 150.0), time >= 20.0)


def _fixes(log, times, truths, inside, rng, heading):
    """Fixes every 5 s, of which the estimator refuses the outliers and one other."""
    for sequence, (time, item, relative) in enumerate(zip(times[30::50], truths[30::50], inside[30::50], strict=True)):
        outlier, lost = sequence % 13 == 5, sequence % 11 == 3
        value = relative + 0.003 * np.linalg.norm(relative) * rng.standard_normal(3) + (20.0 if outlier else 0.0)
        stamp = time - 0.04
        packet = np.array([*value, heading, 0.0, 0.0, DOCK_DEPTH])
        received = np.nan if lost else stamp + 1.5
        log.reading(Reading("usbl", stamp, received, packet, sequence), lost, outlier)
        log.reading(Reading("compass", time, time, np.array([item.attitude[2], 0.0, 0.0]), sequence))
        log.reading(Reading("depth", time, time, item.position[2:], sequence))
        log.reading(Reading("feedback", time, time, np.zeros(5), sequence))
        if not lost:
            reason = "outlier" if outlier else "too_old" if sequence == 9 else ""
            log.append("measurements", (received, "usbl", stamp, sequence, not reason, reason, math.nan))
    log.append("measurements", (0.5, "compass", 0.5, -1, False, "not_started", math.nan))
    log.append("measurements", (200.0, "usbl", 2.96, 0, False, "duplicate", math.nan))  # a second copy of the first


def fleet_log() -> Log:
    """Three vehicles: two dock far apart, the second later and at another dock; the third keeps a straight track."""
    docks = {"west": {"north": 20.0, "east": -200.0, "heading": 2.0}, "east": {"north": -30.0, "east": 180.0}}
    vehicles = {
        "auv_1": {"dock": "west", "usbl_structure": "west"},
        "auv_2": {"dock": "east", "usbl_structure": "east"},
        "auv_3": {"dock": "", "usbl_structure": "west", "mission": "track", "mission_settings": TRACK},
    }
    found = writers(vehicles, docks, {**ATTRIBUTES, "scenario": FLEET_SCENARIO})
    west = np.array([20.0, -200.0, 5.0])
    record(found["auv_1"], [(-80, 9), (-40, 0.3), (-0.5, 0.1)], 1, dock=west, heading=2.0)
    for time in np.arange(53.7, 202.0, 0.1):  # held in its dock
        found["auv_1"].truth(truth(time, from_dock(-0.5, 0.1, 0.0, 2.0, west), (0.0, 0.0, 2.0), (0.0, 0.0, 0.0)))
    record(found["auv_2"], STRAIGHT, 2, dock=np.array([-30.0, 180.0, 5.0]))
    third = found["auv_3"]
    for time in np.arange(0.0, 120.0, 0.1):
        third.truth(truth(time, (1.5 * time, 10.0, 12.0), (0.0, 0.0, 0.0)))
        third.append("mission", (time, 0 if time < 5.0 else 1, 0.0, 12.0, 1.5, 1, 0.25))
        if round(10 * time) % 5 == 0:
            third.estimate(time, (1.5 * time + 0.3, 10.4, 13.2), 0.0, (1.5, 0, 0), (0, 0), np.eye(8) * 0.04)
    return third.finish("complete").log


TRACK = "{kind: track, pattern: {kind: waypoints, points: [[0.0, 5.0], [500.0, 5.0]]}}"  # 5 m beside where it goes
FLEET_SCENARIO = """
structures:
  west: {north: 20.0, east: -200.0, depth: 5.0}
  east: {north: -30.0, east: 180.0, depth: 5.0}
vehicles:
  auv_1: {mission: {kind: docking, dock: west}}
  auv_2: {mission: {kind: docking, dock: east}}
  auv_3: {start: {north: 0.0, east: 10.0}, sensors: {usbl: {dock: west}}, mission: {kind: track}}
"""
