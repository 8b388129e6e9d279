"""The docking filter for currents that may turn: interacting modes, and fixes that may be outliers, in the buffer."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from estimators import ekf, imm, outliers, recovery
from estimators.ekf import Innovation
from estimators.errors import ParameterError
from estimators.history import Input, Node
from estimators.outliers import Doubtful, Outliers
from estimators.planar_filter import COMPASS, ROBUST_NOISE, USBL, DockingNoise, PlanarModels
from estimators.planar_model import MAX_SUBSTEP, Integrator, PlanarParameters, PlanarProcess
from estimators.recovery import Rejected
from estimators.types import Array, Gaussian, Measurement

ANGLES = (2,)  # the heading
TRUSTED = 3  # fixes taken before the filter believes itself more than two fixes that agree against it


class InteractingState(NamedTuple):
    """What a node keeps: each mode's belief and probability, and what is remembered of fixes."""

    beliefs: tuple[Gaussian, ...]
    weights: Array  # (m,) probabilities of the modes
    accepted: int = 1  # fixes taken so far
    outliers: int = 0  # fixes more probably wrong than not, so far
    rejected: tuple[Rejected, ...] = ()
    innovation: Innovation | None = None  # of the last fix, in the mode most probable then

    @property
    def belief(self) -> Gaussian:
        """The modes' beliefs merged."""
        return imm.merge(self.beliefs, self.weights, ANGLES)


class InteractingFilter:
    """Interacting extended Kalman filters that differ in how fast the current may change (sec. 13), for a `History`.

    Each fix is weighed against being an outlier in each mode, and modes may change right after it. The compass says
    nothing of the modes, which share the heading.

    A filter that takes good fixes for outliers, because it is wrong itself, is set right as `AugmentedFilter` is, by
    fixes that agree against it: by two if it has taken fewer than three, as after a wrong first fix, else by three.

    Args:
        parameters: The vehicle.
        noise: What it believes of its noise, but for the current's; and the biases that it estimates besides.
        currents: Random walk of the current in each mode [m^2/s^3], the slowest first.
        transition: (m, m) probability of changing from mode i (row) to mode j (column), each fix.
        initial: Probabilities of the modes at the first fix (m,).
        outliers: What is believed of fixes that are wrong.
        transponder, initial_surge, integrator, max_substep: See `PlanarModels`.
    """

    def __init__(
        self,
        parameters: PlanarParameters,
        noise: DockingNoise = ROBUST_NOISE,
        *,
        currents: Sequence[float] = (1e-8, 0.02),
        transition: Sequence[Sequence[float]] = ((0.997, 0.003), (0.01, 0.99)),
        initial: Sequence[float] = (0.5, 0.5),
        outliers: Outliers | None = None,
        transponder: tuple[float, float] = (0.0, 0.0),
        initial_surge: float | None = None,
        integrator: Integrator = "midpoint",
        max_substep: float = MAX_SUBSTEP,
    ) -> None:
        self.parameters, self.noise = parameters, noise
        self._transition, self._initial = np.array(transition, dtype=float), np.array(initial, dtype=float)
        m = len(currents)
        rows = np.vstack((self._initial, self._transition)) if self._transition.shape == (m, m) else np.zeros((1, m))
        if self._initial.shape != (m,) or (rows <= 0.0).any() or np.abs(rows.sum(axis=1) - 1.0).max() > 1e-9:
            raise ParameterError(
                f"{m} modes need as many initial probabilities and rows of transition, above 0 and of sum 1 each; not "
                f"{list(initial)} and {[list(row) for row in transition]}"
            )
        self.models = PlanarModels(
            parameters,
            noise,
            transponder=transponder,
            initial_surge=initial_surge,
            integrator=integrator,
            max_substep=max_substep,
        )
        self._currents = np.array(currents, dtype=float)
        self._processes = [self.models.process_with(replace(noise, current=current)) for current in currents]
        self._outliers = outliers or Outliers()

    def start(self, nodes: Sequence[Node[InteractingState]], index: int) -> InteractingState | None:
        """State at the first fix; a second fix at the same node is fused."""
        first = self.models.first(nodes, index)
        if first is None:
            return None
        belief, fix = first
        others = [m for m in nodes[index].measurements if m.kind == USBL and m is not fix]
        state = InteractingState((belief,) * len(self._processes), self._initial)
        return self.correct(state, nodes[index].time, others)

    def predict(self, state: InteractingState, u: Input, duration: float) -> InteractingState:
        """State after `duration` [s]."""
        modes = zip(state.beliefs, self._processes, strict=True)
        return state._replace(beliefs=tuple(ekf.predict(belief, process, u, duration) for belief, process in modes))

    def correct(
        self, state: InteractingState, node_time: float, measurements: Sequence[Measurement]
    ) -> InteractingState:
        """State after the compass samples and fixes of a node."""
        for measurement in measurements:
            if measurement.kind == COMPASS:
                beliefs = tuple(self.models.fuse_heading(belief, measurement) for belief in state.beliefs)
                state = state._replace(beliefs=beliefs)
            elif measurement.kind == USBL:
                state = self._fuse_fix(state, measurement)
        return state

    def process_after(self, state: InteractingState) -> PlanarProcess:
        """For `smoothing`: the merged belief moves on with the modes' mean noise."""
        return self.models.process_with(replace(self.noise, current=float(state.weights @ self._currents)))

    def _fuse_fix(self, state: InteractingState, fix: Measurement) -> InteractingState:
        position = self.models.position
        modes = [outliers.correct(belief, fix, position, self._outliers) for belief in state.beliefs]
        weights = imm.update(state.weights, [mode.log_likelihood for mode in modes])
        innovation = modes[int(weights.argmax())].innovation
        rejected: tuple[Rejected, ...] = ()
        count = state.outliers
        if sum(w * mode.probability for w, mode in zip(weights, modes, strict=True)) > 0.5:
            now = self._rejected(state, fix, modes)
            agreeing = recovery.agreeing(now, state.rejected, self.noise)
            needed = 1 if state.accepted < TRUSTED else 2
            if len(agreeing) >= needed or len(state.rejected) >= recovery.REMEMBERED:
                earlier = agreeing[0] if agreeing else state.rejected[-1]
                recovered = recovery.recover(state.belief, earlier, now, self.noise)
                beliefs = (recovered,) * len(modes)
                return InteractingState(beliefs, self._initial, 2, count - len(agreeing), (), innovation)
            rejected = (*state.rejected, now)
            count += 1
        accepted = state.accepted + (not rejected)
        beliefs, weights = imm.mix([mode.belief for mode in modes], weights, self._transition, ANGLES)
        return InteractingState(beliefs, weights, accepted, count, rejected, innovation)

    def _rejected(self, state: InteractingState, fix: Measurement, modes: Sequence[Doubtful]) -> Rejected:
        """The fix as seen by the modes together, before it was used."""
        residual = np.sum([w * m.innovation.residual for w, m in zip(state.weights, modes, strict=True)], axis=0)
        H = self.models.position.jacobian(state.belief.mean)
        return Rejected(fix.stamp, residual, H, fix.covariance)
