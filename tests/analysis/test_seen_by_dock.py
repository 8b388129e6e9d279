"""Errors of the position as a dock sees it whose compass is off: from first principles, on a log made by hand."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from auvsim.analysis import estimates

MOUTH, HEADING, OFF, BELIEVED = np.array([12.0, -7.0, 20.0]), 0.7, math.radians(3.0), math.radians(1.2)


class HandMade(dict):
    """A vehicle's log with one place, told by a dock whose compass shows `OFF` too much."""

    def table(self, name):
        return {"mean": SimpleNamespace(labels=("north", "east", "dock_heading_bias"))}


def turned(angle):
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def a_log(monkeypatch, believed, error=(0.0, 0.0), variance=1e-12):
    place = MOUTH[:2] + np.array([-60.0, 25.0])
    # The fixes show the place turned about the mouth by OFF, and the filter turns back what it believes of that.
    shown = MOUTH[:2] + turned(OFF - believed) @ (place - MOUTH[:2]) + error
    covariance = np.diag([0.04, 0.09, variance])
    packets = np.zeros((200, 7))
    packets[:, 3] = HEADING + OFF
    log = HandMade(
        estimate={
            "position": np.array([[*shown, 20.0]]), "covariance": covariance[None],
            "mean": np.array([[*shown, believed]]),
        },
        usbl={"time": np.arange(200.0), "value": packets},
    )  # fmt: skip
    dock = SimpleNamespace(heading=HEADING, position=MOUTH)
    monkeypatch.setattr(estimates, "usbl_dock", lambda _: dock)
    return log, place[None]


@pytest.mark.parametrize("believed", [0.0, BELIEVED, OFF])
def test_turn_of_all_that_the_dock_measures_is_no_error_to_it(monkeypatch, believed):
    error, _ = estimates._seen_by_dock(*a_log(monkeypatch, believed))
    assert error[0] == pytest.approx([0.0, 0.0], abs=1e-9)  # rounding of places of 100 m


def test_other_errors_stay_in_length_and_turn_with_the_axis(monkeypatch):
    error, _ = estimates._seen_by_dock(*a_log(monkeypatch, BELIEVED, error=(0.3, -0.8)))
    assert error[0] == pytest.approx(turned(BELIEVED - OFF) @ (0.3, -0.8), abs=1e-9)


def test_covariance_agrees_with_finite_differences_of_what_is_seen(monkeypatch):
    deviation = math.radians(0.5)
    log, place = a_log(monkeypatch, BELIEVED, error=(0.3, -0.8), variance=deviation**2)
    _, covariance = estimates._seen_by_dock(log, place)
    mean, step, columns = log["estimate"]["mean"][0], 1e-6, []
    for k in range(3):
        ends = []
        for sign in (1.0, -1.0):
            moved = mean + sign * step * np.eye(3)[k]
            log["estimate"] |= {"mean": moved[None], "position": np.array([[*moved[:2], 20.0]])}
            ends.append(estimates._seen_by_dock(log, place)[0][0])
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    J = np.column_stack(columns)
    # Central differences of smooth functions: relative error of step^2, and rounding of 1e-13 / step.
    assert covariance[0] == pytest.approx(J @ np.diag([0.04, 0.09, deviation**2]) @ J.T, rel=1e-6, abs=1e-7)


def test_without_a_dock_that_speaks_there_is_none():
    log = HandMade(estimate={"covariance": np.eye(3)[None]})
    error, covariance = estimates._seen_by_dock(log, np.zeros((1, 2)))
    assert np.isnan(error).all()
    assert np.isnan(covariance).all()
