"""Compiled scenes of vehicles and structures: composed once for each fleet, then only moved and turned.

To compose a scene with PyMJCF takes a ninth of a whole trial, to move its structures and compile it again 5 ms. The
compiled model is the same bit for bit.
"""

import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

import mujoco
import numpy as np
from dm_control import mjcf
from pydantic import Field

from auvsim.base.errors import InputError, at_key
from auvsim.base.frames import Array, euler_to_quaternion, flip, flip_quaternion
from auvsim.base.settings import Settings
from auvsim.physics import hydrodynamics, scenery, soundness
from auvsim.physics.ballast import BallastSettings, load, shift_buoyancy
from auvsim.physics.fluid import WATER
from auvsim.physics.forces import RECORD
from auvsim.physics.truth import StructurePose
from auvsim.vehicles import library, model_files
from auvsim.water.terrain import FlatSettings, Terrain, TerrainSettings, build_terrain

Integrator = Literal["Euler", "implicit", "implicitfast", "RK4"]
GRAVITY = 9.81  # [m/s2], MuJoCo's default
_NAME = re.compile(r"[A-Za-z0-9_.-]+")


class WorldSettings(Settings):
    """What surrounds the vehicles."""

    integrator: Integrator = Field(
        default="implicitfast",
        description="MuJoCo's integrator; implicitfast is the fast default, RK4 the accurate one",
    )
    water_density: float = Field(
        default=hydrodynamics.SEA_WATER, ge=900.0, le=1300.0, description="density of the water [kg/m3]"
    )
    sea_floor: float = Field(default=40.0, gt=0, le=12_000.0, description="depth of the sea floor [m]")
    terrain: TerrainSettings = Field(default=FlatSettings(), description="Shape of the sea floor, by its `kind`.")

    @property
    def floor(self) -> Terrain:
        """The sea floor.

        Raises:
            InputError: the file of a grid cannot be used.
        """
        return build_terrain(self.terrain, self.sea_floor)


class Scene(NamedTuple):
    """A compiled scene and what is in it, by instance name; scenes of one fleet share the PyMJCF elements."""

    model: mujoco.MjModel
    vehicles: dict[str, library.Vehicle]
    structures: dict[str, library.Structure]
    poses: dict[str, StructurePose]
    terrain: Terrain


def scene(
    fleet: Mapping[str, str],
    structures: Mapping[str, tuple[str, StructurePose]],
    settings: WorldSettings,
    rate: float,
    ballast: Mapping[str, BallastSettings] | None = None,
) -> Scene:
    """Scene of vehicles and structures, as `compose` makes it.

    Vehicles are free, in the order given, and stand at the origin until the world places them. What was composed is
    kept by the text of the models' MJCF files; files that these refer to are not looked at again.

    Args:
        fleet: model of each vehicle, by instance name; models as `library.vehicle` takes them.
        structures: model and pose of each structure, by instance name; models as `library.structure` takes them.
        settings: of what surrounds them.
        rate: physics steps per second [Hz].
        ballast: of vehicles that are not as their models have them, by instance name.

    Raises:
        InputError: a name or model cannot be used, or MuJoCo refuses the scene.
    """
    with at_key("water.terrain"):
        poses, terrain = {name: pose for name, (_, pose) in structures.items()}, settings.floor
    for name, model in fleet.items():
        with at_key(f"vehicles.{name}.model"):
            soundness.check(model, settings.water_density)
    composed = _composed(
        tuple((name, model, *model_files.source("vehicle", model)) for name, model in fleet.items()),
        tuple((name, model, *model_files.source("structure", model)) for name, (model, _) in structures.items()),
        tuple(_has_pillar(pose, terrain) for pose in poses.values()),
        settings,  # pyright: ignore[reportArgumentType] (frozen, and so hashable)
        rate,
    )
    for name, pose in poses.items():
        _check_depth(name, composed.structures[name], pose, terrain)
    spec = composed.spec.copy()
    spec.stat.center = _center(poses.values(), terrain)
    for name, pose in poses.items():
        place, quaternion = _place(pose)
        for element in (spec.site(name), spec.body(f"{name}/")):
            element.pos, element.quat = place, quaternion
        ends = _pillar(composed.structures[name], pose, terrain)
        if ends is not None:
            spec.geom(_pillar_name(name)).fromto = ends
    loads = {name: of for name, of in (ballast or {}).items() if not of.is_zero}
    for name, of in loads.items():
        shift_buoyancy(spec, name, of, _buoyancy(composed.vehicles[name], settings.water_density))
    try:
        model = spec.compile()
    except ValueError as error:
        raise _refused(error) from None
    for name, of in loads.items():
        load(model, name, of)
    scenery.shape_sea_floor(model, terrain)
    return Scene(model, composed.vehicles, composed.structures, poses, terrain)


def _buoyancy(vehicle: library.Vehicle, density: float) -> float:
    """Buoyancy of a vehicle under water [N]."""
    volume = vehicle.root.find("numeric", "hull_displaced_volume")
    return GRAVITY * density * float(np.ravel(volume.data)[0])


class _Composed(NamedTuple):
    spec: mujoco.MjSpec
    vehicles: dict[str, library.Vehicle]
    structures: dict[str, library.Structure]


@lru_cache(maxsize=16)
def _composed(
    fleet: tuple[tuple[str, str, Path, str], ...],
    structures: tuple[tuple[str, str, Path, str], ...],
    pillars: tuple[bool, ...],
    settings: WorldSettings,
    rate: float,
) -> _Composed:
    """The scene with every structure at the origin, looking north; files and texts of the models are the cache's keys.

    Args:
        fleet: name, model, file and its text of each vehicle.
        structures: the same of each structure.
        pillars: whether each structure has room for a pillar.
        settings: of what surrounds them.
        rate: physics steps per second [Hz].
    """
    vehicles = {name: library.vehicle(model) for name, model, _, _ in fleet}
    loaded = {}
    for name, model, _, _ in structures:
        with at_key(f"structures.{name}.model"):
            loaded[name] = library.structure(model)
    # A depth that has room for a pillar, or has not, as the structure's own.
    floor = settings.floor.depth(0.0, 0.0)
    poses = {
        name: StructurePose(depth=floor - (2.0 * scenery.PILLAR_TOP if pillar else 0.0), heading=0.0)
        for name, pillar in zip(loaded, pillars, strict=True)
    }
    root = compose(vehicles, {name: (loaded[name], poses[name]) for name in loaded}, settings, rate)
    try:
        spec = mujoco.MjSpec.from_string(root.to_xml_string(), assets=root.get_assets())
    except ValueError as error:
        raise _refused(error) from None
    return _Composed(spec, vehicles, loaded)


def compose(
    vehicles: Mapping[str, library.Vehicle],
    structures: Mapping[str, tuple[library.Structure, StructurePose]],
    settings: WorldSettings,
    rate: float,
) -> Any:
    """The scene as one PyMJCF model: sea floor, structures, vehicles with a free joint, and the open latches.

    Every pair of a structure and a vehicle has a capture sensor and a latch, both named by `pair_name`.

    Args:
        vehicles: by instance name, freshly loaded; their models are renamed to it.
        structures: the same, and where they are.
        settings: of what surrounds them.
        rate: physics steps per second [Hz].

    Raises:
        InputError: an instance name is used twice or holds anything but letters, digits, '_', '.' and '-'.
    """
    _check_names([*vehicles, *structures])
    root: Any = mjcf.RootElement(model="trial")
    root.compiler.angle = "radian"
    root.size.nuser_body, root.size.nuserdata = RECORD, WATER * len(vehicles)
    root.option.timestep, root.option.integrator = 1.0 / rate, settings.integrator
    root.option.flag.autoreset = "disable"  # a diverging simulation must be seen, not restarted
    terrain = settings.floor
    scenery.furnish(root, terrain, _center([pose for _, pose in structures.values()], terrain))
    for name, (structure, pose) in structures.items():
        structure.root.model = name
        place, quaternion = _place(pose)
        root.worldbody.add("site", name=name, pos=place, quat=quaternion, rgba=(0, 0, 0, 0)).attach(structure.root)
        ends = _pillar(structure, pose, terrain)
        if ends is not None:
            scenery.add_pillar(root, _pillar_name(name), ends)
    for name, vehicle in vehicles.items():
        vehicle.root.model, vehicle.root.size.nuserdata = name, None
        root.worldbody.attach(vehicle.root).add("freejoint")
    for structure in structures:
        for vehicle in vehicles:
            _add_latch(root, structure, vehicle)
    return root


def pair_name(structure: str, vehicle: str) -> str:
    """Name of the capture sensor and of the latch of a structure for a vehicle."""
    return f"{structure}:{vehicle}"


def _add_latch(root: Any, structure: str, vehicle: str) -> None:
    name = pair_name(structure, vehicle)
    root.sensor.add("insidesite", name=name, objtype="site", objname=f"{vehicle}/nose", site=f"{structure}/capture")
    root.equality.add(
        "weld",
        name=name,
        site1=f"{structure}/latched",
        site2=f"{vehicle}/nose",
        active=False,
        solref=(0.15, 1.0),
        solimp=(0.1, 0.1, 0.001),
    )


def _check_names(names: list[str]) -> None:
    for name in names:
        if not _NAME.fullmatch(name):
            raise InputError(f"instance name '{name}': give letters, digits, '_', '.' or '-'")
        if name == scenery.SEA_FLOOR:
            raise InputError(f"instance name '{name}' is the sea floor's; give another")
        if names.count(name) > 1:
            raise InputError(f"instance name '{name}' is used {names.count(name)} times; give each its own")


def _place(pose: StructurePose) -> tuple[Array, Array]:
    """Position (3,) and quaternion (4,) of a structure in MuJoCo's world."""
    quaternion = flip_quaternion(euler_to_quaternion(pose.roll, pose.pitch, pose.heading))
    return flip(pose.position) + 0.0, quaternion  # without the sign of a zero


def _center(poses: Any, terrain: Terrain) -> Array:
    """Middle (3,) of the structures in MuJoCo's world; of the water column where there are none."""
    places = [_place(pose)[0] for pose in poses]
    return np.mean(places, axis=0) if places else np.array([0.0, 0.0, -0.5 * terrain.depth(0.0, 0.0)])


def _check_depth(name: str, structure: library.Structure, pose: StructurePose, terrain: Terrain) -> None:
    """Sees that the mouth of a structure is in the water as a whole."""
    radius, floor = structure.mouth_radius, terrain.depth(pose.north, pose.east)
    if not radius <= pose.depth <= floor - radius:
        raise InputError(
            f"structures.{name}.depth: a mouth of radius {radius:g} m at a depth of {pose.depth:g} m is not wholly "
            f"between the surface and the sea floor at {floor:g} m; give a depth between {radius:g} and "
            f"{floor - radius:g} m"
        )


def _pillar_name(structure: str) -> str:
    return f"{structure}:pillar"


def _has_pillar(pose: StructurePose, terrain: Terrain) -> bool:
    return scenery.pillar_ends(terrain.depth(pose.north, pose.east), pose.depth, np.zeros(2)) is not None


def _pillar(structure: library.Structure, pose: StructurePose, terrain: Terrain) -> Array | None:
    """Ends (6,) of a structure's pillar, which stands 0.3 m behind the end of its cone."""
    ahead = (structure.cone_length + 0.3) * np.array([np.cos(pose.heading), -np.sin(pose.heading)])
    return scenery.pillar_ends(terrain.depth(pose.north, pose.east), pose.depth, _place(pose)[0][:2] + ahead)


def compile_scene(root: Any) -> mujoco.MjModel:
    """Compiles a composed scene.

    Raises:
        InputError: MuJoCo refuses it; the text has its reason.
    """
    try:
        return mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    except ValueError as error:
        raise _refused(error) from None


def _refused(error: ValueError) -> InputError:
    """MuJoCo's reason for not compiling a scene, in one line."""
    return InputError(f"scene 'trial': {' '.join(str(error).split())[:300]}")
