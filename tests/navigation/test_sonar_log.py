"""What the log holds of a sonar's navigation: which loop closures were believed, and the keyframes' path."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvsim.data.log import read
from auvsim.navigation import sonar_log
from auvsim.navigation.sonar_log import PATH, SHADES, TABLES, SonarLog
from auvsim.simulation.loading import load_scenario
from auvsim.simulation.run import run
from estimators.core.types import Gaussian
from estimators.map_path.frames import SectorGrid
from estimators.map_path.keyframes import MARKED, KeyframeState

GRID = SectorGrid(cell=0.3, shape=(5, 8), ranges=(0.4, 1.4), half_sector=0.9, ahead=1.1)
NUMBERS, STAMPS = (MARKED, 0, 7, 20, 21, 22), (61.0, 64.0, 92.0, 144.0, 148.0, 152.0)


def state(count: int, closed: int, *links: tuple[float, float]) -> KeyframeState:
    """A state of five frames and a mark, 5 states of the vehicle's own."""
    rng = np.random.default_rng(5)
    root = rng.normal(size=(23, 23))
    whole = Gaussian(mean=rng.normal(size=23) + np.tile((0.0, 0.0, 3.0), 8)[:23], covariance=root @ root.T)
    frames = tuple(SimpleNamespace(values=(k + 1.0) * rng.normal(size=GRID.shape)) for k in range(6))
    held: Any = frames
    return KeyframeState(whole, held, numbers=NUMBERS, stamps=STAMPS, count=count, closed=closed, links=links)


def navigator(held: KeyframeState | None) -> Any:
    """What the log watches."""
    return SimpleNamespace(grid=GRID, _estimator=SimpleNamespace(history=SimpleNamespace(state=held)))


def test_rows_of_an_update_tell_count_dive_point_and_new_closures() -> None:
    """NaN before the dive; each pair of frames of a closure once, in the update in which it was believed."""
    watched = navigator(None)
    log = SonarLog(watched)
    (row,) = log.rows(3.0)
    assert row.values[:2] == (3.0, 0)
    assert np.isnan(row.values[2]).all()
    first, more = ((144.0, 64.0), (144.0, 92.0)), (148.0, 64.0)
    for time, links, new in ((5.0, first, first), (5.5, first, ()), (6.0, (*first, more), (more,))):
        held = state(23, len(links), *links)
        watched._estimator.history.state = held
        matching, *pairs = log.rows(time)
        assert matching.values[:2] == (time, len(links))
        np.testing.assert_array_equal(matching.values[2], held.poses[0, :2])
        assert pairs == [(sonar_log.CLOSURES, (time, *pair)) for pair in new]


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
    # One or two keyframes each; a frame closes a loop with those seen from its side and from another.
    assert counts[-1] <= len(rows["later"]) <= 2 * counts[-1]
    assert (rows["later"] - rows["earlier"] >= 30.0).all()
    assert np.isin(rows["earlier"], path["time"][path["frame"]]).all()
    assert path["frame"].tolist() == [False] + [True] * (len(path["time"]) - 1)
    estimate = log["estimate"]
    then = np.column_stack([np.interp(path["time"], estimate["time"], estimate["position"][:, k]) for k in range(2)])
    assert np.abs(path["pose"][:, :2] - then).max() < 4.0  # what is learnt later of the fixes' slow error
    assert np.linalg.eigvalsh(path["covariance"]).min() > 0.0
