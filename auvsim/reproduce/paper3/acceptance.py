"""What the study of paper 3 is to reach, and what it reached."""

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from auvsim.reproduce.paper3.study import POOLED, Study, ratio
from auvsim.reproduce.paper3.truths import SCENES
from auvsim.reproduce.verdict import Verdict
from estimators.path_prediction.statistics import FadingStatistics

ORDER = ("dr", "ekf", "dekf", "iiru")
OBSERVED = ("weave", "straight", "curve", "lweave")  # in line nobody knows the position across
BENT = ("weave", "curve", "lweave")  # where a delay that is ignored shows
RECURSION = "recursion"  # stands for a row where eq. 10 is compared with eqs 8 and 9


def verdicts(study: Study) -> list[Verdict]:
    """All that can be judged of the rows that were run. Signed means are never judged."""
    return [*_order(study), *_fine(study), *_loss(study), *_choice(study), _recursion()]


def _order(study: Study) -> Iterator[Verdict]:
    if (results := study.results.get(POOLED)) is None:
        return
    for one, other in pairwise(ORDER):
        value, low, _ = ratio(results[one], results[other])
        yield _verdict(POOLED, f"{one} / {other}", value, 1.0, math.inf, value - low)
    value, low, _ = ratio(results["ekf"], results["iiru"])
    yield _verdict(POOLED, "ekf / iiru", value, 1.4, math.inf, value - low)


def _fine(study: Study) -> Iterator[Verdict]:
    for scene in OBSERVED:
        row = f"fine_process_{scene}"
        if (results := study.results.get(row)) is None:
            continue
        for key in ("sc", "rt"):
            value, low, _ = ratio(results[key], results["oracle"])
            yield _verdict(row, f"{key} / oracle", value, 0.95, 1.05, value - low)
            nees = results[key].nees
            spread = 1.96 * float(nees.std()) / math.sqrt(max(len(nees) - 1, 1))
            yield _verdict(row, f"NEES {key}", float(nees.mean()), 0.75, 1.3, spread)
        if scene in BENT:
            value, low, _ = ratio(results["ekf"], results["oracle"])
            yield _verdict(row, "ekf / oracle", value, 1.5, math.inf, value - low)


def _loss(study: Study) -> Iterator[Verdict]:
    if {"loss_fine_60%", "loss_fine_0%"} <= study.results.keys():
        value, low, _ = ratio(study.results["loss_fine_60%"]["sc"], study.results["loss_fine_0%"]["sc"])
        yield _verdict("loss_fine_60%", "sc / sc without loss", value, 0.0, 1.1, value - low)


def _choice(study: Study) -> Iterator[Verdict]:
    for noise in ("fine", "paper"):
        for mode in ("process", "sensor"):
            for scene in SCENES:
                row = f"{noise}_{mode}_{scene}"
                if (results := study.results.get(row)) is not None:
                    best = "sc" if results["sc"].rms < results["rt"].rms else "rt"
                    value, _, high = ratio(results["choosing"], results[best])
                    yield _verdict(row, f"choosing / {best}, upper bound", high, 0.0, 1.1, high - value)


def _recursion() -> Verdict:
    """Largest difference of eq. 10 from eqs 8 and 9 over 200 samples."""
    samples, b, worst, found = np.random.default_rng(0).standard_normal(200), 0.95, 0.0, FadingStatistics()
    for n, sample in enumerate(samples, start=1):
        found.update(sample)
        weights = (1.0 - b) / (1.0 - b**n) * b ** np.arange(n - 1, -1, -1)
        mean = weights @ samples[:n]
        variance = weights @ (samples[:n] - mean) ** 2
        # The floor of the first few samples is not part of the equations; here it is zero.
        worst = max(worst, abs(found.mean - mean), abs(found.variance - variance))
    return Verdict(row=RECURSION, quantity="eq. 10 less eqs 8, 9", measured=float(worst), low=0.0, high=1e-12)


def _verdict(row: str, quantity: str, measured: float, low: float, high: float, half: float) -> Verdict:
    verdict = Verdict(row=row, quantity=quantity, measured=measured, low=low, high=high, deviation=half / 1.96)
    if verdict.met:
        return verdict
    within = low <= measured + half and measured - half <= high
    reason = f"within its interval of ± {half:.2g}: more runs would tell" if within else f"its interval is ± {half:.2g}"
    return Verdict(
        row=row, quantity=quantity, measured=measured, low=low, high=high, deviation=half / 1.96, reason=reason
    )
