"""One vehicle's log as ROS 2 messages: truth and estimate as odometry, every sensor as its driver would publish it.

World frame `map`: east, north, up from the datum. Body frame `NAME/base_link`: forward, port, up. Rudder and planes
keep the log's signs (a positive rudder turns to starboard), as joints have axes of their own; the DVL's message is
forward, starboard, down by its own definition. Stamps are the simulated time at which a reading was true; messages are
recorded when they arrived, lost ones never. Variances are those of the sensors' data sheets, noise and bias together.
"""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from auvsim.base.datum import Datum
from auvsim.base.frames import Array, euler_to_quaternion, flip, rotation
from auvsim.data.log import VehicleLog
from auvsim.identification import log_records
from auvsim.identification.signals import Signal
from auvsim.physics.scenes import GRAVITY
from auvsim.ros import types
from auvsim.ros.frames import enu, enu_quaternion
from auvsim.simulation.scenario import Scenario
from auvsim.simulation.sensor_settings import on_board
from auvsim.vehicles import library

MAP = "map"
UNKNOWN = 1e6  # variance of what is not estimated
ATMOSPHERE = 101325.0  # [Pa]
_PLANAR = ("north", "east", "heading", "surge", "sway", "yaw_rate", "current_north", "current_east")
Rows = Iterator[tuple[float, float, Any]]  # stamp [s], when recorded [s], message


class Stream(NamedTuple):
    """The messages of one topic."""

    topic: str
    type: str
    rows: Rows


class Ros:
    """Makes messages, with numbers and arrays as their classes want them."""

    def __init__(self) -> None:
        self._types = types.store().types

    def make(self, name: str, /, **fields: Any) -> Any:
        """A message of a type `package/msg/Name`."""
        return self._types[name](**fields)

    def time(self, stamp: float) -> Any:
        """A stamp [s]."""
        seconds, rest = divmod(round(stamp * 1e9), 1_000_000_000)
        return self.make("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)

    def header(self, stamp: float, frame: str) -> Any:
        """A header."""
        return self.make("std_msgs/msg/Header", stamp=self.time(stamp), frame_id=frame)

    def vector(self, values: Any, name: str = "Vector3") -> Any:
        """A Vector3 or Point of three numbers."""
        x, y, z = (float(v) for v in values)
        return self.make(f"geometry_msgs/msg/{name}", x=x, y=y, z=z)

    def quaternion(self, wxyz: Array) -> Any:
        """A quaternion."""
        w, x, y, z = wxyz.tolist()
        return self.make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def pose(self, position: Array, quaternion: Array, covariance: Array) -> Any:
        """A pose in ENU with its covariance (6, 6), of positions and attitudes in NED."""
        pose = self.make(
            "geometry_msgs/msg/Pose",
            position=self.vector(enu(position), "Point"), orientation=self.quaternion(enu_quaternion(quaternion)),
        )  # fmt: skip
        return self.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=covariance.ravel())

    def twist(self, linear: Array, angular: Array) -> Any:
        """A twist, of whatever axes the numbers are in."""
        return self.make("geometry_msgs/msg/Twist", linear=self.vector(linear), angular=self.vector(angular))


def streams(log: VehicleLog, plan: Scenario, datum: Datum | None) -> Iterator[Stream]:
    """All topics of a vehicle.

    Args:
        log: Of the vehicle.
        plan: The scenario of the run, for the sensors' data sheets.
        datum: Where the origin is; None: positions from elsewhere are poses in `map`, not satellite fixes.
    """
    ros, at = Ros(), f"/{log.name}"
    own = plan.vehicles[log.name]
    yield Stream(f"{at}/truth/odometry", "nav_msgs/msg/Odometry", _truth(ros, log))
    yield Stream("/tf", "tf2_msgs/msg/TFMessage", _transforms(ros, log))
    for name, rows in (("current", _current(ros, log)), ("velocity_through_water", _through_water(ros, log))):
        yield Stream(f"{at}/truth/{name}", "geometry_msgs/msg/TwistStamped", rows)
    if datum is not None:
        yield Stream(f"{at}/truth/fix", "sensor_msgs/msg/NavSatFix", _true_fixes(ros, log, datum))
    if "estimate" in log:
        gauge = own.sensors.depth
        rows = _estimates(ros, log, gauge.noise**2 + gauge.bias**2)
        yield Stream(f"{at}/estimate/odometry", "nav_msgs/msg/Odometry", rows)
    if "command" in log:
        yield Stream(f"{at}/command", "sensor_msgs/msg/JointState", _commands(ros, log))
    for name, settings in on_board(own.sensors):
        if name in log and name != "usbl":
            kind = getattr(settings, "kind", name)
            yield from _sensor(ros, log, name, kind, settings, plan, datum)
    if "usbl" in log and "compass" in log:
        yield from _usbl(ros, log, plan)


def _truth(ros: Ros, log: VehicleLog) -> Rows:
    truth, exact = log["truth"], np.zeros((6, 6))
    for t, place, q, nu in zip(*(truth[k] for k in ("time", "position", "quaternion", "nu")), strict=True):
        twist = ros.make(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=ros.twist(flip(nu[:3]), flip(nu[3:])), covariance=exact.ravel(),
        )  # fmt: skip
        yield t, t, _odometry(ros, log, t, ros.pose(place, q, exact), twist)


def _odometry(ros: Ros, log: VehicleLog, t: float, pose: Any, twist: Any) -> Any:
    return ros.make(
        "nav_msgs/msg/Odometry",
        header=ros.header(t, MAP), child_frame_id=f"{log.name}/base_link", pose=pose, twist=twist,
    )  # fmt: skip


def _transforms(ros: Ros, log: VehicleLog) -> Rows:
    truth = log["truth"]
    for t, place, q in zip(*(truth[k] for k in ("time", "position", "quaternion")), strict=True):
        transform = ros.make(
            "geometry_msgs/msg/Transform",
            translation=ros.vector(enu(place)), rotation=ros.quaternion(enu_quaternion(q)),
        )  # fmt: skip
        stamped = ros.make(
            "geometry_msgs/msg/TransformStamped",
            header=ros.header(t, MAP), child_frame_id=f"{log.name}/base_link", transform=transform,
        )  # fmt: skip
        yield t, t, ros.make("tf2_msgs/msg/TFMessage", transforms=[stamped])


def _current(ros: Ros, log: VehicleLog) -> Rows:
    for t, current in zip(log["truth"]["time"], log["truth"]["current"], strict=True):
        twist = ros.twist(enu(current), np.zeros(3))
        yield t, t, ros.make("geometry_msgs/msg/TwistStamped", header=ros.header(t, MAP), twist=twist)


def _through_water(ros: Ros, log: VehicleLog) -> Rows:
    truth, frame = log["truth"], f"{log.name}/base_link"
    for t, attitude, nu, current in zip(*(truth[k] for k in ("time", "attitude", "nu", "current")), strict=True):
        through = nu[:3] - rotation(*attitude.tolist()).T @ current
        twist = ros.twist(flip(through), flip(nu[3:]))
        yield t, t, ros.make("geometry_msgs/msg/TwistStamped", header=ros.header(t, frame), twist=twist)


def _true_fixes(ros: Ros, log: VehicleLog, datum: Datum) -> Rows:
    truth = log["truth"]
    every = max(1, round(1.0 / float(np.median(np.diff(truth["time"])))))
    for t, place in zip(truth["time"][::every], truth["position"][::every], strict=True):
        yield t, t, _satellite(ros, t, f"{log.name}/base_link", place, datum, np.zeros(3))


def _satellite(ros: Ros, t: float, frame: str, place: Array, datum: Datum, variances: Array) -> Any:
    geodetic = datum.geodetic(place)
    return ros.make(
        "sensor_msgs/msg/NavSatFix",
        header=ros.header(t, frame),
        status=ros.make("sensor_msgs/msg/NavSatStatus", status=0, service=1),
        latitude=float(geodetic.latitude), longitude=float(geodetic.longitude), altitude=float(geodetic.height),
        position_covariance=np.diag(variances).ravel(), position_covariance_type=2,
    )  # fmt: skip


def _estimates(ros: Ros, log: VehicleLog, depth_variance: float) -> Rows:
    """Odometry of the estimate once it is initialised: velocity over ground by that through the water and current."""
    columns = log["estimate"]
    names = log.table("estimate")["mean"].labels
    keys = ("time", "position", "heading", "velocity", "current", "covariance", "initialised")
    for t, place, heading, (u, v, r), (north, east), covariance, there in zip(*(columns[k] for k in keys), strict=True):
        if not there:
            continue
        c, s = math.cos(heading), math.sin(heading)
        pose, twist = covariances(covariance, names, heading, (north, east), depth_variance)
        ground = np.array([u + c * north + s * east, v - s * north + c * east, 0.0])
        message = ros.make(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=ros.twist(flip(ground), flip(np.array([0.0, 0.0, r]))), covariance=twist.ravel(),
        )  # fmt: skip
        yield t, t, _odometry(ros, log, t, ros.pose(place, euler_to_quaternion(0.0, 0.0, heading), pose), message)


def covariances(
    covariance: Array, names: tuple[str, ...], heading: float, current: tuple[float, float], depth_variance: float
) -> tuple[Array, Array]:
    """Covariances (6, 6) of an odometry message: of the pose in ENU, and of the twist over ground in the body.

    Args:
        covariance: (n, n) of the states.
        names: Of the states.
        heading: [rad].
        current: North, east [m/s].
        depth_variance: Of the gauge [m2].
    """
    known = [k for k, name in enumerate(_PLANAR) if name in names]
    P = np.zeros((8, 8))
    P[np.ix_(known, known)] = covariance[np.ix_(*2 * ([names.index(_PLANAR[k]) for k in known],))]
    c, s = math.cos(heading), math.sin(heading)
    north, east = current
    # (6, 8) east, north, yaw about up; then over ground forward, port, yaw rate about up, by the planar states.
    J = np.zeros((6, 8))
    J[0, 1] = J[1, 0] = 1.0
    J[2, 2], J[5, 5] = -1.0, -1.0
    J[3, [3, 6, 7, 2]] = 1.0, c, s, c * east - s * north
    J[4, [4, 6, 7, 2]] = -1.0, s, -c, c * north + s * east
    Q = J @ P @ J.T
    pose, twist = np.diag(np.full(6, UNKNOWN)), np.diag(np.full(6, UNKNOWN))
    for target, axes, first in ((pose, (0, 1, 5), 0), (twist, (0, 1, 5), 3)):
        there = [k for k in range(3) if Q[first + k, first + k] > 0.0]
        at = [axes[k] for k in there]
        target[np.ix_(at, at)] = Q[np.ix_([first + k for k in there], [first + k for k in there])]
    pose[2, 2] = depth_variance
    return pose, twist


def _joints(ros: Ros, t: float, names: list[str], units: list[str], values: Array) -> Any:
    """Angles as positions, speeds as velocities, forces and moments as efforts; NaN in the other two."""
    position, velocity, effort = (np.full(len(names), math.nan) for _ in range(3))
    for k, (unit, value) in enumerate(zip(units, values.tolist(), strict=True)):
        (velocity if unit.endswith("/s") else effort if unit.startswith("N") else position)[k] = value
    return ros.make(
        "sensor_msgs/msg/JointState",
        header=ros.header(t, ""), name=names, position=position, velocity=velocity, effort=effort,
    )  # fmt: skip


def _commands(ros: Ros, log: VehicleLog) -> Rows:
    table = {name: variable for name, variable in log.table("command").items() if name != "time"}
    values = np.column_stack([log["command"][name] for name in table]).astype(float)
    names, units = [f"{name}_command" for name in table], [variable.units for variable in table.values()]
    for t, row in zip(log["command"]["time"], values, strict=True):
        yield t, t, _joints(ros, t, names, units, row)


def _readings(log: VehicleLog, name: str) -> Iterator[tuple[float, float, Array]]:
    """Stamp, arrival and value of the readings that arrived."""
    columns = log[name]
    for t, received, value in zip(columns["time"], columns["received"], columns["value"], strict=True):
        if not math.isnan(received):
            yield t, received, value


def _sensor(
    ros: Ros, log: VehicleLog, name: str, kind: str, sheet: Any, plan: Scenario, datum: Datum | None
) -> Iterator[Stream]:
    """The topics of a sensor; none of one that ROS has no message for."""
    topic, frame = f"/{log.name}/{name}", f"{log.name}/base_link"
    if kind == "compass":
        yield Stream(topic, "sensor_msgs/msg/Imu", _compass(ros, log, name, frame, sheet))
    elif kind == "gyro":
        yield Stream(topic, "sensor_msgs/msg/Imu", _gyro(ros, log, name, frame, sheet))
    elif kind == "depth":
        scale = plan.water.density * GRAVITY
        yield Stream(topic, "sensor_msgs/msg/FluidPressure", _pressure(ros, log, name, frame, sheet, scale))
    elif kind == "dvl":
        for mode, track in ((1, "bottom"), (2, "water")):
            yield Stream(f"{topic}/{track}", types.DVL, _dvl(ros, log, name, sheet, mode))
    elif kind == "fix":
        message = "geometry_msgs/msg/PoseWithCovarianceStamped" if datum is None else "sensor_msgs/msg/NavSatFix"
        yield Stream(topic, message, _fixes(ros, log, name, frame, sheet, datum))
    elif kind == "range":
        yield Stream(topic, "sensor_msgs/msg/Range", _ranges(ros, log, name, frame, sheet))
    elif kind == "feedback":
        for what in ("channels", "demand"):
            rows = _actuators(ros, log, name, plan, what)
            yield Stream(f"/{log.name}/{'actuators' if what == 'channels' else 'actuation'}", _JOINTS, rows)


_JOINTS = "sensor_msgs/msg/JointState"


def _inertial(ros: Ros, t: float, frame: str, **known: Any) -> Any:
    """An Imu message that knows its attitude or its rates, and says -1 of the rest."""
    lacking = np.array([-1.0, *[0.0] * 8])
    fields = {
        "orientation": ros.quaternion(np.array([1.0, 0.0, 0.0, 0.0])),
        "angular_velocity": ros.vector(np.zeros(3)),
        "linear_acceleration": ros.vector(np.zeros(3)),
        **{f"{name}_covariance": lacking for name in ("orientation", "angular_velocity", "linear_acceleration")},
    }
    return ros.make("sensor_msgs/msg/Imu", header=ros.header(t, frame), **fields | known)


def _compass(ros: Ros, log: VehicleLog, name: str, frame: str, sheet: Any) -> Rows:
    tilt, heading = math.radians(sheet.tilt_noise_deg), math.hypot(sheet.heading_noise_deg, sheet.heading_bias_deg)
    covariance = np.diag([tilt**2, tilt**2, math.radians(heading) ** 2]).ravel()
    for t, received, (psi, pitch, roll) in _readings(log, name):
        attitude = ros.quaternion(enu_quaternion(euler_to_quaternion(roll, pitch, psi)))
        yield t, received, _inertial(ros, t, frame, orientation=attitude, orientation_covariance=covariance)


def _gyro(ros: Ros, log: VehicleLog, name: str, frame: str, sheet: Any) -> Rows:
    variance = math.radians(sheet.noise_density_deg) ** 2 * sheet.rate + math.radians(sheet.bias_deg) ** 2
    covariance = (variance * np.eye(3)).ravel()
    for t, received, rates in _readings(log, name):
        rate = ros.vector(flip(rates))
        yield t, received, _inertial(ros, t, frame, angular_velocity=rate, angular_velocity_covariance=covariance)


def _pressure(ros: Ros, log: VehicleLog, name: str, frame: str, sheet: Any, scale: float) -> Rows:
    variance = scale**2 * (sheet.noise**2 + sheet.bias**2)
    for t, received, (depth,) in _readings(log, name):
        pressure = ATMOSPHERE + scale * float(depth)
        yield t, received, ros.make(
            "sensor_msgs/msg/FluidPressure",
            header=ros.header(t, frame), fluid_pressure=pressure, variance=variance,
        )  # fmt: skip


def _dvl(ros: Ros, log: VehicleLog, name: str, sheet: Any, mode: int) -> Rows:
    """One track, where it is locked; mode 1 over ground, 2 through the water."""
    first, noise = (0, sheet.bottom_noise) if mode == 1 else (3, sheet.water_noise)
    covariance = np.diag(np.square(noise) + sheet.bias**2).ravel()
    none = np.full(4, -1.0, dtype=np.float32)
    for t, received, values in _readings(log, name):
        velocity = values[first : first + 3]
        if not np.isfinite(velocity).all():
            continue
        yield t, received, ros.make(
            types.DVL,
            header=ros.header(t, f"{log.name}/dvl"), velocity_mode=mode, dvl_type=0, velocity=ros.vector(velocity),
            velocity_covar=covariance, altitude=math.nan, course_gnd=math.atan2(velocity[1], velocity[0]),
            speed_gnd=float(np.hypot(velocity[0], velocity[1])), num_good_beams=4, sound_speed=1500.0,
            beam_ranges_valid=False, beam_velocities_valid=False, beam_unit_vec=[ros.vector(np.zeros(3))] * 4,
            range=np.full(4, math.nan), range_covar=none, beam_quality=none, beam_velocity=none,
            beam_velocity_covar=none,
        )  # fmt: skip


def _fixes(ros: Ros, log: VehicleLog, name: str, frame: str, sheet: Any, datum: Datum | None) -> Rows:
    variance = sheet.noise**2 + sheet.bias**2
    for t, received, (north, east) in _readings(log, name):
        place = np.array([north, east, 0.0])
        if datum is not None:
            message = _satellite(ros, t, frame, place, datum, np.array([variance, variance, UNKNOWN]))
        else:
            message = _placed(ros, t, place, variance)
        yield t, received, message


def _placed(ros: Ros, t: float, place: Array, variance: float) -> Any:
    """A horizontal position [m] in `map`, of no depth and attitude."""
    covariance = np.diag([variance, variance, *[UNKNOWN] * 4])
    pose = ros.pose(place, euler_to_quaternion(0.0, 0.0, 0.0), covariance)
    return ros.make("geometry_msgs/msg/PoseWithCovarianceStamped", header=ros.header(t, MAP), pose=pose)


def _ranges(ros: Ros, log: VehicleLog, name: str, frame: str, sheet: Any) -> Rows:
    for t, received, (distance,) in _readings(log, name):
        yield t, received, ros.make(
            "sensor_msgs/msg/Range",
            header=ros.header(t, frame), radiation_type=0, field_of_view=2.0 * math.pi, min_range=0.0,
            max_range=sheet.maximum, range=float(distance),
        )  # fmt: skip


def _actuators(ros: Ros, log: VehicleLog, name: str, plan: Scenario, what: str) -> Rows:
    """The channels as measured, or the demand that they amount to: rudder, elevator, shaft_speed or the like."""
    with library.given(log.log.models):
        actuation = library.vehicle(plan.vehicles[log.name].model).actuation
    if what == "channels":
        names, units = [f"{log.name}/{channel}" for channel in actuation.channels], list(actuation.units)
    else:
        names, units = [d.name for d in actuation.demands], [d.units for d in actuation.demands]
    for t, received, values in _readings(log, name):
        row = values if what == "channels" else np.array(actuation.effective(values.tolist()), dtype=float)
        yield t, received, _joints(ros, t, names, units, row)


def _usbl(ros: Ros, log: VehicleLog, plan: Scenario) -> Iterator[Stream]:
    """The packets of the dock's USBL, and the positions of the vehicle that they say."""
    sheet = plan.vehicles[log.name].sensors.usbl
    at = f"/{log.name}/usbl"
    yield Stream(at, types.USBL, _packets(ros, log, sheet, plan.network.sound_speed))
    compass = log["compass"]
    heading = Signal(times=compass["time"], values=np.unwrap(compass["value"][:, 0]))
    places, stamps, received = log_records.places(log, heading, sheet.transponder)
    sigmas = [sheet.sigma(float(np.linalg.norm(p))) for p in log["usbl"]["value"][:, :3]]
    variance = float(np.median(sigmas)) ** 2 if sigmas else UNKNOWN
    rows = (
        (t, came, _placed(ros, t, np.array([*place, 0.0]), variance))
        for t, came, place in zip(stamps.tolist(), received.tolist(), places, strict=True)
    )
    yield Stream(f"{at}/position", "geometry_msgs/msg/PoseWithCovarianceStamped", rows)


def _packets(ros: Ros, log: VehicleLog, sheet: Any, sound_speed: float) -> Rows:
    """Each fix as the dock's transceiver has it: relative position in NED, range and angles in the dock's frame."""
    source = str(log.attributes.get("usbl_structure") or log.attributes.get("dock", ""))
    for t, received, value in _readings(log, "usbl"):
        relative, (heading, pitch, roll) = value[:3], value[3:6].tolist()
        distance = float(np.linalg.norm(relative))
        bearing, elevation = math.atan2(relative[1], relative[0]), math.asin(-relative[2] / max(distance, 1e-9))
        yield t, received, ros.make(
            types.USBL,
            header=ros.header(t, f"{source}/transceiver"), source_id=0, source_name=log.name,
            source_frame_id=f"{log.name}/base_link", type=3,
            relative_position=ros.vector(rotation(roll, pitch, heading) @ relative, "Point"), range=distance,
            bearing=bearing, elevation=elevation, sound_speed=sound_speed, bearing_raw=bearing, elevation_raw=elevation,
            position_covariance=sheet.sigma(distance) ** 2,
        )  # fmt: skip


def events(log: Any) -> Stream:
    """The run's events, as nodes log them."""
    ros, rows = Ros(), log.groups.get("event", {"time": []})

    def messages() -> Rows:
        for k, t in enumerate(rows["time"]):
            yield t, t, ros.make(
                "rcl_interfaces/msg/Log",
                stamp=ros.time(t), level=20, name=str(rows["vehicle"][k]) or "run",
                msg=f"{rows['kind'][k]}: {rows['text'][k]}", file="", function="", line=0,
            )  # fmt: skip

    return Stream("/rosout", "rcl_interfaces/msg/Log", messages())
