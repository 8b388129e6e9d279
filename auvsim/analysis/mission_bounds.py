"""The Cramér-Rao bound of a mission before it is run: position and current of each follower, over where another starts.

What is planned is taken as the truth. Losses count by their probability at the distance; packets do not collide.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvsim.analysis.mission_plan import STEP, Odometry, Source, Way, is_fixed, odometry, sources, way
from auvsim.analysis.mission_posterior import DRAWS, Ranges, expected_error
from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.base.randomness import stream
from auvsim.simulation import building
from auvsim.simulation.scenario import Scenario
from estimators.core.models.odometry import SPACE, Displacement, N
from estimators.core.odometry_bounds import Sights, Told, bounds, observability, sampled
from estimators.core.types import Gaussian
from estimators.motion_radius.bank import BankFilter, BankState
from estimators.motion_radius.geometry import PROBABLE, second_solution
from estimators.motion_radius.ranges import leader_range

OUTPUTS = 40  # times at which the bound is kept
COARSE = 13  # stations along each axis at which mirror solutions are looked for
FEW = 3  # stations along each axis at which posteriors are integrated
NARROW = 0.1  # deviation of the current of filters that look for mirror solutions [m/s]
HEARD = 0.5  # share of packets that arrive from which a source counts as heard
BLOCK = 500  # stations at once, for the memory
Progress = Callable[[float, float], None]


@dataclass(frozen=True, kw_only=True, slots=True)
class FollowerBound:
    """The bound of one follower, for each start of what is moved."""

    follower: str
    moved: str  # what starts elsewhere
    start: tuple[float, float]  # where the scenario has it start: north, east [m]
    north: Array  # (m,) starts [m]
    east: Array  # (n,) [m]
    times: Array  # (o,) [s]
    position: Array  # (m, n, o) least rms error [m]
    current: Array  # (m, n, o) least rms error [m/s]
    rank: Array  # (m, n) how many of position and current (4) are told to first order
    condition: Array  # (m, n) of that information
    mirror: Array  # (m, n) probability of a second solution that fits as well
    beyond: Array  # (m, n) rms error [m] to expect beyond first order, at some blind and mirrored stations; else NaN
    after: float  # from when on `settled` counts [s]
    blind_above: float  # bound that counts as blind [m]
    ways: dict[str, Way]

    @property
    def settled(self) -> Array:
        """Least rms error (m, n) of the position [m], over the times from `after` on."""
        return np.sqrt(np.mean(self.position[..., self.times >= self.after] ** 2, axis=-1))

    @property
    def expected(self) -> Array:
        """Rms error (m, n) of the position to expect from the best estimator [m]; NaN where only `beyond` knows."""
        unsure = (self.rank < 4) | (self.mirror > PROBABLE)
        return np.where(unsure, self.beyond, self.settled)

    @property
    def blind(self) -> NDArray[np.bool_]:
        """Where (m, n) the geometry does not tell position and current, or so little that it does not help."""
        return (self.rank < 4) | (self.settled >= self.blind_above) | np.isnan(self.settled)

    @property
    def mirrored(self) -> NDArray[np.bool_]:
        """Where (m, n) a second solution is too probable to be ruled out, and yet not blind."""
        return (self.mirror > PROBABLE) & np.logical_not(self.blind)


def mission_bounds(
    scenario: Scenario,
    *,
    moved: str | None = None,
    seed: int = 0,
    span: float | None = None,
    side: int = 51,
    after: float | None = None,
    blind: float = 50.0,
    draws: int = DRAWS,
    progress: Progress | None = None,
) -> list[FollowerBound]:
    """The bounds of all followers: vehicles that range to something and have no positions from elsewhere.

    Args:
        scenario: Every number definite.
        moved: Vehicle, range sensor (its beacon) or structure that starts at each station; None: what the first
            follower hears first.
        seed: Of the current, where that is random, and of missions drawn where first order says nothing.
        span: Width of the square of stations about the follower's start [m]; None: such that the scenario's fits.
        side: Stations along each axis.
        after: From when on the position counts [s]; None: from a third of the duration on.
        blind: Bound of the position that counts as blind [m].
        draws: Missions drawn at stations where first order says nothing; 0: what to expect there stays unknown.
        progress: Called with what is done and the total of it.

    Raises:
        InputError: Nobody ranges to anything, or nobody to what is moved, or a way or sensor is not one to bound.
    """
    field = building.current(scenario, seed)
    tracks = [name for name, v in scenario.vehicles.items() if getattr(v.mission, "kind", "") == "track"]
    ways = {name: way(scenario, name, field) for name in tracks}
    heard = {n: sources(scenario, n, ways) for n, v in scenario.vehicles.items() if not is_fixed(v) and n in ways}
    heard = {name: found for name, found in heard.items() if found}
    if not heard:
        raise InputError(
            "no vehicle on a track ranges to anything: a follower needs a modem that hears one that tells "
            "(modem.tell.period), a sensor of kind range, or a dock's USBL, and no sensor of kind fix"
        )
    names = list(dict.fromkeys(s.name for found in heard.values() for s in found))
    if moved is not None and moved not in names:
        raise InputError(f"--move {moved}: nobody ranges to it; they do to {', '.join(names)}")
    moved = moved or names[0]
    followers = [name for name, found in heard.items() if any(s.name == moved for s in found)]
    steady, found = field.steady_uniform, []
    for count, name in enumerate(followers):
        done = _Share(progress, count, len(followers))
        found.append(
            _bound(scenario, name, heard[name], moved, ways, steady, span, side, after, blind, done, seed, draws)
        )
    return found


class _Share:
    """The part of a progress bar that is one follower's."""

    def __init__(self, progress: Progress | None, number: int, count: int) -> None:
        self._progress, self._number, self._count = progress, number, count

    def __call__(self, share: float) -> None:
        if self._progress:
            self._progress(self._number + share, self._count)


def _bound(
    scenario: Scenario, name: str, heard: Sequence[Source], moved: str, ways: dict[str, Way], steady: bool,
    span: float | None, side: int, after: float | None, blind: float, done: _Share, seed: int, draws: int,
) -> FollowerBound:  # fmt: skip
    own = ways[name]
    about = odometry(scenario, name, own, steady)
    mover = next(s for s in heard if s.name == moved)
    north_0, east_0 = (ways[moved].places[0] if moved in ways else mover.places[0, :2]).tolist()
    start = (north_0, east_0)
    middle = own.places[0]
    half = 0.5 * span if span else max(400.0, 2.0 * float(np.abs(np.array(start) - middle).max()))
    end = STEP * min(len(way.inputs) for way in ways.values())
    north, east = (np.linspace(c - half, c + half, side) for c in middle.tolist())
    prior, times, order, rows, outputs = _sights(own, about, heard, end)
    stations = np.stack(np.meshgrid(north, east, indexing="ij"), axis=-1).reshape(-1, 2)
    results = []
    for k in range(0, len(stations), BLOCK):
        results.append(
            _at(stations[k : k + BLOCK], start, own, about, heard, moved, prior, times, order, rows, outputs)
        )
        done(0.7 * min(1.0, (k + BLOCK) / len(stations)))
    covariance, rank, condition = (np.concatenate(parts) for parts in zip(*results, strict=True))
    shape = (side, side)
    coarse = [np.linspace(axis[0], axis[-1], min(COARSE, side)) for axis in (north, east)]
    mirror = _mirrors(coarse, start, own, about, heard, moved, prior, times, order, rows, done)
    mirror = _nearest(coarse, mirror, (north, east))
    after = end / 3.0 if after is None else after
    unsure = (rank.reshape(shape) < 4) | (mirror > PROBABLE)
    beyond = np.full(shape, np.nan)
    for m, n in _few(north, east, start, unsure):
        relative = _relative(np.array([[north[m], east[n]]]), start, own, heard, moved, times, order)
        ranges = Ranges(times, rows, relative[0], _variances(heard, relative, order)[0][0], _told(heard, order))
        if draws and all(source.bearing_variance is None for source in heard):
            beyond[m, n] = expected_error(ranges, prior, about.walks, after, stream(seed, 0, "error to expect"), draws)
    variance = np.diagonal(covariance, axis1=2, axis2=3).reshape(*shape, len(outputs), -1)
    return FollowerBound(
        follower=name, moved=moved, start=start, north=north, east=east, times=times[outputs],
        position=np.sqrt(variance[..., :2].sum(axis=-1)), current=np.sqrt(variance[..., 2:4].sum(axis=-1)),
        rank=rank.reshape(shape), condition=condition.reshape(shape), mirror=mirror, beyond=beyond,
        after=after, blind_above=blind, ways=ways,
    )  # fmt: skip


def _sights(own: Way, about: Odometry, heard: Sequence[Source], end: float):
    """Prior (9, 9), times (k,) up to `end` [s], source and number of each, displacements (k, 6), those kept."""
    deviations = dict(about.deviations)
    for source in heard:
        for state, deviation in source.errors.items():
            deviations[state] = max(deviations.get(state, 0.0), deviation)
    prior = np.diag(SPACE.vector(deviations) ** 2)
    every = sorted((t, s, k) for s, source in enumerate(heard) for k, t in enumerate(source.times.tolist()) if t <= end)
    if not every:
        raise InputError(f"nothing is ranged to in the {end:g} s before the first track ends")
    times = np.array([t for t, _, _ in every])
    order = np.array([(s, k) for _, s, k in every])
    steps = sampled(own.inputs, STEP, about.noise)
    total = np.vstack((np.zeros(6), np.cumsum(steps, axis=0)))
    known = STEP * np.arange(len(total))
    reached = np.stack([np.interp(times, known, column) for column in total.T], axis=-1)
    rows = np.diff(reached, axis=0, prepend=np.zeros((1, 6)))
    outputs = np.unique(np.linspace(0, len(times) - 1, OUTPUTS).round().astype(np.int64))
    return prior, times, order, rows, outputs


def _relative(
    stations: Array, start, own: Way, heard: Sequence[Source], moved: str, times: Array, order: Array
) -> Array:
    """(s, k, 3) from what is ranged to the vehicle, and how deep below it that is."""
    places = np.array([heard[s].places[k] for s, k in order])
    moves = np.array([heard[s].name == moved for s, _ in order])
    shift = (stations - np.array(start))[:, None, :] * moves[:, None]
    mine = own.at(times)
    flat = mine[:, :2] - places[:, :2] - shift
    below = np.broadcast_to(places[:, 2] - mine[:, 2], flat.shape[:2])
    return np.concatenate((flat, below[..., None]), axis=-1)


def _variances(heard: Sequence[Source], relative: Array, order: Array) -> tuple[Array, Array]:
    """Of ranges and of bearings (s, k), infinite where there is none."""
    distance = np.maximum(np.linalg.norm(relative, axis=-1), 1.0)
    ranges, bearings = np.full(distance.shape, np.inf), np.full(distance.shape, np.inf)
    for s, source in enumerate(heard):
        of = order[:, 0] == s
        # A smooth function of distance, so that it is tabulated.
        table = np.geomspace(1.0, max(2.0, float(distance[:, of].max())), 400)
        ranges[:, of] = _tabulated(table, source.range_variance(table), distance[:, of])
        if source.bearing_variance is not None:
            bearings[:, of] = _tabulated(table, source.bearing_variance(table), distance[:, of])
    return ranges, bearings


def _tabulated(table: Array, values: Array, distance: Array) -> Array:
    with np.errstate(divide="ignore"):
        found = 1.0 / np.maximum(np.interp(distance, table, 1.0 / values), 1e-30)
    return np.where(found > 1e20, np.inf, found)


def _at(stations, start, own, about, heard, moved, prior, times, order, rows, outputs):
    """Covariances (s, o, 9, 9), ranks and conditions (s,) at stations (s, 2)."""
    relative = _relative(stations, start, own, heard, moved, times, order)
    ranges, bearings = _variances(heard, relative, order)
    delay = np.array([heard[s].delay for s, _ in order])
    arrivals = np.maximum.accumulate(times + delay)  # what comes in before an earlier one waits for it
    compass = np.array([heard[s].by_compass for s, _ in order])
    sights = Sights(times, rows, ranges, bearings, arrivals[None], compass, _told(heard, order))
    covariance = bounds(prior, sights, relative[:, None], outputs, about.walks)
    best = ranges.min(axis=-1, keepdims=True)
    told = observability(times, relative, ranges=ranges < best / HEARD, bearings=np.isfinite(bearings))
    return covariance, told.rank, told.condition


def _told(heard: Sequence[Source], order: Array) -> Told | None:
    """Errors of the places that sources tell, sight by sight."""
    tellers = [s for s, source in enumerate(heard) if source.told is not None]
    if not tellers:
        return None
    numbers = np.array([tellers.index(s) if s in tellers else -1 for s, _ in order])
    of = [(heard[s].told, k) for s, k in order]
    kept = np.array([told.kept[k] if told else 0.0 for told, k in of])
    return Told(numbers, kept, np.array([told.added[k] if told else 0.0 for told, k in of]))


def _mirrors(coarse, start, own, about, heard, moved, prior, times, order, rows, done) -> Array:
    """Probability (m, n) of a second solution, by filters from it and from the truth on ranges without noise."""
    found = np.zeros((len(coarse[0]), len(coarse[1])))
    if any(source.bearing_variance is not None for source in heard):
        return found  # a bearing has no mirror
    bank = BankFilter(
        Gaussian(mean=np.zeros(N), covariance=prior), about.noise, walks=about.walks, pruned=len(times) + 1
    )
    mine = own.at(times)
    white = np.array([heard[s].white for s, _ in order])
    for m, n in np.ndindex(*found.shape):
        station = np.array([[coarse[0][m], coarse[1][n]]])
        relative = _relative(station, start, own, heard, moved, times, order)
        state = _truth_and_mirrors(own, prior, relative[0], times, about.walks)
        places = mine - relative[0] * (1.0, 1.0, -1.0)
        variances = _variances(heard, relative, order)[0][0] + white
        for k, row in enumerate(rows.tolist()):
            state = state._replace(
                since=Displacement(*(a + b for a, b in zip(state.since, row, strict=True))), verdicts=()
            )
            if math.isfinite(variances[k]):
                told = leader_range(
                    float(np.linalg.norm(relative[0, k])), (*places[k].tolist(),), deviation=math.sqrt(variances[k]),
                    stamp=times[k], depth=mine[k, 2],
                )  # fmt: skip
                state = bank.correct(state, times[k], [told])
        found[m, n] = second_solution(*state.modes, state.weights)[1]
        done(0.7 + 0.3 * (m * found.shape[1] + n + 1) / found.size)
    return found


def _truth_and_mirrors(own: Way, prior: Array, relative: Array, times: Array, walks: Array) -> BankState:
    """A bank of narrow filters: one at the true current, others where the mean relative motion is mirrored.

    Ranges are the same if the motion relative to what is ranged is reflected in the first line of sight. Where that
    motion bends they are only nearly so, whence means over the whole, a half and a quarter of the mission are tried.
    """
    heading, speed = own.inputs[:, 2], own.inputs[:, 0]
    through_water = np.array((np.mean(speed * np.cos(heading)), np.mean(speed * np.sin(heading))))
    current = (own.places[-1] - own.places[0]) / (STEP * len(speed)) - through_water
    sight = relative[0, :2] / max(float(np.hypot(*relative[0, :2])), 1e-9)
    currents = [current]
    for share in (1.0, 0.5, 0.25):
        k = max(1, round(share * (len(times) - 1)))
        velocity = (relative[k, :2] - relative[0, :2]) / (times[k] - times[0])
        currents.append(current + 2.0 * ((velocity @ sight) * sight - velocity))
    means = np.zeros((len(currents), N))
    means[:, :2], means[:, 2:4] = own.places[0], currents
    narrow = np.ones(N)
    narrow[2:4] = np.minimum(1.0, NARROW / np.sqrt(np.maximum(np.diagonal(prior)[2:4], 1e-12)))
    weights = np.exp(-0.5 * np.sum(means[:, 2:4] ** 2 / np.maximum(np.diagonal(prior)[2:4], 1e-12), axis=1))
    covariances = np.repeat((prior * np.outer(narrow, narrow))[None], len(currents), axis=0)
    return BankState(means, covariances, weights / weights.sum(), walks)


def _few(north: Array, east: Array, start: tuple[float, float], of: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Stations of those marked, spread over the map, and the one where the scenario has it start."""
    few = [((np.arange(FEW) + 0.5) / FEW * len(axis)).astype(int).tolist() for axis in (north, east)]
    planned = tuple(int(np.abs(axis - at).argmin()) for axis, at in zip((north, east), start, strict=True))
    return [(m, n) for m, n in sorted({planned, *((m, n) for m in few[0] for n in few[1])}) if of[m, n]]


def _nearest(coarse, values: Array, axes: tuple[Array, Array]) -> Array:
    """Values of a coarse grid at the nearest of its places."""
    picks = [np.abs(axis[:, None] - known[None]).argmin(axis=1) for axis, known in zip(axes, coarse, strict=True)]
    return values[np.ix_(*picks)]
