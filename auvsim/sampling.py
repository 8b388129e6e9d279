"""From a plan, in which values may be distributions, to definite values, given a seed.

A distribution stands where its value would: `range: {uniform: [250, 350]}`. Each draws from a stream of its own, named
by its dotted key, so that pinning one value changes no other.
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from numpy.random import Generator

from auvsim import schema, yaml_text
from auvsim.errors import InputError
from auvsim.randomness import stream
from auvsim.scenario import Scenario

RANDOM = {
    "vehicle": {
        "start": {
            "range": {"uniform": [250.0, 350.0]},
            "bearing_deg": {"uniform": [-60.0, 60.0]},
            "heading_deg": {"uniform": [-180.0, 180.0]},
            "depth": {"uniform": [10.0, 30.0]},
        }
    },
    "dock": {"heading_deg": {"uniform": [-180.0, 180.0]}},
    "current": {
        "kind": "uniform",
        "speed": {"uniform": [0.0, 0.3]},
        "direction_deg": {"uniform": [-180.0, 180.0]},
    },
}


def default_plan() -> dict:
    """The installed plan: every key of a scenario; start, dock heading and current are distributions."""
    return merge(Scenario().model_dump(mode="json"), RANDOM)


def load_plan(path: Path) -> tuple[dict, dict[str, str]]:
    """What a YAML file pins, and where it gives each dotted key; `merge` it onto the default plan.

    Raises:
        InputError: If it cannot be read or is no mapping.
    """
    document = yaml_text.load(path)
    values = {} if document.value is None else document.value
    if not isinstance(values, Mapping):
        raise InputError(f"{path}: a scenario is a mapping of keys to values, such as `duration: 600`")
    return dict(values), {"": str(path), **document.places}


def merge(base: Mapping, override: Mapping) -> dict:
    """`base` with `override` on top, mapping by mapping; a definite value replaces a distribution."""
    if is_distribution(base) or is_distribution(override):
        return dict(override)
    if "kind" in override and override["kind"] != base.get("kind"):
        return dict(override)  # the keys beside a kind are its own
    merged = dict(base)
    for key, value in override.items():
        below = merged.get(key)
        merged[key] = merge(below, value) if isinstance(below, Mapping) and isinstance(value, Mapping) else value
    return merged


def draw(plan: Mapping, seed: int, trial: int = 0, places: Mapping[str, str] | None = None) -> dict:
    """The definite values of one trial of a plan.

    Args:
        plan: Nested values, some of them distributions.
        seed: Seed of all trials of the plan.
        trial: Number of the trial.
        places: Where each dotted key was given, for errors.

    Raises:
        InputError: For a distribution whose parameters make no sense.
    """
    return {key: _draw(value, key, seed, trial, places or {}) for key, value in plan.items()}


def is_distribution(value: Any) -> bool:
    """Whether a value of a plan is a distribution."""
    return isinstance(value, Mapping) and len(value) == 1 and next(iter(value)) in DISTRIBUTIONS


def _draw(value: Any, path: str, seed: int, trial: int, places: Mapping[str, str]) -> Any:
    if is_distribution(value):
        ((name, parameters),) = value.items()
        try:
            drawn = DISTRIBUTIONS[name](stream(seed, trial, f"scenario/{path}"), parameters)
        except ValueError as error:
            place = schema.place(path, places)
            text = f"{path}: {yaml_text.dump(value, flow=True)}: {error}"
            raise InputError(f"{place}: {text}" if place else text) from None
        # What was chosen may hold distributions itself.
        return _draw(drawn, f"{path}.{name}" if is_distribution(drawn) else path, seed, trial, places)
    if isinstance(value, Mapping):
        return {key: _draw(below, f"{path}.{key}", seed, trial, places) for key, below in value.items()}
    if isinstance(value, list | tuple):
        return [_draw(below, f"{path}.{index}", seed, trial, places) for index, below in enumerate(value)]
    return value


def _pair(parameters: Any, names: str) -> tuple[float, float]:
    numbers = isinstance(parameters, list | tuple) and all(
        isinstance(number, int | float) and not isinstance(number, bool) and math.isfinite(number)
        for number in parameters
    )
    if not numbers or len(parameters) != 2:
        raise ValueError(f"needs two numbers, [{names}]")
    return float(parameters[0]), float(parameters[1])


def _uniform(generator: Generator, parameters: Any) -> float:
    low, high = _pair(parameters, "low, high")
    if low > high:
        raise ValueError("low must not exceed high")
    return float(generator.uniform(low, high))


def _log_uniform(generator: Generator, parameters: Any) -> float:
    low, high = _pair(parameters, "low, high")
    if not 0.0 < low <= high:
        raise ValueError("needs 0 < low <= high")
    return math.exp(generator.uniform(math.log(low), math.log(high)))


def _normal(generator: Generator, parameters: Any) -> float:
    mean, deviation = _pair(parameters, "mean, standard deviation")
    if deviation < 0.0:
        raise ValueError("the standard deviation must not be negative")
    return float(generator.normal(mean, deviation))


def _choice(generator: Generator, parameters: Any) -> Any:
    if not isinstance(parameters, list | tuple) or not parameters:
        raise ValueError("needs a list of values")
    return parameters[int(generator.integers(len(parameters)))]


DISTRIBUTIONS: dict[str, Callable[[Generator, Any], Any]] = {
    "uniform": _uniform,
    "log_uniform": _log_uniform,
    "normal": _normal,
    "choice": _choice,
}
