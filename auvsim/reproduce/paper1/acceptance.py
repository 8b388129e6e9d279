"""What the study of paper 1 is to reach, row by row, and why where it does not."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from auvsim.reproduce.paper1.planar import SETTLED, Study
from auvsim.reproduce.paper1.study import FILTERS, ROWS, Result
from auvsim.reproduce.verdict import Verdict

PAPER_MEANS = {"settled_200": 0.3530, "settled_100": 0.2850, "settled_40": 0.1011, "settled_12": 0.0603}  # Table 1 [m]
PAPER_VARIANCES = {"settled_200": 0.0286, "settled_100": 0.0215, "settled_40": 0.0045, "settled_12": 0.0032}  # [m^2]
NO_LOSS = 1.03  # the filter that is to lose nowhere may be this much worse than the paper's
WINS = 0.9  # better than this counts as better
DELIVERY = "delivery"  # stands for a row where delivery is compared
ALL = "all"  # stands for a row where all are


@dataclass(frozen=True, kw_only=True, slots=True)
class _Criterion:
    row: str
    quantity: str
    measure: Callable[[Mapping[str, Result]], float]
    low: float = 0.0
    high: float = math.inf
    ratio_of: str = ""  # the filter whose ratio to the paper's it is


def verdicts(study: Study) -> list[Verdict]:
    """All that can be judged of the rows that were run, in their order."""
    judged = [_judge(criterion, study) for criterion in _criteria(study) if criterion.row in study.results]
    if ROWS.keys() <= study.results.keys():
        wins = float(sum(results["imm_biases"].ratio < WINS for results in study.results.values()))
        least = float(len(ROWS) // 2 + 1)
        judged.append(
            _explained(
                Verdict(row=ALL, quantity=f"rows, IMM+biases below {WINS:g}", measured=wins, low=least, high=math.inf),
                study,
            )
        )
    late = Verdict(
        row=DELIVERY,
        quantity="late and shuffled minus in order",
        measured=study.worst_delivery,
        low=0.0,
        high=1e-9,
    )
    return [*judged, _explained(late, study)]


def _judge(criterion: _Criterion, study: Study) -> Verdict:
    results = study.results[criterion.row]
    deviation = results[criterion.ratio_of].ratio_deviation if criterion.ratio_of else math.nan
    verdict = Verdict(
        row=criterion.row,
        quantity=criterion.quantity,
        measured=criterion.measure(results),
        low=criterion.low,
        high=criterion.high,
        deviation=deviation,
    )
    return _explained(verdict, study)


def _criteria(study: Study) -> list[_Criterion]:
    found = []
    for name in ROWS:
        if name in SETTLED:
            found += _settled(name, study.bounds.get(name), study.batches.get(name))
        found += _OTHERS.get(name, ())
        found.append(_ratio(name, "imm_biases", high=NO_LOSS))
    return found


def _settled(name: str, bound: float | None, batch: float | None) -> list[_Criterion]:
    augmented, interacting = _AUGMENTED[name], _INTERACTING[name]
    mean = PAPER_MEANS[name]
    found = [
        _Criterion(
            row=name, quantity="paper's mean / Table 1", measure=lambda r: r["paper"].mean / mean, low=0.85, high=1.15
        ),
        _ratio(name, "regular_best", low=5.0),
        _ratio(name, "delay_only", low=4.0),
        _ratio(name, "current_only", low=3.0),
        _ratio(name, "augmented_constant", high=augmented),
        _ratio(name, "imm", high=interacting),
        _Criterion(
            row=name,
            quantity="UKF / A0",
            measure=lambda r: r["unscented"].rms / r["augmented_constant"].rms,
            low=0.98,
            high=1.02,
        ),
        _Criterion(
            row=name, quantity="NEES A0, position", measure=lambda r: r["augmented_constant"].nees, low=0.85, high=1.15
        ),
        _Criterion(
            row=name,
            quantity="NEES A0, eight states",
            measure=lambda r: r["augmented_constant"].state_nees,
            low=0.85,
            high=1.15,
        ),
    ]
    if batch is not None:
        found.append(_Criterion(row=name, quantity="batch MAP / A0", measure=lambda r: batch, low=0.98, high=1.02))
    if bound is not None:
        found.append(
            _Criterion(
                row=name,
                quantity="A0 / bound",
                measure=lambda r: r["augmented_constant"].rms / bound,
                low=0.93,
                high=1.08,
            )
        )
    return found


SHORT = {  # names of filters in tables
    "paper": "paper",
    "paper_euler": "paper Euler",
    "regular": "REG",
    "regular_best": "REG*",
    "delay_only": "DLY",
    "current_only": "CUR",
    "augmented": "A",
    "augmented_constant": "A0",
    "unscented": "UKF",
    "imm": "IMM",
    "imm_biases": "IMM+ biases",
}
assert SHORT.keys() == FILTERS.keys()


def _ratio(row: str, name: str, *, low: float = 0.0, high: float = math.inf) -> _Criterion:
    return _Criterion(
        row=row,
        quantity=f"{SHORT[name].replace('+ ', '+')} / paper",
        measure=lambda r: r[name].ratio,
        low=low,
        high=high,
        ratio_of=name,
    )


def _rms(row: str, quantity: str, measure: Callable[[Mapping[str, Result]], float], high: float) -> _Criterion:
    return _Criterion(row=row, quantity=quantity, measure=measure, high=high)


_AUGMENTED = {"settled_200": 0.80, "settled_100": 0.82, "settled_40": 0.90, "settled_12": 1.00}
_INTERACTING = {"settled_200": 0.92, "settled_100": 0.92, "settled_40": 0.93, "settled_12": 1.03}
_OTHERS: dict[str, tuple[_Criterion, ...]] = {
    "settled_12": (_ratio("settled_12", "paper_euler", low=1.03, high=1.2),),
    "start": (_ratio("start", "imm", high=0.65),),
    "turn_40": (
        _rms("turn_40", "paper, mean peak [m]", lambda r: r["paper"].peak, 4.5),
        _rms("turn_40", "paper, rms [m]", lambda r: r["paper"].rms, 1.6),
        _ratio("turn_40", "imm", high=0.75),
    ),
    "turn_100": (_ratio("turn_100", "imm", high=0.55),),
    "after_turn": (
        _rms("after_turn", "paper, rms [m]", lambda r: r["paper"].rms, 0.17),
        _rms("after_turn", "paper / REG*", lambda r: 1.0 / r["regular_best"].ratio, 0.08),
    ),
    "dropped": (_ratio("dropped", "imm", high=0.65),),
    "late": (_ratio("late", "imm", high=0.92),),
    "jitter": (_ratio("jitter", "imm", high=0.92),),
    "outliers": (
        _rms("outliers", "IMM, rms [m]", lambda r: r["imm"].rms, 0.2),
        _rms("outliers", "IMM, worst run's rms [m]", lambda r: r["imm"].worst_rms, 5.0),
    ),
    "thrust": (_ratio("thrust", "imm", high=1.3),),
    "compass": (_ratio("compass", "imm", high=1.3),),
}


def _explained(verdict: Verdict, study: Study) -> Verdict:
    """The verdict, with the reason if it is not met."""
    if verdict.met:
        return verdict
    miss = max(verdict.low - verdict.measured, verdict.measured - verdict.high)
    runs = study.runs.get(verdict.row)
    if miss < 2.0 * verdict.deviation:
        reason = f"within two standard deviations, of {verdict.deviation:.2g}: no more than chance"
    elif runs is not None and runs < ROWS[verdict.row].runs:
        reason = f"{runs} of the full study's {ROWS[verdict.row].runs} runs: too few to tell"
    elif verdict.row in SETTLED:
        reason = "errors stay alike for 100 s and more: so few independent ones may differ by a tenth"
    else:
        reason = "missed"
    return replace(verdict, reason=reason)
