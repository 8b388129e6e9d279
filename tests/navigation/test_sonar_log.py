"""What the log holds of a sonar's navigation: which loop closures were believed, and the keyframes' path."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvsim.data.log import read
from auvsim.navigation import sonar_log
from auvsim.navigation.sonar import WINDOW
from auvsim.navigation.sonar_log import PATH, SHADES, TABLES, SonarLog, believed
from auvsim.simulation.loading import load_scenario
from auvsim.simulation.run import run
from estimators.core.types import Gaussian
from estimators.map_path.frames import SectorGrid
from estimators.map_path.keyframes import MARKED, Closure, KeyframeState

GRID = SectorGrid(cell=0.3, shape=(5, 8), ranges=(0.4, 1.4), half_sector=0.9, ahead=1.1)
NUMBERS, STAMPS = (MARKED, 0, 7, 20, 21, 22), (61.0, 64.0, 92.0, 144.0, 148.0, 152.0)


def closure(later: int, *earlier: int) -> Closure:
    """A match that waits."""
    return Closure(later, earlier, np.zeros((len(earlier), 3)), np.ones(len(earlier)), np.eye(3))


def state(count: int, closed: int, *pending: Closure) -> KeyframeState:
    """A state of five frames and a mark, 5 states of the vehicle's own."""
    rng = np.random.default_rng(5)
    root = rng.normal(size=(23, 23))
    whole = Gaussian(mean=rng.normal(size=23) + np.tile((0.0, 0.0, 3.0), 8)[:23], covariance=root @ root.T)
    frames = tuple(SimpleNamespace(values=(k + 1.0) * rng.normal(size=GRID.shape)) for k in range(6))
    held: Any = frames
    return KeyframeState(whole, held, numbers=NUMBERS, stamps=STAMPS, count=count, closed=closed, pending=pending)


def navigator(held: KeyframeState | None) -> Any:
    """What the log watches."""
    return SimpleNamespace(grid=GRID, _estimator=SimpleNamespace(history=SimpleNamespace(state=held)))


def test_closures_that_wait_no_longer_were_believed() -> None:
    """Of two that waited both ends are told, of the latest frame's its own; one that went stale was not believed."""
    assert WINDOW.kept == 4
    before = state(22, 9, closure(18, 0), closure(20, 7, 0), closure(21, 0))
    found = believed(before, state(23, 12))
    np.testing.assert_array_equal(np.array(found), [(144.0, 92.0), (144.0, 64.0), (148.0, 64.0), (152.0, math.nan)])
    assert believed(before, state(23, 12, closure(21, 0), closure(22, 7))) == [(144.0, 92.0), (144.0, 64.0)]
    assert believed(before, state(23, 9)) == []  # none more than before: all were only too old
    assert believed(None, state(23, 12)) == believed(before, None) == []


def test_rows_of_an_update_tell_count_and_dive_point(monkeypatch) -> None:
    """NaN before the dive; the closures of this update beside them."""
    log = SonarLog(navigator(None))
    (row,) = log.rows(3.0)
    assert row.values[:2] == (3.0, 0)
    assert np.isnan(row.values[2]).all()
    held = state(23, 4)
    watched = SonarLog(navigator(held))
    monkeypatch.setattr(sonar_log, "believed", lambda before, now: [(1.0, 2.0)] if now is held else [])
    matching, pair = watched.rows(5.0)
    assert matching.values[:2] == (5.0, 4)
    np.testing.assert_array_equal(matching.values[2], held.poses[0, :2])
    assert pair == (sonar_log.CLOSURES, (5.0, 1.0, 2.0))


def test_the_path_is_that_of_the_state() -> None:
    """Poses, their own block of the covariance, and images to half a step of their scale; the mark is no frame."""
    held = state(23, 4)
    log = SonarLog(navigator(held))
    names = list(TABLES[PATH])
    rows = [dict(zip(names, row.values, strict=True)) for row in log.path()]
    assert [row["time"] for row in rows] == list(STAMPS)
    assert [row["frame"] for row in rows] == [False] + [True] * 5
    for k, row in enumerate(rows):
        at = 5 + 3 * k
        np.testing.assert_allclose(row["pose"][:2], held.whole.mean[at : at + 2])
        turn = row["pose"][2] - held.whole.mean[at + 2]
        assert abs(row["pose"][2]) <= math.pi
        assert math.isclose(math.cos(turn), 1.0)
        np.testing.assert_array_equal(row["covariance"], held.whole.covariance[at : at + 3, at : at + 3])
        off = np.abs(row["scale"] * row["image"] - held.frames[k].values)
        assert off.max() <= 0.5000001 * row["scale"]
        assert np.abs(row["image"]).max() == SHADES
        assert [row[n] for n in names[-5:]] == [0.3, 0.4, 1.4, 0.9, 1.1]
    assert log.groups[PATH].shape(2, "image") == (2, 5, 8)
    assert SonarLog(navigator(None)).path() == []


@pytest.mark.slow
def test_a_survey_logs_its_path_and_closures(tmp_path: Path) -> None:
    """Until the second lane one way has closed loops: every closure has a row, and the path is near the estimates."""
    found = run(load_scenario("survey", duration=430.0), seed=3, path=tmp_path / "trial.nc")
    log = read(tmp_path / "trial.nc").vehicle()
    assert log.log.attributes["status"] == found.attributes["status"]
    rows, path, counts = log[sonar_log.CLOSURES], log[PATH], log[sonar_log.MATCHING]["closures"]
    assert counts[-1] >= 3
    assert len(np.unique(np.column_stack((rows["time"], rows["later"])), axis=0)) == counts[-1]
    known = np.isfinite(rows["earlier"])
    assert known.sum() >= 2
    assert (rows["later"][known] - rows["earlier"][known] > 60.0).all()  # of another lane
    assert np.isin(rows["earlier"][known], path["time"][path["frame"]]).all()
    assert path["frame"].tolist() == [False] + [True] * (len(path["time"]) - 1)
    estimate = log["estimate"]
    then = np.column_stack([np.interp(path["time"], estimate["time"], estimate["position"][:, k]) for k in range(2)])
    assert np.abs(path["pose"][:, :2] - then).max() < 4.0  # what is learnt later of the fixes' slow error
    assert np.linalg.eigvalsh(path["covariance"]).min() > 0.0
