"""The plan of a campaign: which trials there are, as a YAML file, and the definite scenario of each."""

import itertools
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError

import auvsim
from auvsim.base import schema, yaml_text
from auvsim.base.errors import InputError
from auvsim.base.settings import Settings
from auvsim.campaign import columns, design
from auvsim.campaign.criterion import Criterion
from auvsim.simulation import controllers, loading, sampling, scenario, short
from auvsim.vehicles import model_files

SHIPPED = Path(auvsim.__file__).parent / "plans"
ALONE = "all"  # name of the only variant of a plan that names none
WITHOUT_EFFECT = {"name", "trials", "stop", "success", "timeout", "keep", "stress"}  # on what a trial comes to
CHECKED = 100  # first trials of each variant that are drawn and checked before anything runs


class Stop(Settings):
    """When to stop before all trials have run."""

    width: float = Field(
        gt=0.0, lt=1.0, description="width of the 95 % interval of each variant's success rate that suffices"
    )
    block: int = Field(default=100, ge=1, le=10_000_000, description="trials of each variant between two looks at it")


class PlanSettings(Settings):
    """A campaign: the same trials with each of several variants of a scenario."""

    name: str = Field(
        default="campaign",
        pattern=r"^[^./\\:\x00-\x1f][^/\\:\x00-\x1f]{0,99}$",
        description="what the report and its folder in out/ call it; a name, not a path",
    )
    seed: int = Field(default=0, ge=0, lt=2**63, description="seed of every random number of every trial")
    trials: int = Field(
        default=100, ge=1, le=10_000_000, description="trials of each variant; at most, if there is a `stop`"
    )
    stop: Stop | None = Field(default=None, description="when to stop earlier")
    success: Criterion | None = Field(
        default=None,
        description="column that says it, or {metric, below or above}; by default docked or finished of the mission",
    )
    sampling: design.Sampling = Field(
        default="independent", description="how trials are drawn: independent, latin_hypercube or sobol"
    )
    base: dict[str, Any] = Field(
        default={}, description="what is not as in the default scenario, or the file that says so"
    )
    grid: dict[str, list[Any]] = Field(
        default={}, description="values of dotted keys; the trials take all their combinations in turn"
    )
    variants: dict[str, dict[str, Any]] = Field(
        default={ALONE: {}}, description="what each variant pins; all see the same draws and noises"
    )
    timeout: float = Field(default=600.0, gt=0.0, description="after which a trial counts as hung, wall-clock time [s]")
    keep: Literal["none", "failures", "all"] = Field(default="none", description="of which trials the logs are kept")
    stress: dict[str, Any] | None = Field(default=None, description="what `auvsim stress` looks for; else of no effect")


@dataclass(frozen=True)
class Plan:
    """A plan that was read and checked."""

    settings: PlanSettings  # `base` is whole: every key of a short scenario, or a scenario in full
    places: Mapping[str, str] = field(default_factory=dict, compare=False)  # where each dotted key was given
    kinds: tuple[str, ...] = ("docking",)  # of the missions
    fleet: bool = False  # whether there are several vehicles

    @cached_property
    def variants(self) -> tuple[str, ...]:
        """Names of the variants, in order; the first is what the others are compared with."""
        return tuple(self.settings.variants)

    @cached_property
    def cells(self) -> list[dict]:
        """What each point of the grid pins."""
        grid = self.settings.grid
        return [
            _nested(dict(zip(grid, values, strict=True))) for values in itertools.product(*grid.values())
        ]  # of no key: one empty point

    @cached_property
    def drawn(self) -> tuple[str, ...]:
        """Dotted keys whose values differ from trial to trial."""
        of_grid = [key for name, values in self.settings.grid.items() for key in _varied_values(name, values)]
        of_plans = [key for name in self.variants for key in sampling.varied(self._distributed(name, 0))]
        return tuple(dict.fromkeys([*of_grid, *of_plans]))

    @cached_property
    def compared(self) -> tuple[str, ...]:
        """Dotted keys that a variant pins, and that are not drawn."""
        pinned = [key for pins in self.settings.variants.values() for key in sampling.varied(pins, chosen=True)]
        return tuple(key for key in dict.fromkeys(pinned) if key and key not in self.drawn)

    @cached_property
    def layout(self) -> columns.Layout:
        """The columns of its table."""
        return columns.layout(self.kinds, self.fleet, self.settings.success)

    @cached_property
    def strata(self) -> int:
        """Trials that are stratified together."""
        return self.settings.stop.block if self.settings.stop else self.settings.trials

    @cached_property
    def distributions(self) -> tuple[str, ...]:
        """Keys of all distributions of any variant and point of the grid, sorted."""
        found = {
            key
            for name in self.variants
            for cell in range(len(self.cells))
            for key, _ in sampling.distributions(self._distributed(name, cell))
        }
        return tuple(sorted(found))

    def values(self, variant: str, trial: int) -> dict:
        """The definite values of a trial of a variant: with independent draws those of `auvsim dock` with its pins."""
        s = self.settings
        quantiles = design.quantiles(s.sampling, s.seed, trial, self.distributions, self.strata)
        return sampling.draw(self._distributed(variant, trial), s.seed, trial, self._places(variant), quantiles)

    def identity(self) -> dict:
        """What makes its trials what they are; a campaign goes on only with a plan of the same."""
        values = self.settings.model_dump(mode="json", exclude=WITHOUT_EFFECT)
        return values | ({"strata": self.strata} if self.settings.sampling == "latin_hypercube" else {})

    def to_yaml(self) -> str:
        """The plan as YAML text, whole, from which `load` makes the same."""
        return yaml_text.dump(self.settings.model_dump(mode="json"))

    def _distributed(self, variant: str, trial: int) -> dict:
        cell = self.cells[trial % len(self.cells)]
        return controllers.layered(self.settings.base, cell, self.settings.variants[variant])

    def _places(self, variant: str) -> dict[str, str]:
        """Where each key of the scenario was given that a variant runs."""
        found = {"": self.places.get("", "")} if "" in self.places else {}
        for prefix in ("base.", "grid.", f"variants.{variant}."):
            found |= {k.removeprefix(prefix): place for k, place in self.places.items() if k.startswith(prefix)}
        return found


def load(name: str) -> Plan:
    """Reads and checks a plan: a YAML file, the folder of a campaign, or the name of a shipped plan.

    Raises:
        InputError: One line with what is wrong and where.
    """
    path = Path(name)
    if path.is_dir():
        path = path / "plan.yaml"
    elif path.suffix not in (".yaml", ".yml"):
        path = SHIPPED / f"{name}.yaml"
        if not path.is_file():
            shipped = ", ".join(sorted(known.stem for known in SHIPPED.glob("*.yaml")))
            raise InputError(
                f"no plan '{name}': no .yaml file, no folder of a campaign, none that is shipped ({shipped})"
            )
    document = yaml_text.load(path)
    if not isinstance(document.value, Mapping):
        raise InputError(f"{path}: a plan is a mapping of keys to values, such as `trials: 200`")
    places = {"": str(path), **document.places}
    values = {"name": path.stem, **document.value}
    if isinstance(values.get("base"), str):
        values["base"], of_base = sampling.load_plan(path.parent / values["base"])
        places |= {f"base.{key}": place for key, place in of_base.items() if key}
    return parse(values, places)


def parse(values: Mapping, places: Mapping[str, str] | None = None) -> Plan:
    """The plan of nested values, checked as far as that goes without running anything.

    Raises:
        InputError: One line with what is wrong and where.
    """
    places = places or {}
    try:
        settings = PlanSettings.model_validate_json(json.dumps(values, default=str), strict=True)
    except ValidationError as error:
        raise schema.explain(error, PlanSettings, values, places) from None
    settings = _renewed(settings)
    _check_names(settings, places)
    if "vehicles" not in settings.base:  # the short form, of which a file gives only what is to differ
        whole = controllers.layered(_default(settings.base), settings.base)
    else:
        whole = controllers.in_full(settings.base)
    settings = settings.model_copy(update={"base": whole})
    plan = Plan(settings, places)
    _check_counts(plan)
    return _checked(plan)


def _default(base: Mapping) -> dict:
    """What a short scenario is given on top of: that of `auvsim manoeuvre` for one, else that of `auvsim dock`."""
    manoeuvre = base.get("manoeuvre")
    kind = manoeuvre.get("kind") if isinstance(manoeuvre, Mapping) else None
    return sampling.manoeuvre_plan(kind) if isinstance(kind, str) else sampling.default_plan()


def missions(values: Mapping) -> dict[str, str]:
    """The kind of each vehicle's mission, by the vehicle's name, from the definite values of a scenario.

    Raises:
        InputError: There is no such vehicle.
    """
    if "vehicles" in values:
        return {
            name: (vehicle.get("mission") or {}).get("kind", "docking") for name, vehicle in values["vehicles"].items()
        }
    given = "docking" if values.get("manoeuvre") is None else "manoeuvre"
    kind = given if values.get("mission") is None else values["mission"].get("kind", "docking")
    return {model_files.model_name("vehicle", values["vehicle"]["model"]): kind}


def _renewed(settings: PlanSettings) -> PlanSettings:
    """Today's keys for those of earlier plans."""
    old, new = "estimator.factory", "estimator.kind"
    grid = {new if key == old else key: values for key, values in settings.grid.items()}
    variants = {name: short.renewed(pins) for name, pins in settings.variants.items()}
    return settings.model_copy(update={"grid": grid, "variants": variants})


def _check_names(settings: PlanSettings, places: Mapping[str, str]) -> None:
    for name in settings.variants:
        if not re.fullmatch(r"[\w+-][\w.+-]*", name, re.ASCII):
            raise _wrong(f"variants.{name}", "a name is made of letters, digits and . _ + -, without spaces", places)
        for key, text in loading.unknown_names(settings.base, settings.variants[name]):
            raise _wrong(f"variants.{name}.{key}", text, places)
    if not settings.variants:
        raise _wrong("variants", "none; leave the key out for a campaign of the base scenario alone", places)
    for key, options in settings.grid.items():
        if not options:
            raise _wrong(f"grid.{key}", "no values; give some, or leave the key out", places)
        if any(other != key and _overlap(key, other) for other in settings.grid):
            raise _wrong(f"grid.{key}", "another key of the grid is above or below it", places)
        for wrong, text in loading.unknown_names(settings.base, _nested({key: options[0]})):
            raise _wrong(f"grid.{wrong}", text, {**places, f"grid.{wrong}": schema.place(f"grid.{key}", places)})
        for name, pins in settings.variants.items():
            below = [*sampling.varied(pins, chosen=True)]
            if any(_overlap(key, other) for other in below):
                raise _wrong(f"grid.{key}", f"variant '{name}' pins it too; it would undo the grid", places)


def _check_counts(plan: Plan) -> None:
    """A grid is balanced only in whole rounds."""
    s, points = plan.settings, len(plan.cells)
    counts = {"trials": s.trials} | ({"stop.block": s.stop.block} if s.stop else {})
    for key, count in counts.items():
        if count % points:
            fitting = " or ".join(str(points * n) for n in (count // points, count // points + 1) if n)
            raise _wrong(key, f"{count} is no multiple of the {points} points of the grid; use {fitting}", plan.places)


def _checked(plan: Plan) -> Plan:
    """The plan with its missions, of which the first trials make sense."""
    found: dict[str, None] = {}
    fleet = False
    for variant in plan.variants:
        places = plan._places(variant)
        for cell in range(len(plan.cells)):
            sampling.check(plan._distributed(variant, cell), places)
        for trial in range(min(plan.settings.trials, max(len(plan.cells), CHECKED))):
            values = plan.values(variant, trial)
            scenario.parse(values, places)
            kinds = missions(values)
            found |= dict.fromkeys(kinds.values())
            fleet = fleet or len(kinds) > 1
    plan = replace(plan, kinds=tuple(found), fleet=fleet)
    try:
        plan.layout  # noqa: B018 (whether there is one)
    except InputError as error:
        where = schema.place("success" if str(error).startswith("success") else "", plan.places)
        raise InputError(f"{where}: {error}" if where else str(error)) from None
    return plan


def _wrong(key: str, text: str, places: Mapping[str, str]) -> InputError:
    return InputError(": ".join(part for part in (schema.place(key, places), key, text) if part))


def _overlap(a: str, b: str) -> bool:
    return a == b or a.startswith(f"{b}.") or b.startswith(f"{a}.")


def _nested(values: Mapping[str, Any]) -> dict:
    """Nested values of dotted keys."""
    result: dict = {}
    for key, value in values.items():
        *above, last = key.split(".")
        below = result
        for part in above:
            below = below.setdefault(part, {})
        below[last] = value
    return result


def _varied_values(key: str, values: list) -> Iterator[str]:
    """The dotted keys of the values of a grid."""
    return sampling.varied({"choice": values}, key)
