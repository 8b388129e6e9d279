"""A log as one MCAP file of ROS 2 messages that holds their definitions, and a Foxglove layout beside it."""

import json
from pathlib import Path
from typing import Any

from auvsim.base.datum import Datum
from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.data.log import Log
from auvsim.exchange import layout, messages
from auvsim.exchange.ros_messages import Stream
from auvsim.ros import types
from auvsim.simulation import scenario
from auvsim.vehicles import model_files


def write(log: Log, path: Path) -> list[Path]:
    """Writes FILE.mcap and FILE.foxglove.json, each whole or not at all; returns both.

    Raises:
        InputError: The packages for it are not installed.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise InputError(types.NEEDED) from None
    found = _streams(log)
    store, definitions = types.store(), {}
    queue: list[tuple[int, int, int, bytes]] = []  # when recorded [ns], topic, stamp [ns], bytes
    for k, stream in enumerate(found):
        for stamp, received, message in stream.rows:
            data = bytes(store.serialize_cdr(message, stream.type))
            queue.append((round(received * 1e9), k, round(stamp * 1e9), data))
    queue.sort(key=lambda row: row[:2])
    with whole(path) as partial, partial.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="auvsim")
        channels = []
        for stream in found:
            if stream.type not in definitions:
                text = store.generate_msgdef(stream.type, ros_version=2)[0]
                definitions[stream.type] = writer.register_schema(stream.type, "ros2msg", text.encode())
            channels.append(writer.register_channel(stream.topic, "cdr", definitions[stream.type]))
        for sequence, (received, k, _, data) in enumerate(queue):
            writer.add_message(channels[k], log_time=received, publish_time=received, data=data, sequence=sequence)
        writer.add_metadata("auvsim", {name: str(value) for name, value in log.attributes.items()})
        writer.finish()
    beside = path.with_suffix(".foxglove.json")
    with whole(beside) as partial:
        text = json.dumps(layout.layout(log.vehicles, {stream.topic for stream in found}), indent=2)
        partial.write_text(text + "\n", encoding="utf-8")
    return [path, beside]


def _streams(log: Log) -> list[Stream]:
    attributes: dict[str, Any] = log.attributes
    datum = None
    if "latitude" in attributes and "longitude" in attributes:
        datum = Datum(latitude=float(attributes["latitude"]), longitude=float(attributes["longitude"]))
    found: dict[str, Stream] = {}
    with model_files.given(log.models):
        plan = scenario.from_yaml(str(attributes["scenario"]), "scenario of the log")
        for name in log.vehicles:
            for stream in messages.streams(log.vehicle(name), plan, datum):
                if stream.topic in found:  # /tf is one topic of all
                    rows = (*found[stream.topic].rows, *stream.rows)
                    found[stream.topic] = stream._replace(rows=iter(rows))
                else:
                    found[stream.topic] = stream
        found["/rosout"] = messages.events(log)
        return [stream._replace(rows=iter(list(stream.rows))) for stream in found.values()]
