"""Stress tests: sequential tests, edges, maps, rare events and worst currents, against closed forms."""

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.stats import norm

from auvsim.base.errors import InputError
from auvsim.base.randomness import stream
from auvsim.campaign import plan as plans
from auvsim.cli import main
from auvsim.stress import plan as stress_plan
from auvsim.stress.envelope import Cell, EnvelopeMap
from auvsim.stress.ladder import Ladder
from auvsim.stress.rare import Subset
from auvsim.stress.search import advance
from auvsim.stress.sequential import decided, indifferent
from auvsim.stress.settings import EdgeSettings, RareSettings, WorstSettings
from auvsim.stress.worst import Worst

FACTORS = {"current.speed": [0.1, 0.9], "lost": {"keys": ["acoustics.dropout_probability"], "range": [0.0, 0.8]}}


class Made(NamedTuple):
    """An outcome without a run."""

    point: Any
    success: bool
    value: float = 0.0
    vehicles: tuple = ()

    def score(self, metric: str) -> float:
        """The value, whatever the metric."""
        return self.value


def made(**stress: Any) -> stress_plan.StressPlan:
    return stress_plan.of_campaign(plans.parse({"seed": 5, "stress": {"factors": FACTORS} | stress}))


# Sequential tests.


def test_the_test_goes_either_way_at_95_percent():
    s = EdgeSettings()
    assert indifferent(s) == pytest.approx(0.95, abs=3e-4)  # of 0.98 and 0.90
    p = indifferent(s)  # where a trial moves the logarithm of the ratio by nothing on average
    assert p * math.log(0.98 / 0.9) + (1 - p) * math.log(0.02 / 0.1) == pytest.approx(0.0, abs=1e-12)


def test_the_first_outcomes_that_decide_do():
    s = EdgeSettings()
    needed = math.ceil(math.log(19.0) / math.log(0.98 / 0.9))  # all succeed
    assert decided(s, [True] * (needed - 1)) is None
    assert decided(s, [True] * needed) is True
    assert decided(s, [False]) is None  # log 5 is below log 19
    assert decided(s, [False, False]) is False
    assert decided(s, [False, False, *[True] * 500]) is False  # what comes later does not count
    assert decided(EdgeSettings(most=10), ([True] * 9 + [False])) is False  # 90 % of 10, below the edge


@pytest.mark.parametrize(("rate", "right"), [(0.98, True), (0.90, False)])
def test_sequential_tests_err_as_seldom_as_they_say(rate, right):
    s, random, wrong, runs = EdgeSettings(most=10_000), np.random.default_rng(3), 0, 400
    for _ in range(runs):
        outcomes = iter((random.random(4000) < rate).tolist())
        wrong += decided(s, outcomes) is not right
    # 5 % of 400 plus 3 sd of a binomial is 33; Wald's bounds are a little safe, so well below.
    assert wrong <= 33


# Edges and maps.


def threshold(points, edge):
    """Succeeds where the current is below the edge."""
    return [Made(p, p.values["current"]["speed"] < edge) for p in points]


def test_a_ladder_halves_down_to_the_edge():
    ladder = Ladder(made(), ("current.speed",))
    advance([ladder], lambda points: threshold(points, 0.61))
    levels = [ladder.values(rung.level)["current.speed"] for rung in ladder.rungs]
    assert levels == pytest.approx([0.9, 0.1, 0.5, 0.7, 0.6, 0.65, 0.625])
    assert ladder.good is not None
    assert ladder.bad is not None
    assert ladder.values(ladder.good)["current.speed"] == pytest.approx(0.6)
    assert ladder.values(ladder.bad)["current.speed"] == pytest.approx(0.625)
    for edge, good, bad in ((2.0, 1.0, None), (0.0, None, 0.0)):  # beyond the range, and before it
        ladder = Ladder(made(), ("current.speed",))
        advance([ladder], lambda points, edge=edge: threshold(points, edge))
        assert (ladder.good, ladder.bad) == (good, bad)


def test_factors_reach_their_keys_and_pins():
    gust = {"kind": "sum", "terms": [{"kind": "uniform", "speed": 0.1}, {"kind": "gust"}]}
    plan = made(
        factors=FACTORS | {"g": {"keys": ["current.terms.1.intensity"], "range": [0.0, 0.4], "pins": {"current": gust}}}
    )
    values = plan.point({"lost": 0.25, "g": 0.5}, 3).values
    assert values["acoustics"]["dropout_probability"] == pytest.approx(0.2)
    assert values["current"]["terms"][1]["intensity"] == pytest.approx(0.2)
    plain = plan.point({}, 3).values
    assert plain == plans.parse({"seed": 5}).values("all", 3)
    assert plan.point({"current.speed": 1.0}, 3).values["vehicle"]["start"] == plain["vehicle"]["start"]


def test_a_map_divides_the_cells_at_the_edge_and_covers_the_square():
    found = EnvelopeMap(
        made(maps={"factors": [["current.speed", "lost"]], "cells": 4, "trials": 2}), ("current.speed", "lost")
    )
    advance([found], lambda points: threshold(points, 0.5))
    assert sum(cell.size**2 for cell in found.cells) == pytest.approx(1.0)
    small = [cell for cell in found.cells if cell.size == 0.125]
    assert {cell.low[0] for cell in small} == {0.25, 0.375, 0.5, 0.625}  # the two columns beside 0.5 m/s
    assert all((cell.rate == 1.0) == (cell.low[0] < 0.5) for cell in found.cells)
    assert Cell((0.0, 0.0), 0.25).touches(Cell((0.25, 0.125), 0.125))
    assert not Cell((0.0, 0.0), 0.25).touches(Cell((0.25, 0.25), 0.25))  # a corner is no side


# Rare events.


class Toy:
    """A trial whose score is the mean of ten of its normals, in units of its standard deviation: N(0, 1)."""

    def __init__(self, seed: int) -> None:
        self._seed = seed

    def point(self, levels, trial, walk=None):
        steps = [(other, math.radians(angle)) for other, angle in walk or ()]
        return float(stream(self._seed, trial, "toy", steps).standard_normal(10).sum()) / math.sqrt(10.0)


def probability(seed: int, above: float, samples: int = 200, levels: int = 8):
    found = Subset(Toy(seed), RareSettings(metric="x", above=above, samples=samples, levels=levels))
    advance([found], lambda points: [Made(p, True, p) for p in points])
    return found


def test_subset_simulation_finds_a_closed_form_and_its_interval_holds_it():
    for above, floor in ((2.326, 0.8), (4.265, 0.75)):  # P = 1e-2 and 1e-5
        exact, runs = norm.sf(above), 40
        found = [probability(seed, above).probability() for seed in range(runs)]
        mean = np.mean([p.value for p in found])
        spread = np.std([p.value for p in found]) / math.sqrt(runs)
        assert mean == pytest.approx(exact, abs=4.0 * float(spread))  # unbiased but for terms of 1/N: 4 sd of the mean
        # A 95 % interval that leaves out how levels hang together; below these shares it would be wrong, not short.
        assert np.mean([p.low <= exact <= p.high for p in found]) >= floor


def test_levels_narrow_by_a_tenth_and_steps_are_taken_as_often_as_wanted():
    found = probability(3, 4.265, samples=1000)
    assert [
        level.rate(after.above) for level, after in zip(found.levels, found.levels[1:], strict=False)
    ] == pytest.approx([0.1] * 4, abs=0.02)  # more where copies are equal
    assert all(min(s.score for s in level.samples) > level.above for level in found.levels[1:])
    assert all(0.3 < level.accepted < 0.6 for level in found.levels[1:])
    # At a limit that plain trials see, it is their share, with Wilson's interval.
    share = np.mean([s.score > 1.0 for s in found.levels[0].samples])
    plain = found.probability(1.0)
    assert plain.value == pytest.approx(share)
    assert plain.low < norm.sf(1.0) < plain.high


def test_an_event_that_is_never_seen_has_an_upper_end():
    found = probability(3, 9.0, levels=3).probability()
    assert (found.value, found.low) == (0.0, 0.0)
    assert 1e-4 < found.high < 5e-3  # 1e-2 times Wilson's upper end of 0 of 20


# The worst current.


def test_the_worst_current_of_a_linear_score_is_known():
    gain = np.array([[1.0, 0.0], [0.0, -2.0], [-0.6, 0.8]])  # score = sum of gain times velocity

    class Linear:
        def in_current(self, trial, knots):
            return knots

    s = WorstSettings(bound=0.3, end=100.0, knots=3, trials=1, iterations=25, population=60, elite=8)
    found = Worst(Linear(), s, seed=4)
    advance(
        [found],
        lambda points: [
            Made(p, True, float(sum(g[0] * k["north"] + g[1] * k["east"] for g, k in zip(gain, p, strict=True))))
            for p in points
        ],
    )
    speeds = [math.hypot(k["north"], k["east"]) for tried in found.iterations for h in tried for k in h.knots]
    assert max(speeds) <= 0.3 * (1 + 1e-12)
    assert [k["time"] for k in found.best.knots] == [0.0, 50.0, 100.0]
    best = 0.3 * np.linalg.norm(gain, axis=1).sum()  # along each gain at the bound
    assert found.best.badness.mean > 0.97 * best  # the spread that stays, a twentieth of the bound, costs 1 - cos of it


# Plans and the command.


@pytest.mark.parametrize(
    ("stress", "text"),
    [
        (None, "stress: the plan has no such section"),
        ({}, "nothing to look for"),
        ({"factors": {"current.sped": [0.0, 1.0]}}, "current.sped"),
        ({"factors": {"current.speed": [1.0, 1.0]}}, "both 1"),
        ({"factors": {"current.speed": [0.0, -1.0]}}, "at -1"),
        ({"factors": FACTORS, "maps": {"factors": [["lost", "found"]]}}, "no factor 'found'; there are current"),
        ({"rare": {"metric": "mis", "above": 1.0}}, "no column of numbers 'mis'"),
        ({"rare": {"metric": "time", "above": 1.0, "samples": 25}}, "whole number"),
        ({"worst": {"bound": 0.3, "start": 9.0, "end": 5.0}}, "after the start"),
    ],
)  # fmt: skip
def test_bad_plans_are_refused_in_one_line(stress, text):
    with pytest.raises(InputError) as refused:
        stress_plan.of_campaign(plans.parse({"stress": stress}))
    assert text in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_bad_plan_ends_the_command_with_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    plan = tmp_path / "p.yaml"
    plan.write_text("stress:\n  factors:\n    current.speed: [0.1]\n")
    assert main(["stress", str(plan), "--out", str(tmp_path / "o")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "p.yaml:3" in said
    assert not (tmp_path / "o").exists()


def test_a_stress_test_goes_on_and_its_findings_replay(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    plan, out = tmp_path / "p.yaml", tmp_path / "o"
    plan.write_text(
        "seed: 3\nbase: {duration: 40}\nsuccess: {metric: time, above: 41}\nstress:\n"
        "  factors: {current.speed: [0.1, 0.9]}\n"
        "  edge: {block: 2, most: 4}\n"
        "  rare: {metric: position_rms, above: 1000, samples: 20, share: 0.2, levels: 2}\n"
    )
    assert main(["stress", str(plan), "--out", str(out), "--jobs", "1", "--budget", "3"]) == 0
    assert "budget was spent" in capsys.readouterr().err
    assert main(["stress", str(plan), "--out", str(out), "--jobs", "1"]) == 0
    files = sorted((out / "trials").rglob("*.json"))
    before = {file: file.stat().st_mtime_ns for file in files}
    assert len(files) == 2 + 2 + 20 + 16  # both ends fail at once; two levels
    assert main(["stress", str(out), "--jobs", "1"]) == 0
    assert {file: file.stat().st_mtime_ns for file in files} == before
    page = (out / "report.html").read_text()
    assert "current.speed" in page
    assert "rare_01" in page
    finding = out / "findings" / "rare_01.yaml"
    trial = next(line for line in finding.read_text().splitlines() if "--trial" in line).split("--trial ")[1].split()[0]
    assert (
        main(["dock", str(finding), "--seed", "3", "--trial", trial, "--no-video", "--out", str(tmp_path / "r")]) == 0
    )
    again = json.loads((tmp_path / "r" / "summary.json").read_text())["estimate"]["all"]["position_rms"]
    kept = [json.loads(file.read_text())["summary"]["estimate"]["all"]["position_rms"] for file in files]
    assert again in kept  # bit for bit
    assert again == max(
        k
        for k, file in zip(kept, files, strict=True)
        if json.loads(file.read_text())["values"]["random"]["walk"] is not None
    )
