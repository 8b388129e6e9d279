"""ROS 2 messages of a vehicle's sensors, as their drivers would publish them.

Variances are those of the sensors' data sheets, noise and bias together.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from auvsim.base.datum import Datum
from auvsim.base.frames import Array, euler_to_quaternion, flip, rotation
from auvsim.data.log import VehicleLog
from auvsim.exchange.ros_messages import Ros, Rows, Stream
from auvsim.identification import log_records
from auvsim.identification.signals import Signal
from auvsim.physics.scenes import GRAVITY
from auvsim.ros import types
from auvsim.ros.frames import enu_quaternion
from auvsim.ros.types import UNKNOWN
from auvsim.simulation.scenario import Scenario
from auvsim.vehicles import library, model_files

ATMOSPHERE = 101325.0  # [Pa]
_JOINTS = "sensor_msgs/msg/JointState"


def sensor(
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
    elif kind in ("fix", "gps"):
        message = "geometry_msgs/msg/PoseWithCovarianceStamped" if datum is None else "sensor_msgs/msg/NavSatFix"
        slow = sheet.bias if kind == "fix" else sheet.wander
        yield Stream(topic, message, _fixes(ros, log, name, frame, sheet.noise**2 + slow**2, datum))
    elif kind == "imu":
        yield Stream(topic, "sensor_msgs/msg/Imu", _imu(ros, log, name, frame, sheet))
    elif kind == "altimeter":
        yield Stream(topic, "sensor_msgs/msg/Range", _altitudes(ros, log, name, sheet))
    elif kind == "range":
        yield Stream(topic, "sensor_msgs/msg/Range", _ranges(ros, log, name, frame, sheet))
    elif kind == "feedback":
        for what in ("channels", "demand"):
            rows = _actuators(ros, log, name, plan, what)
            yield Stream(f"/{log.name}/{'actuators' if what == 'channels' else 'actuation'}", _JOINTS, rows)


def usbl(ros: Ros, log: VehicleLog, plan: Scenario) -> Iterator[Stream]:
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
        (t, came, ros.placed(t, np.array([*place, 0.0]), variance))
        for t, came, place in zip(stamps.tolist(), received.tolist(), places, strict=True)
    )
    yield Stream(f"{at}/position", "geometry_msgs/msg/PoseWithCovarianceStamped", rows)


def _readings(log: VehicleLog, name: str) -> Iterator[tuple[float, float, Array]]:
    """Stamp, arrival and value of the readings that arrived."""
    columns = log[name]
    for t, received, value in zip(columns["time"], columns["received"], columns["value"], strict=True):
        if not math.isnan(received):
            yield t, received, value


def _compass(ros: Ros, log: VehicleLog, name: str, frame: str, sheet: Any) -> Rows:
    tilt, heading = math.radians(sheet.tilt_noise_deg), math.hypot(sheet.heading_noise_deg, sheet.heading_bias_deg)
    covariance = np.diag([tilt**2, tilt**2, math.radians(heading) ** 2]).ravel()
    for t, received, (psi, pitch, roll) in _readings(log, name):
        attitude = ros.quaternion(enu_quaternion(euler_to_quaternion(roll, pitch, psi)))
        yield t, received, ros.inertial(t, frame, orientation=attitude, orientation_covariance=covariance)


def _gyro(ros: Ros, log: VehicleLog, name: str, frame: str, sheet: Any) -> Rows:
    variance = math.radians(sheet.noise_density_deg) ** 2 * sheet.rate + math.radians(sheet.bias_deg) ** 2
    covariance = (variance * np.eye(3)).ravel()
    for t, received, rates in _readings(log, name):
        rate = ros.vector(flip(rates))
        yield t, received, ros.inertial(t, frame, angular_velocity=rate, angular_velocity_covariance=covariance)


def _imu(ros: Ros, log: VehicleLog, name: str, frame: str, sheet: Any) -> Rows:
    rates = math.radians(sheet.gyro_noise_density_deg) ** 2 * sheet.rate + math.radians(sheet.gyro_bias_deg) ** 2
    forces = sheet.noise_density**2 * sheet.rate + sheet.bias**2
    for t, received, values in _readings(log, name):
        yield t, received, ros.inertial(
            t, frame,
            angular_velocity=ros.vector(flip(values[:3])), angular_velocity_covariance=(rates * np.eye(3)).ravel(),
            linear_acceleration=ros.vector(flip(values[3:])),
            linear_acceleration_covariance=(forces * np.eye(3)).ravel(),
        )  # fmt: skip


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


def _fixes(ros: Ros, log: VehicleLog, name: str, frame: str, variance: float, datum: Datum | None) -> Rows:
    for t, received, (north, east) in _readings(log, name):
        place = np.array([north, east, 0.0])
        if datum is not None:
            message = ros.satellite(t, frame, place, datum, np.array([variance, variance, UNKNOWN]))
        else:
            message = ros.placed(t, place, variance)
        yield t, received, message


def _altitudes(ros: Ros, log: VehicleLog, name: str, sheet: Any) -> Rows:
    """Ranges along the x axis of a frame that looks down the hull."""
    for t, received, (distance,) in _readings(log, name):
        yield t, received, ros.make(
            "sensor_msgs/msg/Range",
            header=ros.header(t, f"{log.name}/{name}"), radiation_type=0, field_of_view=math.radians(sheet.beam_deg),
            min_range=sheet.minimum_range, max_range=sheet.maximum_range, range=float(distance),
        )  # fmt: skip


def _ranges(ros: Ros, log: VehicleLog, name: str, frame: str, sheet: Any) -> Rows:
    for t, received, (distance,) in _readings(log, name):
        yield t, received, ros.make(
            "sensor_msgs/msg/Range",
            header=ros.header(t, frame), radiation_type=0, field_of_view=2.0 * math.pi, min_range=0.0,
            max_range=sheet.maximum, range=float(distance),
        )  # fmt: skip


def _actuators(ros: Ros, log: VehicleLog, name: str, plan: Scenario, what: str) -> Rows:
    """The channels as measured, or the demand that they amount to: rudder, elevator, shaft_speed or the like."""
    with model_files.given(log.log.models):
        actuation = library.vehicle(plan.vehicles[log.name].model).actuation
    if what == "channels":
        names, units = [f"{log.name}/{channel}" for channel in actuation.channels], list(actuation.units)
    else:
        names, units = [d.name for d in actuation.demands], [d.units for d in actuation.demands]
    for t, received, values in _readings(log, name):
        row = values if what == "channels" else np.array(actuation.effective(values.tolist()), dtype=float)
        yield t, received, ros.joints(t, names, units, row)


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
