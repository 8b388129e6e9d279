"""Reads MCAP files and rosbag2 folders: the numbers of each topic's messages as arrays, with both of their stamps."""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import closing
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.ros import types

STORAGES = (".mcap", ".db3")
METADATA = "metadata.yaml"
JOINTS = "sensor_msgs/msg/JointState"
_LONGEST = 9  # arrays of at most this many numbers are read, a 3x3 matrix
_POSE = 36  # numbers in a 6x6 covariance, of which the diagonal is read
_NUMBERS = ("bool", "int", "uint", "float")


class Topic(NamedTuple):
    """The messages of one topic."""

    name: str
    type: str
    stamps: NDArray[np.int64] | None  # (n,) of the headers [ns]; None without headers
    received: NDArray[np.int64]  # (n,) when they were recorded [ns]
    fields: Mapping[str, Array]  # (n,) by path: angular_velocity.z, orientation_covariance[0], position.rudder
    frame: str = ""  # of the first header


def is_bag(path: Path) -> bool:
    """Whether a path looks like an MCAP file or a rosbag2, by its name."""
    return path.suffix.lower() in STORAGES or (path / METADATA).is_file()


def read(path: Path, choose: Callable[[Mapping[str, str]], Collection[str]]) -> tuple[dict[str, str], list[Topic]]:
    """Types of all topics by name, and the messages of those that are chosen, each in order of its stamps.

    Args:
        path: An MCAP or SQLite file, or the folder of a rosbag2.
        choose: Of the types by name.

    Raises:
        InputError: It cannot be read, or a chosen topic's type is not defined anywhere; the text names it.
    """
    from_file = _guarded(path)
    with closing(from_file(lambda: _reader(path))) as reader:
        kinds = {c.topic: c.msgtype for c in reader.connections}
        store, lacking = from_file(lambda: _types(reader))
        chosen = [name for name in kinds if name in choose(kinds)]
        for name in chosen:
            if kinds[name] in lacking or kinds[name] not in store.fielddefs:
                raise InputError(
                    f"{path}: {name}: message type {kinds[name]} is not known, and the file does not define it; record "
                    "it as MCAP, which holds definitions"
                )
        return kinds, [from_file(lambda name=name: _topic(reader, store, name, kinds[name])) for name in chosen]


def _guarded(path: Path) -> Callable[[Callable[[], Any]], Any]:
    """Calls something that reads the file, and says in one line what is wrong with the file if it fails."""

    def call(something: Callable[[], Any]) -> Any:
        try:
            return something()
        except InputError:
            raise
        except Exception as error:  # whatever a damaged file leads the reader to
            text = " ".join(str(error).split())[:200] or type(error).__name__
            raise InputError(f"{path}: not a whole MCAP file or rosbag2: {text}") from None

    return call


def _reader(path: Path) -> Any:
    types.store()
    from rosbags.rosbag2 import Reader

    reader = Reader(path)
    reader.open()
    return reader


def _types(reader: Any) -> tuple[Any, set[str]]:
    """A store of types with the file's own definitions, and the types whose definitions cannot be used."""
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    own: dict[str, Any] = {}
    lacking = set()
    for connection in reader.connections:
        text, form = connection.msgdef.data, connection.msgdef.format
        try:
            if form == MessageDefinitionFormat.MSG:
                own |= get_types_from_msg(text, connection.msgtype)
            elif form == MessageDefinitionFormat.IDL:
                own |= get_types_from_idl("\n".join(t for t in text.split("\n") if not t.startswith(("====", "IDL: "))))
        except Exception:  # a definition in a dialect of its own; only what needs it fails
            lacking.add(connection.msgtype)
    return types.store(own), lacking


def _topic(reader: Any, store: Any, name: str, kind: str) -> Topic:
    """The messages of a topic."""
    connections = [c for c in reader.connections if c.topic == name]
    received, messages = [], []
    for _, time, raw in reader.messages(connections=connections):
        received.append(time)
        messages.append(store.deserialize_cdr(raw, kind))
    headed = any(field == "header" for field, _ in store.fielddefs[kind][1])
    stamps = [m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec for m in messages] if headed else received
    order = np.argsort(np.array(stamps, dtype=np.int64), kind="stable")
    fields = {
        path: np.array(list(map(get, messages)), dtype=float)[order] for path, get in _paths(store, kind) if messages
    }
    if kind == JOINTS:
        fields |= {path: values[order] for path, values in _joints(messages).items()}
    return Topic(
        name=name,
        type=kind,
        stamps=np.array(stamps, dtype=np.int64)[order] if headed else None,
        received=np.array(received, dtype=np.int64)[order],
        fields=fields,
        frame=messages[0].header.frame_id if headed and messages else "",
    )


def _paths(store: Any, kind: str, before: str = "") -> Iterator[tuple[str, Callable[[Any], float]]]:
    """Paths to the numbers of a message, and what gets each."""
    from rosbags.interfaces import Nodetype

    fields: Any = store.fielddefs[kind][1]
    for name, (node, what) in fields:
        path = f"{before}{name}"
        if _is_number((node, what)):
            yield path, attrgetter(path)
        elif node == Nodetype.NAME and what != "std_msgs/msg/Header":
            yield from _paths(store, what, f"{path}.")
        elif node == Nodetype.ARRAY and _is_number(what[0]):
            count = int(what[1])
            places = range(count) if count <= _LONGEST else range(0, _POSE, 7) if count == _POSE else ()
            yield from ((f"{path}[{k}]", lambda m, get=attrgetter(path), k=k: get(m)[k]) for k in places)


def _is_number(what: Any) -> bool:
    """Whether a field definition is that of a number."""
    from rosbags.interfaces import Nodetype

    return what[0] == Nodetype.BASE and what[1][0].startswith(_NUMBERS)


def _joints(messages: Collection[Any]) -> dict[str, Array]:
    """Positions, velocities and efforts of joints (n,) by name, NaN where a message has none."""
    found: dict[str, Array] = {}
    for k, message in enumerate(messages):
        for quantity in ("position", "velocity", "effort"):
            for name, value in zip(message.name, getattr(message, quantity), strict=False):
                found.setdefault(f"{quantity}.{name}", np.full(len(messages), np.nan))[k] = value
    return found
