"""Appearance of the scene: light, water and sea floor; only the height of the floor matters to physics."""

import math
from typing import Any

import mujoco
import numpy as np

from auvsim.base.frames import Array
from auvsim.water.terrain import SlopedFloor, Terrain
from auvsim.water.terrain_grid import GriddedFloor

WATER = (0.07, 0.27, 0.36)  # colour into which everything fades [rgb]
TILE = 100.0  # side of the square after which the sea floor's pattern repeats [m]
PIXELS = 512  # of the pattern along that side
MOST_POINTS = 257  # along each side of a height field: more cost MuJoCo time and memory
HALF_WIDTH = 1500.0  # of the sea floor [m]
EXTENT = 100.0  # of the scene, the unit of MuJoCo's distances [m]
MURK = (4.0, 65.0)  # distances at which the water begins to hide things and hides all [m]
PILLAR_TOP = 1.6  # below the dock's axis [m]
SEA_FLOOR = "sea_floor"  # name of its geom
METAL = (0.35, 0.38, 0.42, 1.0)


def furnish(root: Any, terrain: Terrain, center: Array) -> None:
    """Adds the sea floor (the geom `sea_floor`), light and water to a PyMJCF scene.

    Args:
        root: the scene.
        terrain: the sea floor; a grid's depths are put in by `shape_sea_floor` once the scene is compiled.
        center: (3,) point round which the scene is drawn, in MuJoCo's world [m].
    """
    root.visual.map.znear, root.visual.map.zfar = 0.002, 30.0  # of the extent
    root.visual.map.fogstart, root.visual.map.fogend = (distance / EXTENT for distance in MURK)
    root.visual.quality.shadowsize = 0  # software drawing: shadows cost 200 ms a frame
    whole = getattr(root.visual, "global")
    whole.offwidth, whole.offheight = 1920, 1080
    root.statistic.extent, root.statistic.center = EXTENT, center
    root.visual.headlight.ambient, root.visual.headlight.diffuse = (0.38, 0.42, 0.44), (0.25, 0.27, 0.28)
    root.visual.headlight.specular = (0.1, 0.1, 0.1)
    root.visual.rgba.fog = root.visual.rgba.haze = (*WATER, 1.0)
    _add_sea_floor(root, terrain)
    _add_light(root)


def _add_sea_floor(root: Any, terrain: Terrain) -> None:
    """Squares of half a tile, so that the overview has a scale."""
    root.asset.add(
        "texture",
        name="sand",
        type="2d",
        builtin="checker",
        rgb1=(0.50, 0.53, 0.46),
        rgb2=(0.42, 0.46, 0.41),
        width=PIXELS,
        height=PIXELS,
    )
    repeat = 2.0 * HALF_WIDTH / TILE
    root.asset.add("material", name="sand", texture="sand", texrepeat=(repeat, repeat), specular=0, shininess=0)
    shape: dict[str, Any] = {"type": "plane", "size": (HALF_WIDTH, HALF_WIDTH, 10)}
    if isinstance(terrain, GriddedFloor):
        shape, place = _height_field(root, terrain.coarse(MOST_POINTS))
    else:
        place = (0, 0, -terrain.depth(0.0, 0.0))
    if isinstance(terrain, SlopedFloor):
        shape["zaxis"] = (terrain.to_north, -terrain.to_east, 1.0)
    root.worldbody.add("geom", name=SEA_FLOOR, pos=place, material="sand", **shape)


def _height_field(root: Any, terrain: GriddedFloor) -> tuple[dict[str, Any], tuple[float, float, float]]:
    """Shape and place of the geom of a gridded floor, whose asset is added: columns run north, rows run west."""
    corner, (rows, columns) = terrain.corner, terrain.depths.shape
    half = 0.5 * (rows - 1) * corner.to_north, 0.5 * (columns - 1) * corner.to_east
    deepest = float(terrain.depths.max())
    height = max(deepest - float(terrain.depths.min()), 1e-3)
    root.asset.add("hfield", name=SEA_FLOOR, nrow=columns, ncol=rows, size=(*half, height, 10.0))
    return {"type": "hfield", "hfield": SEA_FLOOR}, (corner.north + half[0], -corner.east - half[1], -deepest)


def shape_sea_floor(model: mujoco.MjModel, terrain: Terrain) -> None:
    """Puts the depths of a gridded floor into the compiled scene; any other is right already."""
    if not isinstance(terrain, GriddedFloor):
        return
    terrain = terrain.coarse(MOST_POINTS)
    field, deepest = model.hfield(SEA_FLOOR), float(terrain.depths.max())
    heights = (deepest - terrain.depths.T[::-1]) / field.size[2]
    at = int(field.adr[0])
    model.hfield_data[at : at + heights.size] = heights.ravel()


def _add_light(root: Any) -> None:
    """Sun, and water that is light above and dark below."""
    root.asset.add(
        "texture",
        name="water",
        type="skybox",
        builtin="gradient",
        rgb1=(0.12, 0.40, 0.50),  # above, towards the surface
        rgb2=(0.02, 0.14, 0.22),
        width=64,
        height=64,
    )
    root.worldbody.add(
        "light",
        name="sun",
        directional=True,
        pos=(0, 0, 0),
        dir=(0.35, 0.2, -1),
        diffuse=(0.62, 0.68, 0.68),
        specular=(0.3, 0.3, 0.3),
        castshadow=False,
    )


def add_pillar(root: Any, name: str, ends: Array) -> None:
    """Adds what a structure stands on, without collisions.

    Args:
        root: the scene.
        name: of its geom.
        ends: (6,) from `pillar_ends`.
    """
    root.worldbody.add(
        "geom",
        name=name,
        type="cylinder",
        size=(0.12,),
        fromto=ends,
        contype=0,
        conaffinity=0,
        group=1,
        rgba=METAL,
    )


def pillar_ends(sea_floor: float, depth: float, place: Array) -> Array | None:
    """Top and foot (6,) of the axis of a structure's pillar in MuJoCo's world [m]; None where there is no room for one.

    Args:
        sea_floor: its depth [m].
        depth: of the structure's mouth [m].
        place: (2,) of the pillar's axis in MuJoCo's world, x and y [m].
    """
    if sea_floor <= depth + PILLAR_TOP:
        return None
    x, y = place.tolist()
    return np.array([x, y, -depth - PILLAR_TOP, x, y, -sea_floor])


def widen(model: mujoco.MjModel, reach: float) -> None:
    """Makes a level or sloping sea floor, and the view, wide enough for places up to `reach` [m] from its middle.

    Its squares keep their size. What is near enough for the floor as it was made changes nothing.
    """
    floor = model.geom(SEA_FLOOR)
    factor = math.ceil(2.0 * reach / HALF_WIDTH)
    if factor <= 2 or floor.type[0] != mujoco.mjtGeom.mjGEOM_PLANE:
        return
    floor.size[:2] *= factor
    model.material("sand").texrepeat[:] *= factor
    model.vis.map.zfar *= factor


def paint_sea_floor(model: mujoco.MjModel) -> None:
    """Puts a grain on the compiled sea floor's squares, so that its motion shows from near; the same one always."""
    at = int(model.tex_adr[model.texture("sand").id])
    pattern = model.tex_data[at : at + 3 * PIXELS * PIXELS].reshape(PIXELS, PIXELS, 3)
    generator = np.random.default_rng(0)
    grain = np.zeros((PIXELS, PIXELS))
    for cells in (128, 256, 512):  # value noise, octave by octave, down to a pixel
        grain += np.kron(generator.standard_normal((cells, cells)), np.ones((PIXELS // cells, PIXELS // cells)))
    pattern[:] = np.clip(pattern * (1.0 + 0.045 * grain[:, :, np.newaxis]), 0, 255).astype(np.uint8)
