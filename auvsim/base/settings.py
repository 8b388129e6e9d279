"""Base class of all settings: frozen, strict, documented field by field; and choice among several by `kind`."""

import re
from collections.abc import Callable, Iterator
from typing import Any, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

# Largest size of any setting by its unit, far beyond what a vehicle may meet and well within what numbers can hold;
# clocks may be ahead by an epoch. What is not 0 is at least TINY of such a unit.
LARGEST = {"m": 1e6, "m/s": 100.0, "deg": 3600.0, "deg/s": 3600.0, "Hz": 1e5, "rpm": 1e6, "s": 1e10, "-": 1e6}
OTHERWISE = 1e12
TINY = 1e-9
_UNIT = re.compile(r"\[([^\]]+)\][^\[]*$")  # the last one of a description


class Settings(BaseModel):
    """Part of a scenario, defined by the module that uses it.

    A field's `description` (with its unit) becomes the comment beside it in the printed default scenario.
    Unknown keys, NaN and infinities are refused. Angles are degrees in keys that end in `_deg`, shaft speeds
    revolutions per minute in keys that end in `_rpm`, everything else SI.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="after")
    @classmethod
    def _of_a_possible_size(cls, value: Any, info: ValidationInfo) -> Any:
        """Refuses numbers that no quantity of the field's unit has."""
        field = cls.model_fields.get(info.field_name or "")
        found = _UNIT.search(field.description or "") if field else None
        unit = found.group(1) if found else ""
        largest, smallest = LARGEST.get(unit, OTHERWISE), TINY if unit in LARGEST else 0.0
        for number in _floats(value):
            if abs(number) > largest:
                raise ValueError(f"{number:g} should be at most {largest:g} in size{f' [{unit}]' if unit else ''}")
            if 0.0 < abs(number) < smallest:
                raise ValueError(f"{number:g} should be 0 or at least {smallest:g} in size [{unit}]")
        return value


def _floats(value: Any) -> Iterator[float]:
    """The numbers of a value, those in tuples included."""
    if isinstance(value, float):
        yield value
    elif isinstance(value, tuple):
        for item in value:
            yield from _floats(item)


class OwnPart(Settings):
    """A part of the user's own, by the name of its class or factory."""

    kind: str = Field(pattern=r"^[\w.]+:\w+$", description="package.module:Name, also found in the working folder")
    settings: dict[str, Any] = Field(
        default={}, description="free mapping, checked by the part's class `Settings` if it has one"
    )


def kinds(model: type[BaseModel]) -> tuple[str, ...]:
    """The kinds that a class of settings is for; none for one without, or for parts of a user's own."""
    field = model.model_fields.get("kind")
    return tuple(str(kind) for kind in get_args(field.annotation)) if field else ()


def tag_by_kind(*models: type[BaseModel]) -> Callable[[Any], str]:
    """A discriminator of pydantic: the name of the class that values are meant for, the first if no kind is given.

    Each class of the union carries its own name as its `Tag`.
    """
    by_kind = {kind: model.__name__ for model in models for kind in kinds(model)}
    own = next((model.__name__ for model in models if issubclass(model, OwnPart)), None)

    def name(values: Any) -> str:
        if isinstance(values, BaseModel):
            return type(values).__name__
        kind = values.get("kind", None) if isinstance(values, dict) else None
        if kind is None:
            return models[0].__name__
        return own if own and ":" in str(kind) else by_kind.get(str(kind), str(kind))

    return name
