"""The scenario of a command line: the default plan, a YAML file on top, keys given as options on top of that."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_type_hints

from auvsim.base import schema, yaml_text
from auvsim.base.errors import DOTTED, InputError
from auvsim.simulation import loading, sampling, short
from auvsim.simulation.scenario import Scenario, parse
from auvsim.simulation.scenario_settings import Start
from auvsim.simulation.sensor_settings import SensorSettings
from auvsim.simulation.short import ShortScenario

PLACE = "command line"


def split(arguments: list[str], command: type) -> tuple[list[str], dict]:
    """Separates the command's own arguments from the keys of the scenario, which become nested values.

    `--current.speed 0.2` and `--current.speed=0.2` are keys; the value is YAML. Hyphens stand for underscores.

    Raises:
        InputError: For an option that is neither, a key without a value, or values that exclude each other.
    """
    own = {name: kind is not bool for name, kind in get_type_hints(command).items()}  # name: whether it takes a value
    rest: list[str] = []
    values: dict = {}
    tokens = iter(arguments)
    for token in tokens:
        if not token.startswith("--"):
            rest.append(token)
            continue
        name, equals, text = token[2:].partition("=")
        key = name.replace("-", "_")
        if key.removeprefix("no_") in own:
            rest.append(token)
            if own.get(key) and not equals and (value := next(tokens, None)) is not None:
                rest.append(value)
            continue
        _check(key, name, list(own))
        if not equals:
            text = next(tokens, "")
        if not text or (not equals and text.startswith("--")):
            raise InputError(f"{PLACE}: --{name} needs a value, such as --{name} 1.0")
        _put(values, key, yaml_text.read(text, f"--{name}").value)
    return rest, values


def scenario(
    path: Path | None, estimator: str | None, values: Mapping, seed: int, trial: int, base: Mapping | None = None
) -> Scenario:
    """The definite scenario of one run: what a file and options pin on top of the default plan or of `base`.

    A file with the key `vehicles` says all there is: nothing of the default plan comes in.

    Raises:
        InputError: One line with the file and line, or the option, at fault.
    """
    plan, places = _plan(path, values, estimator, base)
    return parse(sampling.draw(plan, seed, trial, places), places)


@contextmanager
def located(path: Path | None, values: Mapping, estimator: str | None = None) -> Iterator[None]:
    """Says of an InputError that begins with a dotted key where that key was given.

    Args:
        path: file of the scenario.
        values: keys given as options.
        estimator: kind that an option of its own gives.
    """
    try:
        yield
    except InputError as error:
        found = DOTTED.match(str(error))
        if found is None or found.group(1).split(".")[0] not in Scenario.model_fields:
            raise
        plan, places = _plan(path, values, estimator)
        key = found.group(1)
        if "vehicles" not in plan:
            key = short.short_key(key, plan.get("mission") is None)
        where = schema.place(key, places)
        raise InputError(": ".join(part for part in (where, key, str(error)[found.end() :]) if part)) from error


def scenario_text(path: Path | None, default: bool, values: Mapping) -> str:
    """The plan that a file and options make of the default one, checked, as commented YAML.

    Raises:
        InputError: If it cannot be used, or `default` comes with either.
    """
    if default and (path or values):
        raise InputError("scenario --default: takes no file and no keys; leave --default out to see what they make")
    plan, places = _plan(path, values, None)
    parse(sampling.draw(plan, 0, 0, places), places)
    return schema.commented(Scenario if "vehicles" in plan else ShortScenario, plan)


def _plan(
    path: Path | None, values: Mapping, estimator: str | None, base: Mapping | None = None
) -> tuple[dict, dict[str, str]]:
    if estimator is not None:
        values = sampling.merge({"estimator": {"kind": estimator}}, values)
    plan, places = loading.plan_of(path, values, base, PLACE)
    if "vehicles" in plan and "estimator" in values:
        raise InputError(f"{PLACE}: the scenario names its vehicles; give --vehicles.NAME.estimator.kind")
    return plan, {**places, **dict.fromkeys(_paths(values), PLACE)}


def _check(key: str, name: str, own: list[str]) -> None:
    """Refuses an option that is no key of the scenario."""
    known = [*dict.fromkeys([*schema.keys(ShortScenario), *(f"start.{key}" for key in schema.keys(Start))])]
    if key in ("start", "estimator.factory") or _is_key(key, known) or _is_key(key, list(schema.keys(Scenario))):
        return
    siblings = [other for other in known if other.count(".") == key.count(".")]
    near = get_close_matches(key, [*own, *siblings], n=1)
    hint = f"did you mean --{near[0]}?" if near else schema.suggestion(key, ShortScenario, [])
    raise InputError(f"{PLACE}: no option or scenario key --{name}; {hint}")


def _is_key(key: str, known: list[str]) -> bool:
    """Whether a dotted key is known, or above a known one, or below one that holds a value.

    Below a value may stand a distribution or what a mapping of free form holds: `parse` judges those, and so it does
    with sensors under names of the user's own.
    """
    parts = key.split(".")
    for other in known:
        pattern = other.split(".")
        is_leaf = not any(below.startswith(f"{other}.") for below in known)
        if (len(parts) <= len(pattern) or is_leaf) and all(b in ("*", a) for a, b in zip(parts, pattern, strict=False)):
            return True
    return "sensors" in parts and len(parts) >= parts.index("sensors") + 3 and _names_a_sensor(parts)


def _names_a_sensor(parts: list[str]) -> bool:
    """Whether a key is of a sensor that has a name of the user's own."""
    return parts[parts.index("sensors") + 1] not in SensorSettings.model_fields


def _put(values: dict, key: str, value: Any) -> None:
    *above, last = key.split(".")
    for part in above:
        values = values.setdefault(part, {})
        if not isinstance(values, dict):
            raise InputError(f"{PLACE}: --{key} contradicts the value given to a key above it")
    if isinstance(value, dict) and isinstance(values.get(last), dict):
        value = sampling.merge(values[last], value, last)
    values[last] = value


def _paths(values: Mapping, prefix: str = "") -> list[str]:
    """The dotted keys of nested values."""
    return [
        path
        for key, value in values.items()
        for path in (f"{prefix}{key}", *(_paths(value, f"{prefix}{key}.") if isinstance(value, Mapping) else ()))
    ]
