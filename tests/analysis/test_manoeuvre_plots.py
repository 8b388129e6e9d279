"""The picture of a manoeuvre: what is drawn is what was logged, whatever the manoeuvre came to."""

from pathlib import Path

import numpy as np
import pytest
from synthetic import trial_log, writer

from auvsim.analysis import manoeuvre_plots
from auvsim.base.errors import InputError
from auvsim.data.log import VehicleLog
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import ProgressState, run


@pytest.fixture(scope="module")
def log() -> VehicleLog:
    """A straight run, then a coarse spiral, across 180 degrees."""
    parts = [
        {"kind": "straight", "duration": 20.0, "approach": 10.0},
        {"kind": "spiral", "rudder_deg": 10.0, "step_deg": 10.0, "hold": 8.0, "approach": 5.0},
    ]
    pinned = {"manoeuvre": {"kind": "sequence", "parts": parts}, "vehicle": {"start": {"heading_deg": 175.0}}}
    plan = sampling.merge(sampling.manoeuvre_plan("sequence"), pinned)
    return run(scenario.parse(sampling.draw(plan, 2)), seed=2).vehicle()


def test_lines_are_those_of_the_log(log: VehicleLog) -> None:
    """Truth and measurements without jumps at 180 degrees; the spiral has its curve; approaches are marked."""
    figure = manoeuvre_plots.manoeuvre_figure(log)
    axes = {panel.get_title(): panel for panel in figure.axes}
    assert set(axes) == {
        "Track", "Spiral: steady yaw rate", "Heading", "Rudder", "Yaw rate", "Surge through the water"
    }  # fmt: skip
    measured, true, _ = axes["Heading"].get_lines()[:3]
    np.testing.assert_array_equal(true.get_xdata(), log["truth"]["time"])
    headings = np.asarray(true.get_ydata(), dtype=float)
    assert np.abs(np.diff(headings)).max() < 2.0  # at 5 deg/s and 10 Hz half a degree
    np.testing.assert_allclose(np.asarray(measured.get_ydata(), dtype=float), headings[1:], atol=8.0)  # 1 deg of noise
    (rudder, *marks) = axes["Rudder"].get_lines()
    np.testing.assert_allclose(np.asarray(rudder.get_ydata(), dtype=float), np.degrees(log["command"]["rudder"]))
    assert [float(np.asarray(mark.get_xdata())[0]) for mark in marks] == [10.0, 25.0]
    down, back = axes["Spiral: steady yaw rate"].get_lines()
    np.testing.assert_allclose(np.asarray(down.get_xdata(), dtype=float), [10.0, 0.0, -10.0], atol=1e-9)
    np.testing.assert_allclose(np.asarray(back.get_xdata(), dtype=float), [-10.0, 0.0, 10.0], atol=1e-9)
    assert figure.get_suptitle().startswith("Seed 2, trial 0: straight; spiral: yaw rate per rudder at zero 0.")


def test_a_manoeuvre_that_was_stopped_can_be_drawn(log: VehicleLog, tmp_path: Path) -> None:
    """In its first approach, before anything could be read off it; the picture is whole."""
    plan = scenario.from_yaml(str(log.log.attributes["scenario"]))

    def stop(state: ProgressState) -> None:
        raise KeyboardInterrupt

    short = run(plan, seed=2, progress=stop).vehicle()
    assert (short.log.attributes["status"], short["truth"]["time"][-1]) == ("interrupted", pytest.approx(6.0))
    manoeuvre_plots.manoeuvre(short, tmp_path / "stopped.png")
    assert (tmp_path / "stopped.png").read_bytes().startswith(b"\x89PNG")
    assert [path.name for path in tmp_path.iterdir()] == ["stopped.png"]


def test_what_cannot_be_drawn_is_refused(log: VehicleLog, tmp_path: Path) -> None:
    """A docking trial, an empty log, a folder that is not there."""
    empty = writer("manoeuvre", mission_settings=str(log.attributes["mission_settings"])).finish("interrupted")
    with pytest.raises(InputError, match="nothing was logged"):
        manoeuvre_plots.manoeuvre(empty, tmp_path / "x.png")
    with pytest.raises(InputError, match="is docking, not a manoeuvre"):
        manoeuvre_plots.manoeuvre(trial_log(), tmp_path / "x.png")
    with pytest.raises(InputError, match="cannot be written"):
        manoeuvre_plots.manoeuvre(log, tmp_path / "none" / "x.png")
    assert list(tmp_path.iterdir()) == []
