"""What navigators on a `ModelFilter` share: the views of their delay buffer."""

from collections.abc import Sequence
from typing import Any

from estimators.core.estimator import Estimator
from estimators.core.filter import ModelFilter
from estimators.core.history import Node
from estimators.core.types import Gaussian


class OverHistory:
    """The part of `Buffered` that an `Estimator` of a `ModelFilter` gives, kept in `_estimator`."""

    _estimator: Estimator

    @property
    def nodes(self) -> Sequence[Node[Any]]:
        """Nodes of the delay buffer, in order of time."""
        return self._estimator.nodes

    @property
    def filter(self) -> ModelFilter:
        """The filter whose states the nodes hold."""
        return self._estimator.filter  # pyright: ignore[reportReturnType]

    def smoothed(self) -> list[tuple[float, Gaussian]]:
        """Beliefs of the last seconds given all that was heard since, with their times [s]."""
        return self._estimator.smoothed()
