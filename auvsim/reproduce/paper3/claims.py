"""What paper 3 claims, and what of it holds here, each with its number."""

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from auvsim.reproduce.paper3.study import POOLED, Runs, Study, ratio, root_mean_square
from auvsim.reproduce.paper3.truths import STEP, Conditions, commands, integrate
from estimators.path_prediction.observability import observability


class Claim(NamedTuple):
    """A claim of the paper, what was measured of it, and whether it holds."""

    claim: str
    measured: str
    holds: bool


def claims(study: Study) -> list[Claim]:
    """All that the rows which were run tell of."""
    return [*_estimators(study), *_leader(study), *_cost(study), *_packets(study), _heading()]


def _estimators(study: Study) -> Iterator[Claim]:
    if (results := study.results.get(POOLED)) is not None:
        value, low, high = ratio(results["iiru"], results["dekf"])
        measured = f"IIRU / DEKF {value:.2f} ({low:.2f} to {high:.2f}); the tables' 24.4 / 84.4 is 0.29"
        yield Claim("IIRU is more exact than DEKF (table 2)", measured, high < 1.0)
        value, low, high = ratio(results["iiru"], results["iiru_reduced"])
        measured = f"IIRU / reduced {value:.2f} ({low:.2f} to {high:.2f})"
        yield Claim("without the coupling it is less exact (4.4)", measured, high < 1.0)
    if (results := study.results.get("paper_sensor_weave")) is not None:
        value, low, high = ratio(results["iiru"], results["ekf"])
        measured = f"IIRU / EKF {value:.2f} ({low:.2f} to {high:.2f}), leader's own error {_own(results):.0f} m"
        yield Claim("the same where odometry is noisy, not the motion", measured, high < 1.0)
    if (results := study.results.get("fine_process_weave")) is not None:
        nees = float(results["dekf"].nees.mean())
        yield Claim("DEKF is too conservative", f"NEES {nees:.2f}; a cautious filter is below 1", nees < 1.0)
        nees, ours = float(results["iiru"].nees.mean()), float(results["sc"].nees.mean())
        measured = f"NEES of IIRU {nees:.2f}, of SC-EKF, which has the leader's error as a state, {ours:.2f}"
        yield Claim("packets are uncorrelated with the prediction (3.4)", measured, nees < 1.3)


def _leader(study: Study) -> Iterator[Claim]:
    for scene, (predicted, own) in {"straight": (184.5, 182.7), "curve": (36.6, 63.5)}.items():
        if (results := study.results.get(f"paper_sensor_{scene}")) is not None:
            value = root_mean_square(results["iiru"].leader) / _own(results)
            paper = f"the table's signed means {predicted} / {own} m are {predicted / own:.2f}"
            measured = f"rms predicted / own {value:.2f}; {paper}"
            yield Claim(f"the leader is predicted as well as it knows itself, {scene} (table 1)", measured, value < 1.1)
            if scene == "curve":
                yield Claim("it is predicted better than it knows itself, curve (table 1)", measured, value < 0.95)


def _cost(study: Study) -> Iterator[Claim]:
    if ends := _both(study, "delay_fine_1", "delay_fine_60"):
        cpu = [float(np.median(end["iiru"].cpu)) for end in ends]
        size = [float(np.median(end["rt"].memory)) / 1024.0 for end in ends]
        measured = (
            f"CPU of IIRU at 60 s over 1 s {cpu[1] / cpu[0]:.2f}; SC-RT's state {size[0]:.0f} to {size[1]:.0f} kB"
        )
        yield Claim("IIRU costs the same at any delay", measured, cpu[1] / cpu[0] < 1.3)
    if ends := _both(study, "loss_fine_0%", "loss_fine_60%"):
        rms = [end["dekf"].rms for end in ends]
        measured = f"rms {rms[0]:.1f} to {rms[1]:.1f} m at 60 % lost"
        yield Claim("DEKF is unusable when packets are lost", measured, rms[1] > 2.0 * rms[0])


def _packets(study: Study) -> Iterator[Claim]:
    if POOLED in study.inversions:
        count, runs = study.inversions[POOLED], len(study.results[POOLED]["dr"].final)
        measured = f"{count} in {runs} runs: it takes a difference of 10 s, 7 deviations"
        yield Claim("packets come out of order (4.5)", measured, count > 0)
    if both := _both(study, "shuffled", "fine_process_weave"):
        shuffled = both[0]
        count = len(shuffled["rt"].final)
        rms = [root_mean_square(results["iiru"].final[:count]) for results in both]
        measured = (
            f"{study.inversions['shuffled']} in {count} runs with a deviation of 6 s; IIRU {rms[0]:.1f} m, in order "
        )
        measured += f"{rms[1]:.1f} m; " + ", ".join(f"{key} {shuffled[key].rms:.1f} m" for key in ("dekf", "sc", "rt"))
        yield Claim("IIRU copes with packets out of order (4.5)", measured, rms[0] < 1.1 * rms[1])


def _heading() -> Claim:
    """The rank of ranges in each scene: pose and mean yaw rate of the follower."""
    ranks, seen = [], 0
    scenes = ("straight", "curve", "inline", "weave")
    for scene in scenes:
        first_l, motion_l, first_f, motion_f = commands(scene, 1000)
        tracks = integrate(first_l, motion_l), integrate(first_f, motion_f)
        found = observability(*tracks, STEP, np.arange(0.0, 1000.0, 10.0), Conditions().range_variance)
        heading = (
            f"heading to {math.degrees(found.deviations[2]):.1f} deg" if found.heading_observable else "no heading"
        )
        ranks.append(f"{scene} {found.rank} of 4, {heading}")
        seen += found.heading_observable
    return Claim("heading is unobservable from ranges (3.1)", "; ".join(ranks), seen == 0)


def _both(study: Study, *rows: str) -> list[Mapping[str, Runs]]:
    """Results of rows, or none if one of them was not run."""
    return [study.results[row] for row in rows] if set(rows) <= study.results.keys() else []


def _own(results: Mapping[str, Runs]) -> float:
    return root_mean_square(next(iter(results.values())).own)
