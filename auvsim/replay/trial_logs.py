"""Trial logs as recordings: readings, packets and commands as the loop handed them to the estimator."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from auvsim.acoustics.message import Delivery, Message, UsblPacket
from auvsim.base.errors import InputError
from auvsim.base.randomness import Noise, stream
from auvsim.base.reading import Reading
from auvsim.data.log import VehicleLog, read
from auvsim.navigation.navigator import NavigatorSetup
from auvsim.physics.propulsion import propulsion
from auvsim.replay.recording import DELIVERED, Arrival, Recording
from auvsim.simulation import scenario
from auvsim.simulation.scenario import Scenario
from auvsim.simulation.setups import model_speed, navigator_setup
from auvsim.vehicles import library, model_files


def recordings(path: Path) -> list[Recording]:
    """What the estimator of each vehicle of a log was given.

    Raises:
        InputError: It is no whole log, or no estimator ran in it.
    """
    log = read(path)
    with model_files.given(log.models):
        plan = scenario.from_yaml(str(log.attributes["scenario"]), f"{path}: scenario")
        return [_recording(log.vehicle(name), plan, path) for name in log.vehicles]


def _recording(log: VehicleLog, plan: Scenario, path: Path) -> Recording:
    settings = plan.vehicles[log.name]
    vehicle = library.vehicle(settings.model)
    times = log["estimate"]["time"]
    if not len(times):
        raise InputError(f"{path}: no estimate of '{log.name}' in it; an estimator is replayed at the times it ran")
    speed = model_speed(settings.estimator)
    before = propulsion(settings.model, speed, plan.water.density).ahead(settings.start.speed)
    command = log["command"]
    demands = zip(*(command[demand.name].tolist() for demand in vehicle.actuation.demands), strict=True)
    commands = [before, *(type(before)(*values) for values in demands)]
    # An update comes before the command of its own time.
    in_force = np.searchsorted(command["time"], times, side="left")
    sensors = [group for group in log.groups if group.startswith("sensors/")]
    clock = [log[group]["time"] for group in ("truth", "command", *sensors) if group != "sensors/usbl"]
    return Recording(
        name=path.stem if len(log.log.vehicles) == 1 else f"{path.stem}, {log.name}",
        times=times,
        clock=np.unique(np.concatenate([times, *clock])),
        commands=[commands[k] for k in in_force.tolist()],
        arrivals=[a for rank, group in enumerate(sensors) for a in _arrivals(log, group, rank, plan)],
        setup=lambda other: _setup(log, plan, vehicle, other),
        own=settings.estimator,
        vehicle=log,
        messages=list(_messages(log)) if "received" in log else (),
    )


def _setup(log: VehicleLog, plan: Scenario, vehicle: library.Vehicle, settings: Any) -> NavigatorSetup:
    """What an estimator of the log's vehicle is made from, with the models that the log holds."""
    with model_files.given(log.log.models):
        return navigator_setup(plan, log.name, vehicle, settings)


def _arrivals(log: VehicleLog, group: str, rank: int, plan: Scenario) -> Iterator[Arrival]:
    """The readings of a sensor that arrived; of a packet that came twice, both."""
    name, columns = group.removeprefix("sensors/"), log[group]
    rows = zip(columns["time"].tolist(), columns["received"].tolist(), columns["sequence"].tolist(), strict=True)
    copies = _copies(log, plan) if name == "usbl" else {}
    for (stamp, received, sequence), value in zip(rows, columns["value"], strict=True):
        reading = Reading(name, stamp, received, value, sequence)
        if math.isnan(received):
            continue
        if name != "usbl":
            yield Arrival(reading, rank)
            continue
        yield _delivered(log, reading)
        if sequence in copies:
            yield _delivered(log, reading._replace(received=received + copies[sequence]))


def _messages(log: VehicleLog) -> Iterator[Delivery]:
    """The messages of other vehicles' modems."""
    columns = log["received"]
    rows = zip(*(columns[name].tolist() for name in columns if name != "payload"), strict=True)
    names = [name for name in columns if name != "payload"]
    for values, payload in zip(rows, columns["payload"], strict=True):
        row = dict(zip(names, values, strict=True))
        message = Message(
            row["source"], row["destination"] or None, row["stamp"], row["kind"],
            tuple(payload[: row["numbers"]].tolist()), row["bits"], row["sequence"],
            answers=None if row["answers"] < 0 else row["answers"],
        )  # fmt: skip
        distance, bearing = (None if math.isnan(row[name]) else row[name] for name in ("range", "bearing"))
        yield Delivery(message, row["time"], distance, bearing, row["arrived"])


def _delivered(log: VehicleLog, reading: Reading) -> Arrival:
    source = str(log.attributes.get("usbl_structure") or log.attributes.get("dock", ""))
    packet = UsblPacket(reading._replace(received=math.nan), None)
    message = Message(source, log.name, reading.stamp, reading.sensor, packet)
    return Arrival(reading, DELIVERED, Delivery(message, reading.received))


def _copies(log: VehicleLog, plan: Scenario) -> dict[int, float]:
    """How much later a second copy of each packet came [s]; a log has the first only, but its seed says the rest."""
    acoustics = plan.network.acoustics
    if acoustics.duplicate_probability == 0.0:
        return {}
    attributes = log.log.attributes
    seed, trial = int(attributes["seed"]), int(attributes["trial"])
    noise = Noise(stream(seed, trial, f"{log.name}/acoustics", plan.random.steps))
    later = {}
    for sequence in log["sensors/usbl"]["sequence"].tolist():
        *_, twice, gap = noise.uniforms(5)
        if twice < acoustics.duplicate_probability:
            later[sequence] = gap * acoustics.late_delay
    return later
