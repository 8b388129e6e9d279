"""What the study of paper 4 is to reach."""

import math

import numpy as np

from auvsim.reproduce.paper4.claims import identity, table3_ratios
from auvsim.reproduce.paper4.formations import GOOD, WORST
from auvsim.reproduce.paper4.study import MIDDLE, Key, Result, Study
from auvsim.reproduce.verdict import Verdict
from estimators.formation import placement

TITLES = {
    "theory": "theory",
    "good": "good formations, 1 s",
    "worst": "worst formations, 1 s",
    "table 3": "table 3, 7.5 s",
    "uwb": "cars with ultra-wide band",
}


def verdicts(study: Study) -> list[Verdict]:
    """Each thing to reach; steps of 1 s and 4 m^2 unless said."""
    return [*_theory(), *_good(study), *_worst(study), *_rest(study)]


def _theory() -> list[Verdict]:
    theta = np.degrees(np.sort(placement.optimise_bearings(np.ones(3))))
    off = float(np.abs(theta - (0.0, 60.0, 120.0)).max())
    found = {n: placement.optimise_bearings(np.ones(n)) for n in (2, 3, 4, 5)}
    dets = [float(np.linalg.det(placement.information_of(b, np.ones(n)))) / (n * n / 4) for n, b in found.items()]
    return [
        Verdict(row="theory", quantity="det B S1 / sigma^4 - 1", measured=identity(), low=0.0, high=1e-9),
        Verdict(row="theory", quantity="optimiser: off 0, 60, 120 deg by [deg]", measured=off, low=0.0, high=0.01),
        Verdict(
            row="theory",
            quantity="optimiser: least det F / (n^2 / 4), n = 2 .. 5",
            measured=min(dets),
            low=1 - 1e-6,
            high=1 + 1e-6,
        ),
    ]


def _good(study: Study) -> list[Verdict]:
    found = []
    for speed in (1.0, 10.0):
        keys = [Key(1.0, speed, MIDDLE, f) for f in GOOD]
        ratios = [study.results[k]["ekf"].rms / study.bound(k) for k in keys]
        nees = [study.results[k]["ekf"].nees for k in keys]
        for quantity, values, low, high in (("EKF / bound", ratios, 0.97, 1.03), ("NEES", nees, 0.9, 1.1)):
            for which, value in (("least", min(values)), ("largest", max(values))):
                text = f"{quantity} at {speed:g} m/s, {which}"
                found.append(_verdict("good", text, value, low, high, study))
        ratio = _a_rms(study, 1, speed) / _a_rms(study, 6, speed)
        found.append(_verdict("good", f"F1 / F6 at {speed:g} m/s", ratio, 0.97, 1.03, study))
    return found


def _worst(study: Study) -> list[Verdict]:
    far = [_a_rms(study, 3, v) / _a_rms(study, 8, v) for v in (1.0, 10.0)]
    over = min(_a_rms(study, f, 1.0) for f in WORST) / _a_rms(study, 1, 1.0)
    f8 = _filter_ratio(study, 8, 10.0)
    others = max(_filter_ratio(study, f, v) for f in range(1, 11) for v in (1.0, 10.0))
    return [
        _verdict("worst", "F3 / F8, lesser of both speeds", min(far), 1.4, math.inf, study),
        _verdict("worst", "least worst / F1 at 1 m/s", over, 2.0, math.inf, study),
        _verdict("worst", "F3 / F4 at 1 m/s", _a_rms(study, 3, 1.0) / _a_rms(study, 4, 1.0), 1.0, math.inf, study),
        _verdict("worst", "UKF / EKF, F8 at 10 m/s", f8, 0.0, 0.85, study),
        _verdict("worst", "UKF / EKF, largest of all", others, 0.0, 1.02, study),
    ]


def _rest(study: Study) -> list[Verdict]:
    cells = table3_ratios(study)
    gains = [e.gain for bias, e in study.uwb.items() if bias > 0.0]
    return [
        _verdict("table 3", "ours / paper's, least", min(cells), 1 / 1.3, 1.3, study),
        _verdict("table 3", "ours / paper's, largest", max(cells), 1 / 1.3, 1.3, study),
        _verdict("uwb", "worst 2 below worst 1 by, least of biases 5 .. 20 deg", min(gains), 1e-9, 1.0, study),
    ]


def _verdict(row: str, quantity: str, measured: float, low: float, high: float, study: Study) -> Verdict:
    reason = f"{study.runs} runs: few" if study.quick else "measured so"
    return Verdict(row=row, quantity=quantity, measured=measured, low=low, high=high, reason=reason)


def _result(study: Study, formation: int, speed: float) -> dict[str, Result]:
    return dict(study.results[Key(1.0, speed, MIDDLE, formation)])


def _a_rms(study: Study, formation: int, speed: float) -> float:
    return _result(study, formation, speed)["ekf"].a_rms


def _filter_ratio(study: Study, formation: int, speed: float) -> float:
    found = _result(study, formation, speed)
    return found["ukf"].a_rms / found["ekf"].a_rms
