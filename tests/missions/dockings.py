"""Dockings without a vehicle: guidance fed by hand."""

from types import SimpleNamespace
from typing import Any

from auvsim.control.controller import Setpoints
from auvsim.missions.docking.guidance import Docking, DockingSettings
from auvsim.missions.mission import MissionSetup, Place, Situation
from auvsim.navigation.estimate import Estimate
from auvsim.physics.truth import StructurePose

SETTINGS = DockingSettings()
NOSE, MOUTH, LATCHED = 0.8, 0.75, 1.3  # of vehicle and dock [m]
DOCK_DEPTH = 12.0
PERIOD = 0.1  # of control [s]


def new(settings: DockingSettings = SETTINGS, north: float = 0.0, east: float = 0.0, sources=()) -> Docking:
    """A docking at its beginning; only what guidance knows of vehicle and dock is there."""
    structure: Any = SimpleNamespace(mouth_radius=MOUTH, latched=LATCHED, throat_radius=0.15, cone_length=1.04)
    vehicle: Any = SimpleNamespace(nose=NOSE)
    pose = StructurePose(north=north, east=east, depth=DOCK_DEPTH, heading=0.0)
    setup = MissionSetup(
        name="auv", settings=settings, vehicle=vehicle, heading=0.0, depth=5.0, period=PERIOD,
        holds=lambda speed: True, structures={"dock": Place(name="dock", pose=pose, structure=structure)},
        fixes=tuple(sources),
    )  # fmt: skip
    return Docking(setup)


def update(
    guidance: Docking, time: float, estimate: "Estimate | None", heading: float, depth: float, latched=False, fixes=()
) -> Setpoints:
    """One call of a docking."""
    held = "dock" if latched else None
    return guidance.update(Situation(time, estimate, heading, depth, held, fixes, ()))
