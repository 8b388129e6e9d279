"""Adapter of paper 3's estimators to the contract of a run: a follower that hears pulses and late packets."""

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from auvsim.acoustics.message import Delivery
from auvsim.acoustics.payload import NUMBERS, PULSE, STATE, packet_bits
from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.navigation.estimate import Estimate
from auvsim.navigation.heard import Listener
from auvsim.navigation.measurements import of_kind
from auvsim.navigation.navigator import Navigator, NavigatorSetup
from auvsim.navigation.odometry import UNKNOWN, Odometry, planned_start, required
from auvsim.sensors.compass import CompassSettings
from auvsim.sensors.dvl import DvlSettings
from auvsim.sensors.gyro import GyroSettings
from estimators.core.types import Gaussian, Outcome
from estimators.path_prediction.choosing import ChoosingFilter
from estimators.path_prediction.cloning import CloningFilter
from estimators.path_prediction.kinematics import advance
from estimators.path_prediction.messages import Noise, Packet, Pulse
from estimators.path_prediction.real_time import RealTimeFilter


class PathPredictionNavigator:
    """Paper 3's problem, by the filter that chooses between SC-EKF and SC-RT; see `estimators`.

    Odometry is a DVL's bottom track and a gyro; it goes where its course over ground leads, so no current matters.
    The follower is kept back by what a modem takes to hand over a packet, so that each pulse is heard at the time of
    its arrival, and moved on from there by odometry for each estimate.
    """

    states: Mapping[str, str] = MappingProxyType({"north": "m", "east": "m", "course": "rad"})

    def __init__(self, setup: NavigatorSetup) -> None:
        dvls, gyros = of_kind(setup.sensors, DvlSettings), of_kind(setup.sensors, GyroSettings)
        required(
            setup,
            ("a DVL (sensors.dvl.enabled: true)", bool(dvls)),
            ("a gyro (sensors.gyro.enabled: true)", bool(gyros)),
        )
        s, modem = setup.settings, setup.modem
        assert modem is not None
        self._setup, self._modem = setup, modem
        dvl, gyro = next(iter(dvls.values())), next(iter(gyros.values()))
        self._noise = Noise(
            speed=dvl.bottom_noise[0] ** 2 / dvl.rate + s.position_noise,
            yaw_rate=math.radians(gyro.noise_density_deg) ** 2 + s.heading_noise,
        )
        own = modem.modem
        self._lag = (
            own.duration(packet_bits(NUMBERS[STATE])) + own.processing + own.processing_jitter + 2.0 * setup.period
        )
        self._range_sd = math.hypot(s.range_noise, modem.sound_speed * own.timing_noise)
        bearing = own.bearing_noise_deg
        self._bearing_sd = math.inf if bearing is None else math.radians(max(bearing, 1e-3))
        self.reset()

    def reset(self) -> None:
        """Forgets everything."""
        self._odometry = Odometry(self._setup, slice(0, 3))
        self._follower: ChoosingFilter | None = None
        self._begun = 0.0  # when the follower began [s]
        self._steps: list[tuple[float, float, float]] = []  # time [s], speed and yaw rate until then
        self._heard: list[tuple[float, bool, Pulse | Packet]] = []  # by time [s]
        self._leaders: set[str] = set()
        self._first: float | None = None  # stamp of the first pulse heard, which has the number 0 [s]
        self._drift, self._time = 0.0, 0.0  # course less heading [rad], time of the last update [s]

    def update(self, time: float, readings: Sequence[Reading], messages: Sequence[Delivery], commands: Any) -> Estimate:
        """The estimate now, from the readings, messages and commands since the last update."""
        odometry = self._odometry
        odometry.update(time, readings)
        drift = math.atan2(odometry.starboard, odometry.forward)
        turned, dt = wrap(drift - self._drift), time - self._time
        self._drift, self._time = drift, time
        if self._follower is None and odometry.heading is not None and odometry.known:
            self._begin(time, odometry.heading + drift)
        elif self._follower is not None:
            speed = math.hypot(odometry.forward, odometry.starboard)
            self._steps.append((time, speed, odometry.yaw_rate + turned / dt))
        outcomes = tuple(self._take(messages))
        if self._follower is None:
            return self._estimate(time, np.zeros(3), np.zeros((3, 3)), outcomes)
        self._advance(time - self._lag)
        belief = self._follower.belief
        mean, covariance, now = belief.mean.copy(), belief.covariance.copy(), self._follower.time
        for end, speed, yaw_rate in self._steps:
            advance(mean, covariance, 0, speed, yaw_rate, end - now, *self._noise)
            now = end
        return self._estimate(time, mean, covariance, outcomes)

    def _begin(self, time: float, course: float) -> None:
        s = self._setup.settings
        compass = self._setup.sensors.get("compass")
        bias = math.radians(compass.heading_bias_deg) if isinstance(compass, CompassSettings) else UNKNOWN
        start = Gaussian(
            mean=np.array((*planned_start(self._setup), course)),
            covariance=np.diag((s.position**2, s.position**2, bias**2 + math.radians(s.heading) ** 2)),
        )
        leader = Noise(speed=s.leader_speed_noise, yaw_rate=s.leader_yaw_noise)
        slots = math.ceil(s.delay / s.period) + 4
        self._follower = ChoosingFilter(
            CloningFilter(start, self._noise, clones=slots),
            RealTimeFilter(start, self._noise, leader, period=s.period, slots=slots),
        )
        for member in (self._follower, *self._follower.members):
            member.time = time

    def _advance(self, until: float) -> None:
        """Moves the follower on to a time [s], with what was heard before."""
        follower = self._follower
        assert follower is not None
        while self._heard and self._heard[0][0] <= until:
            at, is_packet, what = self._heard.pop(0)
            self._move(max(at, follower.time))
            (follower.receive if is_packet else follower.hear)(what)  # pyright: ignore[reportArgumentType]
        self._move(max(until, follower.time))

    def _move(self, until: float) -> None:
        follower = self._follower
        assert follower is not None
        while self._steps and follower.time < until:
            end, speed, yaw_rate = self._steps[0]
            stop = min(end, until)
            follower.advance(stop, speed, yaw_rate)
            if stop >= end:
                self._steps.pop(0)

    def _take(self, messages: Sequence[Delivery]) -> Iterator[Outcome]:
        s = self._setup.settings
        for delivery in messages:
            m = delivery.message
            if m.kind not in (PULSE, STATE):
                continue
            reason = "no_model" if self._leaders and m.source not in self._leaders else ""
            self._leaders.add(m.source) if not reason else None
            yield Outcome(m.kind, m.source, m.sent, m.sequence, not reason, reason, math.nan)
            if reason:
                continue
            stamp = m.sent if m.kind == PULSE else m.payload[0]
            self._first = first = stamp if self._first is None else self._first
            number = round((stamp - first) / s.period)
            if delivery.range is not None and (m.kind == PULSE or abs(stamp - m.sent) < 0.01):
                arrival = Listener(self._modem).arrival(delivery)
                pulse = Pulse(number, stamp, arrival, self._flat(delivery), self._range_sd**2)
                if delivery.bearing is not None:
                    pulse = pulse._replace(
                        bearing=wrap(delivery.bearing - self._drift), bearing_variance=self._bearing_sd**2
                    )
                self._heard.append((arrival, False, pulse))
            if m.kind == STATE:
                self._heard.append((delivery.received, True, self._packet(number, delivery)))
        self._heard.sort(key=lambda item: item[:2])

    def _flat(self, delivery: Delivery) -> float:
        """The range in the plan view, if the message says how deep the other is."""
        assert delivery.range is not None
        if delivery.message.kind != STATE:
            return delivery.range
        down = delivery.message.payload[3] - (self._odometry.depth.value or 0.0)
        return math.sqrt(max(delivery.range**2 - down**2, 0.0))

    def _packet(self, number: int, delivery: Delivery) -> Packet:
        stamp, north, east, _, heading, vn, ve, yaw_rate, nn, ne, nh, ee, eh, hh = delivery.message.payload
        covariance = np.array(((nn, ne, nh), (ne, ee, eh), (nh, eh, hh)))
        return Packet(
            number, stamp, delivery.received, np.array((north, east, heading)), covariance, math.hypot(vn, ve), yaw_rate
        )

    def _estimate(self, time: float, mean: Any, covariance: Any, outcomes: tuple[Outcome, ...]) -> Estimate:
        odometry = self._odometry
        return Estimate(
            time=time,
            position=np.array((mean[0], mean[1], odometry.depth.at(time) or 0.0)),
            heading=wrap(float(mean[2]) - self._drift),
            velocity=np.array((odometry.forward, odometry.starboard, odometry.yaw_rate)),
            current=np.zeros(2),
            covariance=covariance,
            initialised=self._follower is not None,
            mean=mean,
            outcomes=outcomes,
        )


def path_prediction(setup: NavigatorSetup) -> Navigator:
    """The filter that chooses between SC-EKF and SC-RT, by late pulses and packets of a leader (paper 3)."""
    return PathPredictionNavigator(setup)
