"""`auvsim formation`: what it finds, what it writes, and that bad input is one line."""

import csv
import math

import numpy as np
import pytest

from auvsim.analysis import formation_map
from auvsim.cli import formation as command
from auvsim.cli import main

OPTIONS = {"speed": 1.0, "heading_deg": 0.0, "step": 1.0, "reach": 50.0, "modem": 3000.0, "apart": 20.0}


def judged(leaders, follower="0,0", noise="2", **options):
    made = command.formation(leaders, follower, noise, **{**OPTIONS, **options})
    return made, formation_map.judge(made)


def test_the_optimum_has_nothing_to_gain_by_one_set_of_ranges():
    _, found = judged("0,1000;-866,-500;866,-500")
    assert found.snapshot == pytest.approx(2.0 * math.sqrt(4.0 / 3.0), rel=1e-3) == found.best_snapshot
    assert found.ellipse.major == pytest.approx(found.ellipse.minor, rel=1e-3)
    assert 0.95 * found.steady < found.together_rms < found.steady  # noise of dead reckoning is not round


def test_on_a_line_one_leader_that_steps_aside_opens_it():
    made, found = judged("0,-100;0,100;0,200")
    assert math.isinf(found.snapshot)
    assert math.isinf(found.steady)
    for move in found.moves:
        assert 0.0 < move.distance <= 50.0 + 1e-9
        assert move.rms < 2.0
    assert found.together_rms <= min(move.rms for move in found.moves)
    assert (np.linalg.norm(found.together - made.leaders[:, :2], axis=1) <= 50.0 + 1e-9).all()


def test_depth_takes_from_a_range_what_is_vertical():
    """A leader 300 m down at 400 m: its slant range says (4/5)^2 of the horizontal."""
    _, flat = judged("400,0;0,400")
    _, deep = judged("400,0,300;0,400,300", follower="0,0,0")
    assert deep.snapshot == pytest.approx(flat.snapshot * 500.0 / 400.0, rel=1e-9)


def test_it_writes_a_table_and_a_map(capsys, tmp_path):
    arguments = ["--leaders=-80,10;70,60", "--follower", "5,-5,12", "--noise", "1,2", "--out", str(tmp_path)]
    assert main(["formation", *arguments]) == 0
    assert "best move to" in capsys.readouterr().out
    with (tmp_path / "formation.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert [line["leader"] for line in lines] == ["1", "2", "follower"]
    assert (float(lines[0]["north_m"]), float(lines[1]["noise_m"])) == (-80.0, 2.0)
    assert (tmp_path / "formation.png").stat().st_size > 20_000


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--leaders", ""], "no leader"),
        (["--leaders", "0,100;0,100"], "two stand"),
        (["--leaders", "0,100;5,5", "--noise", "0"], "--noise 0"),
        (["--leaders", "0,100;5,5", "--noise", "1,2,3"], "3 values, not 1 or 2"),
        (["--leaders", "0,0;5,5"], "follower is where"),
        (["--leaders", "nan,0;5,5"], "finite"),
        (["--leaders", "0,100;5"], "north,east"),
        (["--leaders", "0,100;5,five"], "finite"),
        (["--leaders", "0,100;5,1e9"], "further"),
        (["--leaders", "0,100;5,5", "--speed", "nan"], "--speed"),
        (["--leaders", "0,100;5,5", "--step=-1"], "--step"),
        (["--leaders", "0,100;5,5", "--apart", "4000"], "--apart"),
        (["--leaders", "0,100,-5;5,60"], "a depth of -5 m is out of the water"),
        (["--leaders", "0,100;5,5", "--noise", "1e-300"], "--noise 1e-300 must lie in"),
        (["--leaders", "0,100;5,5", "--noise", "1,1e9"], "1e+09"),
        (["--leaders", "0,100;5,5", "--step", "1e12"], "--step 1e+12 must lie in"),
        (["--leaders", "0,100;5,5", "--modem", "90"], "the one at 0, 100 is further from the follower than --modem 90"),
        ([], "leaders"),
    ],
)
def test_what_cannot_be_is_one_line(arguments, says, capsys, tmp_path):
    assert main(["formation", *arguments, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert says in error
    assert not (tmp_path / "out").exists()
