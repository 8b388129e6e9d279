"""Logs of formats 1 and 2 are summed up, plotted and drawn like new ones; of fates of fixes they say nothing."""

from pathlib import Path

import numpy as np
import pytest

from auvsim import video
from auvsim.analysis import plots
from auvsim.analysis.estimates import estimate_errors, fix_fates, fixes, refusals
from auvsim.analysis.manoeuvre_plots import manoeuvre_figure
from auvsim.analysis.summary import summarise
from auvsim.data import log as logs
from auvsim.missions.manoeuvres import metrics
from auvsim.missions.manoeuvres.settings import ZigzagSettings
from auvsim.navigation.estimate import PLANAR_STATES

GOLDEN = Path(__file__).parents[1] / "golden"


@pytest.mark.parametrize("form", ["format1", "format2"])
def test_a_docking(form: str, tmp_path: Path) -> None:
    log = logs.read(GOLDEN / form / "docking.nc")
    vehicle = log.vehicle()
    summary = summarise(vehicle)
    assert (summary["docked"], summary["time"], summary["fixes_refused"]) == (True, 41.5, 2)
    near = np.isfinite(vehicle["usbl"]["received"]) & ~vehicle["usbl"]["outlier"]
    at = np.searchsorted(vehicle["truth"]["time"], vehicle["usbl"]["time"][near])
    off = fixes(vehicle)[near] - vehicle["truth"]["position"][at.clip(max=len(vehicle["truth"]["time"]) - 1), :2]
    assert np.hypot(*off.T).max() < 2.0  # noise below 0.5 m an axis, heading of the dock 0.3 deg at 40 m, 0.1 m of way
    assert set(fix_fates(vehicle).tolist()) == {""}
    assert len(refusals(vehicle)[0]) == 0
    errors = estimate_errors(vehicle)
    assert (errors.sigma[errors.initialised] > 0.0).all()  # each planar state is found by its name
    assert tuple(vehicle.table("estimate")["mean"].labels) == tuple(PLANAR_STATES)
    assert "docked at 41.5 s, 1 attempt, nose 0.10 m" in plots.track_figure(vehicle).get_suptitle()
    video.still(log, tmp_path / "still.png", width=160, height=120)


def test_a_manoeuvre() -> None:
    vehicle = logs.read(GOLDEN / "format2" / "zigzag.nc").vehicle()
    assert isinstance(metrics.settings(vehicle), ZigzagSettings)
    assert metrics.settings(vehicle).duration == 20.0
    assert "first overshoot 1.59 deg" in manoeuvre_figure(vehicle).get_suptitle()
