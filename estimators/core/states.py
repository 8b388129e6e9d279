"""States by name, with units, and which of them are angles."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from estimators.core.errors import ParameterError
from estimators.core.types import Array, Gaussian


@dataclass(frozen=True, slots=True)
class StateSpace:
    """The names of a state vector's elements, in their order."""

    units: Mapping[str, str]  # by name, in order: {"north": "m", "heading": "rad"}
    wrapped: tuple[str, ...] = ()  # those that are angles, kept in (-pi, pi]

    def __post_init__(self) -> None:
        for name in self.wrapped:
            self.index(name)

    @property
    def names(self) -> tuple[str, ...]:
        """The names in order."""
        return tuple(self.units)

    @property
    def angles(self) -> tuple[int, ...]:
        """Places of the angles."""
        return tuple(map(self.index, self.wrapped))

    def __len__(self) -> int:
        return len(self.units)

    def index(self, name: str) -> int:
        """The place of a state.

        Raises:
            ParameterError: There is none of that name.
        """
        if name not in self.units:
            raise ParameterError(f"no state '{name}'; there are {', '.join(self.units)}")
        return self.names.index(name)

    def vector(self, values: Mapping[str, float], default: float = 0.0) -> Array:
        """A vector (n,) of values by name.

        Raises:
            ParameterError: There is no state of a name.
        """
        x = np.full(len(self), default)
        for name, value in values.items():
            x[self.index(name)] = value
        return x

    def belief(self, values: Mapping[str, float], deviations: Mapping[str, float]) -> Gaussian:
        """A known start: values and standard deviations by name; what is not named is zero, and known so."""
        return Gaussian(mean=self.vector(values), covariance=np.diag(self.vector(deviations) ** 2))

    def extended(self, name: str, unit: str) -> "StateSpace":
        """The states with one more at the end."""
        if name in self.units:
            raise ParameterError(f"state '{name}' is there already, in {', '.join(self.units)}")
        return StateSpace({**self.units, name: unit}, self.wrapped)
