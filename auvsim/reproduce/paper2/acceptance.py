"""What the study of paper 2 is to reach, row by row, and which of the paper's claims hold."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from auvsim.reproduce.paper2.study import PHYSICAL, Study
from auvsim.reproduce.verdict import Verdict

NOISES = ("nominal", "coarse", "matched")
FEW = "few runs: only a full study decides"


class Claim(NamedTuple):
    """Something the paper says, and what was measured of it."""

    claim: str
    measured: str
    holds: bool


def verdicts(study: Study) -> list[Verdict]:
    """In the order of the rows that were run."""
    found = [*_planar(study)] if study.results else []
    return found + ([*_physical(study)] if study.physical else [])


def _verdict(study: Study, row: str, quantity: str, measured: float, low: float, high: float) -> Verdict:
    return Verdict(
        row=row, quantity=quantity, measured=measured, low=low, high=high, reason=FEW if study.quick else "missed"
    )


def _planar(study: Study) -> Iterator[Verdict]:
    nominal, results = study.results["nominal"], study.results
    ratio = nominal["reckoning"].final / nominal["paper"].final
    yield _verdict(study, "nominal", "final rms, dead reckoning / paper", ratio, 300.0, math.inf)
    yield _verdict(study, "nominal", "paper: median current error at 500 s", nominal["paper"].current_500, 0.0, 0.1)
    yield _verdict(study, "nominal", "paper: median current error at 1000 s", nominal["paper"].current_1000, 0.0, 0.03)
    worst = results["matched"]["paper"]
    yield _verdict(study, "matched", "paper fails: current error at 1000 s", worst.current_1000, 0.1, math.inf)
    yield _verdict(study, "matched", "paper fails: share of runs lost", worst.lost, 0.1, math.inf)
    for noise in NOISES:
        bank = results[noise]["bank"]
        yield _verdict(study, noise, "bank: rms after 500 s / bound", bank.rms / study.bounds[noise][0], 0.9, 1.25)
        yield _verdict(study, noise, "bank: NEES per axis", bank.nees, 0.8, 1.3)
        yield _verdict(study, noise, "bank: share of runs lost", bank.lost, 0.0, 0.0)
    yield _verdict(study, "parallel", "flagged as rank 2: share of runs", results["parallel"]["bank"].rank_2, 1.0, 1.0)
    yield _verdict(study, "oblique", "flagged as rank 3: share of runs", results["oblique"]["bank"].rank_3, 1.0, 1.0)
    flagged = max(results[noise]["bank"].rank_2 + results[noise]["bank"].rank_3 for noise in NOISES)
    yield _verdict(study, "nominal", "flagged in the weave: share of runs", flagged, 0.0, 0.0)


def _physical(study: Study) -> Iterator[Verdict]:
    bank = study.physical["none"]["bank"]
    yield _verdict(study, "mujoco", "bank: rms after 500 s [m]", bank.rms, 0.0, 1.4)
    yield _verdict(study, "mujoco", "bank: NEES per axis", bank.nees, 0.8, 1.3)
    for row in PHYSICAL:
        if row != "none":
            result = study.physical[row]["states"]
            yield _verdict(study, f"mujoco_{row}", "bank with states: NEES per axis", result.nees, 0.8, 1.5)


def claims(study: Study) -> list[Claim]:
    """The paper's claims beside what was measured on planar truth; empty without it."""
    if not study.results:
        return []
    r, found = study.results, []
    for noise in NOISES:
        paper = r[noise]["paper"]
        found.append(
            Claim(
                f"the current converges within 0 to 500 s ({noise})",
                f"median error {paper.current_500:.3f} m/s at 500 s, {paper.current_1000:.3f} at 1000 s",
                paper.current_500 < 0.1 and paper.current_1000 < 0.03,
            )
        )
        found.append(
            Claim(
                f"the position is markedly improved ({noise})",
                f"rms {paper.rms:.0f} m after 500 s beside a bound of {study.bounds[noise][0]:.1f} m; "
                f"{paper.lost:.0%} of runs end more than 200 m off",
                paper.rms < 3.0 * study.bounds[noise][0] and paper.lost == 0.0,
            )
        )
    for row, what in (("leaderweave", "only the leader weaves"), ("parallel", "parallel"), ("oblique", "oblique")):
        paper = r[row]["paper"]
        text = f"rms {paper.rms:.0f} m after 500 s, {paper.lost:.0%} of runs lost"
        found.append(Claim(f"no manoeuvre is asked for ({what})", text, paper.lost == 0.0))
    large, small = r["p1"]["p1_0"], r["p1"]["p1_4"]
    found.append(
        Claim(
            "a large P1 stands for ignorance",
            f"rms {large.rms:.1f} m after 500 s with P1 = 1e8, 1e7; {small.rms:.1f} m with 100, 1",
            large.rms < 1.5 * small.rms,
        )
    )
    nine = r["terms"]["paper_nine"]
    usual = r["nominal"]["paper"].current_bias
    text = f"the current is off by {nine.current_bias:.2f} m/s for good, with N samples by {usual:.3f}"
    found.append(Claim("eq. 1 adds up N + 1 samples", text, nine.current_bias < 0.05))
    paper, steady = r["nominal"]["paper"], r["nominal"]["paper_small"]
    text = f"NEES per axis {paper.nees:.0f}; with a small P1 {steady.nees:.3f}: P is counted again in Q and R"
    found.append(Claim("P is the covariance of the error", text, 0.8 < paper.nees < 1.3))
    return found
