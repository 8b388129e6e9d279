"""`auvsim floor`: table, map and data of a grid of the user's own; bad input in one line and exit code 2."""

import re
from pathlib import Path

import h5py
import numpy as np
import pytest

from auvsim import cli
from auvsim.cli.floor import longest

NORTH, EAST = np.arange(0.0, 160.0, 0.5), np.arange(-20.0, 90.0, 0.5)


@pytest.fixture(scope="module")
def grid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Depths that are rough north of 80 m and level south of it; lanes of `survey` run from 20 to 140 m."""
    relief = np.random.default_rng(2).normal(scale=0.06, size=(len(NORTH), len(EAST)))
    depth = 20.0 + np.where(NORTH[:, None] > 80.0, relief, 0.0)
    path = tmp_path_factory.mktemp("grid") / "depths.nc"
    with h5py.File(path, "w") as file:
        for name, values in (("y", NORTH), ("x", EAST)):
            file[name] = values
            file[name].make_scale(name)
            file[name].attrs["units"] = "m"
        file["bottom"] = depth
        file["bottom"].attrs.update({"units": "m", "standard_name": "sea_floor_depth_below_mean_sea_level"})
        for k, name in enumerate(("y", "x")):
            file["bottom"].dims[k].attach_scale(file[name])
    return path


def test_shares_and_files_of_a_grid(grid: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Half of the floor and half of the lanes; the longest stretch that does not hold is a lane's southern part."""
    assert cli.main(["floor", str(grid), "--spacing", "2", "--holds", "0.3", "--out", str(tmp_path)]) == 0
    printed, told = capsys.readouterr()
    assert "apart" not in told
    row = next(line for line in printed.splitlines() if "(holds)" in line)
    floor, way = (float(share) / 100.0 for share in re.findall(r"([\d.]+)%", row))
    # The mean over a sector of 20 m sees the edge from 10 m away.
    assert floor == pytest.approx(0.5, abs=10.0 / 160.0)
    with h5py.File(tmp_path / "floor.nc") as file:
        bound, north = np.array(file["floor/bound"]), np.array(file["floor/north"])
        along, at = np.array(file["way/bound"]), np.array(file["way/north"])
    assert way == pytest.approx(float((at > 80.0).mean()), abs=10.0 / 120.0)
    assert (at.min(), at.max()) == pytest.approx((20.0, 140.0))
    assert float((bound <= 0.3).mean()) == pytest.approx(floor, abs=5e-4)
    assert (bound[north > 95.0] <= 0.3).all()
    assert np.isinf(bound[north < 65.0]).all()
    stretch = int(re.findall(r"not hold: (\d+) m", " ".join(printed.split()))[0])
    assert stretch == longest(~(along <= 0.3))
    assert stretch == pytest.approx(2.0 * 60.0 + 7.0, abs=22.0)  # down one lane and up the next
    assert (tmp_path / "floor.png").stat().st_size > 20_000


def test_a_coarse_floor_is_said_to_be_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Most bathymetry has no relief as fine as frames show."""
    coarse = ["--water.terrain.spacing", "2.0", "--water.terrain.rock_radius", "2.0"]
    assert cli.main(["floor", "survey", *coarse, "--out", str(tmp_path)]) == 0
    assert "points are 2 m apart: finer relief" in capsys.readouterr().err


def test_longest_run() -> None:
    """Of values that are true."""
    assert longest(np.array([True, False, True, True, True, False, True])) == 3
    assert longest(np.zeros(4, dtype=bool)) == 0
    assert longest(np.ones(4, dtype=bool)) == 4


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["nowhere.nc"], "nowhere.nc: no such file"),
        (["nothing"], "no scenario 'nothing'"),
        (["three_vehicles"], "the scenario"),
        (["survey", "--altitude", "nan"], "--altitude nan must lie in 0.5 .. 1000 m"),
        (["survey", "--holds", "0"], "--holds 0 must be more than 0 and at most 1000 m"),
        (["survey", "--spacing", "900"], "spacing 900 m: a floor of 310 x 310 m has one point only"),
        (["survey", "--scenario", "nothing"], "--scenario nothing goes with a file of depths; survey is itself"),
        (["survey", "--water.terrain.kind", "flat"], "a floor of kind flat shows nothing to match; give a grid"),
        (["survey", "--water.terrain.rockz", "1"], "rockz"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str], text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And nothing is left behind."""
    assert cli.main(["floor", *arguments, "--out", str(tmp_path / "new")]) == 2
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("auvsim: ")]
    assert len(said) == 1
    assert text in said[0]
    assert not (tmp_path / "new").exists()
