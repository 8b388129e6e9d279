"""The choice of a motion model on the tanker that is none of the package's, beside what anybody would do.

From the checkout: `python tests/identification/study.py --seeds 4 --first 41 --quick`.
"""

import argparse
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import baselines
import numpy as np
import tanker

from auvsim.identification.motion.identify import identify_motion
from auvsim.identification.readers import read

SEAS = {
    "calm": tanker.Sea(disturbance=2e-4),
    "windy": tanker.Sea(wind=(3.0, 2.0), gust=1.0, disturbance=5e-4),
}  # fmt: skip


class Case(NamedTuple):
    """What one seed in one sea came to; errors of position after 60 s by the distance run, rms, held out."""

    chosen: str
    error: float
    best_step: float  # of the chosen structure's steps
    planar: float  # planar model by least squares
    others: tuple[float, ...]  # Abkowitz terms by least squares; with `output_error`, planar by SciPy's output error
    inside: np.ndarray  # (m,) share of held-out positions inside their 95 % band, by horizon
    count: np.ndarray  # (m,)
    halves: float  # rms of the scores of fits to disjoint halves
    seconds: float  # of CPU


def run(seed: int, sea: tanker.Sea, *, quick: bool, output_error: bool) -> Case:
    """Sails six manoeuvres of 300 s, fits four, judges by two."""
    sailed = [tanker.sail(kind, seed, sea) for kind in tanker.KINDS]
    fitted, out = sailed[:4], sailed[4:]
    planar = baselines.error(out, baselines.ordinary(fitted))
    others = [baselines.error(out, baselines.ordinary(fitted, baselines.abkowitz), baselines.abkowitz)]
    if output_error:
        others.append(baselines.error(out, baselines.output_error(fitted)))
    with tempfile.TemporaryDirectory() as folder:
        paths = [tanker.write(Path(folder) / f"{one.kind}.csv", one.log) for one in sailed]
        readings, holdout = read(paths[:4]), read(paths[4:])
    begun = time.process_time()
    found = identify_motion(readings, holdout, quick=quick)
    seconds = time.process_time() - begun
    chosen, k = found.choice.chosen, found.place
    return Case(
        f"{chosen.structure.name}, {chosen.step}", float(found.judged.share[k]),
        min(float(errors[k]) for _, errors in found.steps), planar, tuple(others), found.judged.inside,
        found.judged.count, found.halves.rms, seconds,
    )  # fmt: skip


def mean(ratios: list[float]) -> float:
    """Geometric mean."""
    return float(np.exp(np.mean(np.log(ratios))))


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description="The choice of a motion model on an independent tanker.")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--first", type=int, default=41)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--output-error", action="store_true", help="also SciPy's output error, which takes long")
    options = parser.parse_args()
    cases = []
    for seed in range(options.first, options.first + options.seeds):
        for name, sea in SEAS.items():
            case = run(seed, sea, quick=options.quick, output_error=options.output_error)
            cases.append(case)
            print(
                f"{seed} {name}: {case.chosen}: {case.error:.1%}; planar {case.planar:.1%}, others "
                f"{', '.join(f'{e:.1%}' for e in case.others)}; best step {case.best_step:.1%}; inside "
                f"{np.round(case.inside, 2)}; halves {case.halves:.2f}; {case.seconds:.1f} s",
                flush=True,
            )
    ratios = {
        "planar least squares": [c.error / c.planar for c in cases],
        "the best baseline": [c.error / min(c.planar, *c.others) for c in cases],
        "the best of its own steps": [c.error / c.best_step for c in cases],
    }
    for name, values in ratios.items():
        print(f"error by that of {name}: {mean(values):.2f} ({min(values):.2f} to {max(values):.2f})")
    inside = np.average([c.inside for c in cases], weights=[c.count for c in cases])
    print(f"bands of 95 % hold {inside:.1%} of {sum(int(c.count.sum()) for c in cases)} held-out positions")
    print(f"disjoint halves: rms of scores {np.median([c.halves for c in cases]):.2f}, at most "
          f"{max(c.halves for c in cases):.2f}; CPU {np.median([c.seconds for c in cases]):.1f} s, at most "
          f"{max(c.seconds for c in cases):.1f} s")  # fmt: skip


if __name__ == "__main__":
    main()
