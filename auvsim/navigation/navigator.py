"""Hands what sensors and modem deliver to an estimator, and its estimate to guidance.

An estimator is made by `factory(parameters, scenario) -> Navigator`: `parameters` is the planar model it may believe
(see `planar_fit`), `scenario` the full `Scenario`. FACTORIES has those that are known by name: paper 1's filter, its baselines, and those with the current in their state; any other is given as `package.module:factory`.
"""

import importlib
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from pydantic import Field

from auvsim.base.errors import AuvsimError, InputError, unknown_name
from auvsim.base.frames import Array, wrap
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.vehicles import library
from auvsim.vehicles.allocation import Allocation
from estimators.core.outliers import Outliers
from estimators.docking.estimator import AugmentedFilter, DockingEstimator, InteractingFilter, PaperFilter
from estimators.docking.models import BIASES_OF_VEHICLE, PAPER_NOISE, REGULAR_NOISE, Bias, DockingNoise
from estimators.docking.usbl import UsblFix, UsblModel
from estimators.planar.model import PlanarParameters

TURN = 10.0  # mean duration of a turn of the current that the interacting filters expect [s]
SETTLING = 50.0  # mean time after it for which its memory is kept apart [s]
# An acoustic fix is right or wrong by many metres; one that is wrong by a few would be taken for the begin of a turn.
GROSS = Outliers(prior=0.02, deviations=(15.0,))
ANY = Outliers(prior=0.03, deviations=(2.0, 15.0))  # where fixes may be wrong by a few metres all the same


class Commands(NamedTuple):
    """What control asked of the actuators."""

    rudder: float  # effective rudder, positive to starboard [rad]
    elevator: float  # effective stern plane, positive dives [rad]
    shaft_speed: float  # [rad/s]


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimate:
    """What the vehicle believes at one instant. Position is NED from the surface above the dock's mouth."""

    time: float  # [s]
    position: Array  # (3,) north, east, depth of the body origin [m]
    heading: float  # [rad]
    velocity: Array  # (3,) surge, sway [m/s] and yaw rate [rad/s], through the water
    current: Array  # (2,) north, east [m/s]
    covariance: Array  # (8, 8) of north, east, heading, u, v, r, current north, current east; zeros where not estimated
    initialised: bool  # false until position is known
    refused: int = 0  # readings refused so far
    reasons: Mapping[str, int] = field(default_factory=dict)  # the same by reason
    reinitialised: int = 0  # how often it had to start anew, because its numbers were no longer finite


def estimator_events(before: Estimate | None, now: Estimate) -> list[tuple[str, str]]:
    """Kinds and texts of the events between two estimates: readings refused, by reason, and starts anew."""
    known, told = before.reasons if before else {}, []
    for reason, count in now.reasons.items():
        if (more := count - known.get(reason, 0)) > 0:
            told.append(("refused", f"{more} measurement{'s' * (more > 1)}: {reason.replace('_', ' ')}"))
    if now.reinitialised > (before.reinitialised if before else 0):
        told.append(("reinitialised", "the estimator started anew: its numbers were no longer finite"))
    return told


class Navigator(Protocol):
    """The contract of an estimator in a trial."""

    def update(self, time: float, readings: Sequence[Reading], commands: Commands) -> Estimate:
        """The estimate at `time` [s], given all readings that arrived since the last call, in order of arrival."""
        ...

    def reset(self) -> None:
        """Forgets everything."""
        ...


class EstimatorSettings(Settings):
    """Which estimator, and what it believes of the noises."""

    factory: str = Field(
        default="augmented_ekf",
        description="augmented_ekf, ukf, imm, imm_biased, paper, current_only, delay_only, regular_ekf, or "
        "package.module:factory",
    )
    compass_deg: float = Field(default=1.0, gt=0, description="compass noise it believes, each reading [deg]")
    position_noise: float = Field(default=4e-5, ge=0, description="process noise of position [m2/s]")
    heading_noise: float = Field(default=1e-6, ge=0, description="process noise of heading [rad2/s]")
    velocity_noise: float = Field(default=1e-4, ge=0, description="process noise of surge and sway [m2/s3]")
    yaw_rate_noise: float = Field(default=1e-5, ge=0, description="process noise of yaw rate [rad2/s3]")
    current_noise: float = Field(
        default=3e-6, ge=0, description="random walk of the current [m2/s3]; 3e-3 in turns without imm"
    )
    steady_noise: float = Field(
        default=1e-6, ge=0, description="random walk of the current in the steady modes of the imm [m2/s3]"
    )
    turning_noise: float = Field(
        default=0.02, ge=0, description="random walk of the current while it turns, in the imm [m2/s3]"
    )
    turn_interval: float = Field(default=300.0, gt=0, description="mean time between turns the imm expects [s]")
    compass_bias_deg: float = Field(
        default=0.5, ge=0, description="constant error of the vehicle's compass that the imm estimates [deg]"
    )
    dock_heading_deg: float = Field(default=0.3, ge=0, description="error of the dock's compass it believes [deg]")
    dock_heading_state: bool = Field(
        default=True, description="whether that error is constant, and estimated, instead of new with each fix"
    )
    model: str = Field(
        default="condense",
        description="planar model it believes: condense, a name in models/<vehicle>/planar/, or the path of a .yaml",
    )
    model_speed: float = Field(
        default=1.0, gt=0, description="speed through the water at which the planar model is condensed [m/s]"
    )


class DockingNavigator:
    """The docking estimators of `estimators.docking.estimator` behind the contract.

    Compass readings since the last update are averaged (moved to now with the estimated yaw rate), fin and shaft
    feedback are averaged over the interval they drove, fixes go to the delay buffer with their own stamps. Depth is the
    gauge's, smoothed.
    """

    def __init__(self, estimator: DockingEstimator, allocation: Allocation) -> None:
        self._estimator, self._allocation = estimator, allocation
        self.reset()

    def reset(self) -> None:
        """Forgets everything."""
        self._estimator.reset()
        self._depth: float | None = None
        self._depth_rate = 0.0
        self._depth_stamp = 0.0
        self._yaw_rate = 0.0

    def update(self, time: float, readings: Sequence[Reading], commands: Commands) -> Estimate:
        """The estimate at `time`, see `Navigator.update`."""
        headings, stamps, drives, fixes = [], [], [], []
        for reading in readings:
            if reading.sensor == "compass":
                headings.append(float(reading.value[0]))
                stamps.append(reading.stamp)
            elif reading.sensor == "feedback":
                drives.append(reading.value.tolist())
            elif reading.sensor == "depth":
                self._smooth_depth(reading.stamp, float(reading.value[0]))
            elif reading.sensor == "usbl":
                x, y, z, heading, pitch, roll, _ = reading.value.tolist()
                fix = UsblFix(
                    stamp=reading.stamp, received=reading.received, sequence=reading.sequence,
                    position=(x, y, z), heading=heading, pitch=pitch, roll=roll,
                )  # fmt: skip
                fixes.append(fix)
        rudder, shaft_speed = commands.rudder, commands.shaft_speed
        if drives:
            *fins, shaft_speed = (sum(values) / len(drives) for values in zip(*drives, strict=True))
            rudder, _ = self._allocation.effective(fins)
        result = self._estimator.tick(time, self._heading_now(time, headings, stamps), rudder, shaft_speed, fixes)
        mean = result.mean
        self._yaw_rate = float(mean[5])
        depth = 0.0 if self._depth is None else self._depth + self._depth_rate * (time - self._depth_stamp)
        return Estimate(
            time=time,
            position=np.array([mean[0], mean[1], depth]),
            heading=float(mean[2]),
            velocity=mean[3:6],
            current=mean[6:8],
            covariance=result.covariance,
            initialised=result.initialised,
            refused=sum(result.refused.values()),
            reasons=result.refused,
            reinitialised=result.reinitialised,
        )

    def _heading_now(self, time: float, headings: list[float], stamps: list[float]) -> float | None:
        if not headings:
            return None
        first = headings[0]
        offsets = [wrap(h - first) + self._yaw_rate * (time - t) for h, t in zip(headings, stamps, strict=True)]
        return wrap(first + sum(offsets) / len(offsets))

    def _smooth_depth(self, stamp: float, depth: float) -> None:
        """Alpha-beta filter of the gauge (Bar-Shalom 2001, sec. 6.5), steady-state gains for 0.05 m and 0.02 m/s2."""
        if self._depth is None:
            self._depth, self._depth_stamp = depth, stamp
            return
        dt = stamp - self._depth_stamp
        predicted = self._depth + self._depth_rate * dt
        innovation = depth - predicted
        self._depth, self._depth_stamp = predicted + 0.09 * innovation, stamp
        if dt > 0.0:
            self._depth_rate += 0.0042 * innovation / dt


def _docking(
    parameters: PlanarParameters, scenario: Any, kind: Callable[..., Any], base: DockingNoise, *, delayed: bool = True
) -> DockingNavigator:
    """A docking filter for a scenario; what it believes are the estimator's settings, never the sensors' draws."""
    settings: EstimatorSettings = scenario.estimator
    usbl = scenario.sensors.usbl
    step = 1.0 / scenario.rates.filter
    readings = max(1.0, scenario.sensors.compass.rate * step)
    noise = replace(base, compass=math.radians(settings.compass_deg) / math.sqrt(readings))
    white = 0.0 if "dock_heading" in base.biases else math.radians(settings.dock_heading_deg)
    model = UsblModel(transceiver=usbl.transceiver, dock_heading=white)
    filter_ = kind(parameters, noise, transponder=usbl.transponder[:2])
    estimator = DockingEstimator(filter_, model, step=step, compensate_delay=delayed)
    return DockingNavigator(estimator, _allocation(scenario.vehicle.model))


@cache
def _allocation(model: str) -> Allocation:
    """The fin map of a vehicle; kept, because to load the vehicle takes as long as half a minute of a trial."""
    return library.vehicle(model).allocation


def regular_ekf(parameters: PlanarParameters, scenario: Any) -> Navigator:
    """The regular filter: knows neither delay nor current, with the noise that suits such a filter best."""
    return _docking(parameters, scenario, partial(PaperFilter, weights=None), REGULAR_NOISE, delayed=False)


def delay_only(parameters: PlanarParameters, scenario: Any) -> Navigator:
    """Half of paper 1's filter: the delay buffer (sections 8 and 9), and no current."""
    return _docking(parameters, scenario, partial(PaperFilter, weights=None), REGULAR_NOISE)


def current_only(parameters: PlanarParameters, scenario: Any) -> Navigator:
    """The other half: the current by eq. 11, with fixes taken as made when they arrive."""
    return _docking(parameters, scenario, PaperFilter, PAPER_NOISE, delayed=False)


def paper(parameters: PlanarParameters, scenario: Any) -> Navigator:
    """Paper 1's improved filter (sections 6 to 10), with the noises it recommends."""
    return _docking(parameters, scenario, PaperFilter, PAPER_NOISE)


def augmented_ekf(parameters: PlanarParameters, scenario: Any) -> Navigator:
    """The augmented extended Kalman filter in the delay buffer (paper 1, sections 8 and 12)."""
    return _docking(parameters, scenario, AugmentedFilter, _noise(scenario))


def ukf(parameters: PlanarParameters, scenario: Any) -> Navigator:
    """The same with sigma points instead of derivatives."""
    return _docking(parameters, scenario, partial(AugmentedFilter, transform="unscented"), _noise(scenario))


def imm(parameters: PlanarParameters, scenario: Any) -> Navigator:
    """Interacting augmented filters, for steady and turning currents (paper 1, section 13), with the compass' error."""
    return _interacting(parameters, scenario, {}, GROSS)


def imm_biased(parameters: PlanarParameters, scenario: Any) -> Navigator:
    """The same for worse sensors: errors of thrust and of a poor compass in the state, fixes wrong by a few metres.

    It notices a turn later than `imm`, which takes such fixes for one, and so errs up to 1.4 times as much in it.
    """
    return _interacting(parameters, scenario, BIASES_OF_VEHICLE, ANY)


def _interacting(
    parameters: PlanarParameters, scenario: Any, biases: Mapping[str, Bias], outliers: Outliers
) -> Navigator:
    """Three modes: steady, turning, and steady again after a turn.

    What the turning mode does not know must not leak into the steady one, so that it is believed for long before. Only
    then is the steady mode's covariance mixed with one that has long converged.
    """
    s: EstimatorSettings = scenario.estimator
    noise = _noise(scenario)
    compass = {"compass": Bias(math.radians(s.compass_bias_deg))} if s.compass_bias_deg > 0.0 else {}
    turns, ends, settles = 1.0 / s.turn_interval, 1.0 / TURN, 1.0 / SETTLING
    shares = np.array((1.0, turns / settles, turns / ends))  # nearly those of the chain when it has run for long
    kind = partial(
        InteractingFilter,
        currents=(s.steady_noise, s.steady_noise, s.turning_noise),
        switching=((0.0, 0.0, turns), (settles, 0.0, turns), (0.0, ends, 0.0)),
        initial=shares / shares.sum(),
        outliers=outliers,
    )
    return _docking(parameters, scenario, kind, replace(noise, biases={**compass, **biases, **noise.biases}))


def _noise(scenario: Any) -> DockingNoise:
    """What a filter with the current in its state believes."""
    s: EstimatorSettings = scenario.estimator
    constant = s.dock_heading_state and s.dock_heading_deg > 0.0  # a state without variance is none
    return DockingNoise(
        position=s.position_noise, heading=s.heading_noise, surge=s.velocity_noise, sway=s.velocity_noise,
        yaw_rate=s.yaw_rate_noise, current=s.current_noise,
        biases={"dock_heading": Bias(math.radians(s.dock_heading_deg))} if constant else {},
    )  # fmt: skip


_NAMED = (augmented_ekf, ukf, imm, imm_biased, paper, current_only, delay_only, regular_ekf)
FACTORIES: dict[str, Callable[[PlanarParameters, Any], Navigator]] = {named.__name__: named for named in _NAMED}


def find_factory(name: str) -> Callable[[PlanarParameters, Any], Any]:
    """The estimator factory of a name or of `package.module:factory` (also found in the working folder).

    Raises:
        InputError: there is none.
    """
    if name in FACTORIES:
        return FACTORIES[name]
    if ":" not in name:
        raise unknown_name("estimator", name, [*FACTORIES, "package.module:factory of your own"])
    module, _, attribute = name.partition(":")
    folder = str(Path.cwd())
    if folder not in sys.path:
        sys.path.append(folder)
    try:
        found = getattr(importlib.import_module(module), attribute)
    except Exception as error:  # a user's module may fail in any way while it is imported
        raise InputError(f"estimator '{name}': {type(error).__name__}: {error}") from None
    if not callable(found):
        raise InputError(f"estimator '{name}' is not callable; it must be factory(parameters, scenario) -> Navigator")
    return found


def build(name: str, parameters: PlanarParameters, scenario: Any) -> Navigator:
    """Makes the estimator of a scenario.

    Raises:
        InputError: there is no such factory, or it does not return a Navigator.
    """
    factory = find_factory(name)
    try:
        navigator = factory(parameters, scenario)
    except AuvsimError:
        raise
    except Exception as error:  # a user's factory may fail in any way
        raise InputError(f"estimator '{name}' cannot be made: {type(error).__name__}: {error}") from error
    for method in ("update", "reset"):
        if not callable(getattr(navigator, method, None)):
            raise InputError(f"estimator '{name}' made a {type(navigator).__name__} without {method}(); see Navigator")
    return navigator
