"""The distributions that may stand where a value would: drawn with a generator, or taken at a given quantile."""

import math
from collections.abc import Callable
from statistics import NormalDist
from typing import Any, NamedTuple

from numpy.random import Generator

LARGEST = 1e12  # size of a parameter


class Distribution(NamedTuple):
    """How a distribution of given parameters is drawn; both raise ValueError for parameters that make no sense."""

    draw: Callable[[Generator, Any], Any]
    quantile: Callable[[float, Any], Any]  # the value below which a share of it lies


def _numbers(parameters: Any, *names: str) -> list[float]:
    numbers = isinstance(parameters, list | tuple) and all(
        isinstance(number, int | float) and not isinstance(number, bool) and math.isfinite(number)
        for number in parameters
    )
    if not numbers or len(parameters) != len(names):
        count = {2: "two", 4: "four"}[len(names)]
        raise ValueError(f"needs {count} numbers, [{', '.join(names)}]")
    for number in parameters:
        if abs(number) > LARGEST:
            raise ValueError(f"{number:g} is too large; numbers are at most {LARGEST:g} in size")
    return [float(number) for number in parameters]


def _bounds(parameters: Any) -> tuple[float, float]:
    low, high = _numbers(parameters, "low", "high")
    if low > high:
        raise ValueError("low must not exceed high")
    return low, high


def _logarithms(parameters: Any) -> tuple[float, float]:
    low, high = _numbers(parameters, "low", "high")
    if not 0.0 < low <= high:
        raise ValueError("needs 0 < low <= high")
    return math.log(low), math.log(high)


def _mean_and_deviation(parameters: Any) -> tuple[float, float]:
    mean, deviation = _numbers(parameters, "mean", "standard deviation")
    if deviation < 0.0:
        raise ValueError("the standard deviation must not be negative")
    return mean, deviation


def _options(parameters: Any) -> Any:
    if not isinstance(parameters, list | tuple) or not parameters:
        raise ValueError("needs a list of values")
    return parameters


def _between(low: float, high: float, share: float) -> float:
    return low + (high - low) * share


def _normal_quantile(share: float, parameters: Any) -> float:
    mean, deviation = _mean_and_deviation(parameters)
    return mean + deviation * NormalDist().inv_cdf(min(max(share, 1e-16), 1.0 - 1e-16))


def _truncated_quantile(share: float, parameters: Any) -> float:
    mean, deviation, low, high = _numbers(parameters, "mean", "standard deviation", "low", "high")
    if not (deviation > 0.0 and low < high):
        raise ValueError("needs a standard deviation above 0 and low < high")
    normal = NormalDist(mean, deviation)
    below, above = normal.cdf(low), normal.cdf(high)
    if above - below < 1e-6:
        raise ValueError("hardly anything of this normal lies between low and high")
    return min(max(normal.inv_cdf(min(max(_between(below, above, share), 1e-16), 1.0 - 1e-16)), low), high)


DISTRIBUTIONS: dict[str, Distribution] = {
    "uniform": Distribution(
        lambda generator, parameters: float(generator.uniform(*_bounds(parameters))),
        lambda share, parameters: _between(*_bounds(parameters), share),
    ),
    "log_uniform": Distribution(
        lambda generator, parameters: math.exp(generator.uniform(*_logarithms(parameters))),
        lambda share, parameters: math.exp(_between(*_logarithms(parameters), share)),
    ),
    "normal": Distribution(
        lambda generator, parameters: float(generator.normal(*_mean_and_deviation(parameters))), _normal_quantile
    ),
    "truncated_normal": Distribution(
        lambda generator, parameters: _truncated_quantile(generator.random(), parameters), _truncated_quantile
    ),
    "choice": Distribution(
        lambda generator, parameters: _options(parameters)[int(generator.integers(len(parameters)))],
        lambda share, parameters: _options(parameters)[min(int(share * len(parameters)), len(parameters) - 1)],
    ),
}
