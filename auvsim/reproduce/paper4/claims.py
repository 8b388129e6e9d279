"""What the paper says and what is so: each claim or formula with our number, from theory or from the study."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from auvsim.reproduce.paper4.formations import FORMATIONS, GOOD, SPEEDS, TABLE2, TABLE3, VARIANCES, WORST
from auvsim.reproduce.paper4.study import MIDDLE, STEPS, Key, Study
from estimators.formation import bounds, observability
from estimators.formation.observability import Geometry

ORIGIN = np.zeros(2)


class Claim(NamedTuple):
    """One claim, and what became of it."""

    where: str  # in the paper
    claim: str
    found: str
    verdict: str  # held, failed, misprint, or depends


def claims(study: Study) -> list[Claim]:
    """All of them, theory first."""
    return [*theory(), *experiments(study)]


def geometry(formation: int, speed: float) -> Geometry:
    """Sums of a formation on its way north."""
    return observability.geometry(ORIGIN, FORMATIONS[formation], (speed, 0.0))


def theory() -> Iterator[Claim]:
    """What formulas alone decide."""
    error = _gradient_error()
    yield Claim(
        "p_i, below eq. 14",
        "(f_x cos^2 - f_y sin cos) / r",
        f"f_x and f_y exchanged: off by up to {error:.2f} V/r",
        "misprint",
    )
    change = {f: abs(_true_condition(f) - observability.condition_paper(geometry(f, 10.0))) for f in FORMATIONS}
    worst = max(change, key=lambda f: change[f])
    yield Claim(
        "eq. 15",
        "row operations give 1/C of eq. 14",
        f"1/C changes by up to {change[worst]:.1e} (F{worst}, 10 m/s); the rank stays",
        "failed",
    )
    yield Claim(
        "eq. 14",
        "speed and distance enter the observability",
        "of a rigid formation the second half of the matrix is zero: relative velocity is",
        "failed",
    )
    g = geometry(6, 10.0)
    printed = math.sqrt((3 + g.tau + _root(g)) / (3 + g.tau - _root(g)))
    yield Claim(
        "eq. 17", "1/C", f"as printed {printed:.3f} in F6 at 10 m/s, which is C; 1/C is {1 / printed:.3f}", "misprint"
    )
    minutes = [observability.condition_paper(geometry(3, v)) for v in (1.0, 60.0)]
    yield Claim(
        "eq. 17",
        "1/C measures how well a place is known",
        f"in F3 it is {minutes[0]:.4f} with seconds, {minutes[1]:.4f} with minutes as the unit of time",
        "failed",
    )
    slow, fast = (geometry(3, v) for v in SPEEDS)
    yield Claim(
        "eq. 18",
        "largest Ja is largest 1/C",
        f"F4 from 1 to 10 m/s: Ja {_change(4, observability.ja)}, 1/C stays 0; so only at one tau",
        "failed",
    )
    yield Claim(
        "sec. 2.1",
        "slower is more observable",
        f"1/C of F3 is "
        f"{observability.condition_paper(slow):.4f} at 1 m/s, "
        f"{observability.condition_paper(fast):.4f} at 10 m/s",
        "failed",
    )
    yield Claim(
        "eq. 19 to 25",
        "S1, ellipse and Fisher information agree",
        f"det B S1 / sigma^4 - 1 is {identity():.0e} at most, of equal ranges; of unequal ones they do not",
        "held",
    )
    B, paper = (f(ORIGIN, FORMATIONS[1], 2.0) for f in (bounds.crlb, bounds.crlb_paper))
    yield Claim(
        "eq. 26, 28",
        "the bound of the place's error",
        f"{paper[0, 0]:.3f} m2 an axis in F1; it is {B[0, 0]:.3f} m2",
        "failed",
    )
    dets = np.linalg.det(B), bounds.crlb_determinant_paper(ORIGIN, FORMATIONS[1], 2.0), np.linalg.det(paper)
    yield Claim(
        "eq. 29",
        "det B = 1 / (I S1)",
        f"{dets[1]:.3f}; of its own matrix it is {dets[2]:.3f}, of the right one {dets[0]:.2f} m4",
        "failed",
    )
    s2 = {f: geometry(f, 1.0).s2 for f in (3, 4, 5)}
    yield Claim(
        "sec. 5",
        "F3, F8 are worst 1 (S2 = 0), F4, F9 worst 2 (S2 = 3)",
        f"with the heading from east S2 is {s2[3]:.0f} in F3 and {s2[4]:.0f} in F4",
        "failed",
    )
    yield Claim("sec. 5", "S2 = 1.5 in the sub-optimal formation", f"{s2[5]:.2f}", "failed")
    opened = [math.degrees(2.0 * math.atan2(5.0, r)) for r in (50.0, 200.0)]
    yield Claim(
        "sec. 4",
        "5 m aside at 50 m open the angle by 10.42 deg, at 200 m by 2.86 deg",
        f"{opened[0]:.2f} deg and {opened[1]:.2f} deg, of both leaders together",
        "misprint",
    )
    simple = [observability.simplified(ORIGIN, FORMATIONS[f])[0] for f in (1, 6)]
    ratio = float(np.linalg.norm(simple[1]) / np.linalg.norm(simple[0]))
    yield Claim(
        "sec. 1",
        "of [13]: distance matters even in good formations",
        f"its simplified matrix scales by {ratio:g} from F1 to F6, the true one not at all",
        "held",
    )


def experiments(study: Study) -> Iterator[Claim]:
    """What the runs decide; with steps of 1 s unless said."""
    rms = {(f, v, T): study.results[Key(T, v, MIDDLE, f)]["ekf"] for f in FORMATIONS for v in SPEEDS for T in STEPS}
    one = {f: rms[f, 1.0, 1.0].a_rms for f in FORMATIONS}
    ten = {f: rms[f, 10.0, 1.0].a_rms for f in FORMATIONS}
    lead = [one[f] / one[1] for f in GOOD[1:]]
    contradiction = f"its table 3 at 6 m2 has F2 {TABLE3[6.0][1]} < F1 {TABLE3[6.0][0]}"
    yield Claim(
        "sec. 5",
        "F1 is the best of the good six",
        f"others over F1 {min(lead):.3f} to {max(lead):.3f}; {contradiction}",
        "failed",
    )
    slower = {f: ten[f] / one[f] for f in FORMATIONS}
    least = min(slower, key=lambda f: slower[f])
    yield Claim(
        "table 2",
        "slower is better in every formation",
        f"10 over 1 m/s: {min(slower.values()):.2f} (F{least}) to {max(slower.values()):.2f}",
        _held(slower[least] > 1.0),
    )
    fit = [ten[f] / TABLE2[f][1] for f in FORMATIONS]
    yield Claim(
        "table 2",
        "errors at 10 m/s",
        f"ours over the paper's {min(fit):.2f} to {max(fit):.2f} (1 s), "
        f"{min(_fits(rms, 7.5)):.2f} to {max(_fits(rms, 7.5)):.2f} (7.5 s): no one step fits",
        "failed",
    )
    near = [one[f] / one[f + 5] for f in (1, 2, 5)]
    yield Claim(
        "sec. 5",
        "distance does not matter in good formations",
        f"1000 over 100 m: {min(near):.3f} to {max(near):.3f}",
        _held(0.97 <= min(near) <= max(near) <= 1.03),
    )
    far = [now[f] / now[f + 5] for now in (one, ten) for f in (3, 4)]
    yield Claim(
        "sec. 5",
        "shorter distances help in worst formations",
        f"F3/F8 {far[0]:.2f}, F4/F9 {far[1]:.2f} at 1 m/s; {far[2]:.2f}, {far[3]:.2f} at 10 m/s",
        "held" if min(far) > 1.05 else "depends",
    )
    yield Claim(
        "sec. 5",
        "F4, F9 are better than F3, F8",
        f"F3/F4 {one[3] / one[4]:.2f}, F8/F9 "
        f"{one[8] / one[9]:.2f} at 1 m/s; "
        f"{ten[3] / ten[4]:.2f}, {ten[8] / ten[9]:.2f} at 10 m/s",
        _depends(one, ten),
    )
    grows = all(
        np.all(np.diff([study.results[Key(T, 1.0, v, f)]["ekf"].a_rms for v in VARIANCES]) > 0.0)
        for f in FORMATIONS
        for T in STEPS
    )
    yield Claim(
        "table 3",
        "more noise of ranges, more error",
        "in every formation and step" if grows else "not everywhere",
        _held(grows),
    )
    cells = table3_ratios(study)
    yield Claim(
        "table 3",
        "its 30 cells",
        f"with steps of 7.5 s ours over the paper's {min(cells):.2f} to {max(cells):.2f}",
        _held(max(cells) <= 1.3 and min(cells) >= 1 / 1.3),
    )
    yield Claim(
        "abstract",
        "9.11, 63.17, 63.99, 81.50 % by speed, distance, both",
        f"its own table 2: {_percent(_paper_gains())}; ours {_percent(_gains(one, ten))}",
        "failed",
    )
    experiment = {bias: study.uwb[bias] for bias in study.uwb}
    told = "; ".join(
        f"bias {b:g} deg: gain {e.gain:.0%}, in one run P = {e.probability:.2f}" for b, e in experiment.items()
    )
    yield Claim("sec. 6", "cars: worst 2 is 41.46 % better than worst 1", told, "depends")
    line = study.offsets["one side", 5.0], study.offsets["one side", 0.0]
    yield Claim(
        "sec. 4",
        "a little aside opens the angle and helps",
        f"5 m to one side: rms {line[0].rms:.1f} m, NEES "
        f"{line[0].nees:.1f} (mirror image); on the line {line[1].rms:.1f} m",
        _held(line[0].rms < line[1].rms),
    )


def identity() -> float:
    """Largest error of det B = sigma^4 / S1, trace B = 3 sigma^2 / S1 over the good formations."""
    found = 0.0
    for f in GOOD:
        B, s1 = bounds.crlb(ORIGIN, FORMATIONS[f], 1.7), geometry(f, 1.0).s1
        found = max(
            found, abs(float(np.linalg.det(B)) * s1 / 1.7**4 - 1.0), abs(float(np.trace(B)) * s1 / 3 / 1.7**2 - 1.0)
        )
    return found


def table3_ratios(study: Study) -> list[float]:
    """Ours over the paper's, with steps of 7.5 s."""
    return [study.results[Key(7.5, 1.0, v, f)]["ekf"].a_rms / TABLE3[v][f - 1] for v in VARIANCES for f in FORMATIONS]


def _gradient_error() -> float:
    """Largest error of the printed p_i, in V / r, over bearings and courses."""
    theta, course = np.meshgrid(np.linspace(0.0, 2.0 * math.pi, 361), np.linspace(0.0, 2.0 * math.pi, 361))
    c, s, fx, fy = np.cos(theta), np.sin(theta), np.cos(course), np.sin(course)
    return float(np.abs((fx - fy) * (c**2 + s * c)).max())


def _true_condition(formation: int) -> float:
    return observability.condition(observability.true(ORIGIN, FORMATIONS[formation], (10.0, 0.0)))


def _root(g: Geometry) -> float:
    return math.sqrt((3 + g.tau) ** 2 - 4 * (g.s1 + g.tau * g.s2))


def _change(formation: int, function) -> str:
    return " to ".join(f"{function(geometry(formation, v)):.1e}" for v in SPEEDS)


def _fits(rms, step: float) -> list[float]:
    return [rms[f, 10.0, step].a_rms / TABLE2[f][1] for f in FORMATIONS]


def _paper_gains() -> tuple[list[float], list[float], list[float]]:
    return _gains({f: TABLE2[f][0] for f in TABLE2}, {f: TABLE2[f][1] for f in TABLE2})


def _gains(one, ten) -> tuple[list[float], list[float], list[float]]:
    """Gains by speed (good, then worst formations) and by distance (worst)."""
    return (
        [1.0 - one[f] / ten[f] for f in GOOD],
        [1.0 - one[f] / ten[f] for f in WORST],
        [1.0 - now[f + 5] / now[f] for f in (3, 4) for now in (one, ten)],
    )


def _percent(gains: tuple[list[float], list[float], list[float]]) -> str:
    texts = [f"{100 * min(g):.1f} to {100 * max(g):.1f} %" for g in gains]
    return f"speed {texts[0]} (good), {texts[1]} (worst), distance {texts[2]} (worst)"


def _held(is_so: bool) -> str:
    return "held" if is_so else "failed"


def _depends(one, ten) -> str:
    orders = [now[a] > now[b] for now in (one, ten) for a, b in ((3, 4), (8, 9))]
    return "held" if all(orders) else "depends" if any(orders) else "failed"
