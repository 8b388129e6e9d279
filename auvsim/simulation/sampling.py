"""Draws definite values from a plan, in which values may be distributions, given a seed.

A distribution stands where its value would: `range: {uniform: [250, 350]}`. Each draws from a stream of its own, named
by its dotted key, so that pinning one value changes no other.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from auvsim.base import schema, yaml_text
from auvsim.base.errors import InputError
from auvsim.base.randomness import stream
from auvsim.simulation import short
from auvsim.simulation.distributions import DISTRIBUTIONS, Distribution

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

# A manoeuvre starts far from the dock, ahead away from it and at another depth; only the current is drawn.
MANOEUVRE = {
    "vehicle": {
        "start": {"range": 300.0, "bearing_deg": 0.0, "heading_deg": 0.0, "depth": 10.0, "speed": 1.5},
    },
    "dock": {"heading_deg": 180.0},
    "sensors": {"dvl": {"enabled": True}, "gyro": {"enabled": True}},
}
# With a single speed, thrust, drag and loss of thrust could not be identified separately.
SPEEDS = {"multisine": (1.5, 1.0, 1.8, 1.2)}  # [m/s]


def default_plan() -> dict:
    """The installed plan: every key of a scenario; start, dock heading and current are distributions."""
    return merge(short.ShortScenario().model_dump(mode="json"), RANDOM)


def manoeuvre_plan(kind: str) -> dict:
    """The installed plan of a manoeuvre: the default one, far from the dock and with DVL and gyro."""
    speeds = {"speed_steps": SPEEDS[kind]} if kind in SPEEDS else {}
    return merge(default_plan(), {**MANOEUVRE, "manoeuvre": {"kind": kind, **speeds}})


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


def merge(base: Mapping, override: Mapping, key: str = "") -> dict:
    """`base` with `override` on top, mapping by mapping; a definite value replaces a distribution.

    The keys beside a `kind` are its own: another kind leaves them behind, but those of an estimator that it shares.
    """
    if key == "":  # the whole scenario, which is no distribution whatever its keys are called
        base, override = short.renewed(base), short.renewed(override)
    elif is_distribution(base) or is_distribution(override):
        return dict(override)
    if "kind" in override and override["kind"] != base.get("kind"):
        shared = short.estimator_keys(str(override["kind"])) - {"kind"} if key == "estimator" else set()
        return {name: value for name, value in base.items() if name in shared} | dict(override)
    merged = dict(base)
    for name, value in override.items():
        below = merged.get(name)
        both = isinstance(below, Mapping) and isinstance(value, Mapping)
        merged[name] = merge(below, value, name) if both else value  # pyright: ignore[reportArgumentType]
    return merged


def draw(
    plan: Mapping,
    seed: int,
    trial: int = 0,
    places: Mapping[str, str] | None = None,
    quantiles: Mapping[str, float] | None = None,
) -> dict:
    """The definite values of one trial of a plan.

    Args:
        plan: Nested values, some of them distributions.
        seed: Seed of all trials of the plan.
        trial: Number of the trial.
        places: Where each dotted key was given, for errors.
        quantiles: Between 0 and 1, for distributions (see `distributions`) that are not to draw on their own: the
            value below which this share of the distribution lies.

    Raises:
        InputError: For a distribution whose parameters make no sense.
    """
    known = quantiles or {}

    def value(path: str, distribution: Distribution, parameters: Any) -> Any:
        if path in known:
            return distribution.quantile(known[path], parameters)
        return distribution.draw(stream(seed, trial, f"scenario/{path}"), parameters)

    return {key: _definite(below, key, value, places or {}) for key, below in plan.items()}


def is_distribution(value: Any) -> bool:
    """Whether a value of a plan is a distribution."""
    return isinstance(value, Mapping) and len(value) == 1 and next(iter(value)) in DISTRIBUTIONS


def distributions(value: Any, path: str = "") -> Iterator[tuple[str, Mapping]]:
    """Every distribution of a plan, those inside choices included, by the dotted key of its stream; some keys twice."""
    if is_distribution(value):
        yield path, value
        ((name, options),) = value.items()
        if name == "choice" and isinstance(options, list | tuple):
            for option in options:
                yield from distributions(option, f"{path}.{name}" if is_distribution(option) else path)
        return
    for key, below in _items(value):
        yield from distributions(below, f"{path}.{key}" if path else str(key))


def varied(value: Any, path: str = "", chosen: bool = False) -> Iterator[str]:
    """The dotted keys of a plan whose values differ from trial to trial; with `chosen` all keys that hold a value."""
    if is_distribution(value):
        ((name, options),) = value.items()
        for option in options if name == "choice" else [None]:
            yield from varied(option, path, True)
        return
    items = list(_items(value))
    if chosen and (not items or isinstance(value, list | tuple)):
        yield path
        return
    for key, below in items:
        yield from varied(below, f"{path}.{key}" if path else str(key), chosen)


def check(plan: Mapping, places: Mapping[str, str] | None = None) -> None:
    """Checks every distribution of a plan, also those that are seldom chosen.

    Raises:
        InputError: For one whose parameters do not.
    """
    for path, value in distributions(plan):
        _definite(value, path, lambda _, distribution, parameters: distribution.quantile(0.5, parameters), places or {})


def _definite(value: Any, path: str, draw: Callable[[str, Distribution, Any], Any], places: Mapping[str, str]) -> Any:
    if is_distribution(value):
        ((name, parameters),) = value.items()
        try:
            drawn = draw(path, DISTRIBUTIONS[name], parameters)
        except ValueError as error:
            place = schema.place(path, places)
            text = f"{path}: {yaml_text.dump(value, flow=True)}: {error}"
            raise InputError(f"{place}: {text}" if place else text) from None
        # What was chosen may hold distributions itself.
        return _definite(drawn, f"{path}.{name}" if is_distribution(drawn) else path, draw, places)
    if isinstance(value, Mapping):
        return {key: _definite(below, f"{path}.{key}", draw, places) for key, below in value.items()}
    if isinstance(value, list | tuple):
        return [_definite(below, f"{path}.{index}", draw, places) for index, below in enumerate(value)]
    return value


def _items(value: Any) -> Iterator[tuple[Any, Any]]:
    if isinstance(value, Mapping):
        yield from value.items()
    elif isinstance(value, list | tuple):
        yield from enumerate(value)
