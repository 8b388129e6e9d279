"""The docking filter for currents that may turn: interacting modes, and fixes that may be outliers, in the buffer."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Unpack

import numpy as np

from estimators.core.history import Node
from estimators.core.interacting import InteractingModelFilter, InteractingState
from estimators.core.outliers import Outliers
from estimators.core.types import Array, Gaussian, Measurement, ProcessModel
from estimators.docking.models import ModelOptions, PlanarModels
from estimators.docking.noise import ROBUST_NOISE, DockingNoise
from estimators.docking.recovery import FixRecovery
from estimators.docking.sensors import USBL
from estimators.planar.model import Dynamics

__all__ = ["InteractingFilter", "InteractingState"]


class InteractingFilter(InteractingModelFilter):
    """Interacting extended Kalman filters that differ in how fast the current may change (sec. 13), for a `History`.

    The compass says nothing of the modes, which share the heading.

    Args:
        parameters: The vehicle.
        noise: Noise that it assumes, the current's excepted; and the biases that it estimates besides.
        currents: Random walk of the current in each mode [m^2/s^3], the slowest first.
        switching: (m, m) rates of changing from mode i (row) to mode j (column) [1/s]; the diagonal is not read.
        initial: Probabilities of the modes at the first fix (m,).
        outliers: Model of outliers among the fixes.
        echo: Time for which a false echo may show one place, which is no jump of the vehicle [s].
        doubtful: Allow for a first fix that is an outlier in the covariance at the start.
        gate: Probability with which a measurement of the `aids` that fits is accepted; None accepts all.
        **options: See `PlanarModels`.
    """

    def __init__(
        self,
        parameters: Dynamics,
        noise: DockingNoise = ROBUST_NOISE,
        *,
        currents: Sequence[float] = (1e-8, 0.02),
        switching: Sequence[Sequence[float]] = ((0.0, 6e-4), (2e-3, 0.0)),
        initial: Sequence[float] = (0.5, 0.5),
        outliers: Outliers | None = None,
        echo: float = 0.0,
        doubtful: bool = False,
        gate: float | None = 0.999,
        **options: Unpack[ModelOptions],
    ) -> None:
        self.parameters, self.noise = parameters, noise
        self.models = models = PlanarModels(parameters, noise, **options)
        densities = np.array(currents, dtype=float)

        def blended(weights: Array) -> ProcessModel:
            return models.process_with(replace(noise, current=float(weights @ densities)))

        mixture = outliers or Outliers()

        def start(nodes: Sequence[Node[InteractingState]], index: int) -> tuple[Gaussian, list[Measurement]] | None:
            found = models.start(nodes, index)
            if found is None or not doubtful or all(m.kind != USBL for m in found[1]):
                return found
            covariance = found[0].covariance.copy()
            covariance[:2, :2] += mixture.covariance(2)
            return Gaussian(mean=found[0].mean, covariance=covariance), found[1]

        super().__init__(
            [models.process_with(replace(noise, current=current)) for current in currents],
            models.sensors,
            start,
            switching=switching,
            initial=initial,
            mixtures={USBL: mixture},
            recovery=FixRecovery(noise, echo),
            gates={key if isinstance(key, str) else key[0]: gate for key in models.aids} if gate else {},
            echo=echo,
            blended=blended,
        )
