"""Navigation of a vehicle that a dock locates acoustically: Qiu and Li (2019), a USBL-based method for homing.

The dock measures the transponder in its own frame and sends it by modem, with its attitude: every fix is old when it
arrives. Eq. 7 (into the world) and eq. 11 (the current) are here. World axes are (north, east) throughout.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from estimators import ekf
from estimators.augmented import AugmentedFilter
from estimators.errors import ParameterError
from estimators.history import Filter, History, Input, Node
from estimators.loops import wrap
from estimators.planar_filter import (
    COMPASS,
    PAPER_NOISE,
    REFERENCE_NOISE,
    USBL,
    DockingNoise,
    HeadingModel,
    PositionModel,
    first_belief,
)
from estimators.planar_model import MAX_SUBSTEP, Integrator, PlanarParameters, PlanarProcess
from estimators.types import Array, Gaussian, Measurement

__all__ = [
    "PAPER_NOISE",
    "REFERENCE_NOISE",
    "AugmentedFilter",
    "DockingEstimate",
    "DockingEstimator",
    "DockingNoise",
    "PaperFilter",
    "UsblFix",
    "UsblModel",
    "estimate_current",
]


@dataclass(frozen=True, kw_only=True, slots=True)
class UsblFix:
    """One packet of the dock."""

    stamp: float  # when the transponder was measured [s]
    received: float  # when the packet arrived [s]
    position: (
        tuple[float, float, float] | Array
    )  # transponder from transceiver in the dock's frame, forward, starboard, down [m]
    heading: float  # dock's attitude, ZYX [rad]
    pitch: float = 0.0  # [rad]
    roll: float = 0.0  # [rad]
    sequence: int | None = None  # packet number


@dataclass(frozen=True, kw_only=True, slots=True)
class UsblModel:
    """What the vehicle believes of the dock's USBL.

    The deviations are those of the paper's Table 1 (square roots of its variances), interpolated on logarithmic axes
    and constant outside; they follow no power law.
    """

    transceiver: tuple[float, float, float] = (0.0, 0.0, 0.0)  # its place in the dock's frame [m]
    ranges: tuple[float, ...] = (12.0, 40.0, 100.0, 200.0)  # [m]
    deviations: tuple[float, ...] = (0.0067, 0.0678, 0.3390, 0.4807)  # of each axis at these ranges [m]
    dock_heading: float = 0.0  # standard deviation of the dock's compass, which acts across the line of sight [rad]

    def __post_init__(self) -> None:
        increasing = all(a < b for a, b in zip(self.ranges, self.ranges[1:], strict=False))
        if not (
            increasing and len(self.ranges) == len(self.deviations) and min((*self.ranges, *self.deviations)) > 0.0
        ):
            raise ParameterError(f"USBL ranges {self.ranges} must rise, with one deviation > 0 each: {self.deviations}")

    def deviation(self, distance: float) -> float:
        """Standard deviation of each axis [m] at a distance [m]."""
        if not distance > self.ranges[0]:
            return self.deviations[0]
        return math.exp(float(np.interp(math.log(distance), np.log(self.ranges), np.log(self.deviations))))

    def world_fix(self, fix: UsblFix) -> Measurement:
        """Transponder (north, east) from the dock's origin by eq. 7, with covariance M Sigma M'."""
        numbers = (*map(float, fix.position), fix.heading, fix.pitch, fix.roll)
        if not all(map(math.isfinite, numbers)):
            numbers = (math.nan,) * 6  # for the history to refuse: the cosine of infinity would raise here
        x, y, z, *attitude = numbers
        M = horizontal_rotation(*attitude)
        value = M @ (np.array((x, y, z)) + self.transceiver)
        variance = self.deviation(math.sqrt(x * x + y * y + z * z)) ** 2
        covariance = variance * (M @ M.T)
        if self.dock_heading > 0.0:
            across = np.array((-value[1], value[0])) * self.dock_heading
            covariance += np.outer(across, across)
        return Measurement(
            kind=USBL, value=value, covariance=covariance, stamp=fix.stamp, received=fix.received, sequence=fix.sequence
        )


def horizontal_rotation(heading: float, pitch: float, roll: float) -> Array:
    """First two rows (2, 3) of the ZYX rotation from the dock's frame to north, east, down; the paper's eq. 7."""
    cy, sy, cp, sp, cr, sr = (f(a) for a in (heading, pitch, roll) for f in (math.cos, math.sin))
    return np.array(
        (
            (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
            (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        )
    )


def estimate_current(
    history: Sequence[tuple[float, float]],
    weights: Array,
    gain: Array,
    residual: Array,
    interval: float,
) -> tuple[float, float]:
    """Eq. 11: V_n = a_0 V_(n-m) + ... + a_(m-1) V_(n-1) + a_m (V_(n-1) + K_C (z_n - p_n^-) / (t_n - t_(n-1))).

    Args:
        history: The last m estimates (north, east), oldest first [m/s].
        weights: (m + 1,) a_0 .. a_m, positive, of sum 1.
        gain: K_C (2, 2), the position's gain on the position.
        residual: z_n - p_n^- (2,), fix minus predicted position [m].
        interval: t_n - t_(n-1) between the stamps [s].
    """
    past = np.array((*history, history[-1]))
    north, east = weights @ past + weights[-1] * (gain @ residual) / interval
    return float(north), float(east)


class PaperState(NamedTuple):
    """What a node keeps: the belief, its states 7, 8 the current of eq. 11 without covariance; eq. 11's memory."""

    belief: Gaussian
    currents: tuple[tuple[float, float], ...]  # last m estimates, oldest first [m/s]
    last_fix: float  # stamp of the fix before [s]
    outliers: int = 0  # it has no gate


class PaperFilter:
    """The paper's improved filter: six states, the current by eq. 11 beside them; for a `History`.

    It has no gate: its covariance does not know the current's error, so that a gate would lock it out. For the same
    reason the position noise is inflated, and its covariance is not consistent.

    Args:
        parameters: The vehicle.
        noise: What it believes of its noise; that of the current is not used.
        weights: a_0 .. a_m of eq. 11.
        transponder, initial_surge: As for `AugmentedFilter`.
        integrator, max_substep: As there; the paper's are "euler" and its step of 0.5 s.
    """

    def __init__(
        self,
        parameters: PlanarParameters,
        noise: DockingNoise = PAPER_NOISE,
        *,
        weights: tuple[float, ...] = (0.3, 0.3, 0.4),
        transponder: tuple[float, float] = (0.0, 0.0),
        initial_surge: float | None = None,
        integrator: Integrator = "midpoint",
        max_substep: float = MAX_SUBSTEP,
    ) -> None:
        if len(weights) < 2 or min(weights) <= 0.0 or abs(sum(weights) - 1.0) > 1e-9:
            raise ParameterError(f"weights {weights} of eq. 11 must be two or more, above 0, of sum 1")
        self.parameters = parameters
        self.noise = noise
        self._weights = np.array(weights)
        self._initial_surge = initial_surge
        densities = noise.densities()
        densities[6:] = 0.0  # with no covariance either, the augmented model is the six-state one with a given current
        self._process = PlanarProcess(parameters, densities, integrator=integrator, max_substep=max_substep)
        self._heading = HeadingModel()
        self._position = PositionModel(transponder)

    def start(self, nodes: Sequence[Node[PaperState]], index: int) -> PaperState | None:
        """State at the first fix, with no current; a second fix at the same node is fused."""
        first = first_belief(self.parameters, self.noise, self._position, nodes, index, self._initial_surge)
        if first is None:
            return None
        belief, fix = first
        belief.covariance[6:, :] = belief.covariance[:, 6:] = 0.0
        state = PaperState(belief, ((0.0, 0.0),) * (len(self._weights) - 1), fix.stamp)
        others = [m for m in nodes[index].measurements if m.kind == USBL and m is not fix]
        return self.correct(state, nodes[index].time, others)

    def predict(self, state: PaperState, u: Input, duration: float) -> PaperState:
        """State after `duration` [s]; eq. 12."""
        belief = ekf.predict(state.belief, self._process, u, duration)
        return PaperState(belief, state.currents, state.last_fix)

    def correct(self, state: PaperState, node_time: float, measurements: Sequence[Measurement]) -> PaperState:
        """State after the compass samples and fixes of a node."""
        for measurement in measurements:
            if measurement.kind == COMPASS:
                belief, _ = ekf.correct(state.belief, measurement, self._heading)
                state = PaperState(belief, state.currents, state.last_fix)
            elif measurement.kind == USBL:
                state = self._fuse_fix(state, measurement)
        return state

    def _fuse_fix(self, state: PaperState, fix: Measurement) -> PaperState:
        belief, innovation = ekf.correct(state.belief, fix, self._position)
        interval = fix.stamp - state.last_fix
        if abs(interval) < 1e-6:
            return state._replace(belief=belief)
        gain = innovation.gain[:2, :2]
        current = estimate_current(state.currents, self._weights, gain, innovation.residual, interval)
        belief.mean[6:] = current
        return PaperState(belief, (*state.currents[1:], current), fix.stamp)


@dataclass(frozen=True, kw_only=True, slots=True)
class DockingEstimate:
    """What a docking estimator knows at one time; zeros before the first fix."""

    time: float  # [s]
    mean: Array  # (8,) north, east [m], psi [rad], u, v [m/s], r [rad/s], current c_n, c_e [m/s]
    covariance: Array  # (8, 8), zeros where nothing is estimated
    current: Array  # (2,) north, east [m/s]
    initialised: bool
    refused: Mapping[str, int]  # measurements refused so far, by reason; "outlier" by the filter's gate


class DockingFilter(Filter[Any], Protocol):
    """A filter for a `DockingEstimator`: its states have `belief` (8 states) and `outliers`."""

    noise: DockingNoise


class DockingEstimator:
    """A docking filter behind its delay buffer: measurements in, in whatever order, estimate out.

    Args:
        filter: `AugmentedFilter`, `PaperFilter`, or one of that form.
        usbl: What is believed of the dock's USBL.
        step: Nominal time between ticks [s].
        keep: Age up to which fixes are used [s].
    """

    def __init__(
        self, filter: DockingFilter, usbl: UsblModel | None = None, *, step: float = 0.5, keep: float = 30.0
    ) -> None:
        self._filter = filter
        self._usbl = usbl or UsblModel()
        self._step, self._keep = step, keep
        self._compass_covariance = np.array([[filter.noise.compass**2]])
        self.reset()

    def reset(self) -> None:
        """Forgets everything, counts included."""
        self._history: History[Any] = History(self._filter, step=self._step, keep=self._keep)

    def tick(
        self, time: float, heading: float | None, rudder: float, shaft_speed: float, fixes: Sequence[UsblFix] = ()
    ) -> DockingEstimate:
        """One step of the filter.

        Args:
            time: Now [s]; later than at the last tick.
            heading: Compass sample made now [rad], or None.
            rudder: Mean rudder angle since the last tick [rad], positive to starboard.
            shaft_speed: Mean shaft speed since the last tick [rad/s].
            fixes: Packets that arrived since the last tick, in any order.

        Raises:
            ParameterError: The time does not advance, or an input is not a number.
            NotFiniteError: The filter diverged.
        """
        u = (float(rudder), float(shaft_speed))
        if not (math.isfinite(u[0]) and math.isfinite(u[1])):
            raise ParameterError(f"rudder {rudder} rad and shaft speed {shaft_speed} rad/s at {time} s must be finite")
        history = self._history
        compass = () if heading is None else (self._compass(time, float(heading)),)
        history.append(float(time), u, compass)
        for fix in fixes:
            history.insert(self._usbl.world_fix(fix))
        return self._estimate(time, history.replay())

    def _compass(self, time: float, heading: float) -> Measurement:
        value = np.array((wrap(heading),))
        return Measurement(kind=COMPASS, value=value, covariance=self._compass_covariance, stamp=time, received=time)

    def _estimate(self, time: float, state: Any) -> DockingEstimate:
        refused = {**self._history.refused, "outlier": 0 if state is None else state.outliers}
        belief = Gaussian(mean=np.zeros(8), covariance=np.zeros((8, 8))) if state is None else state.belief
        return DockingEstimate(
            time=time,
            mean=belief.mean,
            covariance=belief.covariance,
            current=belief.mean[6:],
            initialised=state is not None,
            refused=refused,
        )
