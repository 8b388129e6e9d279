"""Dead reckoning by DVL, gyro and compass, corrected by fixes and ranges: for vehicles of which no model is known."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from auvsim.acoustics.message import Delivery
from auvsim.base.alpha_beta import AlphaBeta
from auvsim.base.reading import Reading
from auvsim.navigation.docking import DEPTH_GAINS
from auvsim.navigation.estimate import Estimate
from auvsim.navigation.measurements import FIX, measurements, of_kind
from auvsim.navigation.navigator import Navigator, NavigatorSetup
from auvsim.navigation.over_history import OverHistory
from auvsim.sensors.fix import FixSettings
from auvsim.sensors.gps import GpsSettings
from auvsim.sensors.range import RangeSettings
from estimators.core.estimator import Estimator
from estimators.core.filter import ModelFilter
from estimators.core.history import Node
from estimators.core.models import sensors
from estimators.core.models.motion import Motion, constant_velocity, with_error
from estimators.core.models.process import MotionProcess
from estimators.core.states import StateSpace
from estimators.core.types import Gaussian, Measurement, Models
from estimators.docking.aids import BOTTOM, GYRO, RANGE
from estimators.docking.sensors import COMPASS
from estimators.docking.usbl import UsblFix, UsblModel

BIASES = {"compass_bias": "rad", "gyro_bias": "rad/s"}
GYRO_WALK = 1e-12  # of a gyro's bias [rad2/s3]
SPEED, TURNING = 1.0, 0.1  # what is not known at first: velocities [m/s], yaw rate [rad/s]
GYRO_BIAS, UNKNOWN = 1e-3, 50.0  # deviations at the start: of a gyro's bias [rad/s], of a position by ranges alone [m]
DOUBT = 10.0  # deviation of a dock's first fix, which may be an outlier, until a second one has come [m]


class ReckoningNavigator(OverHistory):
    """A filter of position, heading, velocity over ground and yaw rate, all of which only measurements tell.

    Velocities are random walks, so that a DVL that is away for a while costs no more than it must. Without anything
    that fixes the position it starts at the datum.
    """

    positions: tuple[str, ...] = (FIX,)  # kinds of measurement that are one of the position

    def __init__(self, setup: NavigatorSetup) -> None:
        s = setup.settings
        motion = self._motion()
        self.states: Mapping[str, str] = dict(motion.space.units)
        self._space, self._sensors = motion.space, dict(setup.sensors)
        self._compass_bias = math.radians(s.compass_error_deg)
        self._located = (setup.dock is not None and setup.usbl.enabled) or any(
            of_kind(self._sensors, kind) for kind in (FixSettings, GpsSettings)
        )
        self._ranged = bool(of_kind(self._sensors, RangeSettings))
        self._dock = np.zeros(2) if setup.dock is None else setup.dock.position[:2]
        self._usbl = UsblModel(transceiver=setup.usbl.transceiver, dock_heading=math.radians(s.dock_heading_deg))
        self._doubt = DOUBT if setup.dock is not None and setup.usbl.enabled else 0.0
        process = MotionProcess(
            motion,
            {
                "north": s.position_noise,
                "east": s.position_noise,
                "surge": s.acceleration,
                "sway": s.acceleration,
                "yaw_rate": s.yaw_acceleration,
                **self._walks(setup),
            },
            input_noise=self._input_noise(setup),
        )
        models = {
            COMPASS: sensors.compass(motion, bias="compass_bias"),
            GYRO: sensors.gyro(motion, bias="gyro_bias"),
            BOTTOM: sensors.dvl(motion),
            FIX: sensors.fix(motion),
            RANGE: sensors.range_to(motion),
        }
        self._estimator = self._estimator_of(motion, process, models, setup)
        self.reset()

    def _motion(self) -> Motion:
        """How the vehicle moves."""
        motion = constant_velocity(turning=True)
        for name, unit in BIASES.items():
            motion = with_error(motion, name, unit)
        return motion

    def _walks(self, setup: NavigatorSetup) -> dict[str, float]:
        """Process noise of the sensors' errors, by state [unit2/s]."""
        return {"gyro_bias": GYRO_WALK}

    def _input_noise(self, setup: NavigatorSetup) -> dict[str, float]:
        """Power spectral densities of the noise of the motion's inputs, by input [unit2 s]."""
        return {}

    def _estimator_of(self, motion: Motion, process: MotionProcess, models: Models, setup: NavigatorSetup) -> Estimator:
        """The filter behind its delay buffer."""
        return Estimator(ModelFilter(process, models, self._beginning(), gates=0.9999), step=setup.period)

    def _known(self) -> dict[str, float]:
        """Deviations at the start of what no reading shows at once."""
        return {
            "surge": SPEED, "sway": SPEED, "yaw_rate": TURNING, "compass_bias": self._compass_bias,
            "gyro_bias": GYRO_BIAS,
        }  # fmt: skip

    def _more(self) -> list[Measurement]:
        """What else there is to tell since the last update."""
        return []

    def _inputs(self, time: float) -> tuple[float, ...]:
        """Inputs of the motion since the last update."""
        return ()

    def _measured(self, reading: Reading) -> Iterable[Measurement]:
        """What a reading says of the horizontal motion."""
        return measurements(reading, self._sensors[reading.sensor], self._depth.value or 0.0, tilt=self._tilt)

    def reset(self) -> None:
        """Forgets everything."""
        self._estimator.reset()
        self._depth = AlphaBeta(*DEPTH_GAINS)
        self._tilt = (0.0, 0.0)  # pitch and roll by the compass [rad]

    def update(self, time: float, readings: Sequence[Reading], messages: Sequence[Delivery], commands: Any) -> Estimate:
        """The estimate now, from the readings, messages and commands since the last update."""
        found: list[Measurement] = []
        for reading in readings:
            if reading.sensor == "compass":
                self._tilt = (float(reading.value[1]), float(reading.value[2]))
            if reading.sensor == "depth":
                self._depth.update(reading.stamp, float(reading.value[0]))
            elif reading.sensor == "usbl":
                found.append(self._fix(reading))
            elif reading.sensor in self._sensors:
                found += self._measured(reading)
        result = self._estimator.tick(time, self._inputs(time), [*found, *self._more()])
        n = len(self._space)
        belief = result.belief or Gaussian(mean=np.zeros(n), covariance=np.zeros((n, n)))
        # Copied: it may be a part of the state with all frames' poses, which a log would then hold at every tick.
        mean, covariance = belief.mean.copy(), belief.covariance.copy()
        return Estimate(
            time=time,
            position=np.array((mean[0], mean[1], self._depth.at(time) or 0.0)),
            heading=float(mean[2]),
            velocity=mean[3:6],
            current=np.zeros(2),
            covariance=covariance,
            initialised=result.belief is not None,
            mean=mean,
            names=tuple(self.states),
            refused=sum(result.refused.values()),
            reasons=result.refused,
            reinitialised=result.reinitialised,
            outcomes=result.outcomes,
        )

    def _fix(self, reading: Reading) -> Measurement:
        """A dock's packet as a position from the datum."""
        x, y, z, heading, pitch, roll, _ = reading.value.tolist()
        fix = self._usbl.world_fix(
            UsblFix(stamp=reading.stamp, received=reading.received, sequence=reading.sequence, position=(x, y, z),
                    heading=heading, pitch=pitch, roll=roll)
        )  # fmt: skip
        return Measurement(
            kind=FIX, value=fix.value + self._dock, covariance=fix.covariance, stamp=fix.stamp, received=fix.received,
            sequence=fix.sequence,
        )  # fmt: skip

    def _beginning(self) -> "Start":
        """What a filter begins with."""
        return Start(
            space=self._space,
            positions=self.positions,
            located=self._located,
            deviation=UNKNOWN if self._ranged else 0.0,
            compass_bias=self._compass_bias,
            known=self._known(),
            doubt=self._doubt,
        )


@dataclass(frozen=True, kw_only=True)
class Start:
    """The belief at the first node with a fix and a compass at or before it; at the first compass, if nothing locates.

    It knows no navigator: the two would hold each other, and all frames that a filter keeps, long after a run.
    """

    space: StateSpace
    positions: tuple[str, ...]  # kinds of measurement that are one of the position
    located: bool  # whether there is a sensor of one
    deviation: float  # of the position where no fix is [m]
    compass_bias: float  # deviation [rad]
    known: Mapping[str, float]  # deviations of the other states
    doubt: float  # deviation of a first fix that may be an outlier [m]
    slow: Mapping[str, tuple[str, str]] = field(default_factory=dict)  # states that are errors of a position, by kind
    means: Mapping[str, float] = field(default_factory=dict)  # of states that are not expected to be 0

    def __call__(self, nodes: Sequence[Node], index: int) -> tuple[Gaussian, list[Measurement]] | None:
        """The belief and the measurements that it is made of; None where those of the node do not suffice."""
        node = nodes[index]
        earlier = [m for other in nodes[: index + 1] for m in other.measurements if m.kind == COMPASS]
        fix = next((m for m in node.measurements if m.kind in self.positions), None)
        if not earlier or (self.located and fix is None):
            return None
        known = {
            "heading": math.hypot(self.compass_bias, math.sqrt(earlier[-1].covariance.item())),
            "north": self.deviation,
            "east": self.deviation,
            **self.known,
        }
        belief = self.space.belief({"heading": float(earlier[-1].value[0]), **self.means}, known)
        mean, covariance = belief.mean, belief.covariance
        psi, bias = self.space.index("heading"), self.space.index("compass_bias")
        covariance[psi, bias] = covariance[bias, psi] = -(
            self.compass_bias**2
        )  # it shows too much: so does the heading
        if fix is not None:
            mean[:2], covariance[:2, :2] = fix.value, fix.covariance + self.doubt**2 * np.eye(2)
            for axis, name in enumerate(self.slow.get(fix.kind, ())):
                k = self.space.index(name)
                covariance[axis, axis] += covariance[k, k]
                covariance[axis, k] = covariance[k, axis] = -covariance[k, k]
        return belief, [m for m in node.measurements if m is fix or m is earlier[-1]]


def dead_reckoning(setup: NavigatorSetup) -> Navigator:
    """Dead reckoning by DVL, gyro and compass with fixes and ranges, on no vehicle's model."""
    return ReckoningNavigator(setup)
