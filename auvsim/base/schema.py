"""Dotted keys of a settings class, its errors in one line, and its text as commented YAML."""

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import to_jsonable_python

from auvsim.base import yaml_text
from auvsim.base.errors import InputError
from auvsim.base.settings import OwnPart, kinds

WIDTH = 120  # columns of the commented YAML


class UnknownKeyError(ValueError):
    """Raised by a validator that found a key which its settings do not have.

    Args:
        key: that is unknown.
        siblings: those that there are.
        more: what else is right, appended to the suggestion.
    """

    def __init__(self, key: str, siblings: list[str], more: str = "") -> None:
        super().__init__(f"unknown key {key}")
        self.key, self.siblings, self.more = key, siblings, more


def members(annotation: Any) -> list[type[BaseModel]]:
    """The settings classes an annotation allows: several for a union discriminated by `kind`, none for plain values.

    Of a mapping of names to settings, those of its values.
    """
    if get_origin(annotation) is Annotated:
        return members(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return [model for argument in get_args(annotation) for model in members(argument)]
    if get_origin(annotation) is dict:
        return members(get_args(annotation)[1])
    return [annotation] if isinstance(annotation, type) and issubclass(annotation, BaseModel) else []


def member(annotation: Any, value: Any) -> type[BaseModel] | None:
    """The one settings class that `value` is meant for, if there is only one."""
    models = [] if get_origin(annotation) is dict else members(annotation)
    if len(models) > 1 and isinstance(value, Mapping):
        kind = value.get("kind", models[0].model_fields["kind"].default)
        own = [model for model in models if issubclass(model, OwnPart)] if ":" in str(kind) else []
        models = own or [model for model in models if kind in kinds(model)]
    return models[0] if len(models) == 1 else None


def keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Every dotted key below a settings class, those of all kinds included; items of lists have none.

    In place of a name that the user chooses stands `*`.
    """
    for name, field in model.model_fields.items():
        yield prefix + name
        named = "*." if get_origin(field.annotation) is dict else ""
        for below in members(field.annotation):
            yield from keys(below, f"{prefix}{name}.{named}")


def suggestion(key: str, model: type[BaseModel], siblings: list[str]) -> str:
    """What the unknown dotted `key` may have meant: a similar one beside it, or the same name elsewhere."""
    *above, name = key.split(".")
    if key in keys(model):  # of the kind that stands there it is not
        return f"only another kind has it; there are {', '.join(siblings)}"
    near = [".".join([*above, close]) for close in get_close_matches(name, siblings, n=1)]
    if not near:
        everywhere = [other for other in dict.fromkeys(keys(model)) if not key.startswith(f"{other}.")]
        near = [other for other in everywhere if other.split(".")[-1] == name] or get_close_matches(
            key, everywhere, n=1
        )
    if near:
        return f"did you mean {' or '.join(near[:3])}?"
    return f"there are {', '.join(siblings)}" if siblings else "see `auvsim scenario --default` for those that exist"


def explain(error: ValidationError, model: type[BaseModel], values: Mapping, places: Mapping[str, str]) -> InputError:
    """Pydantic's report as one line: place, key, value, what would be right.

    Args:
        error: Raised by validating `values`.
        model: The class it was validated as.
        values: What was validated.
        places: Where a dotted key was given (`scenario.yaml:7`); keys above it serve too, and "" for the whole.
    """
    found = [report["loc"] for report in error.errors()]
    # A wrong item also makes its list too short, and an unknown key is the likely cause of a missing one.
    reports = [
        report
        for report in error.errors(include_url=False)
        if not any(place[: len(report["loc"])] == report["loc"] != place for place in found)
    ]
    report = min(reports, key=lambda report: report["type"] != "extra_forbidden")
    path, owner, field, options = _locate(report["loc"], model, values)
    cause = report.get("ctx", {}).get("error")
    if isinstance(cause, UnknownKeyError):
        path = f"{path}.{cause.key}"
        text = f"unknown key; {suggestion(path, model, cause.siblings)}{cause.more}"
    else:
        text = _reason(report, path, model, owner, field, options)
    below, colon, rest = text.partition(": ")
    if colon and (not path or f"{path}.{below}" in places):  # a validator of the whole says which key below it
        path, text = f"{path}.{below}" if path else below, rest
    more = f" ({len(reports) - 1} more wrong)" if len(reports) > 1 else ""
    return InputError(": ".join(part for part in (place(path, places), path, text + more) if part))


def commented(model: type[BaseModel], values: Mapping) -> str:
    """`values` as YAML text with each key's description beside it; keys that `values` lacks show their defaults."""
    return "\n".join(_section(model, values, 0)).strip() + "\n"


def _locate(
    location: tuple, model: type[BaseModel], values: Any
) -> tuple[str, type[BaseModel] | None, FieldInfo | None, list[type[BaseModel]]]:
    """Where pydantic found an error, its union tags left out.

    Returns:
        Dotted path, the class that owns the last key, its field, and the classes of settings that may stand there.
    """
    path: list[str] = []
    tagged = False  # whether the tag of the union at this place has been left out
    owner: type[BaseModel] | None = model
    field: FieldInfo | None = None
    annotation: Any = model
    for part in location:
        if not tagged and _is_tag(part, annotation, values):
            tagged = True
            continue
        if part == "[key]":  # the name that the user chose is itself at fault
            continue
        path.append(str(part))
        tagged = False
        if isinstance(part, int):
            annotation = (get_args(annotation) or (None,))[0]
            values = values[part] if isinstance(values, list | tuple) and part < len(values) else None
            continue
        if get_origin(annotation) is dict:  # a name that the user chose
            annotation = get_args(annotation)[1]
            values = values.get(part) if isinstance(values, Mapping) else None
            owner, field = None, None
            continue
        owner = member(annotation, values)
        field = owner.model_fields.get(part) if owner else None
        annotation = field.annotation if field else None
        values = values.get(part) if isinstance(values, Mapping) else None
    return ".".join(path), owner, field, members(annotation)


def _is_tag(part: Any, annotation: Any, values: Any) -> bool:
    """Whether a part of pydantic's location is the tag of a union, not a key."""
    models = members(annotation)
    if (isinstance(values, Mapping) and part in values) or get_origin(annotation) is dict:
        return False
    return part in {model.__name__ for model in models} or (
        len(models) > 1 and part in {kind for model in models for kind in kinds(model)}
    )


def _reason(
    report: Any,
    path: str,
    model: type[BaseModel],
    owner: type[BaseModel] | None,
    field: FieldInfo | None,
    options: list[type[BaseModel]],
) -> str:
    kind, message = report["type"], report["msg"]
    about = f" ({field.description})" if field and field.description else ""
    if kind == "extra_forbidden":
        return f"unknown key; {suggestion(path, model, list(owner.model_fields) if owner else [])}"
    if kind == "missing":
        return f"not given{about}"
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        found = report.get("ctx", {}).get("tag")
        tags = [kind for option in options for kind in kinds(option)]
        if any(issubclass(option, OwnPart) for option in options):
            tags.append("package.module:Name of your own")
        return f"{f'no kind {found!r}' if found else 'kind is not given'}; there are {', '.join(tags)}"
    if kind == "value_error":
        return message.removeprefix("Value error, ")
    limits = report.get("ctx", {})
    if kind == "too_short":
        return f"give {limits['min_length']} or more, not {limits['actual_length']}{about}"
    if kind == "too_long":
        return f"give {limits['max_length']} at most, not {limits['actual_length']}{about}"
    value = yaml_text.dump(report["input"], flow=True)
    value = value if len(value) <= 60 else value[:57] + "..."
    if kind == "string_pattern_mismatch" and report["loc"][-1] == "[key]":
        return f"a name is 1 to 64 letters without accents, digits, '_' and '-', and begins with no digit{about}"
    for said, better in (("Input should", "should"), ("String should", "should"), ("be an object", "be a mapping")):
        message = message.replace(said, better, 1)
    return f"{value} {message}{about}"


def place(path: str, places: Mapping[str, str]) -> str:
    parts = path.split(".")
    candidates = (".".join(parts[:length]) for length in range(len(parts), -1, -1))
    return next((places[key] for key in candidates if key in places), "")


def _section(model: type[BaseModel], values: Mapping, depth: int) -> Iterator[str]:
    indent = "  " * depth
    for name, field in sorted(model.model_fields.items(), key=lambda item: item[0] != "kind"):
        value = values[name] if name in values else _default(field)
        below = member(field.annotation, value)
        if below is None or not isinstance(value, Mapping) or not (value.keys() & below.model_fields.keys()):
            yield from _leaf(name, value, field, indent)
            if value is None:  # what could stand there instead
                yield from _others(members(field.annotation), indent)
            continue
        if depth == 0:
            yield ""
        yield from (f"{indent}# {field.description or _first_line(below)}", f"{indent}{name}:")
        yield from _section(below, value, depth + 1)
        yield from _others([other for other in members(field.annotation) if other is not below], indent)


def _others(models: list[type[BaseModel]], indent: str) -> Iterator[str]:
    """The settings classes that could stand in a place, as comments."""
    for other in models:
        yield f"{indent}  # or: {_first_line(other)}"
        yield from (f"{indent}  # {line}" for line in _section(other, {}, 0) if line)


def _default(field: FieldInfo) -> Any:
    """The default as YAML would give it; an empty text where a key must be given."""
    return "" if field.is_required() else to_jsonable_python(field.get_default(call_default_factory=True))


def _leaf(name: str, value: Any, field: FieldInfo, indent: str) -> Iterator[str]:
    if isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
        yield f"{indent}{name}:  # {field.description}"
        yield from (f"{indent}  {line}" for line in yaml_text.dump(value).splitlines())
        return
    text = f"{indent}{name}: {yaml_text.dump(value, flow=True) if value != '' else ''}".rstrip()
    if not field.description:
        yield text
    elif len(text) + len(field.description) + 4 <= WIDTH:
        yield f"{text}  # {field.description}"
    else:
        yield from (f"{indent}# {field.description}", text)


def _first_line(model: type[BaseModel]) -> str:
    return (model.__doc__ or model.__name__).strip().splitlines()[0]
