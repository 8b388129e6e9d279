"""The choice of a motion model on vehicles that are none of the package's, beside what anybody would do.

From the checkout: `python tests/identification/study.py --seeds 4 --first 41 --cases calm --quick`. All errors are of
the same predictions: from the smoothed states of what is held out, against these a minute later.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import baselines
import mariner
import numpy as np
import tanker
import usv

from auvsim.identification.motion import data
from auvsim.identification.motion.identify import identify_motion
from auvsim.identification.motion.rollout import rms, roll
from auvsim.identification.readers import read
from estimators.planar.terms import vector


class Kind(NamedTuple):
    """A sort of vehicle at sea."""

    sail: Callable[[str, int], tanker.Run]  # a manoeuvre of a seed
    rudder: bool = True


def _ship(sea: tanker.Sea, of: Callable[[int], tanker.Ship]) -> Kind:
    return Kind(lambda kind, seed: tanker.sail(kind, seed, sea, ship=of(seed)))


def _tanker(sea: tanker.Sea) -> Kind:
    return _ship(sea, lambda seed: tanker.TANKER)


QUIET = tanker.Sea(disturbance=2e-4, lag=0.0, filtered=0.0)
CASES = {
    "calm": _ship(QUIET, mariner.ship),
    "wind": _ship(tanker.Sea(wind=(3.0, 2.0), gust=1.0, disturbance=3e-4), mariner.ship),
    "unstable": _ship(tanker.Sea(disturbance=2e-4), lambda seed: mariner.ship(seed, 0.6)),
    "lag": _tanker(tanker.Sea(disturbance=2e-4, filtered=0.0)),
    "filtered": _tanker(tanker.Sea(disturbance=2e-4)),
    "tanker in wind": _tanker(tanker.Sea(wind=(3.0, 2.0), gust=1.0, disturbance=5e-4)),
    "two screws": Kind(
        lambda kind, seed: usv.sail(kind, seed, tanker.Sea(disturbance=3e-3, lag=0.2, filtered=0.2)), rudder=False
    ),
}  # fmt: skip
SURGE = ("1", "u|u|", "n|n|", "|n|u", "vr", "rr", "uudd", "u", "vv")  # terms in the order of the baselines
LATERAL = ("uv", "ur", "v|v|", "r|r|", "uud", "v", "r", "v|r|", "|v|r", "n|n|d", "nud")


class Case(NamedTuple):
    """What one seed in one case came to; errors of position after 60 s by the distance run, rms, held out."""

    chosen: str
    error: float
    best_step: float  # of the best structure's steps
    alone: float  # of the best structure and step alone
    baselines: dict[str, float]
    inside: np.ndarray  # (m,) share of held-out positions inside their 95 % band, by horizon
    count: np.ndarray  # (m,)
    # Errors of one held-out record by the least of all others there (2,): of the choice, and of the one of those others
    # that is the best in the other record, which no choice can know.
    by_record: np.ndarray
    foretold: np.ndarray
    halves: float  # rms of the scores of fits to disjoint halves
    seconds: float  # of CPU

    @property
    def ratio(self) -> float:
        """The error by the least of all others."""
        return self.error / min([self.best_step, *self.baselines.values()])


def run(name: str, seed: int, *, quick: bool, output_error: bool) -> Case:
    """Sails six manoeuvres, fits four, judges by two."""
    kind = CASES[name]
    sailed = [kind.sail(one, seed) for one in tanker.KINDS]
    with tempfile.TemporaryDirectory() as folder:
        paths = [tanker.write(Path(folder) / f"{one.kind}.csv", one.log) for one in sailed]
        readings, holdout = read(paths[:4]), read(paths[4:])
    begun = time.process_time()
    found = identify_motion(readings, holdout, quick=quick)
    seconds = time.process_time() - begun
    coarsest = data.QUICK if quick else data.COARSEST
    motions = data.prepare(holdout.records, coarsest=coarsest, known=found.lags)
    others: dict[str, float] = {}
    if kind.rudder:
        fits = {
            "planar": baselines.ordinary(sailed[:4]),
            "Abkowitz": baselines.ordinary(sailed[:4], baselines.abkowitz),
        }
        if output_error:
            fits["planar, output error"] = baselines.output_error(sailed[:4])
            fits["Abkowitz, output error"] = baselines.output_error(sailed[:4], baselines.abkowitz)
        others = {key: _vector(own) for key, own in fits.items()}
    chosen, alone, k, folds = found.choice.chosen, found.choice.alone, found.place, found.choice.folds
    single = folds.fit(alone.structure, alone.step, -1)
    all_others = [*others.values(), *(folds.fit(alone.structure, step, -1).vector for step, _ in found.steps)]
    each = np.array([[_off([motion], own) for motion in motions] for own in all_others])
    best = each.argmin(axis=0)
    foretold = np.array([each[best[1], 0], each[best[0], 1]]) / each.min(axis=0)
    return Case(
        f"{chosen.structure.name}, {chosen.step}", float(found.judged.share[k]),
        min(float(errors[k]) for _, errors in found.steps), _off(motions, single.vector),
        {key: _off(motions, own) for key, own in others.items()}, found.judged.inside, found.judged.count,
        np.array([_off([motion], found.fit.vector) for motion in motions]) / each.min(axis=0), foretold,
        found.halves.rms, seconds,
    )  # fmt: skip


def _vector(coefficients: list[np.ndarray]) -> np.ndarray:
    """All parameters of a baseline's coefficients."""
    values = {}
    for axis, names, own in zip(("surge", "sway", "yaw"), (SURGE, LATERAL, LATERAL), coefficients, strict=True):
        values |= {f"{axis} {term}": float(value) for term, value in zip(names, own, strict=False)}
    return vector(values)


def _off(motions: list[data.Motion], parameters: np.ndarray) -> float:
    return float(rms([roll(parameters, motion, (60.0,)).shares for motion in motions])[0])


def mean(ratios: list[float]) -> float:
    """Geometric mean."""
    return float(np.exp(np.mean(np.log(ratios))))


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description="The choice of a motion model on independent vehicles.")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--first", type=int, default=41)
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--in-turn", type=int, default=0, help="so many cases of each seed, in turn; 0: all")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--output-error", action="store_true", help="also SciPy's output error, which takes long")
    options = parser.parse_args()
    cases: dict[str, list[Case]] = {}
    turn = 0
    for seed in range(options.first, options.first + options.seeds):
        count = options.in_turn or len(options.cases)
        for name in [options.cases[(turn + k) % len(options.cases)] for k in range(count)]:
            case = run(name, seed, quick=options.quick, output_error=options.output_error)
            cases.setdefault(name, []).append(case)
            others = ", ".join(f"{key} {error:.1%}" for key, error in case.baselines.items())
            print(
                f"{seed} {name}: {case.chosen}: {case.error:.1%}; best step {case.best_step:.1%}, alone "
                f"{case.alone:.1%}; {others}; inside {np.round(case.inside, 2)}; halves {case.halves:.2f}; "
                f"{case.seconds:.1f} s", flush=True,
            )  # fmt: skip
        turn += count
    for name, some in [*cases.items(), ("all", [case for own in cases.values() for case in own])]:
        show(name, some)


def show(name: str, cases: list[Case]) -> None:
    """Prints what some cases come to together."""
    print(f"\n{name}: {len(cases)} runs, errors by those of the others (geometric mean, least to most)")
    ratios = {key: [c.error / c.baselines[key] for c in cases if key in c.baselines] for key in cases[0].baselines}
    ratios |= {
        "the best of its steps": [c.error / c.best_step for c in cases],
        "the best structure alone": [c.error / c.alone for c in cases],
        "the best of all these": [c.ratio for c in cases],
        "the same, each record held out": [float(x) for c in cases for x in c.by_record],
        "what the other record would have chosen of these, there": [float(x) for c in cases for x in c.foretold],
    }
    for key, values in ratios.items():
        within = np.mean([value <= 1.03 for value in values])
        print(f"  {key}: {mean(values):.2f}, median {np.median(values):.2f} ({min(values):.2f} to {max(values):.2f}), "
              f"within 3 % in {within:.0%}")  # fmt: skip
    inside = np.average([c.inside for c in cases], weights=[c.count for c in cases])
    print(f"  bands of 95 % hold {inside:.1%} of {sum(int(c.count.sum()) for c in cases)} held-out positions")
    print(f"  disjoint halves: rms of scores {np.median([c.halves for c in cases]):.2f}, at most "
          f"{max(c.halves for c in cases):.2f}; CPU {np.median([c.seconds for c in cases]):.1f} s, at most "
          f"{max(c.seconds for c in cases):.1f} s")  # fmt: skip


if __name__ == "__main__":
    main()
