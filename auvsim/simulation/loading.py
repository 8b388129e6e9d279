"""Scenarios by name, from a file or from the default plan: what is pinned stays, the rest is drawn from a seed."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import auvsim
from auvsim.base.errors import InputError, unknown_name
from auvsim.simulation import controllers, sampling
from auvsim.simulation.scenario import Scenario, parse

SHIPPED = Path(auvsim.__file__).parent / "scenarios"


def load_scenario(name: str | Path | None = None, *, seed: int = 0, trial: int = 0, **pinned: Any) -> Scenario:
    """A definite scenario.

    `load_scenario(seed=3, current={"kind": "gust", "intensity": 0.1})` is what `auvsim dock --seed 3` runs, in gusts.

    Args:
        name: of a shipped scenario, or a YAML file; None for the default docking plan.
        seed: from which values are drawn that nothing pins.
        trial: number of the trial under that seed.
        **pinned: keys of the scenario, as nested mappings, on top of the file.

    Raises:
        InputError: one line with the file and key at fault, and what would be right.
    """
    plan, places = plan_of(find(str(name)) if name is not None else None, pinned)
    return parse(sampling.draw(plan, seed, trial, places), places)


def plan_of(
    path: Path | None, pinned: Mapping, base: Mapping | None = None, place: str = ""
) -> tuple[dict, dict[str, str]]:
    """The plan that a file and pinned values make of the default plan or of `base`, and where the file gives each key.

    A file with the key `vehicles` is the whole plan: nothing of the default one is added.

    Args:
        path: the file.
        pinned: values on top of it.
        base: what it is given on top of.
        place: where values are pinned, for errors.

    Raises:
        InputError: the file cannot be read, or a pinned value is of a vehicle or structure that there is not.
    """
    given, places = ({}, {}) if path is None else sampling.load_plan(path)
    whole = "vehicles" in given
    for key, text in unknown_names(given if whole else sampling.default_plan() if base is None else base, pinned):
        raise InputError(": ".join(part for part in (place, key, text) if part))
    if whole:
        return controllers.in_full(sampling.merge(given, pinned)), places
    return controllers.layered(sampling.default_plan() if base is None else base, given, pinned), places


def unknown_names(plan: Mapping, pinned: Mapping) -> Iterator[tuple[str, str]]:
    """Pinned vehicles and structures that a plan does not have: dotted key, and what is wrong; a name adds none."""
    for group, what in (("vehicles", "vehicle"), ("structures", "structure")):
        names, known = pinned.get(group), plan.get(group, {})
        if names is None or sampling.is_distribution(names):
            continue
        if "vehicles" not in plan:
            yield (
                group,
                (
                    "the scenario is that of a lone vehicle, whose keys stand without its name, such as "
                    "vehicle.start.depth, dock.depth or estimator.kind"
                ),
            )
        elif isinstance(names, Mapping) and isinstance(known, Mapping) and not sampling.is_distribution(known):
            yield from ((f"{group}.{n}", str(unknown_name(what, str(n), [*known]))) for n in names if n not in known)


def find(name: str) -> Path:
    """The file of a scenario: a YAML file, or a shipped one by name.

    Raises:
        InputError: there is none.
    """
    path = Path(name)
    if path.suffix in (".yaml", ".yml"):
        return path
    shipped = SHIPPED / f"{name}.yaml"
    if not shipped.is_file():
        known = ", ".join(sorted(found.stem for found in SHIPPED.glob("*.yaml"))) or "none"
        raise InputError(f"no scenario '{name}': no .yaml file, and none that is shipped ({known})")
    return shipped
