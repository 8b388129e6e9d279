"""Frames of the ray-cast imaging sonar over a generated sea floor, with rocks or only rough, for paper 5's study."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.random import Generator

from auvsim.base.frames import Array, euler_to_quaternion
from auvsim.navigation.sonar_frames import SectorFrames
from auvsim.physics.truth import Truth
from auvsim.sensors.imaging_sonar import ImagingSonar, ImagingSonarSettings
from auvsim.water.currents import CurrentField, Uniform
from auvsim.water.seabed import SeabedSettings
from auvsim.water.terrain import Terrain, build_terrain
from estimators.map_path.frames import PolarGrid, SectorGrid, SonarFrame

DEPTH = 20.0  # of the floor on average [m]
ALTITUDE = 5.0  # of the vehicle above that, on one depth; the sonar's SNR is as of it [m]
SPACING = 0.1  # of the floor's points [m]
BESIDE = 22.0  # floor beside the path [m]
SMOOTHING = 30  # frames over which the floor's depth is averaged, as on missions
SURROUNDINGS = (
    0.5  # see `SectorFrames`; a wider mean leaves light that moves with the vehicle and draws matches short [m]
)
MAXIMUM_RANGE = 21.0  # slant, to the end of the frames' sector [m]


@dataclass(frozen=True)
class Floor:
    """Still water over a sea floor with nothing on it that is not of the floor, as a sensor sees the world."""

    terrain: Terrain
    current: CurrentField = field(default_factory=lambda: Uniform((0.0, 0.0, 0.0)))
    structures: dict[str, Any] = field(default_factory=dict)

    def rays(self, place: Array, directions: Array, reach: float) -> None:
        """Nothing to meet."""
        return

    def truth(self, vehicle: str) -> Truth:
        """There is no vehicle but the sensor's own.

        Raises:
            KeyError: always.
        """
        raise KeyError(vehicle)


def floor_frames(
    poses: Array, grid: SectorGrid, *, rocks: float, snr: float, seed: int, generator: Generator
) -> tuple[SonarFrame, ...]:
    """A frame at each pose, at steps of 1 s, over the floor of a seed.

    The altitude is above the mean depth below the vehicle of late, by an altimeter: above each bump, features that lie
    ahead would move by metres of range times its height over the altitude.

    Args:
        poses: (k, 3) north, east [m], heading [rad].
        grid: of the frames.
        rocks: number of rocks [1/m^2]; 0 for a rough floor without any.
        snr: of the sonar, see `ImagingSonarSettings` [dB].
        seed: of the floor.
        generator: of speckle and noise, new each ping.
    """
    low, high = poses[:, :2].min(axis=0), poses[:, :2].max(axis=0)
    center, extent = 0.5 * (low + high), float(np.max(high - low)) + 2.0 * BESIDE
    settings = SeabedSettings(
        seed=seed, center=(float(center[0]), float(center[1])), extent=extent, spacing=SPACING, rocks=rocks
    )
    world = Floor(build_terrain(settings, DEPTH))
    sonar = ImagingSonar(ImagingSonarSettings(snr=snr, maximum_range=MAXIMUM_RANGE), generator)
    polar = PolarGrid(bearings=tuple(sonar.bearings.tolist()), ranges=tuple(sonar.ranges.tolist()))
    maker = SectorFrames(polar=polar, grid=grid, surroundings=SURROUNDINGS)
    frames, altitude = [], 0.0
    for k, pose in enumerate(poses):
        truth = _at(float(k), pose)
        below = world.terrain.depth(pose[0], pose[1]) - (DEPTH - ALTITUDE)
        altitude += (below - altitude) / min(k + 1, SMOOTHING)
        frames.append(maker.frame(sonar.image(truth, world), altitude=altitude, stamp=float(k), sequence=k))
    return tuple(frames)


def _at(time: float, pose: Array) -> Truth:
    """A vehicle on an even keel at a pose."""
    north, east, heading = pose.tolist()
    return Truth(
        time=time, position=np.array([north, east, DEPTH - ALTITUDE]),
        quaternion=euler_to_quaternion(0.0, 0.0, heading), attitude=np.array([0.0, 0.0, heading]), nu=np.zeros(6),
        current=np.zeros(3), actuators=np.zeros(3),
    )  # fmt: skip
