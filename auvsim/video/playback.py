"""A trial log as something that moves: the state of everything that is drawn, at any time."""

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import InputError
from auvsim.base.frames import Array, flip, flip_quaternion
from auvsim.data.log import TrialLog
from auvsim.missions.docking.dock_frame import nose_position
from auvsim.missions.docking.metrics import fixes, phase_at
from auvsim.physics import scenery, world
from auvsim.physics.truth import DockPose
from auvsim.simulation import scenario
from auvsim.vehicles import library

FARTHEST = 1e4  # a vehicle farther from the dock than this has diverged [m]
# At 25 pictures a second a propeller of 25 revolutions a second would seem to stand still: it is shown slowed down.
PROPELLER_SLOWNESS = 17.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Belief:
    """What the estimator holds."""

    position: Array  # (3,) in MuJoCo's world [m]
    heading: float  # [rad]
    covariance: Array  # (2, 2) of north, east [m2]


@dataclass(frozen=True, kw_only=True, slots=True)
class Moment:
    """A trial at one time; places and directions in MuJoCo's world."""

    time: float  # [s]
    position: Array  # (3,) of the body origin [m]
    nose: Array  # (3,) [m]
    quaternion: Array  # (4,) wxyz
    heading: float  # [rad], clockwise from north
    speed: float  # over ground [m/s]
    current: Array  # (3,) velocity of the water [m/s]
    drift: Array  # (3,) way of the water since the start [m]
    range: float  # from the nose to the centre of the mouth [m]
    phase: int  # index into PHASES, -1 before the first
    attempt: int
    belief: Belief | None  # before the first fix there is none


class Playback:
    """The scene of a log and its motion, interpolated between samples.

    Args:
        log: of any status, with at least one finite sample of the truth.

    Raises:
        InputError: the log holds nothing to draw, or its scenario cannot be composed again.
    """

    def __init__(self, log: TrialLog) -> None:
        truth = log["truth"]
        sound = np.isfinite(truth["position"]).all(axis=1) & np.isfinite(truth["quaternion"]).all(axis=1)
        sound &= np.abs(np.nan_to_num(truth["position"], nan=np.inf)).max(axis=1, initial=0.0) < FARTHEST
        count = len(sound) if sound.all() else int(sound.argmin())
        if not count:
            raise InputError("the log holds no finite state of the vehicle: there is nothing to draw")
        self._sound = slice(0, count)
        self.log = log
        self.plan = scenario.from_yaml(str(log.attributes["scenario"]), "scenario in the log")
        vehicle, dock = library.vehicle(self.plan.vehicle.model), library.dock(self.plan.dock.model)
        self.pose = DockPose(depth=log.number("dock_depth"), heading=log.number("dock_heading"))
        self.model = world.compile_scene(
            world.compose(vehicle, dock, self.pose, self.plan.world, self.plan.rates.physics)
        )
        scenery.paint_sea_floor(self.model)
        self.data = mujoco.MjData(self.model)
        self.vehicle_name, self.nose = vehicle.name, vehicle.nose
        self._address(vehicle)
        self._truth_columns()
        self._belief_columns()

    def _address(self, vehicle: library.Vehicle) -> None:
        """Where in qpos the vehicle, its fins and its shaft are."""
        self._free = int(self.model.joint(f"{vehicle.name}/").qposadr[0])
        driven = [
            self.model.actuator(f"{vehicle.name}/{name}").trnid[0] for name in (*vehicle.allocation.names, "shaft")
        ]
        *self._fin_angles, self._shaft_angle = (int(self.model.jnt_qposadr[joint]) for joint in driven)

    def _truth_columns(self) -> None:
        truth, part = self.log["truth"], self._sound
        self.times = truth["time"][part]
        self.start, self.end = float(self.times[0]), float(self.times[-1])
        self.positions = flip(truth["position"][part])
        self.noses = flip(nose_position(self.log)[part])
        self.ranges = np.linalg.norm(self.noses - self.mouth, axis=1)
        self.phases = phase_at(self.log, self.times)
        quaternions = flip_quaternion(truth["quaternion"][part])
        turns = np.sign(np.sum(quaternions[1:] * quaternions[:-1], axis=1))  # q and -q are the same attitude
        quaternions[1:] *= np.cumprod(np.where(turns < 0.0, -1.0, 1.0))[:, np.newaxis]
        self._quaternions = quaternions
        self._headings = np.unwrap(truth["attitude"][part, 2])
        self._speeds = np.linalg.norm(truth["nu"][part, :3], axis=1)
        self._fins = truth["fins"][part]
        self._shaft = self._integral(truth["shaft_speed"][part][:, np.newaxis])[:, 0] / PROPELLER_SLOWNESS
        self._currents = flip(truth["current"][part])
        self._drift = self._integral(self._currents)

    def _integral(self, rates: Array) -> Array:
        """Integral (n, k) over time of rates (n, k), trapezoidal."""
        steps = 0.5 * (rates[1:] + rates[:-1]) * np.diff(self.times)[:, np.newaxis]
        return np.concatenate([np.zeros((1, rates.shape[1])), np.cumsum(steps, axis=0)])

    def _belief_columns(self) -> None:
        estimate = self.log["estimate"]
        places = estimate["position"]
        seen = (
            estimate["initialised"]
            & np.isfinite(places).all(axis=1)
            & (np.abs(places).max(axis=1, initial=0.0) < FARTHEST)
        )
        self.belief_times = estimate["time"][seen]
        self.belief_positions = flip(places[seen])
        self._belief_headings = np.unwrap(estimate["heading"][seen])
        self._covariances = np.nan_to_num(estimate["covariance"][seen][:, :2, :2])

    @property
    def mouth(self) -> Array:
        """(3,) centre of the dock's mouth in MuJoCo's world [m]."""
        return np.array([0.0, 0.0, -self.pose.depth])

    @property
    def axis(self) -> Array:
        """(3,) direction in which a vehicle enters the dock, in MuJoCo's world."""
        return np.array([math.cos(self.pose.heading), -math.sin(self.pose.heading), 0.0])

    def received_fixes(self) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Times of arrival (n,) [s], places (n, 3) in MuJoCo's world and whether the estimator took them in (n,)."""
        usbl, estimate = self.log["usbl"], self.log["estimate"]
        times, level = usbl["received"], fixes(self.log)
        arrived = np.isfinite(times) & (times <= self.end) & np.isfinite(level).all(axis=1)
        times, level = times[arrived], level[arrived]
        depths = np.interp(times, self.times, self.positions[:, 2])
        places = np.stack([level[:, 0], -level[:, 1], depths], axis=1)
        rises = np.concatenate([np.diff(estimate["refused"], prepend=0) > 0, [False]])
        taken = ~rises[np.searchsorted(estimate["time"], times)]
        return times, places, taken

    def at(self, time: float) -> Moment:
        """Everything at a time, held at its ends beyond them."""
        index, weight = _between(self.times, time)

        def mix(values: Array) -> Array:
            return (1.0 - weight) * values[index] + weight * values[min(index + 1, len(values) - 1)]

        quaternion = mix(self._quaternions)
        guidance = self.log["guidance"]
        now = int(np.searchsorted(guidance["time"], time, side="right")) - 1
        return Moment(
            time=time,
            position=mix(self.positions),
            nose=mix(self.noses),
            quaternion=quaternion / max(float(np.linalg.norm(quaternion)), 1e-9),
            heading=float(mix(self._headings)),
            speed=float(mix(self._speeds)),
            current=mix(self._currents),
            drift=mix(self._drift),
            range=float(mix(self.ranges)),
            phase=int(guidance["phase"][now]) if now >= 0 else -1,
            attempt=int(guidance["attempt"][now]) if now >= 0 else 1,
            belief=self._belief(time),
        )

    def _belief(self, time: float) -> Belief | None:
        if not len(self.belief_times) or time < self.belief_times[0]:
            return None
        index, weight = _between(self.belief_times, time)
        after = min(index + 1, len(self.belief_times) - 1)
        return Belief(
            position=(1.0 - weight) * self.belief_positions[index] + weight * self.belief_positions[after],
            heading=float((1.0 - weight) * self._belief_headings[index] + weight * self._belief_headings[after]),
            covariance=self._covariances[index],
        )

    def pose_model(self, moment: Moment) -> None:
        """Puts the scene's bodies where they are at that moment."""
        qpos, free = self.data.qpos, self._free
        qpos[free : free + 3], qpos[free + 3 : free + 7] = moment.position, moment.quaternion
        index, weight = _between(self.times, moment.time)
        after = min(index + 1, len(self.times) - 1)
        qpos[self._fin_angles] = (1.0 - weight) * self._fins[index] + weight * self._fins[after]
        qpos[self._shaft_angle] = (1.0 - weight) * self._shaft[index] + weight * self._shaft[after]
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)


def _between(times: Array, time: float) -> tuple[int, float]:
    """The sample before a time, and the weight of the one after it."""
    index = min(max(int(np.searchsorted(times, time, side="right")) - 1, 0), max(len(times) - 2, 0))
    if len(times) < 2:
        return 0, 0.0
    width = float(times[index + 1] - times[index])
    return index, min(max((time - float(times[index])) / width, 0.0), 1.0) if width > 0.0 else 0.0
