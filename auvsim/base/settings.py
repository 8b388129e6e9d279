"""Base class of all settings: frozen, strict, documented field by field; and choice among several by `kind`."""

from collections.abc import Callable
from typing import Any, get_args

from pydantic import BaseModel, ConfigDict, Field


class Settings(BaseModel):
    """Part of a scenario, defined by the module that uses it.

    A field's `description` (with its unit) becomes the comment beside it in the printed default scenario.
    Unknown keys, NaN and infinities are refused. Angles are degrees in keys that end in `_deg`, shaft speeds
    revolutions per minute in keys that end in `_rpm`, everything else SI.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


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
