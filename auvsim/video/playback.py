"""A log as something that moves: the state of everything that is drawn, at any time."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import Array, flip
from auvsim.data.log import Log, StructureLog
from auvsim.physics import scenery, scenes
from auvsim.physics.truth import StructurePose
from auvsim.simulation import scenario
from auvsim.vehicles import model_files
from auvsim.video.motion import Motion, VehicleMoment


@dataclass(frozen=True, kw_only=True, slots=True)
class Dock:
    """A structure as it is drawn, in MuJoCo's world."""

    name: str
    mouth: Array  # (3,) centre of its mouth [m]
    axis: Array  # (3,) direction in which a vehicle enters
    heading: float  # the same, clockwise from north [rad]

    @classmethod
    def of(cls, log: StructureLog) -> "Dock":
        """A structure of a log."""
        axis = np.array([math.cos(log.heading), -math.sin(log.heading), 0.0])
        return cls(name=log.name, mouth=flip(log.position), axis=axis, heading=log.heading)


@dataclass(frozen=True, kw_only=True, slots=True)
class Moment:
    """All vehicles at one time, by name; `focus` is the one that views follow which are of no other."""

    time: float  # [s]
    vehicles: dict[str, VehicleMoment]
    focus: str

    @property
    def followed(self) -> VehicleMoment:
        """The vehicle in focus."""
        return self.vehicles[self.focus]


class Playback:
    """The scene of a log and its motion, interpolated between samples.

    Args:
        log: of any status, with at least one finite sample of every vehicle's truth.

    Raises:
        InputError: the log holds nothing to draw, or its scenario cannot be composed again.
    """

    def __init__(self, log: Log) -> None:
        self.log = log
        self.motions = {name: Motion(log.vehicle(name)) for name in log.vehicles}
        self.docks = {name: Dock.of(log.structure(name)) for name in log.structures}
        with model_files.given(log.models):
            plan = scenario.from_yaml(str(log.attributes["scenario"]), "scenario in the log")
            scene = scenes.scene(
                {name: _model(name, plan.vehicles) for name in log.vehicles},
                {name: (_model(name, plan.structures), _pose(log.structure(name))) for name in log.structures},
                plan.world,
                plan.rates.physics,
            )
        self.settings = plan.vehicles
        self.model, self._vehicles = scene.model, scene.vehicles
        self.fixed_modems = {name: flip(np.array(fixed.place)) for name, fixed in plan.fixed_modems.items()}
        scenery.paint_sea_floor(self.model)
        scenery.widen(self.model, max(float(np.abs(m.positions[:, :2]).max()) for m in self.motions.values()))
        self.data = mujoco.MjData(self.model)
        found = [motion.received_fixes() for motion in self.motions.values()]
        told = [(float(t), str(r)) for fixes in found for t, r in zip(fixes.times, fixes.reasons, strict=True) if r]
        self._refusals = sorted(told)
        self.hears_fixes = any(len(fixes.times) for fixes in found)
        self._joints = {name: self._addresses(name) for name in self.motions}

    def _addresses(self, name: str) -> tuple[int, list[int], list[int], Array]:
        """Where in qpos a vehicle and its hinges are, their channels, and which of these turn on and on (n,).

        Thrusters turn no hinge.
        """
        actuation, model = self._vehicles[name].actuation, self.model
        actuators = [model.actuator(f"{name}/{channel}") for channel in actuation.channels]
        hinged = [k for k, a in enumerate(actuators) if model.actuator_trntype[a.id] == mujoco.mjtTrn.mjTRN_JOINT]
        places = [int(model.jnt_qposadr[int(actuators[k].trnid[0])]) for k in hinged]
        turning = np.array([actuation.units[k] == "rad/s" for k in hinged], dtype=bool)
        return int(model.joint(f"{name}/").qposadr[0]), places, hinged, turning

    @property
    def beacons(self) -> dict[str, Array]:
        """Places (3,) [m] of modems that are neither on a vehicle nor on a dock, in MuJoCo's world."""
        return {name: place for name, place in self.fixed_modems.items() if name not in self.docks}

    @property
    def talks(self) -> bool:
        """Whether any vehicle has a modem."""
        return any("received" in motion.log for motion in self.motions.values())

    @property
    def lone(self) -> bool:
        """Whether there is one vehicle only."""
        return len(self.motions) == 1

    @property
    def first(self) -> Motion:
        """The first vehicle's motion."""
        return next(iter(self.motions.values()))

    @property
    def longest(self) -> Motion:
        """The motion that goes on for longest."""
        return max(self.motions.values(), key=lambda motion: motion.end)

    @property
    def start(self) -> float:
        """When the motion begins [s]."""
        return min(motion.start for motion in self.motions.values())

    @property
    def end(self) -> float:
        """When the motion ends [s]."""
        return self.longest.end

    def dock_of(self, vehicle: str) -> Dock | None:
        """The structure of a vehicle's mission."""
        structure = self.log.vehicle(vehicle).structure
        return self.docks[structure.name] if structure else None

    def at(self, time: float, focus: str | None = None) -> Moment:
        """Everything at a time, held at its ends beyond them.

        Args:
            time: [s].
            focus: vehicle that views follow which are of no other; by default the first.
        """
        moments = {name: motion.at(time) for name, motion in self.motions.items()}
        return Moment(time=time, vehicles=moments, focus=focus or next(iter(moments)))

    def latest_refusal(self, time: float) -> str:
        """Why the last fix that was refused up to a time was refused; "" if none was."""
        return next((reason for at, reason in reversed(self._refusals) if at <= time), "")

    def pose_model(self, moment: Moment) -> None:
        """Puts the scene's bodies where they are at that moment."""
        qpos = self.data.qpos
        for name, now in moment.vehicles.items():
            free, joints, channels, turning = self._joints[name]
            qpos[free : free + 3], qpos[free + 3 : free + 7] = now.position, now.quaternion
            qpos[joints] = np.where(turning, now.turns[channels], now.actuators[channels])
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)


def _model(name: str, settings: Mapping[str, Any]) -> str:
    """Model of a vehicle or structure by its name in the log, or of the only one, whatever it is called."""
    if name not in settings and len(settings) != 1:
        raise InputError(f"the scenario in the log has no '{name}'; there are {', '.join(settings) or 'none'}")
    return settings[name].model if name in settings else next(iter(settings.values())).model


def _pose(log: StructureLog) -> StructurePose:
    north, east, depth = log.position.tolist()
    return StructurePose(north=north, east=east, depth=depth, heading=log.heading)
