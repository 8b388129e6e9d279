"""Scenarios by name, from a file or from the default plan: what is pinned stays, the rest is drawn from a seed."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import auvsim
from auvsim.base.errors import InputError
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


def plan_of(path: Path | None, pinned: Mapping, base: Mapping | None = None) -> tuple[dict, dict[str, str]]:
    """The plan that a file and pinned values make of the default plan or of `base`, and where the file gives each key.

    A file with the key `vehicles` is the whole plan: nothing of the default one is added.

    Raises:
        InputError: the file cannot be read.
    """
    given, places = ({}, {}) if path is None else sampling.load_plan(path)
    if "vehicles" in given:
        return controllers.in_full(sampling.merge(given, pinned)), places
    return controllers.layered(sampling.default_plan() if base is None else base, given, pinned), places


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
