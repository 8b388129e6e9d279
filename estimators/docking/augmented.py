"""The docking filter with the current in its state: a Kalman filter whose gate recovers from its own errors."""

from collections.abc import Sequence
from typing import Literal, NamedTuple, Unpack

from estimators.core import ekf, ukf
from estimators.core.consistency import chi_square
from estimators.core.ekf import Innovation
from estimators.core.errors import ParameterError
from estimators.core.history import Input, Node
from estimators.core.types import Gaussian, Measurement, Verdicts
from estimators.docking import recovery
from estimators.docking.models import COMPASS, OUTLIER, USBL, DockingNoise, ModelOptions, PlanarModels, first_verdicts
from estimators.docking.recovery import Rejected
from estimators.planar.model import PlanarParameters, PlanarProcess

Transform = Literal["extended", "unscented"]
TRANSFORMS = {"extended": ekf, "unscented": ukf}


class AugmentedState(NamedTuple):
    """What a node keeps: the belief of [north, east, psi, u, v, r, c_n, c_e, biases] and what the gate remembers."""

    belief: Gaussian
    outliers: int = 0  # fixes rejected so far
    rejected: tuple[Rejected, ...] = ()
    innovation: Innovation | None = None  # of the last fix
    verdicts: Verdicts = ()  # on this node's measurements, and revised ones


class AugmentedFilter:
    """Planar Kalman filter with the current as a random walk (sec. 12 of the paper), for a `History`.

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

    Fixes far noisier than assumed may never agree; so after four rejected in a row, whatever their age, the next one
    is taken with the last of them.

    Args:
        parameters: The vehicle.
        noise: Noise that it assumes, and the biases that it estimates besides.
        gate: Probability with which a fix that fits is accepted; None accepts all.
        transform: "extended" (EKF) or "unscented" (UKF).
        **options: See `PlanarModels`.
    """

    def __init__(
        self,
        parameters: PlanarParameters,
        noise: DockingNoise | None = None,
        *,
        gate: float | None = 0.999,
        transform: Transform = "extended",
        **options: Unpack[ModelOptions],
    ) -> None:
        if transform not in TRANSFORMS:
            raise ParameterError(f"no transform '{transform}'; there are {', '.join(TRANSFORMS)}")
        self.parameters = parameters
        self.noise = noise or DockingNoise()
        self.models = PlanarModels(parameters, self.noise, **options)
        self._kalman = TRANSFORMS[transform]
        self._gate = gate

    def start(self, nodes: Sequence[Node[AugmentedState]], index: int) -> AugmentedState | None:
        """State at the first fix; a second fix at the same node is fused."""
        first = self.models.first(nodes, index)
        if first is None:
            return None
        belief, fix = first
        others = [m for m in nodes[index].measurements if m.kind == USBL and m is not fix]
        state = self.correct(AugmentedState(belief), nodes[index].time, others)
        return state._replace(verdicts=first_verdicts(nodes[index], fix) + state.verdicts)

    def predict(self, state: AugmentedState, u: Input, duration: float) -> AugmentedState:
        """State after `duration` [s]."""
        belief = self._kalman.predict(state.belief, self.models.process, u, duration)
        return AugmentedState(belief, state.outliers, state.rejected, state.innovation)

    def correct(self, state: AugmentedState, node_time: float, measurements: Sequence[Measurement]) -> AugmentedState:
        """State after the compass samples and fixes of a node."""
        for measurement in measurements:
            if measurement.kind == COMPASS:
                belief, nis = self.models.fuse_heading(state.belief, measurement)
                verdicts = (*state.verdicts, (measurement, "", nis))
                state = AugmentedState(belief, state.outliers, state.rejected, state.innovation, verdicts)
            elif measurement.kind == USBL:
                state = self._fuse_fix(state, measurement)
        return state

    def process_after(self, state: AugmentedState) -> PlanarProcess:
        """For `smoothing`."""
        return self.models.process

    def _fuse_fix(self, state: AugmentedState, fix: Measurement) -> AugmentedState:
        position = self.models.position
        belief, innovation = self._kalman.correct(state.belief, fix, position, self._gate)
        nis = innovation.nis
        accepted = (*state.verdicts, (fix, "", nis))
        if innovation.accepted and (not state.rejected or nis <= chi_square(recovery.PROBABLE, 2)):
            return AugmentedState(belief, state.outliers, (), innovation, accepted)
        now = Rejected(fix, innovation.residual, position.jacobian(state.belief.mean), nis)
        for earlier in recovery.agreeing(now, state.rejected, self.noise)[:1]:
            recovered = recovery.recover(state.belief, earlier, now, self.noise)
            return AugmentedState(recovered, state.outliers - 1, (), innovation, (*accepted, earlier.taken))
        if innovation.accepted:
            return AugmentedState(belief, state.outliers, (), innovation, accepted)
        if len(state.rejected) >= recovery.REMEMBERED:
            earlier = state.rejected[-1]
            recovered = recovery.recover(state.belief, earlier, now, self.noise)
            return AugmentedState(recovered, state.outliers, (), innovation, (*accepted, earlier.taken))
        verdicts = (*state.verdicts, (fix, OUTLIER, nis))
        return AugmentedState(state.belief, state.outliers + 1, (*state.rejected, now), innovation, verdicts)
