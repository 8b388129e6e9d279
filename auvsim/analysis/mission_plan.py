"""What a scenario plans, without dynamics: the ways of its vehicles, what each ranges to, and errors of its sensors."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from auvsim.acoustics.clock import ClockSettings
from auvsim.acoustics.modem import ModemSettings
from auvsim.acoustics.payload import NUMBERS, STATE, packet_bits
from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.missions.mission import MissionSetup, Situation
from auvsim.missions.track.mission import Track
from auvsim.navigation.estimate import Estimate
from auvsim.sensors.fix import FixSettings
from auvsim.sensors.range import RangeSettings
from auvsim.simulation.scenario import Scenario
from auvsim.simulation.scenario_settings import VehicleSettings
from auvsim.simulation.sensor_settings import on_board
from auvsim.vehicles import library
from auvsim.water.currents import CurrentField
from estimators.core.models.odometry import SPACE, OdometryNoise
from estimators.docking.usbl import UsblModel

STEP = 1.0  # of planned ways [s]
FADES = np.polynomial.hermite_e.hermegauss(9)  # nodes and weights of a normal variable
BEGIN, CURRENT = 3.0, 0.5  # error of the start [m] and of the current [m/s] along each axis, where nothing says it


@dataclass(frozen=True, kw_only=True, slots=True)
class Way:
    """A planned way, at every STEP."""

    places: Array  # (k + 1, 2) north, east [m]
    depths: Array  # (k + 1,) [m]
    inputs: Array  # (k, 3) speed ahead and to starboard through the water [m/s], heading [rad]

    def at(self, times: Array) -> Array:
        """North, east, depth (t, 3) at times [s]."""
        known = STEP * np.arange(len(self.places))
        columns = (*self.places.T, self.depths)
        return np.stack([np.interp(times, known, column) for column in columns], axis=-1)


Deviation = Callable[[Array], Array]  # distance [m] -> variance, that of one that is heard over how often that is


@dataclass(frozen=True, kw_only=True, slots=True)
class Source:
    """What a vehicle ranges to."""

    name: str
    times: Array  # (k,) of ranges [s]
    places: Array  # (k, 3) north, east, depth then [m]
    range_variance: Deviation  # [m^2]
    bearing_variance: Deviation | None  # [rad^2]; None: it measures none
    by_compass: bool  # whether bearings are by the vehicle's compass
    delay: float  # from then to when it is known [s]
    errors: Mapping[str, float]  # deviations of states of `core.models.odometry` that it brings
    told: "ToldError | None" = None  # of the places; None: they are known

    @property
    def white(self) -> float:
        """Variance [m^2] of white noise of each told place that has the density of what it errs by."""
        return self.told.density / float(np.diff(self.times).mean()) if self.told and len(self.times) > 1 else 0.0


class ToldError(NamedTuple):
    """The error along each axis of a place that its filter follows by fixes, from packet to packet."""

    kept: Array  # (k,) share that is left of the error at the packet before
    added: Array  # (k,) variance of what is new [m^2]
    density: float  # at low frequencies, that of the fixes [m^2 s]


class Odometry(NamedTuple):
    """What a vehicle knows by itself."""

    noise: OdometryNoise
    deviations: Mapping[str, float]  # of states of `core.models.odometry` at the start
    walks: Array  # (9,) densities of random walks of the states


def way(scenario: Scenario, name: str, field: CurrentField) -> Way:
    """The way of a vehicle up to the end of its track, that heads at once where that asks and knows where it is.

    Raises:
        InputError: It has a mission of another kind.
    """
    vehicle = scenario.vehicles[name]
    if getattr(vehicle.mission, "kind", "") != "track":
        kind = getattr(vehicle.mission, "kind", "one of its own")
        raise InputError(f"vehicles.{name}.mission: a bound needs a track, whose way is known before; not {kind}")
    north, east, depth = scenario.start_position(name)
    heading, start = math.radians(vehicle.start.heading_deg), np.array((north, east))
    setup = MissionSetup(
        name=name, settings=vehicle.mission, vehicle=library.vehicle(vehicle.model), heading=heading, depth=depth,
        period=STEP, holds=lambda speed: True, structures={},
    )  # fmt: skip
    mission, place, speed = Track(setup), start, vehicle.start.speed
    places, depths, inputs = [place], [depth], []
    for k in range(math.ceil(scenario.duration / STEP)):
        water = field.evaluate(k * STEP, np.array((*place, depth))).velocity[:2]
        now = Estimate(
            time=k * STEP, position=np.array((*place, depth)), heading=heading,
            velocity=np.array((speed, 0.0, 0.0)), current=water, covariance=np.zeros((8, 8)), initialised=True,
        )  # fmt: skip
        asked = mission.update(Situation(k * STEP, now, heading, depth, None, (), ()))
        if mission.finished:
            break
        heading, depth, speed = asked.heading, asked.depth, asked.speed
        place = place + STEP * (speed * np.array((math.cos(heading), math.sin(heading))) + water)
        places.append(place)
        depths.append(depth)
        inputs.append((speed, 0.0, heading))
    return Way(places=np.array(places), depths=np.array(depths), inputs=np.array(inputs))


def odometry(scenario: Scenario, name: str, own: Way, steady: bool) -> Odometry:
    """Noise and constant errors of a vehicle's DVL and compass, and how well its estimator knows start and current.

    A constant error of the DVL's velocity is one of its scale and of its mounting, at the planned speed.

    Args:
        scenario: Every number definite.
        name: Of the vehicle.
        own: Its way.
        steady: Whether the current is the same everywhere and always; else it walks as the estimator assumes.

    Raises:
        InputError: It has no DVL.
    """
    vehicle = scenario.vehicles[name]
    dvl, compass, estimator = vehicle.sensors.dvl, vehicle.sensors.compass, vehicle.estimator
    if not dvl.enabled:
        raise InputError(
            f"vehicles.{name}.sensors.dvl.enabled: a bound needs a DVL, by which the vehicle reckons; true"
        )
    forward, starboard, _ = dvl.water_noise
    position = float(getattr(estimator, "position", BEGIN))
    current = float(getattr(estimator, "current", CURRENT))
    noise = OdometryNoise(
        forward=forward**2 / dvl.rate,
        starboard=starboard**2 / dvl.rate,
        heading=math.radians(compass.heading_noise_deg) ** 2 / compass.rate,
    )
    constant = dvl.bias / max(0.1, float(own.inputs[:, 0].mean()))
    mounting = math.radians(math.hypot(compass.heading_bias_deg, dvl.misalignment_deg))
    deviations = {
        "north": position, "east": position, "current_north": current, "current_east": current,
        "speed_scale": math.hypot(dvl.scale_error, constant), "compass_bias": math.hypot(mounting, constant),
    }  # fmt: skip
    walk = 0.0 if steady else float(getattr(estimator, "current_noise", 0.0))
    return Odometry(noise, deviations, SPACE.vector({"current_north": walk, "current_east": walk}))


def sources(scenario: Scenario, name: str, ways: Mapping[str, Way]) -> list[Source]:
    """What a vehicle ranges to: modems that tell where they are, or that it asks; beacons; the dock's USBL."""
    vehicle = scenario.vehicles[name]
    found = []
    for other in ways:
        its = scenario.vehicles[other]
        if other != name and its.modem is not None:
            told = _Teller(other, its.modem, its.clock, its, ways[other].at)
            found.append(_told(scenario, name, told))
    for other, fixed in scenario.fixed_modems.items():
        told = _Teller(other, fixed.modem, fixed.clock, None, lambda times, place=fixed.place: _still(times, place))
        found.append(_told(scenario, name, told))
    found = [source for source in found if source is not None]
    for sensor, settings in on_board(vehicle.sensors):
        if isinstance(settings, RangeSettings):
            found.append(_beacon(scenario, sensor, settings))
    dock = vehicle.sensors.usbl.dock or scenario.dock_of(name)
    if vehicle.sensors.usbl.enabled and dock in scenario.structures:
        found.append(_dock(scenario, vehicle, dock))
    return found


def is_fixed(vehicle: VehicleSettings) -> bool:
    """Whether a vehicle has its position from elsewhere, so that there is nothing to bound."""
    return any(isinstance(settings, FixSettings) for _, settings in on_board(vehicle.sensors))


class _Teller(NamedTuple):
    """Who tells its place by modem."""

    name: str
    modem: ModemSettings
    clock: ClockSettings
    vehicle: VehicleSettings | None  # None: its place is known
    at: Callable[[Array], Array]  # times (k,) [s] -> north, east, depth (k, 3) [m]


def _still(times: Array, place: tuple[float, float, float]) -> Array:
    return np.tile(np.array(place), (len(times), 1))


def _told(scenario: Scenario, name: str, teller: _Teller) -> Source | None:
    """A modem that is heard, by one-way or two-way travel time; the error of a beacon's chart does not count."""
    own, its, other = scenario.vehicles[name].modem, teller.modem, teller.name
    if own is None or not own.modem.hears(its.modem):
        return None
    if own.ask.whom == other:
        period, phase, delay = own.ask.period, own.ask.phase + own.turn_around, 0.0
    elif own.one_way and its.tell.period is not None:
        period, phase, delay = its.tell.period, its.tell.phase, its.tell.delay
    else:
        return None
    network, sender, receiver = scenario.network, its.modem, own.modem
    bits = packet_bits(NUMBERS[STATE])
    times = np.arange(phase, scenario.duration, period)
    timing = (own.sound_speed * receiver.timing_noise) ** 2
    told = None
    if teller.vehicle is not None and (fixes := _fixes(teller.vehicle)):
        times = times[times >= 1.0 / fixes.rate]  # who does not know its place tells nothing
        told = told_error(teller.vehicle, times)

    def heard(distance: Array) -> Array:
        nodes, weights = FADES
        noise = network.noise_in(receiver)
        levels = np.array([network.received_level(sender, d) for d in np.ravel(distance)])[:, None] - noise
        snr = levels + network.fading * nodes
        per_bit = 10.0 ** ((snr + sender.coding_gain) / 10.0) * sender.bandwidth / sender.bit_rate
        good = np.exp(bits * np.log1p(-0.5 * np.exp(-0.5 * per_bit))) @ (weights / weights.sum())
        share = (1.0 - network.dropout_probability) * np.maximum(good, 1e-12)
        return share.reshape(np.shape(distance))

    def bearing(distance: Array) -> Array:
        return math.radians(receiver.bearing_noise_deg or 0.0) ** 2 / heard(distance)

    clocks = teller.clock, scenario.vehicles[name].clock
    two_way = own.ask.whom == other
    errors = {
        "range_offset": 0.0 if two_way else own.sound_speed * abs(clocks[0].offset - clocks[1].offset),
        "range_drift": 0.0 if two_way else own.sound_speed * 1e-6 * abs(clocks[0].drift_ppm - clocks[1].drift_ppm),
        "range_scale": abs(own.sound_speed / network.sound_speed - 1.0),
    }
    return Source(
        name=other, times=times, places=teller.at(times), range_variance=lambda distance: timing / heard(distance),
        bearing_variance=None if receiver.bearing_noise_deg is None else bearing, by_compass=True,
        delay=delay + receiver.processing + sender.duration(bits),
        errors=errors, told=told,
    )  # fmt: skip


class _Fixes(NamedTuple):
    """All fixes of a vehicle as those of one sensor."""

    rate: float  # that arrive [1/s]
    variance: float  # of each axis [m^2]


def _fixes(vehicle: VehicleSettings) -> _Fixes | None:
    all_ = [s for _, s in on_board(vehicle.sensors) if isinstance(s, FixSettings) and s.dropout_probability < 1.0]
    if not all_:
        return None
    rates = [s.rate * (1.0 - s.dropout_probability) for s in all_]
    return _Fixes(sum(rates), sum(rates) / sum(r / s.noise**2 for r, s in zip(rates, all_, strict=True)))


def told_error(vehicle: VehicleSettings, times: Array) -> ToldError:
    """How the error of a vehicle with fixes goes on between `times` (k,) [s], at which it tells its place.

    It is as large as the vehicle's filter says: its gain lets it forget a fix only slowly, so that what it tells has
    the density of the fixes' white noise at low frequencies and much less at high ones.
    """
    fixes = _fixes(vehicle)
    assert fixes is not None
    walk = float(getattr(vehicle.estimator, "position_noise", 0.0))
    kept, added = np.ones(len(times)), np.zeros(len(times))
    P, last, count = 0.0, 1.0 / fixes.rate, 0
    for k, time in enumerate(times.tolist()):
        while (count + 1) / fixes.rate <= time + 1e-9:
            count += 1
            new = walk * max(0.0, count / fixes.rate - last)
            P += new
            gain = P / (P + fixes.variance) if count > 1 else 1.0
            P, last = gain * fixes.variance, count / fixes.rate
            kept[k] *= 1.0 - gain
            added[k] = (1.0 - gain) ** 2 * (added[k] + new) + gain**2 * fixes.variance
        new = walk * (time - last)
        P, added[k], last = P + new, added[k] + new, time
    return ToldError(kept, added, fixes.variance / fixes.rate)


def _beacon(scenario: Scenario, sensor: str, s: RangeSettings) -> Source:
    times = np.arange(1.0 / s.rate, scenario.duration, 1.0 / s.rate)

    def variance(distance: Array) -> Array:
        return np.where(distance <= s.maximum, s.noise**2 / max(1.0 - s.dropout_probability, 1e-12), np.inf)

    return Source(
        name=sensor, times=times, places=_still(times, s.beacon), range_variance=variance,
        bearing_variance=None, by_compass=True, delay=0.0,
        errors={"range_offset": s.bias, "range_scale": s.scale_error},
    )  # fmt: skip


def _dock(scenario: Scenario, vehicle: VehicleSettings, dock: str) -> Source:
    """The dock's USBL, whose fix is a range and a bearing by the dock's compass."""
    usbl, link, pose = vehicle.sensors.usbl, scenario.network.acoustics, scenario.structures[dock].pose
    ranges, deviations = zip(*usbl.noise, strict=True)
    model = UsblModel(ranges=ranges, deviations=tuple(max(1e-6, usbl.noise_scale * d) for d in deviations))
    times = np.arange(usbl.interval, scenario.duration, usbl.interval)
    reach = usbl.maximum_range or math.inf

    def square(distance: Array) -> Array:
        deviation = np.vectorize(model.deviation)(distance)
        return np.where(distance <= reach, deviation**2 / max(1.0 - link.dropout_probability, 1e-12), np.inf)

    def bearing(distance: Array) -> Array:
        return square(distance) / np.maximum(distance, 1.0) ** 2 + math.radians(usbl.dock_heading_bias_deg) ** 2

    return Source(
        name=dock, times=times, places=np.tile(pose.position, (len(times), 1)), range_variance=square,
        bearing_variance=bearing, by_compass=False, delay=link.delay, errors={},
    )  # fmt: skip
