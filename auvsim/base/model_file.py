"""Settings in a YAML file that is written whole or not at all, and read back bit for bit."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from auvsim.base import schema, yaml_text
from auvsim.base.errors import InputError
from auvsim.base.files import whole

Model = TypeVar("Model", bound=BaseModel)


def write(path: Path, values: Mapping[str, Any], key: str, rows: Mapping[str, Any]) -> None:
    """Writes values, and last, under `key`, a mapping with one line for each of its rows.

    Raises:
        InputError: the file cannot be written.
    """
    lines = [
        f"  {yaml_text.dump(name).splitlines()[0]}: {yaml_text.dump(row, flow=True)}" for name, row in rows.items()
    ]
    text = "\n".join((yaml_text.dump(values).rstrip(), f"{key}:", *lines, ""))
    try:
        with whole(path) as partial:
            partial.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def read(path: Path, model: type[Model], what: str) -> Model:
    """Reads a file as a model, strictly.

    Args:
        path: the file.
        model: class of what is in it.
        what: it is: "a parameter set".

    Raises:
        InputError: one line with the file, the line and the key at fault.
    """
    document = yaml_text.load(path)
    if not isinstance(document.value, Mapping):
        raise InputError(f"{path}: {what} is a mapping of keys to values, not {type(document.value).__name__}")
    try:
        return model.model_validate_json(json.dumps(document.value, default=str), strict=True)
    except ValidationError as error:
        raise schema.explain(error, model, document.value, {"": str(path), **document.places}) from None
