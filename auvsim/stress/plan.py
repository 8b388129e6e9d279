"""The plan of a stress test: a campaign's, with the section `stress`; and the definite scenario of each trial."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from pydantic import ValidationError

from auvsim.base import schema
from auvsim.base.errors import InputError
from auvsim.base.randomness import stream
from auvsim.campaign import plan as plans
from auvsim.campaign.plan import Plan
from auvsim.simulation import controllers, sampling, scenario
from auvsim.simulation.scenario_settings import RandomSettings
from auvsim.stress.settings import FactorSettings, StressSettings

Steps = tuple[tuple[int, float], ...]  # of a walk: trial and angle [deg]


@dataclass(frozen=True, kw_only=True, slots=True)
class Point:
    """One trial that a search wants."""

    trial: int
    values: Mapping[str, Any]  # of its scenario, all definite


@dataclass(frozen=True)
class StressPlan:
    """A plan that was read and checked."""

    plan: Plan
    settings: StressSettings

    def point(self, levels: Mapping[str, float], trial: int, walk: Steps | None = None) -> Point:
        """A trial with factors at their levels.

        Args:
            levels: From 0, mild, to 1, harsh, by the factor's name.
            trial: Number of the trial.
            walk: Steps away from it, with which the draws of the scenario are walked too; none: the trial itself.
        """
        seed, factors = self.plan.settings.seed, self.settings.named(tuple(levels))
        distributed = controllers.layered(self._base, *(factor.pins for factor in factors.values()))
        quantiles = {}
        if walk is not None:
            made = {"walk": [{"trial": other, "angle_deg": angle} for other, angle in walk]}
            distributed["random"] = made
            steps = RandomSettings.model_validate_json(json.dumps(made)).steps
            for key, _ in sampling.distributions(distributed):
                quantiles[key] = float(stream(seed, trial, f"quantile/{key}", steps).random())
        values = sampling.draw(distributed, seed, trial, {}, quantiles)
        for name, factor in factors.items():
            for key in factor.keys or (name,):
                _put(values, key, factor.value(levels[name]))
        return Point(trial=trial, values=values)

    def in_current(self, trial: int, knots: Sequence[Mapping[str, float]]) -> Point:
        """A trial in a current of these knots."""
        values = sampling.draw(self._base, self.plan.settings.seed, trial)
        water = values["water"] if "vehicles" in values else values
        water["current"] = {"kind": "knots", "knots": [dict(knot) for knot in knots]}
        return Point(trial=trial, values=values)

    @cached_property
    def _base(self) -> dict:
        s = self.plan.settings
        return controllers.layered(s.base, s.variants[self.plan.variants[0]])


def load(name: str) -> StressPlan:
    """Reads and checks a plan: a YAML file, the folder of a stress test, or the name of a shipped plan.

    Raises:
        InputError: One line with what is wrong and where.
    """
    return of_campaign(plans.load(name))


def of_campaign(plan: Plan) -> StressPlan:
    """The stress test of a campaign's plan.

    Raises:
        InputError: One line with what is wrong and where.
    """
    given = plan.settings.stress
    if given is None:
        raise _wrong(plan, "stress", "the plan has no such section; it says what to look for, such as factors")
    places = {key.removeprefix("stress."): place for key, place in plan.places.items() if key.startswith("stress.")}
    try:
        settings = StressSettings.model_validate_json(json.dumps(given, default=str), strict=True)
    except ValidationError as error:
        raise schema.explain(error, StressSettings, given, {"": plan.places.get("stress", ""), **places}) from None
    for key, several in (("variants", len(plan.variants) > 1), ("grid", len(plan.cells) > 1)):
        if several:
            raise _wrong(plan, key, "a stress test takes one variant and no grid; the factors say what is varied")
    found = StressPlan(plan, settings)
    if not (settings.factors or settings.rare or settings.worst):
        raise _wrong(plan, "stress", "nothing to look for; give factors, rare or worst")
    for section in ("rare", "worst"):
        sought = getattr(settings, section)
        numbers = [name for name, column in plan.layout.columns.items() if column.dtype in ("int", "float")]
        if sought is not None and sought.metric not in numbers:
            text = f"no column of numbers '{sought.metric}'; there are {', '.join(numbers[:12])}"
            raise _wrong(plan, f"stress.{section}.metric", text)
    for factor, own in settings.factors.items():
        _check(found, factor, own)
    return found


def _check(plan: StressPlan, name: str, factor: FactorSettings) -> None:
    """Sees that a factor makes sense at both ends."""
    for level in (0.0, 1.0):
        try:
            scenario.parse(plan.point({name: level}, 0).values)
        except InputError as error:
            raise _wrong(plan.plan, f"stress.factors.{name}", f"at {factor.value(level):g}: {error}") from None


def _put(values: Any, key: str, value: float) -> None:
    """Puts a value under a dotted key of nested values, in place; parts of the key may be places in lists.

    Raises:
        InputError: There is no such place.
    """
    *above, last = key.split(".")
    for part in above:
        if isinstance(values, list) and part.isdigit() and int(part) < len(values):
            values = values[int(part)]
        elif isinstance(values, dict):
            below = values.get(part)
            values[part] = below if isinstance(below, dict | list) else {}
            values = values[part]
        else:
            raise InputError(f"{key}: there is no '{part}' in the scenario")
    if not isinstance(values, dict):
        raise InputError(f"{key}: there is no '{last}' in the scenario")
    values[last] = value


def _wrong(plan: Plan, key: str, text: str) -> InputError:
    return InputError(": ".join(part for part in (schema.place(key, plan.places), key, text) if part))
