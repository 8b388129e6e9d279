"""Missions of hovering vehicles: on a vehicle that is where it is asked to be, and in MuJoCo by its own sensors."""

import math

import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.control.controller import Setpoints, Station
from auvsim.missions import registry
from auvsim.missions.docking.guidance import Phase
from auvsim.missions.docking.reports import DockReports
from auvsim.missions.hovering.carrot import LEAD, Carrot
from auvsim.missions.hovering.docking import ASIDE, HoveringDocking, HoveringDockingSettings
from auvsim.missions.hovering.hold import Hold, HoldSettings
from auvsim.missions.mission import MissionSetup, Place, Situation
from auvsim.navigation.estimate import Estimate
from auvsim.physics.truth import StructurePose
from auvsim.simulation import run
from auvsim.simulation.loading import load_scenario
from auvsim.vehicles import library

PERIOD, AXIS = 0.1, 2.2
ROV, CAGE = library.vehicle("bluerov2_heavy"), library.structure("dock_cage")
POSE = StructurePose(north=40.0, east=-15.0, depth=12.0, heading=AXIS)
TO_NED = np.array(((math.cos(AXIS), -math.sin(AXIS)), (math.sin(AXIS), math.cos(AXIS))))


def setup(settings, *, vehicle=ROV, usbl=True):
    places = {"cage": Place(name="cage", pose=POSE, structure=CAGE)}
    return MissionSetup(
        name="rov", settings=settings, vehicle=vehicle, heading=0.3, depth=9.0, period=PERIOD, holds=lambda _: True,
        structures=places, usbl=usbl,
    )  # fmt: skip


def fix(time, heading=AXIS, depth=12.0):
    return Reading("usbl", time, time, np.array([1.0, 2.0, 3.0, heading, 0.0, 0.0, depth]))


class Follower:
    """A vehicle that is at once where it is asked to be, give or take `off` across the dock's axis [m]."""

    def __init__(self, mission, along, cross, *, heading=0.0):
        self.mission, self.heading, self.time, self.depth = mission, heading, 0.0, 9.0
        self.place = POSE.position[:2] + TO_NED @ (along, cross)
        self.latched, self.heard, self.off, self.deviation = None, True, 0.0, 0.1
        self.held = None  # distance across the axis at which it is held against its will [m]
        self.path = []

    def nose(self):
        ahead = ROV.nose * np.array([math.cos(self.heading), math.sin(self.heading)])
        return TO_NED.T @ (self.place + ahead - POSE.position[:2])

    def step(self):
        self.time += PERIOD
        shown = self.place + TO_NED @ (0.0, self.off)
        estimate = Estimate(
            time=self.time, position=np.array([*shown, self.depth]), heading=self.heading, velocity=np.zeros(3),
            current=np.zeros(2), covariance=self.deviation**2 * np.eye(8), initialised=True,
        )  # fmt: skip
        readings = [fix(self.time)] if self.heard and round(self.time / PERIOD) % 20 == 0 else []
        wanted = self.mission.update(
            Situation(self.time, estimate, self.heading, self.depth, self.latched, readings, [])
        )
        if isinstance(wanted, Station):
            self.place = np.array(wanted.place) - TO_NED @ (0.0, self.off)
            self.heading, self.depth = wanted.heading, wanted.depth
            if self.held is not None:
                along = (TO_NED.T @ (self.place - POSE.position[:2]))[0]
                self.place = POSE.position[:2] + TO_NED @ (along, self.held)
        self.path.append(self.nose())
        return wanted

    def until(self, condition, longest=600.0):
        while not condition() and self.time < longest:
            wanted = self.step()
        assert condition(), f"{self.mission.phase} after {self.time:.0f} s"
        return wanted


@pytest.mark.parametrize("start", [(-25.0, 12.0), (-6.0, -1.0), (8.0, 0.5), (0.5, -14.0)])
def test_it_lines_up_and_creeps_in_from_anywhere(start):
    """In line before it comes nearer than the gate, never through the cage, at the creep speed, on the axis."""
    mission = HoveringDocking(setup(HoveringDockingSettings()))
    vehicle = Follower(mission, *start)
    vehicle.until(lambda: mission.phase == Phase.APPROACH)
    path = np.array(vehicle.path)
    near = (path[:, 0] > -2.5) & (path[:, 0] < 3.0)
    assert np.abs(path[near, 1]).min(initial=9.0) > (0.0 if start[0] == 8.0 else 3.0) or start == (0.5, -14.0)
    if start[0] > 0.0:
        assert np.abs(path[(path[:, 0] > -3.0) & (path[:, 0] < 1.5), 1]).min(initial=99.0) > ASIDE - 2.0
    assert abs(wrap(vehicle.heading - AXIS)) < 1e-9
    began, place = vehicle.time, vehicle.nose()[0]
    vehicle.until(lambda: mission.phase == Phase.FINAL)
    assert (vehicle.nose()[0] - place) / (vehicle.time - began) == pytest.approx(0.15, rel=0.02)
    vehicle.until(lambda: vehicle.nose()[0] > CAGE.latched)
    assert abs(vehicle.nose()[1]) < 1e-6
    vehicle.latched = "cage"
    assert isinstance(vehicle.step(), Setpoints)
    assert mission.finished
    assert mission.at_rest
    assert [e.kind for e in mission.events] == ["homing", "approach", "final", "docked"]


def test_it_waits_outside_the_cage_until_it_is_in_line_again():
    mission = HoveringDocking(setup(HoveringDockingSettings(patience=1e4)))
    vehicle = Follower(mission, -6.0, 0.0)
    vehicle.until(lambda: mission.phase == Phase.APPROACH)
    for _ in range(100):
        vehicle.step()
    vehicle.held, along = 0.4, vehicle.nose()[0]
    for _ in range(60):
        vehicle.step()
    assert vehicle.nose()[0] - along < 0.05
    vehicle.held = None
    vehicle.until(lambda: mission.phase == Phase.FINAL)


def test_an_uncertain_vehicle_does_not_creep_in():
    mission = HoveringDocking(setup(HoveringDockingSettings()))
    vehicle = Follower(mission, -6.0, 0.0)
    vehicle.deviation = CAGE.mouth_radius / 2.9
    for _ in range(600):
        vehicle.step()
    assert mission.phase == Phase.HOMING
    vehicle.deviation = CAGE.mouth_radius / 3.1
    vehicle.until(lambda: mission.phase == Phase.APPROACH)


def test_it_backs_out_when_it_is_not_captured_and_gives_up_at_last():
    """No latch: out along the axis, and the second attempt was the last."""
    mission = HoveringDocking(setup(HoveringDockingSettings(attempts=2)))
    vehicle = Follower(mission, -6.0, 0.0)
    vehicle.until(lambda: mission.phase == Phase.GO_AROUND)
    out = len(vehicle.path)
    vehicle.until(lambda: mission.phase == Phase.APPROACH)
    assert mission.attempt == 2
    assert np.abs(np.array(vehicle.path[out:])[:, 1]).max() < 1e-6
    vehicle.until(lambda: mission.phase == Phase.ABORTED)
    assert mission.finished
    assert "attempt 2 was the last" in mission.events[-1].text


def test_silence_breaks_off_and_ends_it():
    mission = HoveringDocking(setup(HoveringDockingSettings(lost_timeout=60.0)))
    vehicle = Follower(mission, -6.0, 0.0)
    vehicle.until(lambda: mission.phase == Phase.APPROACH)
    vehicle.heard = False
    vehicle.until(lambda: mission.phase == Phase.GO_AROUND)
    assert "no fix for 3" in mission.events[-1].text
    vehicle.until(lambda: mission.phase == Phase.ABORTED)
    assert "no fix for 60 s" in mission.events[-1].text


def test_the_chart_serves_where_no_dock_reports():
    mission = HoveringDocking(setup(HoveringDockingSettings(), usbl=False))
    vehicle = Follower(mission, -6.0, 1.0)
    vehicle.heard = False
    vehicle.until(lambda: mission.phase == Phase.FINAL)


def test_reports_of_a_dock_are_averaged_across_north():
    reports = DockReports(None)
    reports.observe([fix(1.0, 0.1, 12.2), fix(2.0, 2.0 * math.pi - 0.2, 12.0), fix(3.0, math.nan)])
    assert (reports.count, reports.last) == (2, 2.0)
    assert reports.axis == pytest.approx(-0.05, abs=1e-6)
    assert reports.depth == pytest.approx(12.1)


def test_a_carrot_moves_at_its_speed_and_waits():
    carrot, goal = Carrot(PERIOD), np.array([3.0, 4.0])
    assert carrot.move(goal, np.zeros(2), 0.5) == pytest.approx([0.03, 0.04])
    for _ in range(60):
        place = carrot.move(goal, np.zeros(2), 0.5)
    assert np.hypot(*place) == pytest.approx(LEAD)
    for _ in range(200):
        place = carrot.move(goal, place, 0.5)
    assert place == pytest.approx(goal)


def test_a_place_is_gone_to_and_held():
    mission = Hold(setup(HoldSettings(north=45.0, east=-11.0, depth=7.0, heading_deg=-40.0)))
    vehicle = Follower(mission, 0.0, 0.0)
    wanted = vehicle.until(lambda: mission.phase == 2)
    assert wanted[:2] == pytest.approx((math.radians(-40.0), 7.0))
    for _ in range(50):
        vehicle.step()
    assert vehicle.place == pytest.approx([45.0, -11.0])


@pytest.mark.parametrize("settings", [HoldSettings(), HoveringDockingSettings()])
def test_a_torpedo_cannot_hover(settings):
    with pytest.raises(InputError, match=f"mission {settings.kind} of 'rov': 'remus100' cannot hover"):
        registry.build(settings.kind, setup(settings, vehicle=library.vehicle("remus100")))


def test_the_shipped_scenario_docks():
    """One trial, by DVL, gyro, compass, depth gauge and USBL in 0.3 m/s; 100 are in the documentation."""
    log = run.run(load_scenario("rov_docking", seed=7), seed=7)
    found = HoveringDocking.metrics(log.vehicle())
    assert found["docked_first"]
    assert found["docked_aligned"]
    assert found["peak_contact_force"] < 1000.0


def test_a_place_is_held_by_ones_own_sensors():
    """In 0.2 m/s: position within what USBL and DVL tell, depth within the gauge's bias of 0.1 m sd."""
    pins = load_scenario("rov_docking", seed=9).model_dump(mode="json")
    pins["duration"] = 150.0
    pins["water"]["current"] = {"kind": "uniform", "speed": 0.2, "direction_deg": 70.0}
    rov = pins["vehicles"]["rov"]
    rov["start"] |= {"north": 3.0, "east": 10.0}
    rov["mission"] = {"kind": "hold", "north": 6.0, "east": 4.0, "depth": 12.0, "heading_deg": 100.0}
    from auvsim.simulation.scenario import parse

    found = Hold.metrics(run.run(parse(pins), seed=9).vehicle())
    assert found["held"]
    assert found["position_rms"] < 0.3
    assert found["depth_rms"] < 0.3
    assert found["heading_rms_deg"] < 3.0  # the compass' bias is 0.5 deg, its error seen in the heading besides


def test_within_the_cage_it_goes_on_whatever_it_shows():
    """There the walls lead it; to wait would leave it in the flare."""
    mission = HoveringDocking(setup(HoveringDockingSettings()))
    vehicle = Follower(mission, -6.0, 0.0)
    vehicle.until(lambda: vehicle.nose()[0] > 0.1)
    along, vehicle.held = vehicle.nose()[0], 0.4
    for _ in range(20):
        vehicle.step()
    assert vehicle.nose()[0] - along > 0.15
