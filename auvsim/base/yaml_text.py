"""Reads and writes YAML by the core schema of YAML 1.2, with the line of every key and errors of one line.

PyYAML follows YAML 1.1, where `1e-4` is a string, `010` is eight, `1:30` ninety and `no` false. Here numbers are
numbers, only `true` and `false` are truth values, and a key given twice is refused.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from auvsim.base.errors import InputError

# The core schema of YAML 1.2.2, section 10.3.2: tag, pattern, first characters.
_CORE_SCHEMA = [
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", list("-+0123456789")),
    (
        "float",
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        list("-+.0123456789"),
    ),
]

MOST = 200_000  # values of a document; the largest scenario has some thousands


class _Loader(yaml.SafeLoader):
    yaml_implicit_resolvers: dict = {}  # noqa: RUF012 (PyYAML fills this class attribute)


# The compiled one is five times as quick, and each trial writes its scenario; not every PyYAML has it.
_SafeDumper: type[yaml.SafeDumper] = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


class _Dumper(_SafeDumper):
    yaml_implicit_resolvers: dict = {}  # noqa: RUF012

    def ignore_aliases(self, data: Any) -> bool:
        return True


for _tag, _pattern, _first in _CORE_SCHEMA:
    for _class in (_Loader, _Dumper):
        _class.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(f"^(?:{_pattern})$"), _first)


def _integer(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int:
    text = loader.construct_scalar(node)
    return int(text, 0) if text.startswith(("0o", "0x")) else int(text)


_Loader.add_constructor("tag:yaml.org,2002:int", _integer)
_Dumper.add_representer(tuple, lambda dumper, value: dumper.represent_list(value))


@dataclass(frozen=True, kw_only=True, slots=True)
class Document:
    """A YAML text read: its values, and the place (`file.yaml:7`) of every key by its dotted path."""

    value: Any
    places: dict[str, str]


def read(text: str, source: str = "YAML") -> Document:
    """Reads one YAML document; `source` names it in errors.

    Raises:
        InputError: for text that is no YAML or gives a key twice, with its line.
    """
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            return Document(value=None, places={})
        _count(node, {}, source)
        places = {path: f"{source}:{line}" for path, line in _lines(node, "", source)}
        return Document(value=loader.construct_document(node), places=places)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"{source}:{mark.line + 1}" if mark else source
        raise InputError(f"{where}: not YAML: {error.problem or error.context}") from None
    except (yaml.YAMLError, ValueError) as error:
        raise InputError(f"{source}: not YAML: {' '.join(str(error).split())}") from None
    except RecursionError:
        raise InputError(f"{source}: not YAML: values are nested too deeply") from None


def load(path: Path) -> Document:
    """Reads a YAML file.

    Raises:
        InputError: if it cannot be read or is no YAML.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: cannot be read: it is not UTF-8 text") from None
    return read(text, str(path))


def dump(value: Any, *, flow: bool = False) -> str:
    """The value as YAML text that `read` turns back into it; `flow` puts it on one line."""
    text = yaml.dump(
        value, Dumper=_Dumper, sort_keys=False, default_flow_style=flow, allow_unicode=True, width=1_000_000
    )
    return text.removesuffix("...\n").strip() if flow else text


def _count(node: yaml.Node, counts: dict[int, int], source: str) -> int:
    """Number of values below a node, each alias counted as what it stands for.

    Args:
        node: where to begin.
        counts: of the nodes seen so far, by identity; 0 for those that are being counted.
        source: names the text in errors.

    Raises:
        InputError: a value contains itself, or there are more than MOST.
    """
    if id(node) in counts:
        if not counts[id(node)]:
            raise InputError(f"{source}:{node.start_mark.line + 1}: not YAML: a value contains itself")
        return counts[id(node)]
    counts[id(node)], total = 0, 1
    below = node.value if isinstance(node, yaml.SequenceNode | yaml.MappingNode) else []
    for item in below:
        total += sum(_count(part, counts, source) for part in (item if isinstance(item, tuple) else (item,)))
    if total > MOST:
        raise InputError(f"{source}:{node.start_mark.line + 1}: more than {MOST} values, aliases written out")
    counts[id(node)] = total
    return total


def _lines(node: yaml.Node, path: str, source: str) -> Iterator[tuple[str, int]]:
    """Dotted path and line of every key and list item below a node."""
    if isinstance(node, yaml.MappingNode):
        seen = set()
        for key, value in node.value:
            line = key.start_mark.line + 1
            name = str(key.value)
            if name in seen:
                raise InputError(f"{source}:{line}: the key '{name}' is given twice")
            seen.add(name)
            below = f"{path}.{name}" if path else name
            yield below, line
            yield from _lines(value, below, source)
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            yield f"{path}.{index}", value.start_mark.line + 1
            yield from _lines(value, f"{path}.{index}", source)
