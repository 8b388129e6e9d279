"""A follower's extended Kalman filter: compass, gyro and DVL, the unknown current, ranges to vehicles that move."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from auvsim.acoustics.message import Delivery
from auvsim.base.alpha_beta import AlphaBeta
from auvsim.base.reading import Reading
from auvsim.navigation.docking import DEPTH_GAINS
from auvsim.navigation.estimate import Estimate
from auvsim.navigation.heard import LESS_CERTAIN, Listener, Sight, along, bend, flat_share
from auvsim.navigation.measurements import averaged, measurements, of_kind
from auvsim.navigation.navigator import Navigator, NavigatorSetup
from auvsim.navigation.odometry import planned_start, required
from auvsim.navigation.over_history import OverHistory
from auvsim.sensors.compass import CompassSettings
from auvsim.sensors.dvl import DvlSettings
from estimators.core.estimator import Estimator
from estimators.core.filter import ModelFilter
from estimators.core.fusion import cautious_variance
from estimators.core.history import Node
from estimators.core.models import sensors
from estimators.core.models.motion import constant_velocity, with_current, with_error
from estimators.core.models.odometry import Displacement, OdometryNoise
from estimators.core.models.process import MotionProcess
from estimators.core.types import Gaussian, Measurement
from estimators.docking.aids import BOTTOM, GYRO, RANGE, WATER
from estimators.docking.sensors import COMPASS
from estimators.motion_radius.geometry import MIN_RANGES, Geometry

SPEED, TURNING, GYRO_BIAS = 2.0, 0.1, 1e-3  # not known at first: velocities [m/s], yaw rate, bias of a gyro [rad/s]


class RangeNavigator(OverHistory):
    """Position, heading, velocity through the water and current, by ranges to those whose packets say where they are.

    A range is that from where the other was when it sent to where this vehicle was when the packet arrived, and goes
    into the delay buffer with that stamp. The current is the difference between what ranges and what the DVL's water
    track say. Errors of another's position count as independent from packet to packet, but those of one that itself
    ranges to others: they may be correlated with the own in any way, and count by `cautious_variance`. Where the place
    is not known across a range, that is taken to second order.
    """

    def __init__(self, setup: NavigatorSetup) -> None:
        s = setup.settings
        required(setup, ("a DVL (sensors.dvl.enabled: true)", bool(of_kind(setup.sensors, DvlSettings))))
        assert setup.modem is not None
        self._settings, self._modem, self._sensors = s, setup.modem, dict(setup.sensors)
        self._ranging, self._period = setup.ranging, setup.period
        self._odometry = OdometryNoise(position=s.position_noise)
        compass = setup.sensors.get("compass")
        self._compass_bias = math.radians(
            max(compass.heading_bias_deg, 0.01) if isinstance(compass, CompassSettings) else 1.0
        )
        motion = with_current(constant_velocity(turning=True))
        for name, unit in (("compass_bias", "rad"), ("gyro_bias", "rad/s")):
            motion = with_error(motion, name, unit)
        self.states: Mapping[str, str] = dict(motion.space.units)
        self._space = motion.space
        noise = {
            "north": s.position_noise, "east": s.position_noise,
            "surge": s.acceleration, "sway": s.acceleration, "yaw_rate": s.yaw_acceleration, "gyro_bias": 1e-12,
            "current_north": s.current_noise, "current_east": s.current_noise,
        }  # fmt: skip
        models = {
            COMPASS: sensors.compass(motion, bias="compass_bias"),
            GYRO: sensors.gyro(motion, bias="gyro_bias"),
            BOTTOM: sensors.dvl(motion, track="bottom"),
            WATER: sensors.dvl(motion, track="water"),
            RANGE: sensors.range_to(motion, point=setup.modem.transducer[:2]),
        }
        self._origin = planned_start(setup)
        filter_ = ModelFilter(MotionProcess(motion, noise), models, self._start, gates=0.9999)
        self._estimator = Estimator(filter_, step=setup.period)
        self.reset()

    def reset(self) -> None:
        """Forgets everything."""
        self._estimator.reset()
        self._listener = Listener(self._modem)
        self._depth = AlphaBeta(*DEPTH_GAINS)
        self._tilt = (0.0, 0.0)  # pitch and roll by the compass [rad]
        self._belief: Gaussian | None = None
        self._geometry, self._since = Geometry(), Displacement()  # of the ranges so far, and the way since the last
        self._judged, self._warnings = 0, ()  # after how many ranges the geometry was judged last, and how

    def update(self, time: float, readings: Sequence[Reading], messages: Sequence[Delivery], commands: Any) -> Estimate:
        """The estimate now, from the readings, messages and commands since the last update."""
        found: list[Measurement] = []
        for reading, count in averaged(readings):
            if reading.sensor == "compass":
                self._tilt = (float(reading.value[1]), float(reading.value[2]))
            if reading.sensor == "depth":
                self._depth.update(reading.stamp, float(reading.value[0]))
            elif reading.sensor in self._sensors:
                own, depth = self._sensors[reading.sensor], self._depth.value or 0.0
                single = measurements(reading, own, depth, tilt=self._tilt)
                found += [replace(m, covariance=m.covariance / count) for m in single] if count > 1 else single
        for sight in self._listener.sights(messages):
            if sight.range is not None:
                found += self._used(self._range(sight))
        result = self._estimator.tick(time, (), found)
        n = len(self._space)
        self._belief = result.belief
        belief = result.belief or Gaussian(mean=np.zeros(n), covariance=np.zeros((n, n)))
        mean = belief.mean
        heading, ahead, starboard = mean[2:5].tolist()
        self._since = self._since.extended(ahead, starboard, heading, self._period, self._odometry)
        return Estimate(
            time=time,
            position=np.array((mean[0], mean[1], self._depth.at(time) or 0.0)),
            heading=float(mean[2]),
            velocity=mean[3:6],
            current=mean[6:8],
            covariance=belief.covariance,
            initialised=result.belief is not None,
            mean=mean,
            refused=sum(result.refused.values()),
            reasons=result.refused,
            reinitialised=result.reinitialised,
            outcomes=result.outcomes,
            warnings=self._doubts(belief) if result.belief else (),
        )

    def _doubts(self, belief: Gaussian) -> tuple[str, ...]:
        """Why the geometry cannot tell, judged anew at each range; one filter knows of no second solution."""
        geometry = self._geometry
        if geometry.ranges > max(self._judged, MIN_RANGES - 1):
            self._judged = geometry.ranges
            self._warnings = geometry.warnings(belief.mean[None], belief.covariance[None], np.ones(1))
        return self._warnings

    def _used(self, range_: Measurement) -> list[Measurement]:
        """A range, if it says anything; the way since the last one goes into the geometry."""
        if not math.isfinite(variance := range_.covariance.item()):
            self._estimator.history.refuse(LESS_CERTAIN, range_)
            return []
        north, east, _ = range_.parameters
        self._geometry = self._geometry.extended(self._since, north, east, range_.value.item(), variance)
        self._since = Displacement()
        return [range_]

    def _range(self, sight: Sight) -> Measurement:
        """A range to where the other was; across depths its error of position counts less."""
        assert sight.range is not None
        s, report = self._settings, sight.report
        down = report.depth - (self._depth.value or 0.0) - self._modem.transducer[2]
        own, block = self._origin, (s.position**2, 0.0, s.position**2)
        if (belief := self._belief) is not None:
            own, block = belief.mean[:2].tolist(), belief.covariance[np.triu_indices(2)].tolist()
        flat = flat_share(sight.range, down)
        timing = self._modem.sound_speed * self._modem.modem.timing_noise
        variance = s.range_noise**2 + timing**2 + flat * sight.variance_along(*own)
        way = report.north - own[0], report.east - own[1]
        longer, uncertain = bend(along((-way[1], way[0]), *block), math.hypot(*way))
        variance += uncertain
        if sight.source in self._ranging:
            variance = cautious_variance(flat * along(way, *block), variance)
        return Measurement(
            kind=RANGE, value=np.array((sight.range - longer,)), covariance=np.array(((variance,),)), stamp=sight.stamp,
            received=sight.received, sequence=sight.sequence, source=sight.source,
            parameters=(report.north, report.east, down),
        )  # fmt: skip

    def _start(self, nodes: Sequence[Node], index: int) -> tuple[Gaussian, list[Measurement]] | None:
        """At the first compass reading, at the assumed start."""
        compass = next((m for m in nodes[index].measurements if m.kind == COMPASS), None)
        if compass is None:
            return None
        s, bias = self._settings, self._compass_bias
        known = {
            "north": s.position, "east": s.position, "current_north": s.current, "current_east": s.current,
            "heading": math.hypot(bias, math.sqrt(compass.covariance.item())), "surge": SPEED, "sway": SPEED,
            "yaw_rate": TURNING, "compass_bias": bias, "gyro_bias": GYRO_BIAS,
        }  # fmt: skip
        north, east = self._origin
        belief = self._space.belief({"north": north, "east": east, "heading": float(compass.value[0])}, known)
        i, j = self._space.index("heading"), self._space.index("compass_bias")
        belief.covariance[i, j] = belief.covariance[j, i] = -(bias**2)  # it shows too much: so does the heading
        return belief, [compass]


def range_ekf(setup: NavigatorSetup) -> Navigator:
    """An extended Kalman filter of a follower, by ranges to others."""
    return RangeNavigator(setup)
