"""Trials of a hovering vehicle: speed against force by axis, stopping, a step of its place, holding in a current."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from auvsim.base.frames import Array
from auvsim.control.hovering import Hovering, HoveringSettings
from auvsim.physics import hydrodynamics
from auvsim.physics.planar_fit import Level
from auvsim.physics.truth import Truth
from auvsim.simulation import controllers
from auvsim.simulation.sea_trials import DEPTH, PERIOD, Bench
from auvsim.vehicles import library
from auvsim.vehicles.actuation import Wrench

AXES = {"ahead": (0, 1.0), "astern": (0, -1.0), "to starboard": (1, 1.0), "down": (2, 1.0), "up": (2, -1.0),
        "turning": (5, 1.0)}  # fmt: skip
STEP = 1.0  # of the place [m]
STILL = 0.05  # speed at which it counts as stopped [m/s]


@dataclass(frozen=True, kw_only=True, slots=True)
class Axis:
    """Speed against force along an axis, up to the largest that the thrusters give."""

    name: str
    curve: Array  # (k, 2) force [N] or moment [N m], and speed [m/s] or rate [rad/s]

    @property
    def top(self) -> tuple[float, float]:
        """Largest force and speed."""
        force, speed = self.curve[-1].tolist()
        return force, speed


@dataclass(frozen=True, kw_only=True, slots=True)
class HoverTrials:
    """What a vehicle that thrusters drive does."""

    model: str
    mass: float  # [kg]
    buoyancy: float  # net, positive floats [N]
    length: float  # [m]
    axes: tuple[Axis, ...]
    hover_share: float  # largest share of a thruster's thrust to hover in still water
    stopping_distance: float  # from 0.75 of its top speed, by its controller [m]
    stopping_time: float  # [s]
    stop_series: Array  # (n, 2) time [s], surge [m/s]
    step_series: Array  # (n, 4) time [s], place ahead [m], pitch and roll [rad], of a step ahead
    rise_time: float  # of that step, to nine tenths [s]
    overshoot: float  # of it [m]
    holding: (
        Array  # (k, 3) current across [m/s], largest error after a minute [m], largest share of a thruster's thrust
    )


class _Pilot:
    """The vehicle's hovering controller, which sees the truth."""

    def __init__(self, model: str) -> None:
        found = controllers.of_model(model)
        self.settings = HoveringSettings.model_validate(found if found.get("kind") == "hovering" else {})
        self._law = Hovering(self.settings, PERIOD)

    def hold(self, truth: Truth, place: Array) -> Wrench:
        """The demand at a place (3,) to be held, looking north."""
        return self._law.command(place - truth.position, truth.attitude, truth.nu, 0.0)


def run(model: str, progress: Callable[[float], None] = lambda _: None) -> HoverTrials:
    """Runs the trials of a vehicle that thrusters drive.

    Args:
        model: name in models/, or the path of an MJCF file.
        progress: told the share that is done.

    Raises:
        InputError: the vehicle cannot be used.
    """
    vehicle, level = library.vehicle(model), Level(model, hydrodynamics.SEA_WATER)
    actuation, bench, here = vehicle.actuation, Bench(model), np.array([0.0, 0.0, DEPTH])
    axes = tuple(Axis(name=name, curve=_curve(level, at, side)) for name, (at, side) in AXES.items())
    rest = Wrench(*(-level.resistance(np.zeros(6))).tolist())
    progress(0.2)
    pilot, top = _Pilot(model), axes[0].top[1]
    bench.sail(lambda _, t: pilot.hold(t, here), 20.0, start=rest)  # its integral finds the trim
    fast = Wrench(*(-level.resistance((0.75 * top, 0.0, 0.0, 0.0, 0.0, 0.0))).tolist())
    stop = bench.sail(lambda _, t: pilot.hold(t, here), 60.0, start=fast, speed=0.75 * top, until=_is_still)
    progress(0.4)
    pilot, goal = _Pilot(model), here + np.array((STEP, 0.0, 0.0))
    bench.sail(lambda _, t: pilot.hold(t, here), 20.0, start=rest)
    step = bench.sail(lambda _, t: pilot.hold(t, goal), 40.0)
    ahead = np.array([t.position[0] for t in step])
    progress(0.6)
    holding = [_held(model, speed, rest, here) for speed in (0.1, 0.2, 0.3, 0.4, 0.5)]
    return HoverTrials(
        model=vehicle.model, mass=level.mass, length=vehicle.length, axes=axes,
        buoyancy=9.81 * (hydrodynamics.SEA_WATER * level.volume - level.mass),
        hover_share=float(actuation.shares(rest).max()),
        stopping_distance=float(max(t.position[0] for t in stop)), stopping_time=PERIOD * (len(stop) - 1),
        stop_series=np.array([(PERIOD * k, t.nu[0]) for k, t in enumerate(stop)]),
        step_series=np.array([(PERIOD * k, t.position[0], *t.attitude[1::-1]) for k, t in enumerate(step)]),
        rise_time=float(PERIOD * np.argmax(ahead >= 0.9 * STEP)) if (ahead >= 0.9 * STEP).any() else math.nan,
        overshoot=float(max(ahead.max() - STEP, 0.0)), holding=np.array(holding),
    )  # fmt: skip


def _curve(level: Level, at: int, side: float, points: int = 25) -> Array:
    """Force and speed (k, 2) along an axis, up to the largest that the thrusters give."""
    still = level.resistance(np.zeros(6))

    def needed(speed: float) -> Array:
        nu = np.zeros(6)
        nu[at] = side * speed
        return -level.resistance(nu)

    low, high = 0.0, 20.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        fits = bool(level.actuation.shares(needed(middle)).max() <= 1.0)
        low, high = (middle, high) if fits else (low, middle)
    speeds = np.linspace(0.0, low, points)
    return np.array([(abs(float((needed(speed) + still)[at])), speed) for speed in speeds])


def _is_still(truth: Truth) -> bool:
    return truth.nu[0] < STILL


def _held(model: str, speed: float, rest: Wrench, here: Array) -> tuple[float, float, float]:
    """Current across [m/s], the largest error of the place in the last ten of sixty seconds [m], largest share then."""
    bench, pilot, shares = Bench(model, (0.0, speed, 0.0)), _Pilot(model), []

    def demand(_: float, truth: Truth) -> Wrench:
        wanted = pilot.hold(truth, here)
        shares.append(float(bench.actuation.shares(wanted).max()))
        return wanted

    found = bench.sail(demand, 60.0, start=rest)
    late = found[-100:]
    return speed, float(max(np.linalg.norm(t.position - here) for t in late)), max(shares[-100:])
