"""Adapter of paper 2's estimators to the contract of a run: a follower in an unknown current, by ranges to a leader."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np

from auvsim.acoustics.message import Delivery
from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.navigation.estimate import Estimate
from auvsim.navigation.heard import LESS_CERTAIN, Listener, Sight, along, flat_share
from auvsim.navigation.measurements import of_kind
from auvsim.navigation.navigator import Navigator, NavigatorSetup
from auvsim.navigation.odometry import UNKNOWN, Odometry, planned_start, required
from auvsim.sensors.compass import CompassSettings
from auvsim.sensors.dvl import DvlSettings
from estimators.core.fusion import cautious_variance
from estimators.core.history import History
from estimators.core.models.odometry import SPACE, OdometryNoise
from estimators.core.types import Gaussian
from estimators.motion_radius.bank import BENT, BankFilter, BankState
from estimators.motion_radius.geometry import MIN_RANGES
from estimators.motion_radius.ranges import SHARED, leader_range


class MotionRadiusNavigator:
    """Paper 2's problem, by the bank of filters: an unknown current, by ranges to a leader; see `estimators`.

    Odometry is a DVL's water track and the compass.
    """

    states: Mapping[str, str] = SPACE.units

    def __init__(self, setup: NavigatorSetup) -> None:
        dvls = [*of_kind(setup.sensors, DvlSettings).values()]
        required(setup, ("a DVL (sensors.dvl.enabled: true)", bool(dvls)))
        s, modem = setup.settings, setup.modem
        assert modem is not None
        self._setup, self._modem = setup, modem
        dvl, compass = dvls[0], setup.sensors.get("compass")
        known = isinstance(compass, CompassSettings)
        white = math.radians(compass.heading_noise_deg) ** 2 / compass.rate if known else 0.0
        noise = OdometryNoise(
            forward=dvl.water_noise[0] ** 2 / dvl.rate, starboard=dvl.water_noise[1] ** 2 / dvl.rate, heading=white,
            position=s.position_noise,
        )  # fmt: skip
        speed = modem.sound_speed
        deviations = {
            "north": s.position, "east": s.position, "current_north": s.current, "current_east": s.current,
            "range_offset": speed * s.clock_offset, "range_drift": speed * 1e-6 * s.clock_drift_ppm,
            "range_scale": s.sound_speed_error, "speed_scale": dvl.scale_error,
            "compass_bias": math.radians(compass.heading_bias_deg) if known else UNKNOWN,
        }  # fmt: skip
        north, east = planned_start(setup)
        walks = SPACE.vector({"current_north": s.current_noise, "current_east": s.current_noise})
        self._filter = BankFilter(
            SPACE.belief({"north": north, "east": east}, deviations), noise, walks=walks, gate=0.9999,
            memory=s.memory, bend=BENT,
        )  # fmt: skip
        self._range_sd = math.hypot(s.range_noise, speed * modem.modem.timing_noise)
        self.reset()

    def reset(self) -> None:
        """Forgets everything."""
        self._history: History[Any] = History(
            self._filter, step=self._setup.period, keep=30.0, verdicts=attrgetter("verdicts")
        )
        self._odometry, self._listener = Odometry(self._setup, slice(3, 6)), Listener(self._modem)
        self._place: tuple[float, float] = planned_start(self._setup)
        self._judged, self._warnings = 0, ()  # after how many ranges they were judged last, and how
        position = self._setup.settings.position**2
        self._spread = position, 0.0, position  # variances of north and of both, of east [m2]

    def update(self, time: float, readings: Sequence[Reading], messages: Sequence[Delivery], commands: Any) -> Estimate:
        """The estimate now, from the readings, messages and commands since the last update."""
        odometry, history = self._odometry, self._history
        odometry.update(time, readings)
        state = None
        if odometry.heading is not None:
            history.append(time, (odometry.forward, odometry.starboard, odometry.heading))
            for sight in self._listener.sights(messages):
                if sight.range is not None:
                    measurement = self._measured(sight)
                    if math.isfinite(measurement.covariance.item()):
                        history.insert(measurement)
                    else:
                        history.refuse(LESS_CERTAIN, measurement)
            state = history.replay()
        n = len(SPACE)
        belief = state.belief if state is not None else Gaussian(mean=np.zeros(n), covariance=np.zeros((n, n)))
        mean = belief.mean
        if state is not None:
            self._place = float(mean[0]), float(mean[1])
            self._spread = (*belief.covariance[np.triu_indices(2)].tolist(),)
        bias = float(mean[8])
        return Estimate(
            time=time,
            position=np.array((mean[0], mean[1], odometry.depth.at(time) or 0.0)),
            heading=wrap((odometry.heading or 0.0) - bias),
            velocity=np.array((odometry.forward, odometry.starboard, odometry.yaw_rate)),
            current=mean[2:4],
            covariance=belief.covariance,
            initialised=state is not None,
            mean=mean,
            refused=sum(history.refused.values()),
            reasons=dict(history.refused),
            reinitialised=history.reinitialised,
            warnings=self._doubts(state) if state is not None else (),
            outcomes=history.outcomes,
        )

    def _doubts(self, state: BankState) -> tuple[str, ...]:
        """Why the estimate may be wrong, judged anew at each range."""
        if state.accepted > max(self._judged, MIN_RANGES - 1):
            self._judged, self._warnings = state.accepted, state.warnings
        return self._warnings

    def _measured(self, sight: Sight) -> Any:
        assert sight.range is not None
        report, own = sight.report, self._odometry.depth.value or 0.0
        found = leader_range(
            sight.range, (report.north, report.east, report.depth - self._modem.transducer[2]),
            deviation=self._range_sd, stamp=sight.stamp, received=sight.received, depth=own,
            leader_deviation=math.sqrt(sight.variance_along(*self._place)), sequence=sight.sequence,
            source=sight.source,
        )  # fmt: skip
        if sight.source not in self._setup.ranging:
            return found
        way, flat = (
            (report.north - self._place[0], report.east - self._place[1]),
            flat_share(sight.range, report.depth - own),
        )
        known = cautious_variance(flat * along(way, *self._spread), found.covariance.item())
        return replace(found, kind=SHARED, covariance=np.array([[known]]))


def motion_radius(setup: NavigatorSetup) -> Navigator:
    """The bank of filters for an unknown current, by ranges to a leader (paper 2)."""
    return MotionRadiusNavigator(setup)
