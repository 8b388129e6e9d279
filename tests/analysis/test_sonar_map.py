"""The picture of a feature map: a lone echo lies where its bearing and range say, and the path over it."""

import math

import numpy as np
import pytest

from auvsim.analysis.sonar_map import CELL, map_figure
from estimators.map_path.frames import SectorGrid

GRID = SectorGrid(cell=0.5, shape=(40, 80), ranges=(1.0, 20.0), half_sector=math.radians(60.0))


@pytest.mark.parametrize("heading", [0.0, 0.5 * math.pi, -2.0])
def test_an_echo_ahead_to_starboard_lies_there(heading: float) -> None:
    """North up, east to the right, in metres, within a cell of the frame and one of the map."""
    image = np.zeros(GRID.shape)
    image[24, 52] = 9.0
    ahead, aside = GRID.centres[24, 52]
    poses = np.array([(30.0, -12.0, heading), (30.0, -12.0, heading)])
    axes = map_figure([image, image], poses, GRID).axes[0]
    (shown,) = axes.images
    west, east, south, north = shown.get_extent()
    assert not axes.yaxis_inverted()
    values = np.nan_to_num(np.asarray(shown.get_array()))
    assert (east - west, north - south) == pytest.approx((CELL * values.shape[1], CELL * values.shape[0]))
    row, column = np.argwhere(values == values.max()).mean(axis=0)
    found = (south + CELL * (row + 0.5), west + CELL * (column + 0.5))
    c, s = math.cos(heading), math.sin(heading)
    expected = (30.0 + c * ahead - s * aside, -12.0 + s * ahead + c * aside)
    assert found == pytest.approx(expected, abs=0.5 * (CELL + GRID.cell))
    np.testing.assert_allclose(np.asarray(axes.lines[0].get_xydata()), poses[:, [1, 0]])
