"""One vehicle inside MuJoCo's arrays."""

import math
from collections.abc import Sequence

import mujoco
import numpy as np
from numba import njit

from auvsim.base.frames import (
    FLIP,
    FLIP6,
    FLIP_QUATERNION,
    Array,
    euler_to_quaternion,
    flip,
    flip_quaternion,
)
from auvsim.physics import water_slot
from auvsim.physics.fluid import WATER
from auvsim.physics.forces import DERIVED, HULL, STRIPS
from auvsim.physics.truth import Truth
from auvsim.vehicles import library
from auvsim.water.currents import CurrentField
from auvsim.water.surface import surface


@njit(cache=True, error_model="numpy")
def _observe(pose, velocity, state):
    """Position, quaternion, attitude and body velocity (16,) in NED of MuJoCo's pose (7,) and velocity (6,)."""
    for k in range(3):
        state[k] = pose[k] * FLIP[k]
        state[10 + k], state[13 + k] = velocity[k] * FLIP6[k], velocity[3 + k] * FLIP6[3 + k]
    for k in range(4):
        state[3 + k] = pose[3 + k] * FLIP_QUATERNION[k]
    w, x, y, z = state[3], state[4], state[5], state[6]
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    r00, r01, r02 = ww + xx - yy - zz, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    r10, r11, r12 = 2.0 * (x * y + w * z), ww - xx + yy - zz, 2.0 * (y * z - w * x)
    r20, r21, r22 = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), ww - xx - yy + zz
    state[7] = math.atan2(r21, r22)
    state[8] = -math.asin(max(-1.0, min(1.0, r20)))
    state[9] = math.atan2(r10, r00)
    u, v, w = state[10], state[11], state[12]
    state[10] = u * r00 + v * r10 + w * r20
    state[11] = u * r01 + v * r11 + w * r21
    state[12] = u * r02 + v * r12 + w * r22


class Craft:
    """Views of MuJoCo's arrays that belong to one vehicle, and what is read from and written to them.

    The arrays stay where they are: to ask `MjData` for one costs as much as a calculation.

    Args:
        model: the compiled scene.
        data: its state.
        name: instance name of the vehicle.
        vehicle: its model.
        slot: offset of its water in `mjData.userdata`.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, name: str, vehicle: library.Vehicle, slot: int
    ) -> None:
        self.name, self.vehicle = name, vehicle
        joint = model.joint(f"{name}/")
        q, v = int(joint.qposadr[0]), int(joint.dofadr[0])
        base = int(model.body(f"{name}/").id)
        dofs = np.flatnonzero(model.body_rootid[model.dof_bodyid] == base)
        self.dofs = slice(int(dofs[0]), int(dofs[-1]) + 1)
        positions = [int(at) for at in model.jnt_qposadr[model.dof_jntid[dofs[6:]]]]  # of its hinges
        self._hinges = slice(min(positions), max(positions) + 1) if positions else slice(0, 0)
        self._pose = data.qpos[q : q + 7]
        self.position, self._quaternion = self._pose[:3], self._pose[3:]
        self._velocity, self.speeds = data.qvel[v : v + 6], data.qvel[self.dofs]
        self._data, self._qpos, self._qvel, self._control = data, data.qpos, data.qvel, data.ctrl
        self._water = data.userdata[slot : slot + WATER]
        actuators = [model.actuator(f"{name}/{channel}") for channel in vehicle.actuation.channels]
        self._controls = [int(actuator.id) for actuator in actuators]
        self._act = data.act
        # A thruster's command is a state of MuJoCo, or acts at once; there is nothing that turns.
        self._thrusters = [int(model.actuator_actadr[i]) for i in self._controls if model.actuator_actnum[i]]
        driven = [a for a in actuators if model.actuator_trntype[a.id] == mujoco.mjtTrn.mjTRN_JOINT]
        joints = [int(actuator.trnid[0]) for actuator in driven]
        self._angles = model.jnt_qposadr[joints]
        # A velocity servo has no stiffness: its channel is a rate, any other's an angle.
        self._turning = [
            (channel, int(self._angles[channel]), int(model.jnt_dofadr[joint]))
            for channel, (joint, actuator) in enumerate(zip(joints, driven, strict=True))
            if actuator.biasprm[1] == 0.0
        ]
        hull = model.body(f"{name}/hull")
        record, strips = hull.user, {**HULL, **DERIVED}
        self._axis, self._place = data.xmat[hull.id, ::3], data.xpos[hull.id]
        self._reach = float(record[strips["reach"][0]])
        x, radius, half = (
            record[strips[field][0] :][:STRIPS] for field in ("strip_x", "strip_radius", "strip_half_length")
        )
        self._strips = x[radius > 0.0], radius[radius > 0.0], half[radius > 0.0]
        self._joints_carry = len(joints) == len(actuators)

    def place(self, position: Array, heading: float, velocity: Array, channels: Array) -> None:
        """Puts the vehicle level at a place.

        Args:
            position: (3,) NED [m].
            heading: [rad].
            velocity: (3,) over ground, NED [m/s].
            channels: (n,) commands, which the actuators already carry out.
        """
        self.speeds[:] = 0.0
        self._qpos[self._hinges] = 0.0
        self.position[:] = flip(position)
        self._quaternion[:] = flip_quaternion(euler_to_quaternion(0.0, 0.0, heading))
        self._velocity[:3] = flip(velocity)
        if self._joints_carry:
            self._qpos[self._angles] = channels
        elif self._thrusters:
            self._act[self._thrusters] = channels
        for channel, angle, rate in self._turning:
            self._qpos[angle], self._qvel[rate] = 0.0, channels[channel]
        self._control[self._controls] = channels

    def command(self, channels: Sequence[float]) -> None:
        """Sets the commands (n,) of the actuators."""
        control = self._control
        for index, value in zip(self._controls, channels, strict=True):
            control[index] = value

    def refresh_water(self, current: CurrentField, time: float) -> None:
        """Writes the water round the vehicle, and the surface above it, where the fluid callback reads them."""
        place = flip(self.position)
        water, above = current.evaluate(time, place), surface(current, time, place)
        water_slot.fill(self._water, time, self.position, water, above)

    @property
    def surfaced(self) -> bool:
        """Whether any part of the hull is out of the water."""
        water = self._water
        if not water.item(water_slot.SURFACE) or water.item(water_slot.ELEVATION) - self._place.item(2) > self._reach:
            return False
        x, radius, half = self._strips
        points = self._place + x[:, np.newaxis] * self._axis
        rise = points[:, :2] - water[water_slot.PLACE :][:2]
        level = water[water_slot.ELEVATION] + water[water_slot.ELEVATION + 1] * (
            self._data.time - water[water_slot.TIME]
        )
        level = level + rise @ water[water_slot.ELEVATION + 2 : water_slot.WATER]
        upright = self._axis[2] ** 2
        extent = np.sqrt(radius * radius * (1.0 - upright) + half * half * upright)
        return bool((level - points[:, 2] < extent).any())

    def truth(self, current: CurrentField, time: float) -> Truth:
        """The true state, in NED and forward-starboard-down, in the water of a time [s], which is now."""
        state = np.empty(16)
        _observe(self._pose, self._velocity, state)
        position = state[:3]
        if self._joints_carry:
            actuators = self._qpos.take(self._angles)
        else:
            actuators = self._act.take(self._thrusters) if self._thrusters else self._control.take(self._controls)
        for channel, _, rate in self._turning:
            actuators[channel] = self._qvel[rate]
        water = current.evaluate(time, position).velocity
        return Truth(time, position, state[3:7], state[7:10], state[10:], water, actuators)
