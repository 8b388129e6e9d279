"""The docking filters give the numbers that they always gave: runs with late, doubled, shifted and wrong packets.

The file holds what the filters were fed and what they said, as written by `python tests/estimators/test_golden.py`.
Bit for bit on one machine; other machines' sines differ in the last bit, which a filter that has converged forgets.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from docking_runs import TICK, simulate

from estimators.core.outliers import Outliers
from estimators.docking.estimator import (
    INTERACTING_NOISE,
    REFERENCE_NOISE,
    REGULAR_NOISE,
    AugmentedFilter,
    Bias,
    DockingEstimator,
    DockingNoise,
    InteractingFilter,
    PaperFilter,
    UsblFix,
    UsblModel,
)
from estimators.planar.model import PRESTERO

GOLDEN = Path(__file__).parent / "data" / "golden.npz"
BIASES = {"surge": Bias(3e-3), "compass": Bias(0.02), "dock_heading": Bias(0.01), "clock": Bias(0.1)}
FILTERS = {
    "paper": lambda: PaperFilter(PRESTERO),
    "paper_euler": lambda: PaperFilter(PRESTERO, integrator="euler", max_substep=0.5),
    "regular": lambda: PaperFilter(PRESTERO, REGULAR_NOISE, weights=None),
    "augmented": lambda: AugmentedFilter(PRESTERO, REFERENCE_NOISE),
    "augmented_arm": lambda: AugmentedFilter(PRESTERO, transponder=(0.8, 0.1)),
    "ungated": lambda: AugmentedFilter(PRESTERO, REFERENCE_NOISE, gate=None),
    "biased": lambda: AugmentedFilter(PRESTERO, replace(REFERENCE_NOISE, biases=BIASES)),
    "unscented": lambda: AugmentedFilter(PRESTERO, REFERENCE_NOISE, transform="unscented"),
    "interacting": lambda: InteractingFilter(PRESTERO),
    "interacting_eight": lambda: InteractingFilter(PRESTERO, INTERACTING_NOISE, currents=(1e-6, 0.02)),
    "three_modes": lambda: InteractingFilter(
        PRESTERO,
        DockingNoise(biases={"compass": Bias(0.01), "dock_heading": Bias(0.005)}),
        currents=(1e-6, 1e-6, 0.02),
        switching=((0, 0, 1 / 300), (1 / 50, 0, 1 / 300), (0, 0.1, 0)),
        initial=(0.7, 0.2, 0.1),
        outliers=Outliers(prior=0.02, deviations=(15.0,)),
    ),
}


def inputs(seed):
    """Compass samples, and packets as rows of stamp, received, north, east, sequence."""
    run, rng = simulate(seed, duration=120.0), np.random.default_rng(100 + seed)
    rows = []
    for k, fix in enumerate(run.fixes):
        place = np.array(fix.position[:2]) + (fix.stamp > 70.0) * np.array((12.0, -7.0))
        if rng.random() < 0.15:
            angle = rng.uniform(0.0, 2.0 * math.pi)
            place = place + rng.uniform(3.0, 30.0) * np.array((math.cos(angle), math.sin(angle)))
        received = fix.stamp + rng.uniform(0.0, 20.0)
        rows.append((fix.stamp, received, *place, k))
        if k % 5 == 0:
            rows.append((fix.stamp, received + 1.0, *place, k))
    rows.append((60.0, 60.5, math.nan, 1.0, 999))
    rows.append((61.0, 61.5, 1e9, 1.0, 998))
    return {
        "compass": run.compass,
        "rudder": run.rudder,
        "deviation": run.usbl.deviations[0],
        "packets": np.array(rows),
    }


def outputs(given, name):
    """Means and covariances at every tenth tick (12, 8 + 36), and all counts at the end."""
    deviation = float(given["deviation"])
    usbl = UsblModel(ranges=(1.0, 2.0), deviations=(deviation, deviation))
    estimator, rows = (
        DockingEstimator(FILTERS[name](), usbl, step=TICK),
        sorted(given["packets"].tolist(), key=received),
    )
    upper, said, estimate = np.triu_indices(8), [], None
    for k, heading in enumerate(given["compass"].tolist()):
        arrived = [row for row in rows if row[1] <= TICK * k]
        rows = rows[len(arrived) :]
        fixes = [
            UsblFix(stamp=stamp, received=at, position=(north, east, 0.0), heading=0.0, sequence=round(number))
            for stamp, at, north, east, number in arrived
        ]
        estimate = estimator.tick(TICK * k, heading, float(given["rudder"]), 0.0, fixes)
        if k % 20 == 19:
            said.append((*estimate.mean[:8], *estimate.covariance[:8, :8][upper]))
    assert estimate is not None
    return np.array(said), np.array([estimate.refused[r] for r in sorted(estimate.refused)])


def received(row):
    return row[1]


@pytest.mark.parametrize("name", FILTERS)
def test_numbers_are_those_of_before(name):
    with np.load(GOLDEN) as golden:
        said, counts = outputs(golden, name)
        assert (counts == golden[f"{name}/counts"]).all()
        # Rounding of other machines' libraries, grown over 240 ticks.
        assert said == pytest.approx(golden[f"{name}/said"], rel=1e-6, abs=1e-9)


if __name__ == "__main__":
    given = inputs(4)
    written = dict(given)
    for name in FILTERS:
        written[f"{name}/said"], written[f"{name}/counts"] = outputs(given, name)
    np.savez_compressed(GOLDEN, **written)
