"""The look of the scene: light, water and sea floor; nothing here touches physics but the height of the floor."""

from typing import Any

import mujoco
import numpy as np

from auvsim.base.frames import Array

WATER = (0.07, 0.27, 0.36)  # colour into which everything fades [rgb]
TILE = 100.0  # side of the square after which the sea floor's pattern repeats [m]
PIXELS = 512  # of the pattern along that side
HALF_WIDTH = 1500.0  # of the sea floor [m]
EXTENT = 100.0  # of the scene, the unit of MuJoCo's distances [m]
MURK = (4.0, 65.0)  # distances at which the water begins to hide things and hides all [m]
PILLAR_TOP = 1.6  # below the dock's axis [m]
METAL = (0.35, 0.38, 0.42, 1.0)


def furnish(root: Any, sea_floor: float, dock_depth: float) -> None:
    """Adds the sea floor (the geom `sea_floor`), light and water to a PyMJCF scene.

    Args:
        root: the scene.
        sea_floor: its depth [m].
        dock_depth: depth of the dock's mouth, round which the scene is centred [m].
    """
    root.visual.map.znear, root.visual.map.zfar = 0.002, 30.0  # of the extent
    root.visual.map.fogstart, root.visual.map.fogend = (distance / EXTENT for distance in MURK)
    root.visual.quality.shadowsize = 0  # software drawing: shadows cost 200 ms a frame
    whole = getattr(root.visual, "global")
    whole.offwidth, whole.offheight = 1920, 1080
    root.statistic.extent, root.statistic.center = EXTENT, (0, 0, -dock_depth)
    root.visual.headlight.ambient, root.visual.headlight.diffuse = (0.38, 0.42, 0.44), (0.25, 0.27, 0.28)
    root.visual.headlight.specular = (0.1, 0.1, 0.1)
    root.visual.rgba.fog = root.visual.rgba.haze = (*WATER, 1.0)
    _add_sea_floor(root, sea_floor)
    _add_light(root)


def _add_sea_floor(root: Any, depth: float) -> None:
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
    root.worldbody.add(
        "geom",
        name="sea_floor",
        type="plane",
        size=(HALF_WIDTH, HALF_WIDTH, 10),
        pos=(0, 0, -depth),
        material="sand",
    )


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


def add_pillar(root: Any, sea_floor: float, dock_depth: float, forward: Array) -> None:
    """Adds what the dock stands on, without collisions, where there is room for it.

    Args:
        root: the scene.
        sea_floor: its depth [m].
        dock_depth: depth of the dock's mouth [m].
        forward: (2,) place of the pillar's axis in MuJoCo's world, x and y [m].
    """
    if _has_pillar(sea_floor, dock_depth):
        root.worldbody.add(
            "geom",
            name="pillar",
            type="cylinder",
            size=(0.12,),
            fromto=_pillar_ends(sea_floor, dock_depth, forward),
            contype=0,
            conaffinity=0,
            group=1,
            rgba=METAL,
        )


def _has_pillar(sea_floor: float, dock_depth: float) -> bool:
    """Whether there is room for one."""
    return sea_floor > dock_depth + PILLAR_TOP


def turn_pillar(spec: mujoco.MjSpec, sea_floor: float, dock_depth: float, forward: Array) -> None:
    """Puts the pillar of a scene elsewhere; arguments as of `add_pillar`."""
    if _has_pillar(sea_floor, dock_depth):
        spec.geom("pillar").fromto = _pillar_ends(sea_floor, dock_depth, forward)


def _pillar_ends(sea_floor: float, dock_depth: float, forward: Array) -> tuple[float, ...]:
    x, y = forward.tolist()
    return x, y, -dock_depth - PILLAR_TOP, x, y, -sea_floor


def paint_sea_floor(model: mujoco.MjModel) -> None:
    """Puts a grain on the compiled sea floor's squares, so that its motion shows from near; the same one always."""
    at = int(model.tex_adr[model.texture("sand").id])
    pattern = model.tex_data[at : at + 3 * PIXELS * PIXELS].reshape(PIXELS, PIXELS, 3)
    generator = np.random.default_rng(0)
    grain = np.zeros((PIXELS, PIXELS))
    for cells in (128, 256, 512):  # value noise, octave by octave, down to a pixel
        grain += np.kron(generator.standard_normal((cells, cells)), np.ones((PIXELS // cells, PIXELS // cells)))
    pattern[:] = np.clip(pattern * (1.0 + 0.045 * grain[:, :, np.newaxis]), 0, 255).astype(np.uint8)
