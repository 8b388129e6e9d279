"""MCAP files and rosbag2 folders as columns: which topic is what, by its type or a map, in the user's axes."""

import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import InputError
from auvsim.base.frames import Array, quaternion_to_euler
from auvsim.identification import bag_deviations
from auvsim.identification.bag_deviations import is_ned
from auvsim.identification.columns import NAMESPACE, QUANTITIES, UNITS, ColumnSettings, quantity_of
from auvsim.identification.table_text import Column
from auvsim.ros import bags, types
from auvsim.ros.bags import Topic
from auvsim.ros.frames import enu, enu_quaternion

LATE = 0.01  # between a header's stamp and receipt, from which it is told [s]
_TRUTH = {"truth", "ground_truth"}  # in the name of a topic: no sensor, used only where a map says so
_ROWS = "stamps"  # the column of time of all that is used
Stamps = NDArray[np.int64]
Derived = dict[str, Array]  # values (n,) by quantity, in the first unit of its kind


class Chosen(NamedTuple):
    """What a bag holds of use."""

    columns: dict[str, Column]
    mapping: dict[str, ColumnSettings]  # of each quantity to one of them
    notes: list[str]
    described: list[str]  # the topics with their types, for errors


def load(path: Path, mapping: Mapping[str, ColumnSettings]) -> Chosen:
    """The quantities of a bag, each with a time column of its own.

    A topic is used for what its type says, if no other could be the same; sensors go before `nav_msgs/Odometry`. A map
    names a topic (`heading: /auv/imu`), one of its numbers (`rudder: {column: /fins.data, unit: deg}`), and a
    `namespace` that alone counts. Times are the headers', or `TOPIC.received` where a map says so.

    Raises:
        InputError: It cannot be read, two topics could be the same, a topic is not there, has no stamps, or another
            clock; the text names topics and types.
    """
    given = dict(mapping)
    space = given.pop(NAMESPACE, None)
    prefix = "" if space is None else space.column.rstrip("/") + "/"

    def wanted(kinds: Mapping[str, str]) -> list[str]:
        named = {_split(s.column, kinds)[0] for s in given.values() if s.column}
        return [n for n, kind in kinds.items() if n in named or (n.startswith(prefix) and kind in _BY_TYPE)]

    kinds, topics = bags.read(path, wanted)
    described = [f"{name} ({kind})" for name, kind in sorted(kinds.items())]
    by_name = {topic.name: topic for topic in topics if len(topic.received)}
    if not by_name:
        raise InputError(f"{path}: no message of use; there are {', '.join(described) or 'no topics'}")
    derived = {name: _derived(topic) for name, topic in by_name.items()}
    seen = {n: found for n, found in derived.items() if n.startswith(prefix) and not _TRUTH & set(n.split("/"))}
    chosen, notes = _chosen(path, seen, by_name, set(given))
    settings = {quantity: ColumnSettings(column=f"{name}.{quantity}") for quantity, name in chosen.items()}
    settings |= {q: _resolved(path, q, s, by_name, derived, described) for q, s in given.items()}
    columns, more = _columns(path, settings, by_name, derived, described)
    rest = sorted(set(kinds) - {_split(s.column, kinds)[0] for s in settings.values()})
    if rest:
        notes.append(f"{path.name}: topics not used: {', '.join(rest)}")
    return Chosen(columns, {"time": ColumnSettings(column=_ROWS), **settings}, notes + more, described)


def _split(column: str, kinds: Mapping[str, object]) -> tuple[str, str]:
    """The topic and the field that a column's name `TOPIC.FIELD` means; no field where it is a topic."""
    if column in kinds:
        return column, ""
    topic, _, field = column.partition(".")
    return topic, field


def _chosen(
    path: Path, derived: Mapping[str, Derived], topics: Mapping[str, Topic], given: set[str]
) -> tuple[dict[str, str], list[str]]:
    """The topic of each quantity that a map does not give, and notes on those that only a map can tell."""
    found, notes = {}, []
    for quantity in QUANTITIES:
        if quantity in given:
            continue
        could = [name for name, has in derived.items() if quantity in has and topics[name].type not in _UNCLEAR]
        sensors = [name for name in could if topics[name].type != _ODOMETRY]
        could = sensors or could
        listed = ", ".join(f"{name} ({topics[name].type})" for name in could)
        if len(could) > 1 and sensors:
            raise InputError(
                f"{path}: {quantity} could be of {listed}; say which in a --columns file, such as `{quantity}: "
                f"{could[0]}`, or `{NAMESPACE}: {could[0].rsplit('/', 1)[0] or '/'}` for all"
            )
        if len(could) > 1:
            notes.append(f"{path.name}: {quantity} not used, as it could be of {listed}; --columns says which")
        elif could:
            found[quantity] = could[0]
    estimated = [quantity for quantity, name in found.items() if topics[name].type == _ODOMETRY]
    if estimated:
        notes.append(f"{path.name}: {', '.join(estimated)} of {found[estimated[0]]}: an estimate counts as measured")
    for name in derived:
        if topics[name].type in _UNCLEAR:
            notes.append(
                f"{path.name}: {name} ({topics[name].type}) not used: over ground, or through the water? "
                f"Say in a --columns file, such as `surge: {name}`"
            )
    return found, notes


def _resolved(
    path: Path, quantity: str, given: ColumnSettings, topics: Mapping[str, Topic], derived: Mapping[str, Derived],
    described: list[str],
) -> ColumnSettings:  # fmt: skip
    """What a map says of a quantity, with the full name of the number."""
    if not given.column:
        return given
    name, field = _split(given.column, topics)
    if name not in topics:
        raise InputError(f"{path}: {quantity}: no messages of topic '{name}'; there are {', '.join(described)}")
    field = field or quantity
    numbers = [*derived[name], *topics[name].fields]
    if field not in numbers:
        raise InputError(
            f"{path}: {quantity}: {name} ({topics[name].type}) has no number '{field}'; there are {', '.join(numbers)}"
        )
    return given.model_copy(update={"column": f"{name}.{field}"})


def _columns(
    path: Path, settings: dict[str, ColumnSettings], topics: Mapping[str, Topic], derived: Mapping[str, Derived],
    described: list[str],
) -> tuple[dict[str, Column], list[str]]:  # fmt: skip
    """The columns that the settings name, and of their times; the settings get the names of these."""
    raw: dict[str, tuple[Array, str | None, str, float | None]] = {}
    clocks, notes = {}, []
    for quantity, given in settings.items():
        if not given.column:
            continue
        name, field = _split(given.column, topics)
        topic = topics[name]
        clock = given.time or f"{name}.{'received' if topic.stamps is None else 'stamp'}"
        if clock not in clocks or clock.rpartition(".")[0] != name:
            clocks[clock], more = _clock(path, topic, clock)
            notes += more
        own = field in derived[name]
        raw[given.column] = (
            derived[name][field] if own else topic.fields[field],
            next(iter(UNITS[QUANTITIES[quantity].kind])) if own else None,
            clock,
            bag_deviations.deviations(topic).get(quantity) if own else None,
        )
        settings[quantity] = given.model_copy(update={"time": clock})
    if not clocks:
        raise InputError(f"{path}: no topic is of use; there are {', '.join(described)}")
    _same_clock(path, clocks)
    first = min(int(times[0]) for times in clocks.values())
    seconds = {clock: 1e-9 * (times - first).astype(float) for clock, times in clocks.items()}
    columns = {clock: Column(values=values, unit="s") for clock, values in seconds.items()}
    columns[_ROWS] = Column(values=np.unique(np.concatenate([*seconds.values()])), unit="s")
    columns |= {
        name: Column(values=values, unit=unit, time=clock, deviation=deviation)
        for name, (values, unit, clock, deviation) in raw.items()
    }
    return columns, notes


def _clock(path: Path, topic: Topic, clock: str) -> tuple[Stamps, list[str]]:
    """Times of a topic's messages (n,) [ns], and notes on them."""
    if clock == f"{topic.name}.received":
        note = [] if topic.stamps is not None else [f"{path.name}: {topic.name} has no stamps: times are of receipt"]
        return topic.received, note
    if clock != f"{topic.name}.stamp" or topic.stamps is None:
        raise InputError(f"{path}: time: '{clock}': give {topic.name}.received, or {topic.name}.stamp with a header")
    if not topic.stamps.any():
        raise InputError(
            f"{path}: {topic.name} ({topic.type}): the stamps of its headers are all 0; let the driver set them, or "
            f"say `time: {topic.name}.received` of that quantity in a --columns file"
        )
    late = 1e-9 * (topic.received - topic.stamps)
    if float(np.abs(late).max()) < LATE:
        return topic.stamps, []
    text = (
        f"received {np.median(late):.3g} s after its headers' stamps (median; {late.min():.3g} to {late.max():.3g} s)"
    )
    return topic.stamps, [f"{path.name}: {topic.name} {text}: the stamps count"]


def _same_clock(path: Path, clocks: Mapping[str, Stamps]) -> None:
    """Sees that all times overlap.

    Raises:
        InputError: They do not: some are of another clock.
    """
    longest = max(clocks, key=lambda clock: len(clocks[clock]))
    a, b = int(clocks[longest][0]), int(clocks[longest][-1])
    for clock, times in clocks.items():
        if times[-1] < a or times[0] > b:
            spans = [f"{c} from {1e-9 * clocks[c][0]:.1f} to {1e-9 * clocks[c][-1]:.1f} s" for c in (longest, clock)]
            raise InputError(f"{path}: not one clock: {', but '.join(spans)}; see `time` in a --columns file")


def _derived(topic: Topic) -> Derived:
    """What a message type says in itself."""
    return dict(_BY_TYPE[topic.type](topic)) if topic.type in _BY_TYPE else {}


def _xyz(topic: Topic, path: str) -> Array:
    return np.stack([topic.fields[f"{path}.{axis}"] for axis in "xyz"], axis=-1)


def _attitude(topic: Topic, path: str) -> Iterator[tuple[str, Array]]:
    """Heading and pitch; nothing where the quaternion is empty."""
    q = np.stack([topic.fields[f"{path}.{axis}"] for axis in "wxyz"], axis=-1)
    if not (np.abs(np.linalg.norm(q, axis=-1) - 1.0) < 0.1).all():
        return
    _, pitch, heading = np.moveaxis(quaternion_to_euler(q if is_ned(topic) else enu_quaternion(q)), -1, 0)
    yield from (("heading", heading), ("pitch", pitch))


def _imu(topic: Topic) -> Iterator[tuple[str, Array]]:
    if (topic.fields["orientation_covariance[0]"] != -1.0).all():
        yield from _attitude(topic, "orientation")
    if (topic.fields["angular_velocity_covariance[0]"] != -1.0).all():
        yield "yaw_rate", topic.fields["angular_velocity.z"] * (1.0 if is_ned(topic) else -1.0)


def _place(path: str) -> Callable[[Topic], Iterator[tuple[str, Array]]]:
    def found(topic: Topic) -> Iterator[tuple[str, Array]]:
        place = _xyz(topic, path)
        north, east, _ = np.moveaxis(place if is_ned(topic) else enu(place), -1, 0)
        yield from (("north", north), ("east", east))

    return found


def _odometry(topic: Topic) -> Iterator[tuple[str, Array]]:
    yield from _place("pose.pose.position")(topic)
    yield from _attitude(topic, "pose.pose.orientation")
    yield from _twist("twist.twist", ("ground",))(topic)


def _twist(path: str, over: tuple[str, ...]) -> Callable[[Topic], Iterator[tuple[str, Array]]]:
    def found(topic: Topic) -> Iterator[tuple[str, Array]]:
        side = 1.0 if is_ned(topic) else -1.0
        for name in over:
            before = "ground_" if name == "ground" else ""
            yield f"{before}surge", topic.fields[f"{path}.linear.x"]
            yield f"{before}sway", side * topic.fields[f"{path}.linear.y"]
        yield "yaw_rate", side * topic.fields[f"{path}.angular.z"]

    return found


def _satellites(topic: Topic) -> Iterator[tuple[str, Array]]:
    there = topic.fields["status.status"] >= 0
    for name in ("latitude", "longitude"):
        yield name, np.where(there, topic.fields[name], math.nan)


def _dvl(topic: Topic) -> Iterator[tuple[str, Array]]:
    """Forward and starboard, over ground or through the water, as each message says."""
    water = topic.fields["velocity_mode"] == 2.0
    for before, chosen in (("ground_", ~water), ("", water)):
        if chosen.any():
            yield f"{before}surge", np.where(chosen, topic.fields["velocity.x"], math.nan)
            yield f"{before}sway", np.where(chosen, topic.fields["velocity.y"], math.nan)


def _water_linked(topic: Topic) -> Iterator[tuple[str, Array]]:
    good = topic.fields["velocity_valid"] > 0.0
    yield "ground_surge", np.where(good, topic.fields["velocity.x"], math.nan)
    yield "ground_sway", np.where(good, topic.fields["velocity.y"], math.nan)


def _joints(topic: Topic) -> Iterator[tuple[str, Array]]:
    """Rudder and shaft by the names of joints."""
    for path, values in topic.fields.items():
        side, _, name = path.partition(".")
        quantity = quantity_of(name)
        kind = None if quantity is None else QUANTITIES[quantity].kind
        if quantity is not None and (side, kind) in (("position", "angle"), ("velocity", "shaft")):
            yield quantity, values


_ODOMETRY = "nav_msgs/msg/Odometry"
_UNCLEAR = ("geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/TwistWithCovarianceStamped")
_BOTH = ("ground", "water")
_BY_TYPE: dict[str, Callable[[Topic], Iterator[tuple[str, Array]]]] = {
    "sensor_msgs/msg/Imu": _imu,
    "sensor_msgs/msg/NavSatFix": _satellites,
    bags.JOINTS: _joints,
    _ODOMETRY: _odometry,
    "geometry_msgs/msg/PoseWithCovarianceStamped": _place("pose.pose.position"),
    "geometry_msgs/msg/PoseStamped": _place("pose.position"),
    "geometry_msgs/msg/PointStamped": _place("point"),
    "geometry_msgs/msg/TwistStamped": _twist("twist", _BOTH),
    "geometry_msgs/msg/TwistWithCovarianceStamped": _twist("twist.twist", _BOTH),
    types.DVL: _dvl,
    types.WATER_LINKED: _water_linked,
}
