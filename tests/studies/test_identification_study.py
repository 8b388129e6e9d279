"""Coverage, convergence and process noise of the fits: one seed of each always; all of them as the slow study."""

import io
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from auvsim.studies.identification import Covered, convergence, coverage, noisy, run_study, share_inside, table


def test_one_seed_of_each() -> None:
    """Errors of some deviations at most; a start wrong by a factor of 5 ends where the true one does."""
    covered = coverage("remus100", 1, 100.0)
    assert covered.converged
    assert np.abs(covered.scores).max() < 4.0  # 14 correlated normal deviates: beyond in less than one of 1000 seeds
    assert convergence(1, 5.0, 100.0) < 0.1
    result = noisy(1, 100.0)
    assert result.polished < 0.3
    assert result.worst_output > result.polished
    # NEES of 80 s of one record: some ten independent values of six degrees of freedom, 1 +- 0.18.
    assert 0.4 < result.nees < 1.8
    study = {
        "coverage remus100": [covered], "coverage prestero": [replace(covered, converged=False)],
        "starts": [0.01], "zero": [0.2], "noisy": [result],
    }  # fmt: skip
    output = io.StringIO()
    Console(width=160, file=output).print(table(study))
    text = output.getvalue()
    assert "1 of 1, worst 0.01 deviations off" in text
    assert "0 of 1, worst 0.2 deviations off" in text
    assert text.count(" 0 not converged") == 2
    assert text.count(" 1 not converged") == 1


def test_share_inside_counts() -> None:
    fits = [Covered(scores=np.array(scores), converged=True) for scores in ([0.0, 1.9], [-2.0, 3.0])]
    assert share_inside(fits) == (2, 4)


@pytest.mark.slow
def test_whole_study() -> None:
    """50 seeds: coverage 90 to 99 %, all starts converge, the polish stays below 10 % and is consistent."""
    study = run_study(50)
    for name in ("remus100", "prestero"):
        assert all(fit.converged for fit in study[f"coverage {name}"])
        inside, total = share_inside(study[f"coverage {name}"])
        assert 0.90 <= inside / total <= 0.99
    assert max(study["starts"]) < 0.1
    assert max(study["zero"]) < 0.1
    rows = study["noisy"]
    assert np.median([row.polished for row in rows]) < 0.10
    assert np.median([row.worst_output for row in rows]) > 1.0
    assert 0.8 <= np.mean([row.nees for row in rows]) <= 1.3
