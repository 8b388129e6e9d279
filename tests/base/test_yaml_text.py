"""YAML by its 1.2 core schema, with the line of every error."""

import math
from pathlib import Path

import pytest

from auvsim.base import yaml_text
from auvsim.base.errors import InputError


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-4", 1e-4),
        ("-1E3", -1000.0),
        ("1.", 1.0),
        (".5", 0.5),
        ("1_0", "1_0"),
        ("010", 10),
        ("0o14", 12),
        ("0x1f", 31),
        ("+7", 7),
        ("1:30", "1:30"),
        ("no", "no"),
        ("On", "On"),
        ("True", True),
        ("~", None),
        ("", None),
        (".inf", math.inf),
        ("2026-01-01", "2026-01-01"),
        ("{uniform: [250, 3e2]}", {"uniform": [250, 300.0]}),
    ],
)
def test_scalars_of_yaml_1_2(text: str, value: object) -> None:
    """Section 10.3.2 of YAML 1.2.2; type and value."""
    found = yaml_text.read(text).value
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    "value",
    [
        1e-4,
        1e-30,
        1e22,
        -0.0,
        3,
        True,
        None,
        "yes",
        "1e-4",
        "010",
        "",
        "a: b",
        "null",
        [1, [2.5]],
        {"a": {"b": []}},
        "ö",
    ],
)
@pytest.mark.parametrize("flow", [True, False])
def test_what_is_written_reads_back(value: object, flow: bool) -> None:
    """Strings that look like numbers stay strings, numbers keep every bit."""
    found = yaml_text.read(yaml_text.dump({"key": value}, flow=flow)).value["key"]
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\nb: [1", "s.yaml:2: not YAML: expected"),
        ("a: 1\nb: 2\na: 3", "s.yaml:3: the key 'a' is given twice"),
        ("a:\n\tb: 1", "s.yaml:2: not YAML: found character"),
        ("a: !!python/object:os.system x", "s.yaml:1: not YAML: could not determine a constructor"),
        ("a: &x [*x]", "s.yaml:1: not YAML: a value contains itself"),
        ("a: \x01", "s.yaml: not YAML: unacceptable character"),
        ("{a: 1}: 2", "s.yaml:1: not YAML: found unhashable key"),
        ("a: *b", "s.yaml:1: not YAML: found undefined alias"),
        ("a: 1\n---\nb: 2", "s.yaml:2: not YAML: but found another document"),
    ],
)
def test_errors_are_one_line_with_their_place(text: str, message: str) -> None:
    """File, line, reason."""
    with pytest.raises(InputError) as error:
        yaml_text.read(text, "s.yaml")
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def test_places_of_keys() -> None:
    """The line of each key and list item, by dotted path."""
    places = yaml_text.read("a:\n  b: 1\n  c:\n    - 2\n    - d: 3\n", "s.yaml").places
    lines = {"a": 1, "a.b": 2, "a.c": 3, "a.c.0": 4, "a.c.1": 5, "a.c.1.d": 5}
    assert places == {key: f"s.yaml:{line}" for key, line in lines.items()}


def test_unreadable_files_are_named(tmp_path: Path) -> None:
    """No file, a folder, bytes that are no text."""
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00")
    for name in ("none.yaml", ".", "bytes.yaml"):
        path = tmp_path / name
        with pytest.raises(InputError, match="cannot be read") as error:
            yaml_text.load(path)
        assert str(error.value).startswith(f"{path}: ")
