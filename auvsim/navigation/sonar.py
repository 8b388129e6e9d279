"""Dead reckoning by DVL, gyro and compass with an imaging sonar: frame to window, and loops closed between lanes."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from auvsim.acoustics.message import Delivery
from auvsim.base.errors import InputError
from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.navigation.estimate import Estimate
from auvsim.navigation.measurements import FIX, averaged, of_kind
from auvsim.navigation.navigator import Navigator, NavigatorSetup
from auvsim.navigation.rate_mean import RateMean
from auvsim.navigation.reckoning import ReckoningNavigator, Start
from auvsim.navigation.sonar_frames import SectorFrames
from auvsim.sensors.altimeter import AltimeterSettings
from auvsim.sensors.dvl import DvlSettings
from auvsim.sensors.fix import FixSettings
from auvsim.sensors.gps import GpsSettings
from auvsim.sensors.gyro import GyroSettings
from auvsim.sensors.imaging_sonar import ImagingSonarSettings, geometry
from estimators.core.estimator import Estimator
from estimators.core.models import sensors
from estimators.core.models.motion import Motion, Symbols, with_error
from estimators.core.models.process import MotionProcess
from estimators.core.types import Measurement, Models
from estimators.docking.aids import GYRO, WATER
from estimators.map_path.frames import PolarGrid, SectorGrid
from estimators.map_path.keyframes import MARK, KeyframeFilter, Keyframes, KeyframeState
from estimators.map_path.likelihood import FrameModel, Matcher
from estimators.map_path.odometry import ARM, RELIEF
from estimators.map_path.window import Window

SCALE, MOUNTING = "dvl_scale", "dvl_mounting"
NEARER = "echoes_nearer"  # distance by which echoes come from before what they are of, beyond its setting [m]
TURN_RATE = "turn_rate"  # input
GPS = "gps"  # kind of measurement whose slow error is in the state
GPS_ERRORS = ("gps_north", "gps_east")  # that slow error
ROWS = 80  # of a frame's cells ahead; with half as many, cells drew matches to whole numbers of them
SMOOTHING, PATIENCE = 30.0, 5.0  # time constant of the floor's mean depth; time without echo that begins it anew [s]
POINT_SPREAD, FLOOR_SHARE = 0.2, 0.1  # of echoes [m]; of the floor in the variance of a standardised frame [-]
WINDOW = Window(kept=4, lags=(1,), covariance_factor=6.0)
KEYFRAMES = Keyframes(interval=1, gap=15, support=2, covariance_factor=25.0, other_factor=50.0)
DISTANCES = 0.003  # deviation of distances between frames, by those: 5 cm of altitude are 0.2 %
ALIKE = 0.6  # share of the distance by which echoes come from before, that frames of alike headings show
SUBMERGED = 2.0  # time without a fix after which a dive has begun [s]
HIGHEST = 0.5  # altitude by the sonar's maximum range above which a frame shows too little floor


class SonarNavigator(ReckoningNavigator):
    """Dead reckoning with the DVL's scale as a state, and frames of a sonar matched with earlier ones.

    A frame is laid on the floor at its mean depth of late, which altimeter and depth gauge tell. GPS errs slowly: that
    error is a state, so that fixes one after another do not make the position better known than it is.

    Raises:
        InputError: The vehicle has no imaging sonar or no altimeter, or more than one sonar.
    """

    positions = (FIX, GPS)

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
        cell = reach / ROWS
        half = min(math.radians(60.0), 0.98 * float(bearings[-1]))
        grid = SectorGrid(
            cell=cell,
            shape=(ROWS, 2 * ROWS),
            ranges=(max(4.0 * cell, float(ranges[0])), reach),
            half_sector=half,
            ahead=settings.nose,
        )
        self._frames = SectorFrames(polar=polar, grid=grid, nearer=ALIKE * setup.settings.nearer)
        density = FLOOR_SHARE / (math.pi * POINT_SPREAD**2)  # of features whose images make that share of the variance
        model = FrameModel(
            density=density, amplitude=1.0, point_spread=POINT_SPREAD, noise=math.sqrt(1.0 - FLOOR_SHARE)
        )
        self._matcher, self._highest = Matcher(grid, model), HIGHEST * float(ranges[-1])
        self._positions = {*of_kind(setup.sensors, GpsSettings), *of_kind(setup.sensors, FixSettings)}
        dvls = of_kind(setup.sensors, DvlSettings)
        self._nearer = setup.settings.nearer
        self._nearer_error = max(setup.settings.nearer_error, 1e-6)
        self._scale = max((d.scale_error for d in dvls.values()), default=0.0)
        self._mounting = max((math.radians(d.misalignment_deg) for d in dvls.values()), default=0.0)
        self._gps: GpsSettings | None = next(iter(of_kind(setup.sensors, GpsSettings).values()), None)
        self._gyro = next(iter(of_kind(setup.sensors, GyroSettings)), None)
        super().__init__(setup)

    def _motion(self) -> Motion:
        """Surge and sway are what the DVL shows: its scale is then no part of what it measures, and nothing but
        positions and frames can tell it. As a factor of the measurement a Kalman filter took it for known.

        The heading turns as the gyro says, all of its readings: by a yaw rate that is known at each update only, it
        would be lost by half a degree from one to the next. The yaw rate is then a state by the way.
        """
        motion = with_error(with_error(super()._motion(), SCALE, "1"), MOUNTING, "rad")
        turned = self._gyro is not None  # the function below shall not hold the navigator
        for name, unit in {NEARER: "m", **dict.fromkeys(RELIEF, "1")}.items():
            motion = with_error(motion, name, unit)
        if self._gps is not None:
            for name in GPS_ERRORS:
                motion = with_error(motion, name, "m", time_constant=self._gps.wander_time)

        def rates(x: Symbols, u: Symbols) -> Symbols:
            c, s, k = ca.cos(x[MOUNTING]), ca.sin(x[MOUNTING]), 1.0 + x[SCALE]
            true = {"surge": (c * x["surge"] - s * x["sway"]) / k, "sway": (s * x["surge"] + c * x["sway"]) / k}
            found = motion.rates({**x, **true}, u)
            return {**found, "heading": u[TURN_RATE] - x["gyro_bias"]} if turned else found

        return replace(motion, rates=rates, inputs=(TURN_RATE,) if turned else ())

    def _estimator_of(self, motion: Motion, process: MotionProcess, models: Models, setup: NavigatorSetup) -> Estimator:
        s = setup.settings
        if self._gps is not None:
            models = {**models, GPS: sensors.fix(motion, bias=GPS_ERRORS)}
        if self._gyro:
            models = {**models, GYRO: sensors.gyro(motion)}
        keyframes = replace(KEYFRAMES, closures=s.closures, spacing=s.keyframes) if s.match else None
        filter_ = KeyframeFilter(
            self._matcher,
            process,
            models,
            self._beginning(),
            gates=dict.fromkeys(models, 0.9999),
            window=WINDOW,
            keyframes=keyframes,
            nearer=motion.space.index(NEARER),
        )
        self._matches, self._stride = s.match, s.stride
        return Estimator(filter_, step=setup.period, keep=s.keep)

    def _input_noise(self, setup: NavigatorSetup) -> dict[str, float]:
        """Power spectral densities of the noise of the motion's inputs, by input [unit2 s]."""
        gyros = of_kind(setup.sensors, GyroSettings)
        return {TURN_RATE: math.radians(gyros[self._gyro].noise_density_deg) ** 2} if self._gyro else {}

    def _inputs(self, time: float) -> tuple[float, ...]:
        """The mean turn rate since the last update."""
        return (self._turning.mean(time),) if self._gyro else ()

    def _walks(self, setup: NavigatorSetup) -> dict[str, float]:
        walks = super()._walks(setup)
        gyros = of_kind(setup.sensors, GyroSettings)
        walk = max((math.radians(g.bias_walk_deg) ** 2 for g in gyros.values()), default=0.0) or walks["gyro_bias"]
        wander = 0.0 if self._gps is None else 2.0 * self._gps.wander**2 / self._gps.wander_time
        return {**walks, "gyro_bias": walk, **({} if self._gps is None else dict.fromkeys(GPS_ERRORS, wander))}

    def _known(self) -> dict[str, float]:
        wander = {} if self._gps is None else dict.fromkeys(GPS_ERRORS, max(float(self._gps.wander), 1e-6))
        relief = dict(zip(RELIEF, (DISTANCES, DISTANCES, DISTANCES / ARM), strict=True))
        return {
            **super()._known(),
            SCALE: max(self._scale, 1e-6),
            MOUNTING: max(self._mounting, 1e-6),
            NEARER: self._nearer_error,
            **relief,
            **wander,
        }

    def _beginning(self) -> Start:
        """As without a sonar; where the first fix is of GPS, its slow error is one of the position too."""
        return replace(
            super()._beginning(),
            slow={} if self._gps is None else {GPS: GPS_ERRORS},
            means={NEARER: (1.0 - ALIKE) * self._nearer},
        )

    def reset(self) -> None:
        """Forgets everything."""
        super().reset()
        self._altitude = self._floor = math.nan
        self._turning = RateMean()
        self._echoes, self._heard = 0, -math.inf  # echoes of the floor in a row, and when the last came [s]
        self._fixed: float | None = None  # when there was a fix last [s]
        self._counts: dict[int, int] = {}  # readings in each mean since the last update, by its id
        self._seen = 0  # frames near the floor
        self._dived = False  # whether the begin of the dive was marked

    def update(self, time: float, readings: Sequence[Reading], messages: Sequence[Delivery], commands: Any) -> Estimate:
        """The estimate now; readings of each sensor since the last update are averaged."""
        images = [reading for reading in readings if reading.sensor == self._sonar]
        plain = [reading for reading in readings if reading.sensor != self._sonar]
        for reading in plain:
            if reading.sensor == "depth":
                self._depth.update(reading.stamp, float(reading.value[0]))
            elif reading.sensor in self._altimeters:
                self._hear(reading)
            elif reading.sensor == self._gyro:
                for measurement in super()._measured(reading):
                    self._turning.add(reading.stamp, float(measurement.value[0]))
        fixes = [reading for reading in plain if reading.sensor == "usbl"]
        means = []
        self._counts.clear()
        for reading, count in averaged([r for r in plain if r not in fixes]):
            means.append(reading._replace(stamp=round(reading.stamp, 6)))
            self._counts[id(means[-1])] = count
        if any(reading.sensor in self._positions for reading in plain):
            self._fixed = time
        self._marks = self._dive_mark(time)
        self._images = [image for image in images if self._is_used()]
        return super().update(time, [*means, *fixes], messages, commands)

    def _measured(self, reading: Reading) -> list[Measurement]:
        """What the mean of some readings says: its noise is less by the root of their number, see `averaged`."""
        count = self._counts.get(id(reading), 1)
        own = self._sensors[reading.sensor]
        if isinstance(own, GpsSettings):
            found = [replace(m, kind=GPS, covariance=own.noise**2 * np.eye(2)) for m in super()._measured(reading)]
        else:
            found = super()._measured(reading)
        return [replace(m, covariance=m.covariance / count) for m in found if m.kind != WATER]

    def _is_used(self) -> bool:
        """Whether a frame that came is matched: each `stride`-th of those taken near the floor."""
        if not self._matches or not self._altitude <= self._highest:
            return False
        self._seen += 1
        return (self._seen - 1) % self._stride == 0

    def _hear(self, reading: Reading) -> None:
        """Takes an altimeter's echo: altitude above the mean depth of the floor of late.

        What the sonar looks at is ahead, and no nearer to the depth right below than to the mean; where the altitude
        follows each bump, features seem to move.
        """
        depth = self._depth.at(reading.stamp)
        if depth is None:
            return
        below = depth + float(reading.value[0]) * math.cos(self._tilt[0]) * math.cos(self._tilt[1])
        passed = reading.stamp - self._heard
        self._echoes = 1 if passed > PATIENCE else self._echoes + 1
        share = max(1.0 / self._echoes, 1.0 - math.exp(-passed / SMOOTHING))
        self._floor = below if self._echoes == 1 else self._floor + share * (below - self._floor)
        self._heard, self._altitude = reading.stamp, self._floor - depth

    def _more(self) -> list[Measurement]:
        """The frames of the images, and a mark where the dive begins."""
        above = self._frames.grid.ahead * math.sin(self._tilt[0])
        frames = [
            self._frames.frame(
                reading.image,
                altitude=self._altitude_of(reading) + above,
                stamp=reading.stamp,
                sequence=reading.sequence,
            ).measurement()
            for reading in self._images
        ]
        return [*frames, *self._marks]

    def _altitude_of(self, image: Reading) -> float:
        """Altitude where a frame was taken [m]."""
        depth = None if image.received <= image.stamp else self._depth.at(image.stamp)
        return self._altitude if depth is None else self._floor - depth

    def _dive_mark(self, time: float) -> list[Measurement]:
        """Has the pose kept where the first fixes end."""
        if self._dived or not self._matches or self._fixed is None or time - self._fixed <= SUBMERGED:
            return []
        self._dived = True
        return [Measurement(kind=MARK, value=np.zeros(1), covariance=np.eye(1), stamp=time, received=time)]

    @property
    def path(self) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
        """Stamps (k,), poses (k, 3) and images of the frames that are kept, given all so far: for a map."""
        state = self._estimator.history.state
        if not isinstance(state, KeyframeState):
            return np.empty(0), np.empty((0, 3)), []
        first = 0 if state.mark is None else 1
        poses = state.poses[first:].copy()
        poses[:, 2] = [wrap(heading) for heading in poses[:, 2]]
        return np.array(state.stamps[first:]), poses, [frame.values for frame in state.frames[first:]]

    @property
    def dive(self) -> tuple[float, np.ndarray] | None:
        """When the first dive began [s], after the last fix at the surface, and the pose (3,) there, by all so far."""
        state = self._estimator.history.state
        return state.mark if isinstance(state, KeyframeState) else None

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
