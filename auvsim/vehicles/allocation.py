"""The fin map: what each fin does for the effective rudder and elevator, as data of the vehicle."""

from dataclasses import dataclass
from functools import cached_property
from operator import mul

import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import Array


@dataclass(frozen=True, kw_only=True)
class Allocation:
    """Linear map between the effective rudder and elevator and the fin angles.

    A positive rudder turns to starboard, a positive elevator pitches the nose down.
    """

    names: tuple[str, ...]  # fin actuators, in the order of `fins`
    matrix: Array  # (n, 2) fin angle per unit of rudder and of elevator
    limit: float  # largest fin angle [rad]

    def __post_init__(self) -> None:
        if self.matrix.shape != (len(self.names), 2) or np.linalg.matrix_rank(self.matrix) < 2:
            raise InputError(f"the allocation of {len(self.names)} fins must be ({len(self.names)}, 2) of rank 2")

    @cached_property
    def _inverse(self) -> list[list[float]]:
        return np.linalg.pinv(self.matrix).tolist()

    @cached_property
    def _rows(self) -> list[tuple[float, float]]:
        return [tuple(row) for row in self.matrix.tolist()]

    def fins(self, rudder: float, elevator: float) -> list[float]:
        """Fin angles [rad] for an effective rudder and elevator [rad].

        Where a fin would pass its limit all are scaled together, so that the ratio of rudder to elevator is kept.
        """
        angles = [a * rudder + b * elevator for a, b in self._rows]
        excess = max(map(abs, angles)) / self.limit
        return [angle / excess for angle in angles] if excess > 1.0 else angles

    def effective(self, fins: "list[float] | Array") -> tuple[float, float]:
        """Effective rudder and elevator [rad] of measured fin angles [rad] (least squares where fins disagree)."""
        rudder, elevator = (sum(map(mul, row, fins)) for row in self._inverse)
        return float(rudder), float(elevator)
