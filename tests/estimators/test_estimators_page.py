"""The page on estimators: its program runs on a CSV as it stands, and finds the vehicle."""

import csv
import math
import re
from pathlib import Path

import numpy as np

PAGE = Path(__file__).parents[2] / "docs" / "estimators.md"
BEACONS = {"a": (60.0, 10.0, 5.0), "b": (-20.0, 80.0, 5.0)}
BIASES = {"a": 1.5, "b": -2.0}


def write_log(path):
    """A winding course of two minutes; returns the true positions."""
    rng, x, truth, given = np.random.default_rng(7), np.zeros(3), [], (1.0, 0.0)
    with path.open("w") as file:
        table = csv.writer(file)
        table.writerow(["time", "speed", "turn_rate", "range_a", "range_b"])
        for k in range(241):
            truth.append(x[:2].copy())
            row = []
            for number, (name, place) in enumerate(BEACONS.items()):
                distance = math.dist((*x[:2], 0.0), place) + BIASES[name] + 0.5 * rng.standard_normal()
                distance = 900.0 if k == 100 else distance + 40.0 * (k == 121)
                row.append(f"{distance:.3f}" if k % 2 == number or k in (100, 121) else "")
            speed, turn = 1.0, 0.12 * math.sin(0.03 * k)
            table.writerow([0.5 * k, *given, *row])  # the input that held since the row before
            given = (speed + 0.03 * rng.standard_normal(), turn + 0.01 * rng.standard_normal())
            middle = x[2] + 0.25 * turn
            x = x + 0.5 * np.array([speed * math.cos(middle) + 0.05, speed * math.sin(middle), turn])
    return np.array(truth)


def test_the_program_of_the_page_runs_and_finds_the_vehicle(tmp_path, monkeypatch, capsys):
    (program,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert len([line for line in program.splitlines() if line.strip()]) <= 40
    truth = write_log(tmp_path / "log.csv")
    monkeypatch.chdir(tmp_path)
    space: dict = {}
    exec(compile(program, str(PAGE), "exec"), space)
    errors = np.linalg.norm(np.array([mean[:2] for _, mean, _ in space["track"]]) - truth, axis=1)
    assert len(errors) == 241
    assert np.sqrt(np.mean(errors[120:] ** 2)) < 2.0  # what two ranges of 0.5 m with unknown biases allow
    told = capsys.readouterr().out
    assert "50.0 s: range a refused: impossible" in told
    assert "60.5 s: range b refused: outlier" in told
