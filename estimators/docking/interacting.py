"""The docking filter for currents that may turn: interacting modes, and fixes that may be outliers, in the buffer."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Unpack

import numpy as np

from estimators.core import ekf, imm, loops, outliers
from estimators.core.consistency import chi_square
from estimators.core.ekf import Innovation
from estimators.core.errors import ParameterError
from estimators.core.history import Input, Node
from estimators.core.outliers import MixtureUpdate, Outliers
from estimators.core.types import Array, Gaussian, Measurement, Verdicts
from estimators.docking import recovery
from estimators.docking.models import (
    COMPASS,
    OUTLIER,
    ROBUST_NOISE,
    USBL,
    DockingNoise,
    ModelOptions,
    PlanarModels,
    first_verdicts,
)
from estimators.docking.recovery import Rejected
from estimators.planar.model import PlanarParameters, PlanarProcess

ANGLES = (2,)  # the heading
SHORTEST = 0.1  # time between fixes that counts at least, so that no mode ever dies out [s]
MIN_ACCEPTED = 3  # fixes accepted before two fixes that agree with each other no longer suffice to correct the filter


class InteractingState(NamedTuple):
    """What a node keeps: each mode's belief and probability, and what is remembered of fixes."""

    beliefs: tuple[Gaussian, ...]
    weights: Array  # (m,) probabilities of the modes
    last_fix: float  # stamp of the last fix [s]
    accepted: int = 1  # fixes taken so far
    outliers: int = 0  # fixes more probably wrong than not, so far
    rejected: tuple[Rejected, ...] = ()
    innovation: Innovation | None = None  # of the last fix, in the mode most probable then
    verdicts: Verdicts = ()  # on this node's measurements, and revised ones

    @property
    def belief(self) -> Gaussian:
        """The modes' beliefs merged."""
        return imm.merge(self.beliefs, self.weights, ANGLES)


class InteractingFilter:
    """Interacting extended Kalman filters that differ in how fast the current may change (sec. 13), for a `History`.

    In each mode a fix is weighted by its probability of being no outlier. Modes switch at constant rates, however often
    fixes come: right after a fix, by what the time since the fix before it allows. The compass says nothing of the
    modes, which share the heading.

    A filter that takes good fixes for outliers, because it is wrong itself, recovers as `AugmentedFilter` does, by
    fixes that agree with each other: two if it has accepted fewer than three, as after a wrong first fix, else three.

    Args:
        parameters: The vehicle.
        noise: Noise that it assumes, the current's excepted; and the biases that it estimates besides.
        currents: Random walk of the current in each mode [m^2/s^3], the slowest first.
        switching: (m, m) rates of changing from mode i (row) to mode j (column) [1/s]; the diagonal is not read.
        initial: Probabilities of the modes at the first fix (m,).
        outliers: Model of outliers among the fixes.
        **options: See `PlanarModels`.
    """

    def __init__(
        self,
        parameters: PlanarParameters,
        noise: DockingNoise = ROBUST_NOISE,
        *,
        currents: Sequence[float] = (1e-8, 0.02),
        switching: Sequence[Sequence[float]] = ((0.0, 6e-4), (2e-3, 0.0)),
        initial: Sequence[float] = (0.5, 0.5),
        outliers: Outliers | None = None,
        **options: Unpack[ModelOptions],
    ) -> None:
        self.parameters, self.noise = parameters, noise
        rates, self._initial = np.array(switching, dtype=float), np.array(initial, dtype=float)
        self._generator = _generator(rates, len(currents))
        shaped = self._initial.shape == (len(currents),) and (self._initial > 0.0).all()
        if not (shaped and abs(self._initial.sum() - 1.0) < 1e-9):
            raise ParameterError(f"initial {list(initial)} must be {len(currents)} probabilities above 0 of sum 1")
        self.models = PlanarModels(parameters, noise, **options)
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
        state = InteractingState((belief,) * len(self._processes), self._initial, fix.stamp)
        state = self.correct(state, nodes[index].time, others)
        return state._replace(verdicts=first_verdicts(nodes[index], fix) + state.verdicts)

    def predict(self, state: InteractingState, u: Input, duration: float) -> InteractingState:
        """State after `duration` [s]."""
        modes = zip(state.beliefs, self._processes, strict=True)
        beliefs = tuple(ekf.predict(belief, process, u, duration) for belief, process in modes)
        return state._replace(beliefs=beliefs, verdicts=())

    def correct(
        self, state: InteractingState, node_time: float, measurements: Sequence[Measurement]
    ) -> InteractingState:
        """State after the compass samples and fixes of a node."""
        for measurement in measurements:
            if measurement.kind == COMPASS:
                beliefs, squares = zip(*(self.models.fuse_heading(b, measurement) for b in state.beliefs), strict=True)
                verdict = measurement, "", squares[int(state.weights.argmax())]
                state = state._replace(beliefs=beliefs, verdicts=(*state.verdicts, verdict))
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
        is_wrong = bool(sum(w * mode.probability for w, mode in zip(weights, modes, strict=True)) > 0.5)
        # A fix that the filter would take, but only just, may as well confirm one that it did not take.
        if is_wrong or (state.rejected and innovation.nis > chi_square(recovery.PROBABLE, 2)):
            now = self._rejected(state, fix, modes, innovation.nis)
            agreeing = recovery.agreeing(now, state.rejected, self.noise)
            needed = 1 if state.accepted < MIN_ACCEPTED else 2
            if len(agreeing) >= needed or (is_wrong and len(state.rejected) >= recovery.REMEMBERED):
                earlier = agreeing[0] if agreeing else state.rejected[-1]
                recovered = recovery.recover(state.belief, earlier, now, self.noise)
                beliefs = (recovered,) * len(modes)
                taken = [rejected.taken for rejected in agreeing or (earlier,)]
                verdicts = (*state.verdicts, (fix, "", innovation.nis), *taken)
                count -= len(agreeing)
                return InteractingState(beliefs, self._initial, fix.stamp, 2, count, (), innovation, verdicts)
            rejected = (*state.rejected, now) if is_wrong else ()
            count += is_wrong
        accepted = state.accepted + (not rejected)
        transition = loops.transition(self._generator, max(SHORTEST, fix.stamp - state.last_fix))
        beliefs, weights = imm.mix([mode.belief for mode in modes], weights, transition, ANGLES)
        verdicts = (*state.verdicts, (fix, OUTLIER if is_wrong else "", innovation.nis))
        return InteractingState(beliefs, weights, fix.stamp, accepted, count, rejected, innovation, verdicts)

    def _rejected(
        self, state: InteractingState, fix: Measurement, modes: Sequence[MixtureUpdate], nis: float
    ) -> Rejected:
        """The fix as seen by the modes together, before it was used."""
        residual = np.sum([w * m.innovation.residual for w, m in zip(state.weights, modes, strict=True)], axis=0)
        H = self.models.position.jacobian(state.belief.mean)
        return Rejected(fix, residual, H, nis)


def _generator(rates: Array, modes: int) -> Array:
    """Rates of a Markov chain (m, m) with the diagonal that makes its rows sum to zero.

    Raises:
        ParameterError: They are not rates between that many modes, or leave a mode that is never reached.
    """
    Q = rates.copy() if rates.shape == (modes, modes) else np.full((modes, modes), -1.0)
    np.fill_diagonal(Q, 0.0)
    # Every mode leads to every other, at once or through others.
    if (Q < 0.0).any() or not (np.linalg.matrix_power(np.eye(modes) + (Q > 0.0), modes) > 0.0).all():
        raise ParameterError(
            f"{modes} modes need a row and a column of switching rates each, none below 0, that lead from every mode "
            f"to every other; not {rates.tolist()}"
        )
    np.fill_diagonal(Q, -Q.sum(axis=1))
    return Q
