"""The docking filter with the current in its state: a Kalman filter whose gate recovers from its own errors."""

from typing import Literal, Unpack

from estimators.core.filter import FilterState, ModelFilter
from estimators.core.recovery import Readmission
from estimators.docking.models import ModelOptions, PlanarModels
from estimators.docking.noise import DockingNoise
from estimators.docking.recovery import FixRecovery
from estimators.docking.sensors import USBL
from estimators.planar.model import Dynamics

__all__ = ["AugmentedFilter", "AugmentedState", "Transform"]

Transform = Literal["extended", "unscented"]
AugmentedState = FilterState  # its belief is of [north, east, psi, u, v, r, c_n, c_e, biases]


class AugmentedFilter(ModelFilter):
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
        parameters: Dynamics,
        noise: DockingNoise | None = None,
        *,
        gate: float | None = 0.999,
        transform: Transform = "extended",
        **options: Unpack[ModelOptions],
    ) -> None:
        self.parameters = parameters
        self.noise = noise or DockingNoise()
        self.models = models = PlanarModels(parameters, self.noise, **options)
        recovery = FixRecovery(self.noise)
        aided = {key if isinstance(key, str) else key[0] for key in models.aids}
        super().__init__(
            models.process, models.sensors, models.start, gates={USBL: gate, **dict.fromkeys(aided, gate)},
            recovery=recovery, recoveries=dict.fromkeys(aided, Readmission()), transform=transform,
        )  # fmt: skip
