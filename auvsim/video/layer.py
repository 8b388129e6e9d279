"""A MuJoCo scene with marks in it: lines, arrows and dots beside the bodies."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from auvsim.base.frames import Array
from auvsim.physics import scenery
from auvsim.video.playback import Playback

Colour = tuple[float, float, float, float]

LINE, ARROW = mujoco.mjtGeom.mjGEOM_LINE, mujoco.mjtGeom.mjGEOM_ARROW
BALL, DOT = mujoco.mjtGeom.mjGEOM_ELLIPSOID, mujoco.mjtGeom.mjGEOM_BOX

FLOOR: Colour = (0.32, 0.62, 0.72, 1.0)  # in the overview
MOMENTARY, OF_EACH = 600, 10  # room for marks of the moment, and of each vehicle
_UPRIGHT = np.eye(3).ravel()
_NOTHING = np.zeros(3)


class Mark(NamedTuple):
    """Something that stays once it has been drawn."""

    time: float  # from when it is drawn [s]
    kind: mujoco.mjtGeom
    width: float  # pixels of a line, metres of anything else
    start: Array  # (3,)
    end: Array  # (3,)
    colour: Colour


class Layer:
    """A MuJoCo scene: bodies, and marks that are drawn anew at every moment.

    Args:
        playback: whose bodies are drawn.
        marks: that stay once their time has come.
        overview: clear water, and of the bodies only the sea floor.
    """

    def __init__(self, playback: Playback, marks: Sequence[Mark], *, overview: bool) -> None:
        self._playback, self._overview = playback, overview
        self._option, self._camera = mujoco.MjvOption(), mujoco.MjvCamera()
        self._marks = sorted(marks, key=lambda mark: mark.time)
        self._times = np.array([mark.time for mark in self._marks])
        self._places = np.array([mark.end for mark in self._marks]).reshape(-1, 3)
        geoms = playback.model.ngeom + len(marks) + MOMENTARY + OF_EACH * len(playback.motions)
        self.scene = mujoco.MjvScene(playback.model, maxgeom=geoms)
        self._geoms = self.scene.geoms
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            self.scene.flags[flag] = 0
        self.scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = int(not overview)
        self._bodies()
        if overview:
            self.scene.ngeom = 1  # the sea floor comes first
            self._geoms[0].rgba = FLOOR  # through so much water it is dark and blue

    def _bodies(self) -> None:
        model, data, every = self._playback.model, self._playback.data, mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(model, data, self._option, None, self._camera, every, self.scene)

    def sky(self, seen: bool) -> None:
        """Whether the horizon may be in the picture; to draw what is then hidden would cost a third of the time."""
        self.scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = self.scene.flags[mujoco.mjtRndFlag.mjRND_HAZE] = int(seen)

    def begin(self, time: float, position: Array) -> None:
        """Starts a moment: bodies where the model has them, and the marks up to now that the water does not hide.

        Args:
            time: [s].
            position: (3,) round which it is looked [m].
        """
        count = int(np.searchsorted(self._times, time, side="right"))
        if self._overview:
            kept, self.scene.ngeom = range(count), 1
        else:
            self._bodies()
            away = np.linalg.norm(self._places[:count] - position, axis=1)
            kept = np.flatnonzero(away < scenery.MURK[1]).tolist()
        for index in kept:
            _, kind, width, start, end, colour = self._marks[index]
            self.join(kind, width, start, end, colour)

    def join(self, kind: mujoco.mjtGeom, width: float, start: Array, end: Array, colour: Colour) -> None:
        """Adds a line or an arrow from one point to another, or a dot at the first."""
        geom = self._add(kind, colour)
        if kind == DOT:
            geom.pos, geom.size = start, (width, width, width)
        else:
            mujoco.mjv_connector(geom, kind, width, start, end)

    def ball(self, size: Sequence[float], position: Array, matrix: Array, colour: Colour) -> None:
        """Adds an ellipsoid of semi-axes (3,) [m]."""
        geom = self._add(BALL, colour)
        geom.pos, geom.size, geom.mat = position, size, matrix.reshape(3, 3)

    def _add(self, kind: mujoco.mjtGeom, colour: Colour) -> mujoco.MjvGeom:
        geom = self._geoms[self.scene.ngeom]
        mujoco.mjv_initGeom(geom, kind, _NOTHING, _NOTHING, _UPRIGHT, np.array(colour, dtype=np.float32))
        geom.emission, geom.specular = 0.8, 0.0
        self.scene.ngeom += 1
        return geom
