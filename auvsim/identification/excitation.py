"""A manoeuvre from which the planar model's parameters are learnt best, within limits of rudder, rate, room and time.

D-optimal: the determinant of the Fisher information is made as large as it gets by exchanging one value of a
piecewise constant rudder and speed after another (coordinate exchange, Meyer & Nachtsheim 1995), from the best of some
random histories. It is compared with the standard manoeuvres under the same limits.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.base.randomness import stream
from auvsim.identification.information import STEP, Experiment, Progressed
from auvsim.missions.manoeuvres import laws as manoeuvres
from auvsim.missions.manoeuvres.settings import (
    CircleSettings,
    ManoeuvreSettings,
    MultisineSettings,
    OptimalSettings,
    PrbsSettings,
    SpiralSettings,
    StraightSettings,
    TablePoint,
    TableSettings,
    ZigzagSettings,
)

LEVELS = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])  # rudders among which the design chooses, of the largest
SPEED_DWELLS = 10  # for how many times the dwell of the rudder a speed is asked for: surge takes some 10 s to follow
STARTS = 24  # random histories from which the best is taken
PASSES = 4  # at most, through all values
GAIN = 0.02  # of the log determinant, below which another pass is not worth it
EXCESS = 200.0  # what the log determinant loses for a reach of twice the room: anything inside is better

Genes = NDArray[np.int64]  # (dwells, 2) levels of rudder and of speed


@dataclass(frozen=True, kw_only=True, slots=True)
class Outcome:
    """What a manoeuvre would tell of the parameters."""

    log_det: float  # of the information on the parameters' shares
    deviations: Array  # (k,) expected standard deviations, as shares of the parameters
    reach: float  # largest distance from the end of the approach, through the water [m]


@dataclass(frozen=True, kw_only=True, slots=True)
class Excitation:
    """A designed manoeuvre."""

    table: TableSettings  # what a trial carries out
    history: Array  # (n, 2) rudder [rad], speed asked for [m/s] of each STEP after the approach
    outcome: Outcome


@dataclass(frozen=True, kw_only=True)
class Bench:
    """What manoeuvres are tried out on: the planar model, its sensors and the limits of its actuators."""

    experiment: Experiment
    shaft_speed: Callable[[float], float]  # that holds a speed through the water [m/s -> rad/s]
    rudder_limit: float  # of the fins [rad]

    def approach(self, settings: OptimalSettings) -> Progressed:
        """After the straight course before the manoeuvre, where distances begin to count."""
        steps = round(settings.approach / STEP)
        straight = np.tile([0.0, self.shaft_speed(settings.speed)], (steps, 1))
        there = self.experiment.run(self.experiment.start(settings.speed), straight)
        return _here(there)

    def limit(self, settings: OptimalSettings) -> float:
        """Largest rudder [rad].

        Raises:
            InputError: More is asked for than the fins have.
        """
        if settings.rudder_deg is None:
            return self.rudder_limit
        if settings.rudder_deg > math.degrees(self.rudder_limit) + 1e-9:
            fins = f"{math.degrees(self.rudder_limit):.4g} deg"
            raise InputError(f"manoeuvre optimal: rudder {settings.rudder_deg:g} deg is beyond the fins' {fins}")
        return math.radians(settings.rudder_deg)

    def outcome(self, progressed: Progressed) -> Outcome:
        """What was learnt."""
        return Outcome(
            log_det=self.experiment.log_det(progressed),
            deviations=self.experiment.deviations(progressed),
            reach=progressed.reach,
        )

    def carry_out(self, settings: ManoeuvreSettings, limits: OptimalSettings) -> Outcome:
        """The outcome of any manoeuvre on the planar model, its rudder no faster than the limits allow.

        The heading is known; where the course would be held there is no rudder.
        """
        steering = manoeuvres.Steering(settings, limit=self.limit(limits), rate=1.0 / STEP, course=0.0)
        rate, approach = math.radians(limits.rudder_rate_deg) * STEP, next(manoeuvres.parts(settings)).settings.approach
        progressed, rudder = self.experiment.start(limits.speed), 0.0
        for tick in range(round(settings.duration / STEP)):
            if tick == round(approach / STEP):
                progressed = _here(progressed)
            order = steering.order(tick * STEP, float(progressed.state[2]))
            rudder += max(-rate, min(rate, (order.rudder or 0.0) - rudder))
            progressed = self.experiment.run(progressed, np.array([[rudder, self.shaft_speed(order.speed)]]))
        return self.outcome(progressed)


def standards(settings: OptimalSettings, bench: Bench, *, steps: bool = True) -> dict[str, ManoeuvreSettings]:
    """The standard manoeuvres of the same duration and, with `steps`, with steps between the same speeds.

    Their rudders are the usual ones, or the largest there is.
    """
    limit = math.degrees(bench.limit(settings))
    rudder, swing, most = min(10.0, limit), min(12.0, limit), min(20.0, limit)
    speeds = (settings.fastest, settings.slowest, settings.speed) if steps else ()
    common = {
        "speed": settings.speed,
        "approach": settings.approach,
        "speed_steps": speeds,
        "step_time": SPEED_DWELLS * settings.dwell,
    }
    lasting = {**common, "duration": settings.duration}
    spiral = SpiralSettings(**common, rudder_deg=swing, step_deg=swing / 4.0)
    hold = (settings.duration - settings.approach) / len(spiral.rudders_deg)
    return {
        f"zigzag {rudder:.3g}/10": ZigzagSettings(**lasting, rudder_deg=rudder),
        f"zigzag {most:.3g}/20": ZigzagSettings(**lasting, rudder_deg=most, heading_deg=20.0),
        "circle": CircleSettings(**lasting),
        "multisine": MultisineSettings(**lasting, rudder_deg=rudder),
        "prbs": PrbsSettings(**lasting, rudder_deg=rudder),
        "spiral": spiral.model_copy(update={"hold": hold}),
        "straight": StraightSettings(**lasting),
    }


def design(
    settings: OptimalSettings, bench: Bench, *, seed: int = 0, progress: Callable[[float, float], None] | None = None
) -> Excitation:
    """Designs the manoeuvre; the same seed gives the same.

    Args:
        settings: Limits of rudder, its rate, speed, room and time.
        bench: The planar model, sensors and actuators.
        seed: Of the histories to start from.
        progress: Called with work done and to do.

    Raises:
        InputError: More rudder is asked for than the fins have, or no history stays within the room.
    """
    search = _Search(settings, bench)
    generator = stream(seed, 0, "excitation")
    starts = [*search.circles(), *(search.draw(generator) for _ in range(STARTS))]
    genes = max(starts, key=lambda genes: search.score(search.whole(genes)))
    score = -math.inf
    for done in range(PASSES):
        before = score
        genes, score = search.exchange(genes, lambda share, done=done: progress and progress(done + share, PASSES))
        if score - before < GAIN:
            break
    if progress:
        progress(PASSES, PASSES)
    progressed = search.whole(genes)
    if progressed.reach > settings.room:
        raise InputError(
            f"manoeuvre optimal: nothing was found that stays within a room of {settings.room:g} m; "
            f"the best reaches {progressed.reach:.0f} m"
        )
    return Excitation(table=search.table(genes), history=search.history(genes), outcome=bench.outcome(progressed))


class _Search:
    """Histories as genes: the level of rudder of each dwell, and of speed of each SPEED_DWELLS of them."""

    def __init__(self, settings: OptimalSettings, bench: Bench) -> None:
        self._settings, self._bench = settings, bench
        self._steps = round((settings.duration - settings.approach) / STEP)
        self._dwell = max(1, round(settings.dwell / STEP))
        self._count = math.ceil(self._steps / self._dwell)
        self._rudders = LEVELS * bench.limit(settings)
        self._speeds = np.array([settings.slowest, settings.speed, settings.fastest])
        self._shafts = np.array([bench.shaft_speed(speed) for speed in self._speeds.tolist()])
        self._rate = math.radians(settings.rudder_rate_deg) * STEP
        self._begin = bench.approach(settings)

    def circles(self) -> list[Genes]:
        """Genes of slow circles to port and to starboard, which need the least room."""
        return [np.tile([level, 0], (self._count, 1)) for level in (0, len(LEVELS) - 1)]

    def draw(self, generator: np.random.Generator) -> Genes:
        """Random genes (count, 2): rudders held for one to eight dwells, speeds."""
        genes = np.zeros((self._count, 2), dtype=int)
        at = 0
        while at < self._count:
            after = at + int(generator.integers(1, 9))
            genes[at:after, 0] = generator.integers(len(LEVELS))
            at = after
        blocks = generator.integers(len(self._speeds), size=math.ceil(self._count / SPEED_DWELLS))
        genes[:, 1] = np.repeat(blocks, SPEED_DWELLS)[: self._count]
        return genes

    def history(self, genes: Genes, rudder: float = 0.0, first: int = 0) -> Array:
        """Rudder [rad] and speed [m/s] (n, 2) of each step from dwell `first` on, beginning at a rudder [rad]."""
        begin = first * self._dwell
        wanted = np.repeat(self._rudders[genes[first:, 0]], self._dwell)[: self._steps - begin]
        speeds = np.repeat(self._speeds[genes[first:, 1]], self._dwell)[: self._steps - begin]
        rudders = []
        for target in wanted.tolist():
            rudder += max(-self._rate, min(self._rate, target - rudder))
            rudders.append(rudder)
        return np.column_stack([rudders, speeds])

    def table(self, genes: Genes) -> TableSettings:
        """The manoeuvre of genes, a point wherever one changes."""
        s = self._settings
        changes = np.flatnonzero(np.any(np.diff(genes, axis=0) != 0, axis=1)) + 1
        points = tuple(
            TablePoint(
                time=round(STEP * self._dwell * at, 6),
                rudder_deg=math.degrees(self._rudders[genes[at, 0]]),
                speed=float(self._speeds[genes[at, 1]]),
            )
            for at in (0, *changes.tolist())
        )
        return TableSettings(
            name="optimal", points=points, rudder_rate_deg=s.rudder_rate_deg,
            speed=s.speed, approach=s.approach, duration=s.duration,
        )  # fmt: skip

    def run(self, before: Progressed, history: Array) -> Progressed:
        """Goes on with a history."""
        shafts = self._shafts[np.searchsorted(self._speeds, history[:, 1])]
        return self._bench.experiment.run(before, np.column_stack([history[:, 0], shafts]))

    def whole(self, genes: Genes) -> Progressed:
        """The whole manoeuvre."""
        return self.run(self._begin, self.history(genes))

    def score(self, progressed: Progressed) -> float:
        """The log determinant, less what leaving the room costs."""
        excess = max(0.0, progressed.reach / self._settings.room - 1.0)
        return self._bench.experiment.log_det(progressed) - EXCESS * excess

    def exchange(self, genes: Genes, progress: Callable[[float], object]) -> tuple[Genes, float]:
        """One pass through all values, each replaced by the best in its place: the genes, and their score."""
        genes = genes.copy()
        before, rudder = self._begin, 0.0
        best = self.score(self.whole(genes))
        for at in range(self._count):
            tried: Sequence[tuple[int, slice, int]] = [(0, slice(at, at + 1), len(LEVELS))]
            if at % SPEED_DWELLS == 0:
                tried = [(1, slice(at, at + SPEED_DWELLS), len(self._speeds)), *tried]
            for column, place, choices in tried:
                kept = int(genes[at, column])
                for choice in range(choices):
                    if choice == int(genes[at, column]):
                        continue
                    other = genes.copy()
                    other[place, column] = choice
                    score = self.score(self.run(before, self.history(other, rudder, at)))
                    if score > best:
                        best, kept = score, choice
                genes[place, column] = kept
            here = self.history(genes[: at + 1], rudder, at)
            before, rudder = self.run(before, here), float(here[-1, 0])
            progress((at + 1) / self._count)
        return genes, best


def _here(progressed: Progressed) -> Progressed:
    """The same with distances counted from here."""
    state = progressed.state.copy()
    state[:2] = 0.0
    return progressed._replace(state=state, reach=0.0)
