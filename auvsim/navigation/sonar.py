"""Dead reckoning by DVL, gyro and compass with an imaging sonar: frame to window, and loops closed between lanes."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from auvsim.acoustics.message import Delivery
from auvsim.base.errors import InputError
from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.navigation.estimate import Estimate
from auvsim.navigation.measurements import averaged, of_kind
from auvsim.navigation.navigator import Navigator, NavigatorSetup
from auvsim.navigation.reckoning import ReckoningNavigator
from auvsim.navigation.sonar_frames import SectorFrames
from auvsim.sensors.altimeter import AltimeterSettings
from auvsim.sensors.dvl import DvlSettings
from auvsim.sensors.gyro import GyroSettings
from auvsim.sensors.imaging_sonar import ImagingSonarSettings, geometry
from estimators.core.estimator import Estimator
from estimators.core.models.motion import Motion, Symbols, with_error
from estimators.core.models.process import MotionProcess
from estimators.core.types import Measurement, Models
from estimators.map_path.frames import PolarGrid, SectorGrid
from estimators.map_path.keyframes import KeyframeFilter, Keyframes, KeyframeState
from estimators.map_path.likelihood import FrameModel, Matcher

SCALE = "dvl_scale"
POINT_SPREAD, FLOOR_SHARE = 0.2, 0.1  # of echoes [m]; of the floor in the variance of a standardised frame [-]
HIGHEST = 0.5  # altitude by the sonar's maximum range above which a frame shows too little floor


class SonarNavigator(ReckoningNavigator):
    """Dead reckoning with the DVL's scale as a state, and frames of a sonar matched with earlier ones.

    A frame is laid on the floor by the last altitude.

    Raises:
        InputError: The vehicle has no imaging sonar or no altimeter, or more than one sonar.
    """

    def __init__(self, setup: NavigatorSetup) -> None:
        s = setup.settings
        sonars = of_kind(setup.sensors, ImagingSonarSettings)
        self._altimeters = of_kind(setup.sensors, AltimeterSettings)
        if len(sonars) != 1 or not self._altimeters:
            raise InputError(
                f"estimator '{s.kind}' of '{setup.vehicle}': needs one sensor of kind imaging_sonar and one of kind "
                f"altimeter; there are {len(sonars)} and {len(self._altimeters)}"
            )
        ((self._sonar, settings),) = sonars.items()
        bearings, ranges = geometry(settings)
        polar = PolarGrid(bearings=tuple(bearings.tolist()), ranges=tuple(ranges.tolist()))
        reach = 0.95 * float(ranges[-1])
        cell = reach / 40.0
        half = min(math.radians(60.0), 0.98 * float(bearings[-1]))
        grid = SectorGrid(
            cell=cell, shape=(40, 80), ranges=(max(2.0 * cell, float(ranges[0])), reach), half_sector=half
        )
        self._frames = SectorFrames(polar=polar, grid=grid)
        density = FLOOR_SHARE / (math.pi * POINT_SPREAD**2)  # of features whose images make that share of the variance
        model = FrameModel(
            density=density, amplitude=1.0, point_spread=POINT_SPREAD, noise=math.sqrt(1.0 - FLOOR_SHARE)
        )
        self._matcher, self._highest = Matcher(grid, model), HIGHEST * float(ranges[-1])
        self._altitude = math.nan
        dvls = of_kind(setup.sensors, DvlSettings)
        self._scale = max((d.scale_error for d in dvls.values()), default=0.0)
        super().__init__(setup)

    def _motion(self) -> Motion:
        """Surge and sway are what the DVL shows: its scale is then no part of what it measures, and nothing but
        positions and frames can tell it. As a factor of the measurement a Kalman filter took it for known."""
        motion = with_error(super()._motion(), SCALE, "1")

        def rates(x: Symbols, u: Symbols) -> Symbols:
            true = {name: x[name] / (1.0 + x[SCALE]) for name in ("surge", "sway")}
            return motion.rates({**x, **true}, u)

        return replace(motion, rates=rates)

    def _estimator_of(self, motion: Motion, process: MotionProcess, models: Models, setup: NavigatorSetup) -> Estimator:
        s = setup.settings
        keyframes = Keyframes(closures=s.closures, spacing=s.keyframes) if s.match else None
        filter_ = KeyframeFilter(
            self._matcher, process, models, self._start, gates=dict.fromkeys(models, 0.9999), keyframes=keyframes
        )
        self._matches = s.match
        return Estimator(filter_, step=setup.period, keep=s.keep)

    def _gyro_walk(self, setup: NavigatorSetup) -> float:
        gyros = of_kind(setup.sensors, GyroSettings)
        return max((math.radians(g.bias_walk_deg) ** 2 for g in gyros.values()), default=0.0) or super()._gyro_walk(
            setup
        )

    def _known(self) -> dict[str, float]:
        return {**super()._known(), SCALE: max(self._scale, 1e-6)}

    def update(self, time: float, readings: Sequence[Reading], messages: Sequence[Delivery], commands: Any) -> Estimate:
        """The estimate now; readings of each sensor since the last update are averaged."""
        images = [reading for reading in readings if reading.sensor == self._sonar]
        plain = [reading for reading in readings if reading.sensor != self._sonar]
        for reading in plain:
            if reading.sensor in self._altimeters:
                self._altitude = float(reading.value[0]) * math.cos(self._tilt[0]) * math.cos(self._tilt[1])
        fixes = [reading for reading in plain if reading.sensor == "usbl"]
        means = [
            reading._replace(stamp=round(reading.stamp, 6))
            for reading, _ in averaged([r for r in plain if r not in fixes])
        ]
        self._images = images if self._matches and self._altitude <= self._highest else []
        return super().update(time, [*means, *fixes], messages, commands)

    def _more(self) -> list[Measurement]:
        """The frames of the images."""
        return [
            self._frames.frame(
                reading.image, altitude=self._altitude, stamp=reading.stamp, sequence=reading.sequence
            ).measurement()
            for reading in self._images
        ]

    @property
    def path(self) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
        """Stamps (k,), poses (k, 3) and images of the frames that are kept, given all so far: for a map."""
        state = self._estimator.history.state
        if not isinstance(state, KeyframeState):
            return np.empty(0), np.empty((0, 3)), []
        poses = state.poses.copy()
        poses[:, 2] = [wrap(heading) for heading in poses[:, 2]]
        return np.array(state.stamps), poses, [frame.values for frame in state.frames]

    @property
    def closed(self) -> int:
        """Loop closures believed so far."""
        state = self._estimator.history.state
        return state.closed if isinstance(state, KeyframeState) else 0

    @property
    def grid(self) -> SectorGrid:
        """Of the frames."""
        return self._frames.grid


def sonar_reckoning(setup: NavigatorSetup) -> Navigator:
    """Dead reckoning with a sonar, see `SonarNavigator`."""
    return SonarNavigator(setup)
