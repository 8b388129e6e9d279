"""Compiled scenes of trials, quickly: composed once for each vehicle and dock, and then only turned to the heading.

To compose a scene with PyMJCF takes a ninth of a whole trial, to turn and compile it again 5 ms. The compiled model is
the same bit for bit.
"""

from functools import lru_cache
from typing import NamedTuple

import mujoco

from auvsim.base.frames import euler_to_quaternion, flip_quaternion
from auvsim.physics import scenery, world
from auvsim.physics.truth import DockPose
from auvsim.vehicles import library


class Scene(NamedTuple):
    """A compiled scene, and what is in it; the PyMJCF elements of the latter are shared by all such scenes."""

    model: mujoco.MjModel
    vehicle: library.Vehicle
    dock: library.Dock


def compiled(vehicle: str, dock: str, pose: DockPose, settings: world.WorldSettings, rate: float) -> Scene:
    """The scene of a trial, as `world.compose` makes it.

    Args:
        vehicle: as `library.vehicle` takes it.
        dock: as `library.dock` takes it.
        pose: of the dock.
        settings: of what surrounds them.
        rate: physics steps per second [Hz].

    Raises:
        InputError: a model cannot be used, or MuJoCo refuses the scene.
    """
    spec, loaded_vehicle, loaded_dock = _composed(
        vehicle,
        dock,
        pose.depth,
        settings,  # pyright: ignore[reportArgumentType] (frozen, and so hashable)
        rate,
    )
    spec = spec.copy()
    quaternion = flip_quaternion(euler_to_quaternion(pose.roll, pose.pitch, pose.heading))
    spec.site("dock").quat = spec.body(f"{loaded_dock.name}/").quat = quaternion
    scenery.turn_pillar(spec, settings.sea_floor, pose.depth, world.pillar_place(loaded_dock, pose))
    try:
        return Scene(spec.compile(), loaded_vehicle, loaded_dock)
    except ValueError as error:
        raise world.refused("trial", error) from None


@lru_cache(maxsize=16)
def _composed(
    vehicle: str, dock: str, depth: float, settings: world.WorldSettings, rate: float
) -> tuple[mujoco.MjSpec, library.Vehicle, library.Dock]:
    """The scene with the dock looking north."""
    loaded_vehicle, loaded_dock = library.vehicle(vehicle), library.dock(dock)
    root = world.compose(loaded_vehicle, loaded_dock, DockPose(depth=depth, heading=0.0), settings, rate)
    try:
        spec = mujoco.MjSpec.from_string(root.to_xml_string(), assets=root.get_assets())
    except ValueError as error:
        raise world.refused("trial", error) from None
    return spec, loaded_vehicle, loaded_dock
