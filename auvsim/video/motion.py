"""One vehicle of a log as something that moves; places and directions in MuJoCo's world."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvsim.analysis.estimates import fix_fates, fixes
from auvsim.base.errors import InputError
from auvsim.base.frames import Array, flip, flip_quaternion
from auvsim.data.log import VehicleLog
from auvsim.data.phases import phase_at
from auvsim.missions.docking.dock_frame import nose_position
from auvsim.missions.docking.guidance import Docking

FARTHEST = 1e4  # a vehicle farther from the origin than this has diverged [m]
# At 25 pictures a second a propeller of 25 revolutions a second would seem to stand still: it is shown slowed down.
PROPELLER_SLOWNESS = 17.0
LANES = "lanes"  # phase of a survey
AT_END = ("docked", "aborted", "done")  # phases in which a mission has come to its end


@dataclass(frozen=True, kw_only=True, slots=True)
class Belief:
    """What the estimator holds."""

    position: Array  # (3,) [m]
    heading: float  # [rad]
    covariance: Array  # (2, 2) of north, east [m2]
    age: float  # time since the last estimate of all [s]


@dataclass(frozen=True, kw_only=True, slots=True)
class VehicleMoment:
    """A vehicle at one time."""

    position: Array  # (3,) of the body origin [m]
    nose: Array  # (3,) [m]
    quaternion: Array  # (4,) wxyz
    heading: float  # [rad], clockwise from north
    speed: float  # over ground [m/s]
    current: Array  # (3,) velocity of the water [m/s]
    drift: Array  # (3,) way of the water since the start [m]
    actuators: Array  # (n,) [rad, rad/s]
    turns: Array  # (n,) their integrals, slowed down [rad s, rad]
    range: float  # from the nose to the centre of the mission's mouth [m]; NaN without one
    phase: int  # index into the mission's phases, -1 before the first
    count: str  # number of the attempt or waypoint; empty where there is none
    belief: Belief | None  # before the first fix there is none


@dataclass(frozen=True, kw_only=True, slots=True)
class Fixes:
    """Position fixes that arrived, in order of the log."""

    times: Array  # (n,) of arrival [s]
    places: Array  # (n, 3) [m], at the vehicle's true depth then
    reasons: NDArray[Any]  # (n,) why the estimator refused them, as text; empty where it did not


class Motion:
    """A vehicle's motion, interpolated between the samples of its log.

    Args:
        log: with at least one finite sample of the truth.

    Raises:
        InputError: it holds none.
    """

    def __init__(self, log: VehicleLog) -> None:
        truth = log["truth"]
        sound = np.isfinite(truth["position"]).all(axis=1) & np.isfinite(truth["quaternion"]).all(axis=1)
        sound &= np.abs(np.nan_to_num(truth["position"], nan=np.inf)).max(axis=1, initial=0.0) < FARTHEST
        count = len(sound) if sound.all() else int(sound.argmin())
        if not count:
            raise InputError(f"the log holds no finite state of '{log.name}': there is nothing to draw")
        self.log, self.name, self.phase_names = log, log.name, log.phases
        self._truth_columns(slice(0, count))
        self._belief_columns()
        mission = log["mission"]
        self._mission_times = mission["time"]
        self._counts = {name: mission[name] for name in ("attempt", "waypoint") if name in mission}

    def _truth_columns(self, part: slice) -> None:
        truth = self.log["truth"]
        self.times = truth["time"][part]
        self.start, self.end = float(self.times[0]), float(self.times[-1])
        self.positions = flip(truth["position"][part])
        self.noses = flip(nose_position(self.log)[part])
        dock = self.log.structure
        mouth = flip(dock.position) if dock else np.full(3, np.nan)
        self.ranges = np.linalg.norm(self.noses - mouth, axis=1)  # NaN without a dock
        self.phases = phase_at(self.log, self.times)
        quaternions = flip_quaternion(truth["quaternion"][part])
        turns = np.sign(np.sum(quaternions[1:] * quaternions[:-1], axis=1))  # q and -q are the same attitude
        quaternions[1:] *= np.cumprod(np.where(turns < 0.0, -1.0, 1.0))[:, np.newaxis]
        self._quaternions = quaternions
        self._headings = np.unwrap(truth["attitude"][part, 2])
        self._speeds = np.linalg.norm(truth["nu"][part, :3], axis=1)
        self._actuators = truth["actuators"][part]
        self._turns = self._integral(self._actuators) / PROPELLER_SLOWNESS
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

    def received_fixes(self) -> Fixes:
        """The fixes that arrived while there was motion, and what became of them."""
        if "usbl" not in self.log:
            return Fixes(times=np.empty(0), places=np.empty((0, 3)), reasons=np.empty(0, dtype=object))
        times, level = self.log["usbl"]["received"], fixes(self.log)
        arrived = np.isfinite(times) & (times <= self.end) & np.isfinite(level).all(axis=1)
        times, level, reasons = times[arrived], level[arrived], fix_fates(self.log)[arrived]
        depths = np.interp(times, self.times, self.positions[:, 2])
        return Fixes(times=times, places=np.stack([level[:, 0], -level[:, 1], depths], axis=1), reasons=reasons)

    def over_at(self) -> float:
        """When the mission came to its end [s]; infinite if it did not."""
        last = [index for index, name in enumerate(self.phase_names) if name in AT_END]
        over = np.flatnonzero(np.isin(self.phases, last))
        return float(self.times[over[0]]) if len(over) else np.inf

    def at(self, time: float) -> VehicleMoment:
        """Everything at a time, held at its ends beyond them."""
        index, weight = _between(self.times, time)

        def mix(values: Array) -> Array:
            return (1.0 - weight) * values[index] + weight * values[min(index + 1, len(values) - 1)]

        quaternion = mix(self._quaternions)
        now = int(np.searchsorted(self._mission_times, time, side="right")) - 1
        return VehicleMoment(
            position=mix(self.positions),
            nose=mix(self.noses),
            quaternion=quaternion / max(float(np.linalg.norm(quaternion)), 1e-9),
            heading=float(mix(self._headings)),
            speed=float(mix(self._speeds)),
            current=mix(self._currents),
            drift=mix(self._drift),
            actuators=mix(self._actuators),
            turns=mix(self._turns),
            range=float(mix(self.ranges)),
            phase=int(self.log["mission"]["phase"][now]) if now >= 0 else -1,
            count=self._count(now),
            belief=self._belief(time),
        )

    def _count(self, now: int) -> str:
        """What a sample of the mission counts; where there are lanes and a dock, waypoints there and attempts here."""
        names = [*self._counts]
        if len(names) > 1:
            phase = self.phase_names[int(self.log["mission"]["phase"][now])] if now >= 0 else ""
            names = ["attempt"] if phase in Docking.phases else ["waypoint"] if phase == LANES else []
        if not names:
            return ""
        counts = self._counts[names[0]]
        return f"{names[0]} {int(counts[max(now, 0)]) if len(counts) else 1}"

    def _belief(self, time: float) -> Belief | None:
        if not len(self.belief_times) or time < self.belief_times[0]:
            return None
        index, weight = _between(self.belief_times, time)
        after = min(index + 1, len(self.belief_times) - 1)
        return Belief(
            position=(1.0 - weight) * self.belief_positions[index] + weight * self.belief_positions[after],
            heading=float((1.0 - weight) * self._belief_headings[index] + weight * self._belief_headings[after]),
            covariance=self._covariances[index],
            age=max(time - float(self.belief_times[-1]), 0.0),
        )


def _between(times: Array, time: float) -> tuple[int, float]:
    """The sample before a time, and the weight of the one after it."""
    index = min(max(int(np.searchsorted(times, time, side="right")) - 1, 0), max(len(times) - 2, 0))
    if len(times) < 2:
        return 0, 0.0
    width = float(times[index + 1] - times[index])
    return index, min(max((time - float(times[index])) / width, 0.0), 1.0) if width > 0.0 else 0.0
