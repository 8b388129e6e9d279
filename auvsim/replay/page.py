"""One page of several estimators on one recording: tracks, errors with bounds, innovations by sensor, NEES."""

import os
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from auvsim.analysis.estimates import NEES_INTERVAL
from auvsim.analysis.style import DOCK, OUTLIER, dress, save, vehicle_colour
from auvsim.base.frames import Array
from auvsim.replay.judgement import Judgement, by_sensor
from estimators.core.innovations import Innovated

WIDTH, ROW = 14.0, 3.2  # [in]
SIGMAS = 2.0  # of bounds
MOST_SENSORS = 6  # rows of innovations


def draw(judgements: Sequence[Judgement], path: str | os.PathLike[str]) -> None:
    """Draws estimators on the same recording.

    Raises:
        InputError: The file cannot be written.
    """
    sensors = sorted({name for j in judgements for name in by_sensor(j.replayed.innovations)})[:MOST_SENSORS]
    rows = 2 + -(-len(sensors) // 2)
    figure = Figure(figsize=(WIDTH, ROW * rows + 1.6), layout="constrained")
    grid = figure.add_gridspec(rows, 2)
    recording = judgements[0].replayed.recording
    figure.suptitle(recording.name, fontsize=13)
    plan = figure.add_subplot(grid[:2, 0])
    _plan(plan, judgements)
    _position(figure.add_subplot(grid[0, 1]), judgements)
    _consistency(figure.add_subplot(grid[1, 1]), judgements)
    for k, name in enumerate(sensors):
        axes = figure.add_subplot(grid[2 + k // 2, k % 2])
        for index, judgement in enumerate(judgements):
            found = by_sensor(judgement.replayed.innovations).get(name, [])
            _innovations(axes, found, vehicle_colour(index))
        for bound in (-SIGMAS, SIGMAS):
            axes.axhline(bound, color="#444444", lw=0.8, ls="--")
        dress(axes, f"innovations of {name}; crosses: refused", "time [s]", "in deviations [-]")
        axes.set_ylim(-6.0, 6.0)
    save(figure, path)


def _plan(axes: Axes, judgements: Sequence[Judgement]) -> None:
    vehicle = judgements[0].replayed.recording.vehicle
    if vehicle is not None:
        truth = vehicle["truth"]["position"]
        axes.plot(truth[:, 1], truth[:, 0], color="#444444", lw=2.5, label="truth")
        if vehicle.structure is not None:
            north, east, _ = vehicle.structure.position
            axes.plot(east, north, "s", color=DOCK, ms=7, label="dock")
    fixes = [one.measurement.value for one in judgements[0].replayed.innovations if one.measurement.kind == "fix"]
    if fixes:
        places = np.array(fixes)
        axes.plot(places[:, 1], places[:, 0], ".", color="#999999", ms=4, label="fixes")
    for index, judgement in enumerate(judgements):
        position = _initialised(judgement)[1]
        axes.plot(
            position[:, 1], position[:, 0], color=vehicle_colour(index), lw=1.2, label=judgement.replayed.estimator
        )
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(fontsize=9)
    dress(axes, "plan", "east [m]", "north [m]")


def _position(axes: Axes, judgements: Sequence[Judgement]) -> None:
    """Horizontal errors against what the filters claim of them; without truth the claim alone."""
    for index, judgement in enumerate(judgements):
        time, _, sigma, there = _initialised(judgement)
        colour = vehicle_colour(index)
        axes.plot(time, SIGMAS * sigma, color=colour, lw=1.0, ls="--", label=f"{judgement.replayed.estimator}: 2 sd")
        if judgement.errors is not None:
            error = np.hypot(*judgement.errors.position[there, :2].T)
            axes.plot(time, error, color=colour, lw=1.2, label=f"{judgement.replayed.estimator}: error")
    axes.set_ylim(bottom=0.0)
    axes.legend(fontsize=8)
    dress(axes, "horizontal position", "time [s]", "[m]")


def _consistency(axes: Axes, judgements: Sequence[Judgement]) -> None:
    """NEES where there is truth; else refusals."""
    for index, judgement in enumerate(judgements):
        time, _, _, there = _initialised(judgement)
        if judgement.errors is not None:
            axes.semilogy(time, np.maximum(judgement.errors.nees[there], 1e-3), color=vehicle_colour(index), lw=1.0)
        else:
            refused = [e.refused for e in judgement.replayed.estimates]
            axes.step(time, np.array(refused)[there], color=vehicle_colour(index), where="post")
    if judgements[0].errors is None:
        dress(axes, "measurements refused", "time [s]", "so far [-]")
        return
    for bound in NEES_INTERVAL:
        axes.axhline(bound, color="#444444", lw=0.8, ls="--")
    dress(axes, "NEES of the horizontal position, and where 95 % of a consistent filter's lie", "time [s]", "[-]")


def _initialised(judgement: Judgement) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Times, positions, horizontal standard deviations, and which estimates they are of: those that know a position."""
    estimates = judgement.replayed.estimates
    there = np.array([e.initialised for e in estimates], dtype=bool)
    kept = [e for e in estimates if e.initialised]
    position = np.array([e.position for e in kept]).reshape(-1, 3)
    variance = np.array([np.trace(e.horizontal_covariance) for e in kept])
    return np.array([e.time for e in kept]), position, np.sqrt(variance), there


def _innovations(axes: Axes, found: Sequence[Innovated], colour: str) -> None:
    """Each component in its own deviations."""
    for accepted, marker in ((True, "."), (False, "x")):
        chosen = [one for one in found if one.accepted == accepted]
        for component in range(chosen[0].residual.size if chosen else 0):
            scaled = [one.residual[component] / np.sqrt(one.covariance[component, component]) for one in chosen]
            times = [one.measurement.stamp for one in chosen]
            axes.plot(times, np.clip(scaled, -5.8, 5.8), marker, color=colour if accepted else OUTLIER, ms=3.5)
