"""What if more had been lost, later, or wrong: a recording with its readings changed, from seeded draws."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.randomness import Noise, stream
from auvsim.replay.recording import Arrival, Recording
from auvsim.sensors.range import RangeSettings

POSITIONS = ("usbl", "fix")  # sensors by name that fix the position; so do ranges, whatever they are called
COMPONENTS = {"usbl": 3}  # of a value that an outlier changes; of others all


@dataclass(frozen=True, kw_only=True, slots=True)
class WhatIf:
    """What is to happen to readings besides what did."""

    drop: float = 0.0  # share of readings lost [-]
    delay: float = 0.0  # by which they arrive later [s]
    outliers: float = 0.0  # share that gets an error [-]
    size: tuple[float, float] = (10.0, 30.0)  # of that error, least and largest, in a random direction [m]
    sensors: tuple[str, ...] = ()  # by name; none: those that fix the position
    seed: int = 0

    @property
    def changes(self) -> bool:
        """Whether anything is changed."""
        return (self.drop, self.delay, self.outliers) != (0.0, 0.0, 0.0)


def changed(recording: Recording, what: WhatIf) -> Recording:
    """The recording with readings lost, late or wrong.

    Every reading takes the same draws, from a stream of its sensor, so that more losses are those of before and others.

    Raises:
        InputError: A sensor is named that the recording does not have.
    """
    if not what.changes:
        return recording
    names = {arrival.reading.sensor for arrival in recording.arrivals}
    unknown = [name for name in what.sensors if name not in names]
    if unknown:
        raise InputError(f"{recording.name}: no readings of '{unknown[0]}'; there are {', '.join(sorted(names))}")
    settings = recording.setup(None).sensors
    fixing = {name for name in names if name in POSITIONS or isinstance(settings.get(name), RangeSettings)}
    arrivals: list[Arrival] = []
    for name in sorted(names):
        own = [arrival for arrival in recording.arrivals if arrival.reading.sensor == name]
        arrivals += _changed(own, name, what) if name in (what.sensors or fixing) else own
    return replace(recording, arrivals=arrivals)


def _changed(arrivals: Iterable[Arrival], name: str, what: WhatIf) -> Iterable[Arrival]:
    noise = Noise(stream(what.seed, 0, f"what_if/{name}"))
    for arrival in arrivals:
        lost, wrong, share = noise.uniforms(3)
        reading = arrival.reading
        size = COMPONENTS.get(name, reading.value.size)
        direction = np.array(noise.normals(size))
        if lost < what.drop:
            continue
        if wrong < what.outliers:
            error = what.size[0] + share * (what.size[1] - what.size[0])
            value = reading.value.copy()
            value[:size] += error / math.sqrt(float(direction @ direction)) * direction
            reading = reading._replace(value=value)
        reading = reading._replace(received=reading.received + what.delay)
        delivery = arrival.delivery
        if delivery is not None:
            payload = delivery.message.payload._replace(reading=reading._replace(received=math.nan))
            delivery = delivery._replace(message=delivery.message._replace(payload=payload), received=reading.received)
        yield arrival._replace(reading=reading, delivery=delivery)
