"""Adapters of the docking estimators to the contract of a run: readings in, estimates out."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from auvsim.acoustics.message import Delivery
from auvsim.base.alpha_beta import AlphaBeta
from auvsim.base.errors import InputError
from auvsim.base.frames import Array, rotation, wrap
from auvsim.base.reading import Reading
from auvsim.navigation import aids
from auvsim.navigation.estimate import DEPTH_BIAS, PLANAR_STATES, Estimate
from auvsim.navigation.measurements import measurements, of_kind
from auvsim.navigation.navigator import Navigator, NavigatorSetup
from auvsim.navigation.settings import RobustSettings
from auvsim.sensors.compass import CompassSettings
from auvsim.sensors.dvl import DvlSettings
from auvsim.sensors.light import LightSettings
from auvsim.sensors.range import RangeSettings
from auvsim.vehicles.actuation import Commands, FinsAndShaft
from estimators.core.estimator import StateFilter
from estimators.core.history import Node
from estimators.core.outliers import Outliers
from estimators.core.types import Gaussian
from estimators.docking.estimator import AugmentedFilter, DockingEstimator, InteractingFilter, PaperFilter
from estimators.docking.noise import BIASES_OF_VEHICLE, PAPER_NOISE, REGULAR_NOISE, Bias, DockingNoise
from estimators.docking.usbl import UsblFix, UsblModel
from estimators.docking.vertical import VerticalFilter

TURN = 10.0  # mean duration of a turn of the current that the interacting filters expect [s]
SETTLING = 50.0  # mean time after it for which its memory is kept apart [s]
KEEP = 30.0  # age up to which fixes are used where no setting says it [s]
ECHO = 20.0  # time for which a false echo may show one place [s]
CALM = 100.0  # mean time that gusty water stays so [s]
DEPTH_GAINS = (0.09, 0.0042)  # of the depth gauge's alpha-beta filter, steady state for 0.05 m and 0.02 m/s2
BIAS_UNITS = {
    "compass": "rad", "dock_heading": "rad", "clock": "s", "surge": "m/s2", "gyro": "rad/s", "dvl_surge": "m/s",
    "dvl_sway": "m/s",
}  # fmt: skip
# Of the position where a DVL tells the velocity [m2/s]: its errors of scale and mounting are no constants, but turn and
# grow with the velocity, and the model's surge is not level in a dive. Without it the filter believed itself too much.
DOPPLER_WALK = 4e-4
# An acoustic fix is right or wrong by many metres; one that is wrong by a few would be taken for the start of a turn.
GROSS = Outliers(prior=0.02, deviations=(15.0,))
ANY = Outliers(prior=0.03, deviations=(2.0, 15.0))  # where fixes may be wrong by a few metres all the same

LEARNING = 20.0  # as how many fixes the assumed share of outliers counts beside those heard


class DockingNavigator:
    """A docking estimator in a run.

    Compass readings since the last update are averaged (moved to now with the estimated yaw rate), fin and shaft
    feedback are averaged over the interval they drove, fixes go to the delay buffer with their own stamps. So do ranges
    and bearings of a light, and the last reading of a gyro or DVL. Depth is the gauge's, smoothed; what it shows too
    much against the dock's is a state of its own.

    Args:
        estimator: in whose axes the dock's mouth is the origin.
        actuation: of the vehicle.
        dock: (2,) north, east of the dock's mouth [m].
        aids: settings of the sensors it uses besides, by name.
        vertical: filter of that state.
        tilt_noise: standard deviation of the pitch and roll by which bearings of a light are levelled [rad].
    """

    def __init__(
        self,
        estimator: DockingEstimator,
        actuation: FinsAndShaft,
        dock: Array,
        aids: Mapping[str, Any] | None = None,
        vertical: VerticalFilter | None = None,
        tilt_noise: float = 0.0,
    ) -> None:
        self._estimator, self._actuation = estimator, actuation
        self._vertical, self._tilt_noise = vertical or VerticalFilter(UsblModel()), tilt_noise
        self._dock, self._aids = dock, dict(aids or {})
        biases = {f"{name}_bias": _unit(name) for name in estimator.filter.noise.bias_names}
        self.states: Mapping[str, str] = {**PLANAR_STATES, **biases, DEPTH_BIAS: "m"}
        self._names = tuple(self.states)
        self.reset()

    def reset(self) -> None:
        """Forgets everything."""
        self._estimator.reset()
        self._vertical.reset()
        self._depth = AlphaBeta(*DEPTH_GAINS)
        self._yaw_rate = 0.0
        self._tilt = (0.0, 0.0)  # pitch and roll by the compass [rad]

    def update(
        self, time: float, readings: Sequence[Reading], messages: Sequence[Delivery], commands: Commands
    ) -> Estimate:
        """The estimate at `time`, see `Navigator.update`."""
        headings, stamps, drives, fixes, reports = [], [], [], [], []
        aided: dict[Any, Reading] = {}  # the last reading of a sensor, but every range and bearing of a light
        for reading in readings:
            if reading.sensor == "compass":
                headings.append(float(reading.value[0]))
                self._tilt = (float(reading.value[1]), float(reading.value[2]))
                stamps.append(reading.stamp)
            elif reading.sensor == "feedback":
                drives.append(reading.value.tolist())
            elif reading.sensor == "depth":
                self._depth.update(reading.stamp, float(reading.value[0]))
            elif reading.sensor == "usbl":
                x, y, z, heading, pitch, roll, _ = reading.value.tolist()
                fix = UsblFix(
                    stamp=reading.stamp, received=reading.received, sequence=reading.sequence,
                    position=(x, y, z), heading=heading, pitch=pitch, roll=roll,
                )  # fmt: skip
                fixes.append(fix)
                reports.append(float(reading.value[6]))
            elif reading.sensor in self._aids:
                rare = isinstance(self._aids[reading.sensor], RangeSettings | LightSettings)
                aided[reading.sensor, reading.sequence if rare else None] = reading
        rudder, shaft_speed = commands.rudder, commands.shaft_speed
        if drives:
            rudder, _, shaft_speed = self._actuation.effective(
                [sum(values) / len(drives) for values in zip(*drives, strict=True)]
            )
        depth, origin = self._depth.value or 0.0, (float(self._dock[0]), float(self._dock[1]))
        more = [m for r in aided.values() for m in measurements(r, self._aids[r.sensor], depth, origin, self._tilt)]
        heading = self._heading_now(time, headings, stamps)
        result = self._estimator.tick(time, heading, rudder, shaft_speed, fixes, more)
        now = self._depth.at(time) or 0.0
        self._vertical.gauge(time, now)
        for fix, report in zip(fixes, reports, strict=True):
            self._vertical.fix(fix, report)
        for reading in aided.values() if result.initialised else ():
            if isinstance(self._aids[reading.sensor], LightSettings):
                self._see(reading, self._aids[reading.sensor], result.mean)
        mean, covariance = self._with_depth(result.mean, result.covariance)
        self._yaw_rate = float(mean[5])
        return Estimate(
            time=time,
            position=np.array([mean[0], mean[1], now]),
            heading=float(mean[2]),
            velocity=mean[3:6],
            current=mean[6:8],
            covariance=covariance,
            initialised=result.initialised,
            mean=mean,
            names=self._names,
            refused=sum(result.refused.values()),
            reasons=result.refused,
            reinitialised=result.reinitialised,
            outcomes=result.outcomes,
        )

    def _see(self, reading: Reading, settings: LightSettings, mean: Array) -> None:
        """Takes the elevation of the dock's light, levelled by the compass, for the vertical state."""
        pitch, roll = self._tilt
        level = rotation(roll, pitch, 0.0)
        azimuth, elevation = reading.value.tolist()
        ahead, abeam, down = (level @ (math.cos(azimuth), math.sin(azimuth), -math.tan(elevation))).tolist()
        x, y, below = (level @ settings.camera).tolist()
        cos, sin = math.cos(mean[2]), math.sin(mean[2])
        distance = math.hypot(mean[0] + cos * x - sin * y, mean[1] + sin * x + cos * y)
        noise = math.hypot(math.radians(settings.noise_deg), self._tilt_noise)
        above = math.atan2(-down, math.hypot(ahead, abeam))
        self._vertical.light(reading.stamp, reading.sensor, above, noise, distance, below)

    @property
    def nodes(self) -> Sequence[Node[Any]]:
        """Nodes of the delay buffer, in order of time."""
        return self._estimator.nodes

    @property
    def filter(self) -> StateFilter:
        """The filter whose states the nodes hold."""
        return self._estimator.filter

    def smoothed(self) -> list[tuple[float, Gaussian]]:
        """Beliefs of the last seconds given all that was heard since, with their times [s]."""
        pairs = [(time, self._with_depth(b.mean, b.covariance)) for time, b in self._estimator.smoothed()]
        return [(time, Gaussian(mean=mean, covariance=covariance)) for time, (mean, covariance) in pairs]

    def _with_depth(self, mean: Array, covariance: Array) -> tuple[Array, Array]:
        """Mean and covariance from the datum, with what the gauge shows too much."""
        n = mean.size
        whole, both = np.empty(n + 1), np.zeros((n + 1, n + 1))
        whole[:n], whole[n] = mean, self._vertical.offset
        whole[:2] += self._dock
        both[:n, :n], both[n, n] = covariance, self._vertical.variance
        return whole, both

    def _heading_now(self, time: float, headings: list[float], stamps: list[float]) -> float | None:
        if not headings:
            return None
        first = headings[0]
        offsets = [wrap(h - first) + self._yaw_rate * (time - t) for h, t in zip(headings, stamps, strict=True)]
        return wrap(first + sum(offsets) / len(offsets))


def _unit(bias: str) -> str:
    if bias.startswith("range_"):
        return "1" if bias.startswith("range_scale_") else "m"
    return "rad" if bias.startswith("light_") else BIAS_UNITS.get(bias, "1")


def navigator(
    setup: NavigatorSetup, kind: Callable[..., Any], base: DockingNoise, *, delayed: bool = True
) -> DockingNavigator:
    """A docking filter for a vehicle; what it assumes are the estimator's settings, never the sensors' draws."""
    s, actuation = setup.settings, setup.actuation
    used = aids.used(setup.sensors, getattr(s, "use", ()))
    if setup.dock is None:
        raise InputError(f"estimator '{s.kind}' of '{setup.vehicle}': needs the place of a dock; give a structure")
    if not setup.usbl.enabled and len(of_kind(used, RangeSettings)) < 2:
        raise InputError(
            f"estimator '{s.kind}' of '{setup.vehicle}': without USBL it needs ranges to two beacons or more; "
            "give sensors of kind range, or sensors.usbl.enabled: true"
        )
    if not isinstance(actuation, FinsAndShaft):
        raise InputError(
            f"estimator '{s.kind}' of '{setup.vehicle}': its model is of fins and one shaft, and the vehicle is driven "
            "by thrusters; take dead_reckoning"
        )
    readings = max(1.0, setup.rates.get("compass", 0.0) * setup.period)
    biases = {**aids.biases(used, setup.sensors.get("compass")), **base.biases}
    noise = replace(base, compass=math.radians(s.compass_deg) / math.sqrt(readings), biases=biases)
    if of_kind(used, DvlSettings):
        noise = replace(noise, position=max(noise.position, DOPPLER_WALK))
    white = 0.0 if "dock_heading" in base.biases else math.radians(s.dock_heading_deg)
    scale, keep = getattr(s, "usbl_noise", 1.0), getattr(s, "keep", KEEP)
    model = UsblModel(transceiver=setup.usbl.transceiver, dock_heading=white)
    model = replace(model, deviations=tuple(scale * deviation for deviation in model.deviations))
    more = {"aids": aids.assumed(used)} if used else {}
    filter_ = kind(setup.parameters, noise, transponder=setup.usbl.transponder[:2], **more)
    estimator = DockingEstimator(filter_, model, step=setup.period, keep=keep, compensate_delay=delayed)
    eyes = {name: math.radians(own.bias_deg) for name, own in of_kind(used, LightSettings).items()}
    vertical = VerticalFilter(model, setup.usbl.transponder[2], keep=keep, lights=eyes)
    compass = setup.sensors.get("compass")
    tilt_noise = math.radians(compass.tilt_noise_deg) if isinstance(compass, CompassSettings) else 0.0
    return DockingNavigator(estimator, actuation, setup.dock.position[:2], used, vertical, tilt_noise)


def regular_ekf(setup: NavigatorSetup) -> Navigator:
    """The regular filter: knows neither delay nor current, with the noise that suits such a filter best."""
    return navigator(setup, partial(PaperFilter, weights=None), REGULAR_NOISE, delayed=False)


def delay_only(setup: NavigatorSetup) -> Navigator:
    """Half of paper 1's filter: the delay buffer (sections 8 and 9), and no current."""
    return navigator(setup, partial(PaperFilter, weights=None), REGULAR_NOISE)


def current_only(setup: NavigatorSetup) -> Navigator:
    """The other half: the current by eq. 11, with fixes taken as made when they arrive."""
    return navigator(setup, PaperFilter, PAPER_NOISE, delayed=False)


def paper(setup: NavigatorSetup) -> Navigator:
    """Paper 1's improved filter (sections 6 to 10), with the noises it recommends."""
    return navigator(setup, PaperFilter, PAPER_NOISE)


def augmented_ekf(setup: NavigatorSetup) -> Navigator:
    """The augmented extended Kalman filter in the delay buffer (paper 1, sections 8 and 12)."""
    return navigator(setup, AugmentedFilter, _noise(setup.settings))


def ukf(setup: NavigatorSetup) -> Navigator:
    """The augmented filter with sigma points instead of derivatives."""
    return navigator(setup, partial(AugmentedFilter, transform="unscented"), _noise(setup.settings))


def imm(setup: NavigatorSetup) -> Navigator:
    """Interacting augmented filters, for steady and turning currents (paper 1, section 13), with the compass' error."""
    return _interacting(setup, {}, GROSS)


def imm_biased(setup: NavigatorSetup) -> Navigator:
    """Interacting filters for worse sensors: errors of thrust and of a poor compass in the state, small outliers.

    It notices a turn later than `imm`, which takes fixes that are wrong by a few metres for one, and so errs up to 1.4
    times as much in it.
    """
    return _interacting(setup, BIASES_OF_VEHICLE, ANY)


def robust(setup: NavigatorSetup) -> Navigator:
    """Interacting filters that need no choosing: steady, gusty and turning currents, compass errors, outliers.

    The modes: steady water; gusts, which last; a turn, which is short.
    """
    s = setup.settings
    turns, ends, gusts, calms = 1.0 / s.turn_interval, 1.0 / TURN, 1.0 / s.gust_interval, 1.0 / CALM
    rates = ((0.0, gusts, turns), (calms, 0.0, turns), (0.5 * ends, 0.5 * ends, 0.0))
    currents = (s.steady_noise, s.gust_noise, s.turning_noise)
    shares = np.array((1.0, gusts / calms, turns / ends))
    kind = partial(
        InteractingFilter,
        currents=currents,
        switching=rates,
        initial=shares / shares.sum(),
        outliers=Outliers(prior=s.outlier_probability, deviations=ANY.deviations, worth=LEARNING),
        echo=ECHO,
        doubtful=True,
    )
    return navigator(setup, kind, steady_noise(s))


def steady_noise(s: RobustSettings) -> DockingNoise:
    """What `robust` assumes in steady water."""
    noise = _noise(s)
    compass = {"compass": Bias(math.radians(s.compass_bias_deg))} if s.compass_bias_deg > 0.0 else {}
    clock = {"clock": Bias(s.dock_clock)} if s.dock_clock > 0.0 else {}
    return replace(noise, current=s.steady_noise, biases={**compass, **noise.biases, **clock})


def _interacting(setup: NavigatorSetup, biases: Mapping[str, Bias], outliers: Outliers) -> Navigator:
    """Three modes: steady, turning, and steady again after a turn.

    The third mode keeps the large covariance of a turn out of the steady mode: after a turn, a filter stays in it long
    enough to converge, so that the steady mode's covariance is only ever mixed with one that has converged.
    """
    s = setup.settings
    noise = _noise(s)
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
    return navigator(setup, kind, replace(noise, biases={**compass, **biases, **noise.biases}))


def _noise(s: Any) -> DockingNoise:
    """What a filter with the current in its state assumes."""
    constant = s.dock_heading_state and s.dock_heading_deg > 0.0  # a state without variance is none
    return DockingNoise(
        position=s.position_noise, heading=s.heading_noise, surge=s.velocity_noise, sway=s.velocity_noise,
        yaw_rate=s.yaw_rate_noise, current=s.current_noise,
        biases={"dock_heading": Bias(math.radians(s.dock_heading_deg))} if constant else {},
    )  # fmt: skip
