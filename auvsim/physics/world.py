"""The physical world of a trial: composes the scene, steps MuJoCo, owns its state, and gives `Truth`."""

import math
from typing import Any, Literal, NamedTuple

import mujoco
import numpy as np
from dm_control import mjcf
from pydantic import Field

from auvsim.base.errors import DivergenceError, InputError
from auvsim.base.frames import (
    FLIP,
    FLIP6,
    FLIP_QUATERNION,
    Array,
    euler_to_quaternion,
    flip,
    flip_matrix,
    flip_quaternion,
)
from auvsim.base.settings import Settings
from auvsim.physics import hydrodynamics, scenery
from auvsim.physics.fluid import WATER
from auvsim.physics.forces import RECORD
from auvsim.physics.truth import DockPose, Truth
from auvsim.vehicles import library
from auvsim.water.currents import CurrentField

NEAR = 4.0  # distance from the dock's mouth within which contact is looked for at every physics tick [m]


class WorldSettings(Settings):
    """What surrounds the vehicle."""

    integrator: Literal["Euler", "implicit", "implicitfast", "RK4"] = Field(
        default="implicitfast",
        description="MuJoCo's integrator; implicitfast is the fast default, RK4 the accurate one",
    )
    water_density: float = Field(default=hydrodynamics.SEA_WATER, gt=0, description="density of the water [kg/m3]")
    sea_floor: float = Field(default=40.0, gt=0, description="depth of the sea floor [m]")


class Contact(NamedTuple):
    """Contact between vehicle and surroundings during one physics tick."""

    time: float  # [s]
    force: float  # sum of the magnitudes of the contact forces [N]


def compose(vehicle: library.Vehicle, dock: library.Dock, pose: DockPose, settings: WorldSettings, rate: float) -> Any:
    """The scene as one PyMJCF model: sea floor, dock, vehicle with a free joint, and the open latch between them.

    Args:
        rate: physics steps per second [Hz].
    """
    root: Any = mjcf.RootElement(model="trial")
    root.compiler.angle = "radian"
    root.size.nuser_body, root.size.nuserdata = RECORD, WATER
    root.option.timestep, root.option.integrator = 1.0 / rate, settings.integrator
    root.option.flag.autoreset = "disable"  # a diverging simulation must be seen, not restarted
    scenery.furnish(root, settings.sea_floor, pose.depth)
    quaternion = flip_quaternion(euler_to_quaternion(pose.roll, pose.pitch, pose.heading))
    place = root.worldbody.add("site", name="dock", pos=(0, 0, -pose.depth), quat=quaternion, rgba=(0, 0, 0, 0))
    place.attach(dock.root)
    scenery.add_pillar(root, settings.sea_floor, pose.depth, pillar_place(dock, pose))
    frame = root.worldbody.attach(vehicle.root)
    frame.add("freejoint")
    root.sensor.add(
        "insidesite", name="captured", objtype="site", objname=f"{vehicle.name}/nose", site=f"{dock.name}/capture"
    )
    root.equality.add(
        "weld",
        name="latch",
        site1=f"{dock.name}/latched",
        site2=f"{vehicle.name}/nose",
        active=False,
        solref=(0.15, 1.0),
        solimp=(0.1, 0.1, 0.001),
    )
    return root


def pillar_place(dock: library.Dock, pose: DockPose) -> Array:
    """Where the axis of the dock's pillar is: (2,) x and y in MuJoCo's world [m]."""
    return (dock.cone_length + 0.3) * np.array([np.cos(pose.heading), -np.sin(pose.heading)])


def compile_scene(root: Any) -> mujoco.MjModel:
    """Compiles a composed scene.

    Raises:
        InputError: MuJoCo refuses it; the text has its reason.
    """
    try:
        return mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    except ValueError as error:
        raise refused(root.model, error) from None


def refused(scene: str, error: ValueError) -> InputError:
    """MuJoCo's reason for not compiling a scene, in one line."""
    return InputError(f"scene '{scene}': {' '.join(str(error).split())[:300]}")


class World:
    """One vehicle, one dock and the water, stepped by MuJoCo.

    Args:
        model: the compiled scene; gets its hydrodynamics here.
        data: its state.
        vehicle: the vehicle in it.
        pose: where the dock is.
        current: what the water does.
        water_density: [kg/m3].
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        vehicle: library.Vehicle,
        pose: DockPose,
        current: CurrentField,
        water_density: float = hydrodynamics.SEA_WATER,
    ) -> None:
        self.model, self.data, self.vehicle, self.pose = model, data, vehicle, pose
        self._current = current
        self._slot = hydrodynamics.equip(model, water_density)[f"{vehicle.name}/"]
        self._floor = -float(model.geom("sea_floor").pos[2])
        joint = model.joint(f"{vehicle.name}/")
        q, v = int(joint.qposadr[0]), int(joint.dofadr[0])
        # Views of MuJoCo's arrays, which stay where they are: to ask MjData for one costs as much as a calculation.
        self._qpos, self._qvel, self._control, self._options = data.qpos, data.qvel, data.ctrl, model.opt
        self._position, self._quaternion, self._velocity = (
            data.qpos[q : q + 3],
            data.qpos[q + 3 : q + 7],
            data.qvel[v : v + 6],
        )
        self._sensors, self._active = data.sensordata, data.eq_active
        self._water = data.userdata[self._slot : self._slot + WATER]
        fins = [model.actuator(f"{vehicle.name}/{fin}") for fin in vehicle.allocation.names]
        shaft = model.actuator(f"{vehicle.name}/shaft")
        self._fins, self._fin_controls = vehicle.allocation.fins, [int(fin.id) for fin in fins]
        self._fin_q = np.array([model.jnt_qposadr[fin.trnid[0]] for fin in fins])
        self._shaft_control, self._shaft_v = int(shaft.id), int(model.jnt_dofadr[shaft.trnid[0]])
        self._captured = int(model.sensor("captured").adr[0])
        self._latch = int(model.equality("latch").id)
        self._force, self._rotation = np.zeros(6), np.zeros(9)
        self._matrix = self._rotation.reshape(3, 3)
        self._near_flags = int(model.opt.disableflags)
        self._far_flags = self._near_flags | int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        self.contacts: list[Contact] = []

    @classmethod
    def build(
        cls,
        vehicle: library.Vehicle,
        dock: library.Dock,
        pose: DockPose,
        current: CurrentField,
        settings: WorldSettings,
        rate: float,
    ) -> "World":
        """Composes and compiles the scene and puts the world round it."""
        model = compile_scene(compose(vehicle, dock, pose, settings, rate))
        return cls(model, mujoco.MjData(model), vehicle, pose, current, settings.water_density)

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return self.data.time

    @property
    def latched(self) -> bool:
        """Whether the dock's latch holds the vehicle."""
        return bool(self._active[self._latch])

    def place(self, position: Array, heading: float, speed: float, shaft_speed: float) -> None:
        """Resets to time zero with the vehicle level at a place, moving ahead through the water.

        Args:
            position: (3,) NED [m].
            heading: [rad].
            speed: through the water [m/s].
            shaft_speed: [rad/s].

        Raises:
            InputError: the place is out of the water or below the sea floor.
        """
        if not 0.0 < position[2] < self._floor:
            raise InputError(
                f"start depth {position[2]:g} m is not between the surface and the sea floor at {self._floor:g} m"
            )
        mujoco.mj_resetData(self.model, self.data)
        self.contacts.clear()
        water = self._current.evaluate(0.0, np.asarray(position, dtype=float)).velocity
        ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
        self._position[:] = flip(position)
        self._quaternion[:] = flip_quaternion(euler_to_quaternion(0.0, 0.0, heading))
        self._velocity[:3] = flip(speed * ahead + water)
        self._qvel[self._shaft_v] = shaft_speed
        self._control[self._shaft_control] = shaft_speed
        self.refresh_water()
        mujoco.mj_forward(self.model, self.data)

    def refresh_water(self, ahead: float = 0.0) -> None:
        """Writes the local expansion of the current round the vehicle where the fluid callback reads it.

        Args:
            ahead: how far from now the expansion is taken [s]; half the time for which it will serve makes its error
                second order in that time.
        """
        position, time = self._position, self.data.time + ahead
        water = self._current.evaluate(time, flip(position))
        slot = self._water
        slot[0] = time
        slot[1:4] = position
        slot[4:7] = flip(water.velocity)
        slot[7:10] = flip(water.derivative)
        slot[10:19] = flip_matrix(water.gradient).ravel()

    def command(self, rudder: float, elevator: float, shaft_speed: float) -> None:
        """Sets effective rudder and elevator [rad] and shaft speed [rad/s]; servos and shaft follow with their lags."""
        control = self._control
        for index, angle in zip(self._fin_controls, self._fins(rudder, elevator), strict=True):
            control[index] = angle
        control[self._shaft_control] = shaft_speed

    def advance(self, ticks: int) -> None:
        """Steps the physics.

        Near the dock or the sea floor, contacts are recorded and the latch may close at every tick.

        Raises:
            DivergenceError: the state is no longer finite and physical.
        """
        if not self._current.steady_uniform:
            self.refresh_water(0.5 * ticks * self._options.timestep)
        x, y, z = self._position.tolist()
        near = x * x + y * y + (z + self.pose.depth) ** 2 < NEAR**2 or z < 2.0 - self._floor
        # Far from everything the search for contacts would find none, and costs a third of a step.
        self._options.disableflags = self._near_flags if near else self._far_flags
        if near:
            for _ in range(ticks):
                self._step(1)
                self._watch()
        else:
            self._step(ticks)
        energy = float(self._qvel.dot(self._qvel))
        if not energy < 1e6:
            raise DivergenceError(self._diagnosis())

    def _step(self, ticks: int) -> None:
        mujoco.mj_step(self.model, self.data, ticks)
        step = self._options.timestep
        self.data.time = round(self.data.time / step) * step  # MuJoCo adds steps up, and with them their rounding

    def _watch(self) -> None:
        """Records contact and closes the latch when the nose is in the throat."""
        data = self.data
        if data.ncon:
            total, force = 0.0, self._force[:3]
            for i, address in enumerate(data.contact.efc_address.tolist()):
                if address >= 0:
                    mujoco.mj_contactForce(self.model, data, i, self._force)
                    total += math.sqrt(force.dot(force))
            if total > 0.0:
                self.contacts.append(Contact(data.time, total))
        if self._sensors[self._captured] > 0.5 and not self.latched:
            self._active[self._latch] = 1

    def _diagnosis(self) -> str:
        speeds = np.abs(np.nan_to_num(self.data.qvel, nan=np.inf))
        worst = int(speeds.argmax())
        joint = self.model.joint(int(self.model.dof_jntid[worst])).name
        step = self.model.opt.timestep
        return (
            f"diverged at {self.data.time:.2f} s: joint '{joint}' moves at {speeds[worst]:.3g} (m/s or rad/s); "
            f"check the model's inertia and damping, or raise rates.physics above {1 / step:.0f} Hz"
        )

    def truth(self) -> Truth:
        """The true state now, in NED and forward-starboard-down."""
        time = self.data.time
        position = self._position * FLIP
        quaternion = self._quaternion * FLIP_QUATERNION
        mujoco.mju_quat2Mat(self._rotation, quaternion)
        r00, _, _, r10, _, _, r20, r21, r22 = self._rotation.tolist()
        nu = self._velocity * FLIP6
        over_ground = nu[:3]
        over_ground[:] = over_ground.dot(self._matrix)
        return Truth(
            time=time,
            position=position,
            quaternion=quaternion,
            attitude=np.array((math.atan2(r21, r22), -math.asin(max(-1.0, min(1.0, r20))), math.atan2(r10, r00))),
            nu=nu,
            current=self._current.evaluate(time, position).velocity,
            fins=self._qpos.take(self._fin_q),
            shaft_speed=float(self._qvel[self._shaft_v]),
        )
