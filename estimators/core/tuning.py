"""Noise of sensors re-estimated from what a filter says of them, for any model (Mehra 1970)."""

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from estimators.core.consistency import chi_square
from estimators.core.errors import ParameterError
from estimators.core.types import Outcome

Source = tuple[str, str]  # kind, source


def scales(
    outcomes: Iterable[Outcome], sizes: Mapping[str, int] | None = None, robust: bool = True
) -> dict[Source, float]:
    """Innovations of each source relative to those that the filter predicts: 1 if it is consistent.

    Args:
        outcomes: Of a run; of several outcomes of one measurement the last counts.
        sizes: Components of the kinds that are not scalar.
        robust: By the median of the NIS, which outliers do not move; else by its mean over those accepted.
    """
    last = {(o.kind, o.source, o.stamp, o.sequence): o for o in outcomes if np.isfinite(o.nis)}
    groups: dict[Source, list[Outcome]] = {}
    for found in last.values():
        groups.setdefault((found.kind, found.source), []).append(found)
    result = {}
    for source, group in groups.items():
        size = (sizes or {}).get(source[0], 1)
        if robust:
            result[source] = float(np.median([o.nis for o in group])) / chi_square(0.5, size)
        elif accepted := [o.nis for o in group if o.accepted]:
            result[source] = float(np.mean(accepted)) / size
    return result


def variances(
    run: Callable[[Mapping[Source, float]], Iterable[Outcome]],
    initial: Mapping[Source, float],
    sizes: Mapping[str, int] | None = None,
    *,
    iterations: int = 20,
    tolerance: float = 0.02,
) -> dict[Source, float]:
    """Variances of sources' noise for which a filter's innovations are as large as it says.

    Each round runs the filter and scales each source's variance by the square of how far its NIS is off, so that
    sources whose innovations are mostly the prediction's error are found too.

    Args:
        run: Filters a log with given variances, by (kind, source); returns its outcomes.
        initial: Variances to start from.
        sizes: See `scales`.
        iterations: At most.
        tolerance: Largest relative change of a variance at the end.

    Raises:
        ParameterError: A source of `initial` has no innovations, or the variances do not settle.
    """
    found = dict(initial)
    for _ in range(iterations):
        factors = scales(run(found), sizes)
        missing = [source for source in found if source not in factors]
        if missing:
            raise ParameterError(f"no innovations of {missing[0]}; there are {', '.join(map(str, factors))}")
        found = {source: variance * factors[source] for source, variance in found.items()}
        if max(abs(factors[source] - 1.0) for source in found) < tolerance:
            return found
    raise ParameterError(f"variances have not settled after {iterations} rounds: {found}")
