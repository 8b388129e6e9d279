"""What the study of paper 5 is to reach, row by row, and why where it does not."""

import math
from dataclasses import replace

import numpy as np

from auvsim.reproduce.paper5.methods import TITLES
from auvsim.reproduce.paper5.study import ROWS, Study, paired_ratio
from auvsim.reproduce.verdict import Verdict

LARGEST_RATIO = {"dp": 0.45, "window": 0.15, "particles": 0.2, "graph": 0.2}  # to dead reckoning
RAY_CAST = ("rocks_straight", "rocks_arc", "rough_straight", "rough_arc")
LARGEST_RAY_CAST = 0.3  # of the window to dead reckoning
LARGEST_RMS = {"dp": 3.5, "window": 1.1}  # [m]
WINDOW_TO_DP = 0.6
LEAST_SPEED = {"dp": 20.0, "window": 20.0, "particles": 5.0, "graph": 5.0, "landmarks": 5.0}  # times real time
LARGEST_BIAS = 0.02  # of a match at 20 dB, along an axis [m]
LOCK = "grid lock"  # stands for a row where straight and arc are compared
BIAS = "match bias, 20 dB"


def verdicts(study: Study) -> list[Verdict]:
    """All that can be judged of the rows that were run, in their order."""
    judged = []
    both = [name for name in ("straight", "arc") if name in study.results]
    for name in both:
        results = study.results[name]
        for method, limit in LARGEST_RATIO.items():
            title, result = f"{TITLES[method]} / dead reckoning", results[method]
            judged.append(_at_most(name, title, result.ratio, limit, result.ratio_deviation))
        for method, limit in LARGEST_RMS.items():
            judged.append(_at_most(name, f"{TITLES[method]}, rms [m]", results[method].rms, limit))
        ratio, deviation = paired_ratio(results["window"].squares, results["dp"].squares)
        judged.append(_at_most(name, "frame to window / DP", ratio, WINDOW_TO_DP, deviation))
    if len(both) == 2:
        for method in ("dp", "window"):
            one, other = (study.results[name][method] for name in both)
            quotient = one.ratio / other.ratio
            relative = [r.ratio_deviation / r.ratio for r in (one, other)]
            title, deviation = f"{TITLES[method]}, straight / arc", quotient * math.hypot(*relative)
            judged.append(Verdict(row=LOCK, quantity=title, measured=quotient, low=0.5, high=2.0, deviation=deviation))
    for name in RAY_CAST:
        if name in study.results:
            result, title = study.results[name]["window"], f"{TITLES['window']} / dead reckoning"
            judged.append(_at_most(name, title, result.ratio, LARGEST_RAY_CAST, result.ratio_deviation))
    for name, (mean, deviation) in study.biases.items():
        worst = int(np.argmax(np.abs(mean)))
        title = f"{ROWS[name].title.split(',')[0]}, worst axis [m]"
        judged.append(_at_most(BIAS, title, abs(float(mean[worst])), LARGEST_BIAS, float(deviation[worst])))
    if both:
        for method, limit in LEAST_SPEED.items():
            speed = study.results[both[-1]][method].speed
            judged.append(
                Verdict(
                    row="speed", quantity=f"{TITLES[method]}, times real time", measured=speed, low=limit, high=math.inf
                )
            )
    return [_explained(v, study) for v in judged]


def _at_most(row: str, quantity: str, measured: float, high: float, deviation: float = math.nan) -> Verdict:
    return Verdict(row=row, quantity=quantity, measured=measured, low=0.0, high=high, deviation=deviation)


def _explained(verdict: Verdict, study: Study) -> Verdict:
    """The verdict, with the reason if it is not met."""
    if verdict.met:
        return verdict
    runs = study.runs.get(verdict.row)
    if max(verdict.low - verdict.measured, verdict.measured - verdict.high) < 2.0 * verdict.deviation:
        reason = f"within two standard deviations, of {verdict.deviation:.2g}: no more than chance"
    elif runs is not None and runs < ROWS[verdict.row].runs:
        reason = f"{runs} of the full study's {ROWS[verdict.row].runs} runs: too few to tell"
    elif verdict.row == "speed":
        reason = "processor time on this machine, with what else it does"
    else:
        reason = "missed"
    return replace(verdict, reason=reason)
