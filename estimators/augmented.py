"""The docking filter with the current in its state: an extended Kalman filter whose gate cannot lock it out."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimators import ekf
from estimators.consistency import chi_square
from estimators.history import Input, Node
from estimators.planar_filter import COMPASS, USBL, DockingNoise, HeadingModel, PositionModel, first_belief
from estimators.planar_model import MAX_SUBSTEP, Integrator, PlanarParameters, PlanarProcess
from estimators.types import Array, Gaussian, Measurement

REMEMBERED = 4  # rejected fixes that are kept; the next one then is taken in any case
PROBABLE = 0.95  # probability of fixes that are not compared even after a rejected one
AGREEMENT = 0.99  # probability with which two good fixes are found to agree
FORGOTTEN = 30.0  # age at which a rejected fix says nothing more of the present [s]


class Rejected(NamedTuple):
    """A fix outside the gate, kept until a fix is accepted."""

    stamp: float  # [s]
    residual: Array  # (2,) against the prediction at its time [m]
    H: Array  # (2, 8)
    covariance: Array  # (2, 2) of the fix [m^2]


class AugmentedState(NamedTuple):
    """What a node keeps: the belief of [north, east, psi, u, v, r, c_n, c_e] and what the gate remembers."""

    belief: Gaussian
    outliers: int = 0  # fixes rejected so far
    rejected: tuple[Rejected, ...] = ()


class AugmentedFilter:
    """Planar extended Kalman filter with the current as a random walk (sec. 12 of the paper), for a `History`.

    The gate: a fix whose normalised innovation squared exceeds the chi-square quantile of probability `gate` is
    rejected and remembered. If the filter itself is wrong (a bad first fix, a current that turned faster than its
    random walk), the fixes that follow disagree with it but agree with each other. So a fix outside the gate is
    compared with the last rejected ones, up to four since a fix was last accepted. Two agree if the difference of their
    innovations is explained by their own noise and by an error of the current of `noise.initial_current` acting for the
    time between them. Then the covariance of the position is inflated by the square of the innovation, that of the
    current by its initial value, and both fixes are fused: together they determine position and current. Hence no more
    than one good fix is lost before the filter follows again, one outlier between two good fixes does not delay it
    beyond the second, and a lone outlier moves nothing. Two outliers pass only if they fall by chance within that
    distance of each other.

    The gate widens while fixes are missing. So a fix that comes after a rejected one and is inside the gate, but
    outside its inner 95 %, is compared too: else a belief wrong by some metres would be mended by a wrong current.

    Fixes far noisier than believed may never agree; so after four rejected in a row, whatever their age, the next one
    is taken with the last of them.

    Args:
        parameters: The vehicle.
        noise: What it believes of its noise.
        transponder: Place of the acoustic transponder on the hull, (x, y) forward and starboard of the origin [m].
        gate: Probability with which a fix that fits is accepted; None accepts all.
        initial_surge: Surge at the first fix [m/s]; None: steady at the shaft speed then.
        integrator: "midpoint" or "euler".
        max_substep: Longest substep of the prediction [s].
    """

    def __init__(
        self,
        parameters: PlanarParameters,
        noise: DockingNoise | None = None,
        *,
        transponder: tuple[float, float] = (0.0, 0.0),
        gate: float | None = 0.999,
        initial_surge: float | None = None,
        integrator: Integrator = "midpoint",
        max_substep: float = MAX_SUBSTEP,
    ) -> None:
        self.parameters = parameters
        self.noise = noise or DockingNoise()
        self._initial_surge = initial_surge
        self._process = PlanarProcess(
            parameters, self.noise.densities(), integrator=integrator, max_substep=max_substep
        )
        self._heading = HeadingModel()
        self._position = PositionModel(transponder)
        self._gate = gate

    def start(self, nodes: Sequence[Node[AugmentedState]], index: int) -> AugmentedState | None:
        """State at the first fix; a second fix at the same node is fused."""
        first = first_belief(self.parameters, self.noise, self._position, nodes, index, self._initial_surge)
        if first is None:
            return None
        belief, fix = first
        others = [m for m in nodes[index].measurements if m.kind == USBL and m is not fix]
        return self.correct(AugmentedState(belief), nodes[index].time, others)

    def predict(self, state: AugmentedState, u: Input, duration: float) -> AugmentedState:
        """State after `duration` [s]."""
        return AugmentedState(ekf.predict(state.belief, self._process, u, duration), state.outliers, state.rejected)

    def correct(self, state: AugmentedState, node_time: float, measurements: Sequence[Measurement]) -> AugmentedState:
        """State after the compass samples and fixes of a node."""
        for measurement in measurements:
            if measurement.kind == COMPASS:
                belief, _ = ekf.correct(state.belief, measurement, self._heading)
                state = AugmentedState(belief, state.outliers, state.rejected)
            elif measurement.kind == USBL:
                state = self._fuse_fix(state, measurement)
        return state

    def _fuse_fix(self, state: AugmentedState, fix: Measurement) -> AugmentedState:
        belief, innovation = ekf.correct(state.belief, fix, self._position, self._gate)
        if innovation.accepted and (not state.rejected or innovation.nis <= chi_square(PROBABLE, 2)):
            return AugmentedState(belief, state.outliers)
        H = self._position.jacobian(state.belief.mean)
        now = Rejected(fix.stamp, innovation.residual, H, fix.covariance)
        recent = [r for r in state.rejected if fix.stamp - r.stamp <= FORGOTTEN]
        for earlier in reversed(recent):
            if self._agree(earlier, now):
                return AugmentedState(self._recover(state.belief, earlier, now), state.outliers - 1)
        if innovation.accepted:
            return AugmentedState(belief, state.outliers)
        if len(state.rejected) >= REMEMBERED:
            return AugmentedState(self._recover(state.belief, state.rejected[-1], now), state.outliers)
        return AugmentedState(state.belief, state.outliers + 1, (*state.rejected, now))

    def _agree(self, earlier: Rejected, now: Rejected) -> bool:
        """Whether an error of the current can explain how the innovation changed between two fixes."""
        change = now.residual - earlier.residual
        drift = self.noise.initial_current * (now.stamp - earlier.stamp)
        S = now.covariance + earlier.covariance + drift**2 * np.eye(2)
        return float(change @ np.linalg.solve(S, change)) <= chi_square(AGREEMENT, 2)

    def _recover(self, belief: Gaussian, earlier: Rejected, now: Rejected) -> Gaussian:
        """Belief with position and current opened up and both fixes fused, the earlier one carried to now."""
        T = now.stamp - earlier.stamp
        covariance = belief.covariance.copy()
        covariance[[0, 1], [0, 1]] += now.residual @ now.residual + earlier.residual @ earlier.residual
        covariance[[6, 7], [6, 7]] += self.noise.initial_current**2
        H = np.vstack((now.H, earlier.H))
        H[2:, 6:8] -= T * np.eye(2)  # then, the error of the position was smaller by what the current's has added since
        R = np.zeros((4, 4))
        R[:2, :2] = now.covariance
        R[2:, 2:] = earlier.covariance + (self.noise.position * T + self.noise.current * T**3 / 3.0) * np.eye(2)
        residual = np.concatenate((now.residual, earlier.residual))
        return ekf.correct_linear(Gaussian(mean=belief.mean, covariance=covariance), H, residual, R)[0]
