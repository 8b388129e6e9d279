"""A formation judged: the bound of its follower, the best move of each leader, and a map of the bound around it."""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from auvsim.analysis import bound_maps
from auvsim.analysis.bound_maps import MapEllipse, Symbol
from auvsim.base.frames import Array
from estimators.core.information import Ellipse, bound, error_ellipse, rms_bound
from estimators.formation import placement
from estimators.formation.models import DeadReckoning, InputNoise
from estimators.formation.placement import NOTHING, Objective, Reach

CELLS = 121  # of the map on each side
BLIND = 10.0  # times the least error there is, from which a place counts as blind
LEADER, FOLLOWER, MOVED = "#d62728", "#1f77b4", "#7a3db8"


@dataclass(frozen=True, kw_only=True, slots=True)
class Formation:
    """Leaders and a follower."""

    leaders: Array  # (n, 3) north, east, depth [m]
    follower: Array  # (3,) [m]
    deviations: Array  # (n,) of the ranges [m]
    speed: float  # of all [m/s]
    heading: float  # of all, clockwise from north [rad]
    step: float  # between ranges [s]
    reach: Reach
    noise: InputNoise = field(default_factory=InputNoise)


class Move(NamedTuple):
    """The best place of one leader, the others staying."""

    place: Array  # (2,) north, east [m]
    distance: float  # from where it is [m]
    rms: float  # least rms error in steady motion then [m]


class Judgement(NamedTuple):
    """What a formation tells."""

    snapshot: float  # least rms error by one set of ranges [m]; infinite if a direction is open
    ellipse: Ellipse  # of one set of ranges
    steady: float  # least rms error in steady motion [m]; infinite if a direction is open
    moves: tuple[Move, ...]  # of each leader alone
    together: Array  # (n, 2) places of all leaders when all may move [m]
    together_rms: float  # least rms error in steady motion then [m]
    best_snapshot: float  # least rms error of so many ranges, wherever leaders stand [m]


def judge(formation: Formation) -> Judgement:
    """Bounds, and the best moves within reach by the bound in steady motion."""
    f, leaders, follower = formation, formation.leaders[:, :2], formation.follower[:2]
    steady, snapshot = objectives(f)
    moves = []
    for index in range(len(leaders)):
        place = placement.best_move(follower, leaders, index, steady, f.reach)
        moved = leaders.copy()
        moved[index] = place
        distance = float(np.linalg.norm(place - leaders[index]))
        moves.append(Move(place, distance, _open(steady(follower, moved))))
    together = placement.best_formation(follower, leaders, steady, f.reach)
    F = placement.horizontal_information(follower, leaders, f.deviations, _below(f))
    total = float((f.deviations**-2.0).sum())
    best = math.sqrt(total / placement.best_determinant(f.deviations)) if len(leaders) > 1 else math.inf
    return Judgement(
        _open(snapshot(follower, leaders)), error_ellipse(bound(F)), _open(steady(follower, leaders)), tuple(moves),
        together, _open(steady(follower, together)), best,
    )  # fmt: skip


def objectives(formation: Formation) -> tuple[Objective, Objective]:
    """Least rms error in steady motion, and by one set of ranges, as functions of horizontal places."""
    f = formation
    process, u = DeadReckoning(f.noise), (max(f.speed, 1e-3), f.heading)
    return (
        placement.steady_rms_in_motion(f.deviations, process, u, f.step, _below(f)),
        placement.snapshot_rms(f.deviations, _below(f)),
    )


def draw(formation: Formation, found: Judgement) -> Figure:
    """The map of the bound of one set of ranges at the follower's depth, and the best moves."""
    f, leaders, follower = formation, formation.leaders[:, :2], formation.follower[:2]
    north, east = _grid(f, found)
    shown = bound_maps.sample(lambda points: _rms(f, points), north, east)
    finite = shown.bound[np.isfinite(shown.bound)]
    blind = BLIND * float(finite.min()) if finite.size else math.inf
    symbols = [Symbol("leader", *place, heading=f.heading, colour=LEADER) for place in leaders]
    moved = found.together[np.linalg.norm(found.together - leaders, axis=1) > 0.0]
    symbols += [Symbol("leader, all moved", *place, heading=f.heading, colour=MOVED) for place in moved]
    symbols.append(Symbol("follower", *follower, heading=f.heading, colour=FOLLOWER))
    figure = Figure(figsize=(9.5, 9.0), layout="constrained")
    axes = figure.subplots()
    span = float(east[-1] - east[0])
    places = _ellipse_places(f, north, east)
    ellipses = [error_ellipse(bound(_information(f, place))) for place in places]
    seen = [(place, e) for place, e in zip(places, ellipses, strict=True) if e.major < blind]
    largest = max((e.major for _, e in seen), default=1.0)
    scale = _round_down(0.05 * span / largest)
    marks = [MapEllipse(float(place[0]), float(place[1]), e) for place, e in seen]
    text = "none, a direction is open" if math.isinf(found.steady) else f"{found.steady:.2f} m"
    bound_maps.draw(
        axes, shown, title=f"Ranges to {len(leaders)} leaders; least error of the follower in steady motion: {text}",
        blind=blind, symbols=symbols, ellipses=marks, ellipse_scale=scale,
        quantity="least rms error by one set of ranges [m]",
    )  # fmt: skip
    for place, move in zip(leaders, found.moves, strict=True):
        if move.distance > 0.0:
            arrow = {"arrowstyle": "-|>", "color": LEADER, "lw": 1.4, "ls": "--"}
            axes.annotate("", xy=tuple(move.place[::-1]), xytext=tuple(place[::-1]), arrowprops=arrow, zorder=6)
    axes.plot([], [], "--", color=LEADER, label="best move of one alone")
    handles, _ = axes.get_legend_handles_labels()
    legend = axes.get_legend()
    if legend is not None:
        handles = [*legend.legend_handles, handles[-1]]
        axes.legend(
            handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=3, fontsize=9.0, frameon=False
        )
    return figure


def _information(f: Formation, place: Array) -> Array:
    return placement.horizontal_information(place, f.leaders[:, :2], f.deviations, _below(f))


def _rms(f: Formation, points: Array) -> Array:
    found = np.full(len(points), np.nan)
    apart = np.linalg.norm(points[:, None] - f.leaders[:, :2], axis=-1).min(axis=1) > 1e-6
    found[apart] = rms_bound(np.array([_information(f, place) for place in points[apart]]))
    return found


def _below(f: Formation) -> Array:
    return f.leaders[:, 2] - f.follower[2]


def _grid(f: Formation, found: Judgement) -> tuple[Array, Array]:
    places = np.vstack((f.leaders[:, :2], f.follower[None, :2], found.together, *(m.place[None] for m in found.moves)))
    centre = (places.min(axis=0) + places.max(axis=0)) / 2.0
    half = 0.65 * float(max((places.max(axis=0) - places.min(axis=0)).max(), 10.0))
    return np.linspace(centre[0] - half, centre[0] + half, CELLS), np.linspace(
        centre[1] - half, centre[1] + half, CELLS
    )


def _ellipse_places(f: Formation, north: Array, east: Array) -> list[Array]:
    """The follower's place, and a coarse grid that keeps off the leaders."""
    shares = (0.2, 0.5, 0.8)
    grid = [np.array([north[0] + a * np.ptp(north), east[0] + b * np.ptp(east)]) for a in shares for b in shares]
    keep = 0.08 * float(np.ptp(north))
    others = np.vstack((f.leaders[:, :2], f.follower[None, :2]))
    return [f.follower[:2], *(p for p in grid if np.linalg.norm(others - p, axis=1).min() > keep)]


def _round_down(value: float) -> float:
    power = 10.0 ** math.floor(math.log10(value))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= value)


def _open(value: float) -> float:
    return math.inf if value >= NOTHING else value
