"""The physical world: n vehicles and n structures in the water, stepped by MuJoCo; gives their true states."""

import math
from collections.abc import Sequence
from itertools import combinations

import mujoco
import numpy as np

from auvsim.base.errors import DivergenceError, InputError
from auvsim.base.frames import Array, flip
from auvsim.physics import hydrodynamics, panels, rays
from auvsim.physics.contacts import Contact, ContactRecorder
from auvsim.physics.craft import Craft
from auvsim.physics.scenery import SEA_FLOOR
from auvsim.physics.scenes import Scene, pair_name
from auvsim.physics.truth import StructurePose, Truth
from auvsim.vehicles import library
from auvsim.water.currents import CurrentField
from auvsim.water.terrain import FlatFloor

# Distances within which contact is looked for at every physics tick [m].
NEAR_STRUCTURE = 4.0  # from its mouth to a vehicle's origin
BULK = 5.0  # by which what rays meet may lie nearer than its origin [m]
NEAR_FLOOR = 2.0  # from the sea floor to a vehicle's origin
NEAR_VEHICLE = 2.0  # between two vehicles' origins, beyond half the sum of their lengths
OVERLAP = 0.001  # depth from which two things that start are inside each other [m]
LOOKOUT = 0.25  # longest time between two checks of these distances [s]
SWIFT = NEAR_STRUCTURE / LOOKOUT  # speed beyond any vehicle's, which these presuppose [m/s]


class StructureState:
    """A structure in the world, and its latch.

    Args:
        structure: its model.
        pose: where it is.
        latches: index of its latch for each vehicle.
        active: MuJoCo's flags of active constraints.
    """

    def __init__(
        self, structure: library.Structure, pose: StructurePose, latches: dict[str, int], active: "np.ndarray"
    ) -> None:
        self.structure, self.pose = structure, pose
        self._latches, self._active = latches, active

    @property
    def latched(self) -> str | None:
        """Name of the vehicle that its latch holds."""
        return next((name for name, latch in self._latches.items() if self._active[latch]), None)

    def holds(self, vehicle: str) -> bool:
        """Whether its latch holds a vehicle."""
        return bool(self._active[self._latches[vehicle]])

    def hold(self, vehicle: str) -> None:
        """Closes the latch on a vehicle."""
        self._active[self._latches[vehicle]] = 1

    def release(self, vehicle: str) -> None:
        """Opens the latch if it holds that vehicle."""
        self._active[self._latches[vehicle]] = 0


class World:
    """Vehicles, structures and the water, stepped by MuJoCo.

    Args:
        scene: what is there; its compiled model gets its hydrodynamics here.
        current: what the water does.
        density: of the water [kg/m3].
        data: MuJoCo's state where it belongs to somebody else; a new one by default.
    """

    def __init__(
        self,
        scene: Scene,
        current: CurrentField,
        density: float = hydrodynamics.SEA_WATER,
        *,
        data: mujoco.MjData | None = None,
    ) -> None:
        model = scene.model
        slots = hydrodynamics.equip(model, density)
        self.model, self.data = model, mujoco.MjData(model) if data is None else data
        self.current, self.density, self.terrain = current, density, scene.terrain
        self._craft = {
            name: Craft(model, self.data, name, vehicle, slots[f"{name}/"]) for name, vehicle in scene.vehicles.items()
        }
        self.vehicles = tuple(self._craft)
        self._substeps = 1  # of a physics step where something may be touched
        for name, structure in scene.structures.items():
            if structure.panel_contact is not None and self.vehicles:
                substeps = panels.soften(model, name, self.vehicles, *structure.panel_contact)
                self._substeps = max(self._substeps, substeps)
        self.models = scene.vehicles
        self._options, self._sensors = model.opt, self.data.sensordata
        active = self.data.eq_active
        self.structures: dict[str, StructureState] = {}
        self._captures: list[tuple[StructureState, list[tuple[str, int]]]] = []  # and where its sensors are
        for name, structure in scene.structures.items():
            pairs = {vehicle: pair_name(name, vehicle) for vehicle in self.vehicles}
            latches = {vehicle: int(model.equality(pair).id) for vehicle, pair in pairs.items()}
            state = StructureState(structure, scene.poses[name], latches, active)
            self.structures[name] = state
            sensors = [(vehicle, int(model.sensor(pair).adr[0])) for vehicle, pair in pairs.items()]
            self._captures.append((state, sensors))
        self._mouths = [flip(state.pose.position).tolist() for state in self.structures.values()]
        lengths = [craft.vehicle.length for craft in self._craft.values()]
        self._meetings = [
            (i, j, (0.5 * (lengths[i] + lengths[j]) + NEAR_VEHICLE) ** 2)
            for i, j in combinations(range(len(lengths)), 2)
        ]
        self._recorder = ContactRecorder(model, self.data, self.vehicles)
        self._near_flags = int(model.opt.disableflags)
        self._far_flags = self._near_flags | int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        self._fleet = tuple(self._craft.values())
        self._most_ticks = max(1, round(LOOKOUT / model.opt.timestep))
        self._unplaced = set(self.vehicles)
        self._time = self.data.time  # to ask MjData costs as much as a calculation
        self._flags = -1  # last set
        self._clear = -math.inf  # time before which nothing can be near [s]
        self._looks_ahead = data is None and isinstance(scene.terrain, FlatFloor)  # and nobody else moves the vehicles

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return self._time

    def rays(self, place: Array, directions: Array, reach: float) -> tuple[Array, Array] | None:
        """What rays meet of structures and vehicles, see `rays.cast`; None where none of these is within reach.

        Args:
            place: (3,) where they begin, NED [m]; a vehicle about it is met, too.
            directions: (n, 3) unit vectors, NED.
            reach: their length [m].
        """
        start = flip(place)
        near = [np.array(mouth) for mouth in self._mouths]
        near += [
            craft.position for craft in self._fleet if np.linalg.norm(craft.position - start) > craft.vehicle.length
        ]
        if not any(np.linalg.norm(found - start) < reach + BULK for found in near):
            return None
        return rays.cast(self.model, self.data, place, directions, reach)

    def contacts(self, vehicle: str) -> list[Contact]:
        """Contacts of a vehicle so far, in order of time."""
        return self._recorder.found[vehicle]

    def surfaced(self, vehicle: str) -> bool:
        """Whether any part of a vehicle's hull is out of the water."""
        return self._craft[vehicle].surfaced

    def grounded(self, vehicle: str, since: float) -> bool:
        """Whether a vehicle has touched the sea floor after a time [s]."""
        found = self._recorder.found[vehicle]
        for contact in reversed(found) if found else ():
            if contact.time <= since:
                return False
            if contact.other == SEA_FLOOR:
                return True
        return False

    def latched(self, vehicle: str) -> str | None:
        """Name of the structure whose latch holds a vehicle."""
        for name, state in self.structures.items():
            if state.holds(vehicle):
                return name
        return None

    def reset(self) -> None:
        """Back to time zero: no contact, all latches open, and every vehicle waiting for its place."""
        mujoco.mj_resetData(self.model, self.data)
        self._recorder.clear()
        self._unplaced, self._clear, self._time = set(self.vehicles), -math.inf, 0.0

    def place(self, vehicle: str, position: Array, heading: float, speed: float, channels: Sequence[float]) -> None:
        """Puts a vehicle level at a place, out of any latch, moving ahead through the water.

        Args:
            vehicle: instance name.
            position: (3,) NED [m].
            heading: [rad].
            speed: through the water [m/s].
            channels: (n,) commands of its actuators, which these already carry out.

        Raises:
            InputError: the place is out of the water or below the sea floor.
        """
        position = np.asarray(position, dtype=float)
        floor = self.terrain.depth(float(position[0]), float(position[1]))
        if not 0.0 < position[2] < floor:
            raise InputError(
                f"vehicle '{vehicle}': start depth {position[2]:g} m is not between the surface and the sea floor at "
                f"{floor:g} m"
            )
        for state in self.structures.values():
            state.release(vehicle)
        water = self.current.evaluate(self.time, position).velocity
        ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
        craft = self._craft[vehicle]
        craft.place(position, heading, speed * ahead + water, np.asarray(channels, dtype=float))
        craft.refresh_water(self.current, self.time)
        self._clear = -math.inf
        self._unplaced.discard(vehicle)
        if not self._unplaced:
            mujoco.mj_forward(self.model, self.data)

    def overlaps(self) -> list[tuple[str, str, float]]:
        """Pairs of vehicles, structures and the sea floor that reach into each other, and how deep [m]."""
        self._options.disableflags = self._flags = self._near_flags
        mujoco.mj_fwdPosition(self.model, self.data)
        found = []
        for contact in self.data.contact:
            names = [self.model.body(self.model.geom_bodyid[geom]).name.partition("/")[0] for geom in contact.geom]
            one, other = (SEA_FLOOR if name == "world" else name for name in names)
            if one != other and contact.dist < -OVERLAP:
                found.append((one, other, -float(contact.dist)))
        return found

    def refresh_water(self, ahead: float = 0.0) -> None:
        """Expands the current anew round every vehicle.

        Args:
            ahead: how far from now the expansion is taken [s]; half the time for which it will serve makes its error
                second order in that time.
        """
        for craft in self._fleet:
            craft.refresh_water(self.current, self._time + ahead)

    def command(self, vehicle: str, channels: Sequence[float]) -> None:
        """Sets the commands (n,) of a vehicle's actuators, in the order of its channels; each follows with its lag."""
        self._craft[vehicle].command(channels)

    def advance(self, ticks: int) -> None:
        """Steps the physics.

        Where a vehicle is near a structure, the sea floor or another vehicle, contacts are recorded and latches may
        close at every tick. The distances are looked at again every `LOOKOUT`.

        Raises:
            DivergenceError: a vehicle's state is no longer finite and physical; the text names it.
            InputError: a vehicle has not been placed.
        """
        if self._unplaced:
            raise InputError(f"vehicles without a place: {', '.join(sorted(self._unplaced))}; place them first")
        if not self.current.steady_uniform:
            self.refresh_water(0.5 * ticks * self._options.timestep)
        most = self._most_ticks
        while ticks > most:
            self._advance(most)
            ticks -= most
        self._advance(ticks)

    def _advance(self, ticks: int) -> None:
        near = self._time >= self._clear and self._is_near()
        # Far from everything the search for contacts would find none, and costs a third of a step.
        flags = self._near_flags if near else self._far_flags
        if flags != self._flags:
            self._options.disableflags = self._flags = flags
        if near:
            for _ in range(ticks):
                self._step_near()
        else:
            self._step(ticks, self._options.timestep)
        for craft in self._fleet:
            if not float(craft.speeds.dot(craft.speeds)) < 1e6:
                raise DivergenceError(self._diagnosis(craft))

    def _is_near(self) -> bool:
        """Whether any vehicle may touch something soon."""
        places = [craft.position.tolist() for craft in self._fleet]
        depth, way = self.terrain.depth, math.inf  # the least that a vehicle must move to be near something [m]
        for x, y, z in places:
            above = z - (NEAR_FLOOR - depth(x, -y))
            if above < 0.0:
                return True
            way = min(way, above)
            for a, b, c in self._mouths:
                square = (x - a) * (x - a) + (y - b) * (y - b) + (z - c) ** 2
                if square < NEAR_STRUCTURE**2:
                    return True
                way = min(way, math.sqrt(square) - NEAR_STRUCTURE)
        for i, j, reach in self._meetings:
            (x, y, z), (a, b, c) = places[i], places[j]
            square = (x - a) * (x - a) + (y - b) * (y - b) + (z - c) ** 2
            if square < reach:
                return True
            way = min(way, 0.5 * (math.sqrt(square) - math.sqrt(reach)))
        if self._looks_ahead:
            self._clear = self._time + way / SWIFT
        return False

    def _step(self, ticks: int, step: float) -> None:
        mujoco.mj_step(self.model, self.data, ticks)
        # MuJoCo adds steps up, and with them their rounding.
        self.data.time = self._time = (round(self._time / step) + ticks) * step

    def _step_near(self) -> None:
        """One step in which contacts are recorded and latches may close, in substeps where panels ask for them."""
        step = self._options.timestep
        self._options.timestep = step / self._substeps
        for _ in range(self._substeps):
            self._step(1, step / self._substeps)
            self._watch()
        self._options.timestep = step
        self.data.time = self._time = round(self._time / step) * step

    def _watch(self) -> None:
        """Records contacts, and closes an open latch on a free vehicle whose nose is in the throat."""
        if self.data.ncon:
            self._recorder.record()
        values = self._sensors
        for state, sensors in self._captures:
            for vehicle, at in sensors:
                if values[at] > 0.5 and state.latched is None and self.latched(vehicle) is None:
                    state.hold(vehicle)

    def _diagnosis(self, craft: Craft) -> str:
        speeds = np.abs(np.nan_to_num(craft.speeds, nan=np.inf))
        worst = int(speeds.argmax())
        joint = self.model.joint(int(self.model.dof_jntid[craft.dofs.start + worst])).name
        return (
            f"diverged at {self._time:.2f} s: joint '{joint}' moves at {speeds[worst]:.3g} (m/s or rad/s); "
            f"check the model's inertia and damping, or raise rates.physics above {1 / self._options.timestep:.0f} Hz"
        )

    def truth(self, vehicle: str) -> Truth:
        """The true state of a vehicle now, in NED and forward-starboard-down."""
        return self._craft[vehicle].truth(self.current, self._time)
