"""Shaft energy, way through the water and contacts of a docking against closed forms."""

import math

import numpy as np
import pytest
from synthetic import ATTRIBUTES, SCENARIO, STRUCTURE, empty_log, truth, writers

from auvsim.analysis.summary import summarise
from auvsim.base.frames import rotation
from auvsim.data.log import VehicleLog
from auvsim.missions.docking.effort import contacts
from auvsim.vehicles import library

ATTITUDE, CURRENT = (0.2, -0.1, 0.6), (0.3, -0.2, 0.1)  # roll, pitch, yaw [rad]; NED [m/s]
THROUGH = np.array([1.4, 0.2, -0.1])  # through the water, in the body's axes [m/s]
DENSITY, SHAFT = 1000.0, 150.0  # [kg/m3], [rad/s] of `synthetic.truth`
TIME = 12.0  # [s]


def steady(shaft: float = SHAFT, model: str = "remus100", docked: float | None = None) -> VehicleLog:
    """A steady motion in a current, with the model's text in the log."""
    attributes = {**ATTRIBUTES, "scenario": SCENARIO.replace("sea_floor: 40.0", f"density: {DENSITY}")}
    log = writers({"remus100": {}}, {"dock": STRUCTURE}, attributes)["remus100"]
    log.recorder.append("models", (0.0, "vehicle", model, "", library.vehicle(model).source))
    over_ground = rotation(*ATTITUDE) @ THROUGH + CURRENT
    for time in np.linspace(0.0, TIME, 25):
        state = truth(time, over_ground * time, ATTITUDE, over_ground, CURRENT)
        state.actuators[-1] = shaft
        log.truth(state)
    for time in (1.0, 1.01, 1.02, 1.5, 1.6, 9.0):
        log.append("contact", (time, 10.0, 0.1, "dock"))
    if docked is not None:
        log.event(docked, "docked", "latched")
    return log.finish("complete", wall_time=0.5)


@pytest.mark.parametrize("shaft", [SHAFT, -SHAFT])
def test_a_steady_propeller_takes_its_power_all_the_time(shaft: float):
    """2 pi rho n^3 D^5 K_Q(J) by the numbers of the REMUS-100's table; astern at the bollard value of K_Q."""
    n, d = shaft / math.tau, 0.14
    advance = (1.0 - 0.056) * THROUGH[0] / (n * d)
    coefficient = 0.07 - 0.0585 * max(advance, 0.0)
    power = math.tau * DENSITY * abs(n) ** 3 * d**5 * coefficient
    assert summarise(steady(shaft))["shaft_energy"] == pytest.approx(power * TIME, rel=1e-9)


def test_way_is_through_the_water_and_ends_when_it_docks():
    """The current carries the vehicle besides; what follows a docking does not count."""
    speed = float(np.linalg.norm(THROUGH))
    whole, part = summarise(steady()), summarise(steady(docked=6.0))
    assert whole["way"] == pytest.approx(speed * TIME, rel=1e-12)
    assert part["way"] == pytest.approx(speed * 6.0, rel=1e-12)
    assert part["shaft_energy"] == pytest.approx(0.5 * whole["shaft_energy"], rel=1e-12)
    assert (whole["contacts"], part["contacts"]) == (3, 2)


def test_contacts_are_as_many_as_there_are_pauses():
    """A row each tick of one contact; none is none."""
    times = np.concatenate([np.arange(0.0, 1.0, 0.01), [1.3], [1.6, 1.75]])
    assert contacts(times, 5.0) == 3
    assert contacts(times, 1.5) == 2
    assert contacts(np.empty(0), 5.0) == 0


def test_without_a_propeller_the_energy_is_unknown():
    """Of another model than the log holds, and of a log without anything."""
    assert summarise(steady(model="bluerov2_heavy"))["shaft_energy"] is None
    nothing = summarise(empty_log())
    assert (nothing["shaft_energy"], nothing["way"], nothing["contacts"]) == (None, 0.0, 0)
