"""Outliers among ranges and bearings of a light: survived by interacting filters as by one with a gate."""

import math
from functools import cache

import numpy as np
import pytest

from estimators.core.consistency import interval
from estimators.core.history import Node
from estimators.core.types import Gaussian, Measurement
from estimators.docking.aids import LIGHT, RANGE, Aids
from estimators.docking.estimator import INTERACTING_NOISE, InteractingFilter, UsblFix, UsblModel
from estimators.docking.estimator import DockingEstimator as Estimator
from estimators.docking.models import PlanarModels
from estimators.planar.model import PRESTERO

BEACONS = {"a": (70.0, 15.0, 18.0), "b": (-50.0, 60.0, 18.0), "c": (-25.0, -75.0, 18.0)}
AIDS = Aids(ranges=dict.fromkeys(BEACONS, (0.0, 0.0)), lights={"eye": (0.0, 0.0)})
SHAFT, COURSE, SEEN = 100.0, 0.6, 15.0
RANGE_NOISE, LIGHT_NOISE = 0.2, math.radians(0.7)  # [m], [rad]


def wrong(noise: np.random.Generator, share: float, low: float, high: float) -> float:
    """The extra error of a reading: of either sign, none for most."""
    is_wrong, size, sign = noise.uniform() < share, noise.uniform(low, high), noise.choice((-1.0, 1.0))
    return sign * size if is_wrong else 0.0


@cache
def final_errors(gate: float | None, share: float, seeds: int = 6) -> tuple[float, float]:
    """NEES and rms error [m] of the position from 30 to 4 m before the mouth, over the same runs for all arguments.

    A straight course at the steady surge from 70 m on, with a compass, a fix every 8 s, three ranges every 2 s, and
    the light in the mouth twice a second from 15 m on.

    Args:
        gate: Of the filter.
        share: Of ranges that are wrong by 10 to 30 m, and of bearings that are by 10 to 40 degrees.
        seeds: Number of runs.
    """
    parameters = PlanarModels(PRESTERO, INTERACTING_NOISE)
    surge = parameters._mean(COURSE, Node(0.0, (0.0, SHAFT), [], True))[3]
    way, squares, nees = np.array((math.cos(COURSE), math.sin(COURSE))), [], []
    for seed in range(seeds):
        noise = np.random.default_rng(500 + seed)
        filter_ = InteractingFilter(PRESTERO, INTERACTING_NOISE, aids=AIDS, gate=gate)
        usbl = UsblModel(ranges=(1.0, 2.0), deviations=(0.3, 0.3))
        estimator = Estimator(filter_, usbl)
        for k in range(round(66.0 / surge / 0.5)):
            time = 0.5 * k
            place = (surge * time - 70.0) * way
            away, aids, fixes = math.hypot(*place), [], []
            if k % 16 == 2:
                fixes = [UsblFix(stamp=time, received=time, position=(*(place + 0.3 * noise.normal(size=2)), 0.0),
                                 heading=0.0, sequence=k)]  # fmt: skip
            for name, beacon in BEACONS.items() if k % 4 == 0 else ():
                value = (
                    math.dist(beacon, (*place, 0.0)) + RANGE_NOISE * noise.normal() + wrong(noise, share, 10.0, 30.0)
                )
                aids.append(reading(RANGE, value, RANGE_NOISE, time, name, beacon))
            off = LIGHT_NOISE * noise.normal() + math.radians(wrong(noise, share, 10.0, 40.0))
            if away < SEEN:  # straight ahead
                aids.append(reading(LIGHT, off, LIGHT_NOISE, time, "eye"))
            heading = COURSE + filter_.noise.compass * noise.normal()
            estimate = estimator.tick(time, heading, 0.0, SHAFT, fixes, aids)
            if away < 30.0:
                error = estimate.mean[:2] - place
                squares.append(error @ error)
                nees.append(error @ np.linalg.solve(estimate.covariance[:2, :2], error))
    return float(np.mean(nees)), math.sqrt(np.mean(squares))


def reading(kind: str, value: float, sigma: float, time: float, source: str, parameters=()) -> Measurement:
    """One that arrives at once."""
    return Measurement(
        kind=kind, value=np.array((value,)), covariance=np.array(((sigma**2,),)), stamp=time, received=time,
        source=source, parameters=parameters,
    )  # fmt: skip


def test_outliers_of_ranges_and_light_are_survived() -> None:
    """A tenth of both: consistent (6 runs, errors of one run hang together), and twice the error without at most.

    Without the gate, as before, the same outliers are fused: the error is tenfold, and the filter knows nothing of it.
    """
    _, high = interval(2, 6, 0.999)
    (sound, clean), (gated, error), (blind, dragged) = (
        final_errors(*case) for case in ((0.999, 0.0), (0.999, 0.1), (None, 0.1))
    )
    assert sound < high
    assert gated < high
    assert error < 2.0 * clean
    assert blind > 10.0 * high
    assert dragged > 5.0 * error


def state_with(belief: Gaussian | None = None):
    """A filter and its state 20 m before the mouth, straight ahead, and the time."""
    filter_ = InteractingFilter(PRESTERO, INTERACTING_NOISE, aids=AIDS)
    fix = Measurement(kind="usbl", value=-20.0 * np.array((math.cos(COURSE), math.sin(COURSE))),
                      covariance=0.01 * np.eye(2), stamp=0.0, received=0.0)  # fmt: skip
    compass = Measurement(
        kind="compass", value=np.array((COURSE,)), covariance=np.eye(1) * 1e-4, stamp=0.0, received=0.0
    )
    state = filter_.start([Node(0.0, (0.0, SHAFT), [compass, fix], True)], 0)
    assert state is not None
    return filter_, state


def test_a_lone_outlier_moves_nothing_and_those_that_agree_are_let_in() -> None:
    """A light 0.3 rad to starboard three times in a row, as a camera knocked askew shows it; two sources do not mix."""
    filter_, state = state_with()
    shown = []
    for k in range(4):
        before = state.belief
        state = filter_.correct(state, 0.5 * k, [reading(LIGHT, 0.3, LIGHT_NOISE, 0.5 * k, "eye")])
        shown.append((state.verdicts[-1][1], bool((state.belief.mean == before.mean).all())))
        if k == 0:  # a wrong range in between is none of the light's business
            value = math.dist(BEACONS["a"], (*state.belief.mean[:2], 0.0)) + 20.0
            state = filter_.correct(state, 0.0, [reading(RANGE, value, RANGE_NOISE, 0.0, "a", BEACONS["a"])])
            assert state.verdicts[-1][1] == "outlier"
    assert shown[:2] == [("outlier", True), ("outlier", True)]
    assert shown[2] == ("", False)
    assert state.outliers == 3
    assert [r.measurement.source for r in state.rejected if r.measurement.kind == RANGE] == ["a"]


@pytest.mark.parametrize(("off", "taken"), [(0.02, True), (0.3, False)])
def test_one_that_fits_is_taken_and_clears_the_memory_of_its_source(off: float, taken: bool) -> None:
    filter_, state = state_with()
    state = filter_.correct(state, 0.0, [reading(LIGHT, -0.4, LIGHT_NOISE, 0.0, "eye")])
    assert len(state.rejected) == 1
    state = filter_.correct(state, 0.5, [reading(LIGHT, off, LIGHT_NOISE, 0.5, "eye")])
    assert (state.verdicts[-1][1] == "") == taken
    assert len(state.rejected) == (0 if taken else 2)
