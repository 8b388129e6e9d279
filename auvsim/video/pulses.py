"""Acoustic pulses in the overview: rings that expand from who sends, and lines to who hears or loses them."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from auvsim.acoustics.channel import DELIVERED
from auvsim.acoustics.modems import UNDER_WAY
from auvsim.base.frames import Array
from auvsim.video.layer import LINE, Colour, Layer
from auvsim.video.playback import Playback

RING: Colour = (0.75, 0.9, 1.0, 1.0)
HEARD: Colour = (0.3, 1.0, 0.4, 1.0)
LOST: Colour = (1.0, 0.2, 0.15, 1.0)
LIFE = 6.0  # time for which a pulse is drawn: in time-lapse sound itself would be gone within a picture [s]
BEYOND = 1.15  # of the farthest receiver's distance, to which a ring expands
CORNERS = 40
MOST = 4  # rings that are drawn at one time


@dataclass(frozen=True, kw_only=True, slots=True)
class Pulse:
    """A packet and what became of it."""

    sent: float  # [s]
    source: str
    fates: tuple[tuple[str, bool], ...]  # receivers, and whether each heard it


class Pulses:
    """The packets of a log as rings; slower than sound, each reaches its farthest receiver within `LIFE`."""

    def __init__(self, playback: Playback) -> None:
        rows = playback.log.groups["network/messages"]
        known = playback.motions.keys() | playback.fixed_modems.keys()
        found: dict[tuple[float, str], list[tuple[str, bool]]] = {}
        for time, source, destination, kind, fate in zip(
            *(rows[name].tolist() for name in ("time", "source", "destination", "kind", "fate")), strict=True
        ):
            if kind != "usbl" and fate != UNDER_WAY and {source, destination} <= known:
                found.setdefault((time, source), []).append((destination, fate == DELIVERED))
        self._motions, self._fixed = playback.motions, playback.fixed_modems
        self.shown = [Pulse(sent=t, source=s, fates=tuple(f)) for (t, s), f in sorted(found.items())]
        self._times = np.array([pulse.sent for pulse in self.shown])
        self._round = np.linspace(0.0, math.tau, CORNERS + 1)

    def draw(self, layer: Layer, time: float) -> None:
        """Draws the pulses of the last seconds before a time [s]."""
        first, last = np.searchsorted(self._times, (time - LIFE, time), side="right")
        for pulse in self.shown[max(first, last - MOST) : last]:
            self._one(layer, pulse, (time - pulse.sent) / LIFE)

    def _one(self, layer: Layer, pulse: Pulse, age: float) -> None:
        """One of an age from 0 to 1."""
        origin = self._place(pulse.source, pulse.sent)
        ends = {name: self._place(name, pulse.sent) for name, _ in pulse.fates}
        distances = {name: float(np.linalg.norm(end - origin)) for name, end in ends.items()}
        radius = age * BEYOND * max(distances.values())
        self._ring(layer, origin, radius, (*RING[:3], 1.0 - age))
        for name, heard in pulse.fates:
            if radius >= distances[name]:
                layer.join(LINE, 4.0, origin, ends[name], (*(HEARD if heard else LOST)[:3], 1.0 - 0.7 * age))

    def _place(self, name: str, time: float) -> Array:
        """Where a modem is (3,) [m] at a time [s]: of a vehicle, a dock or a beacon."""
        return self._fixed[name] if name in self._fixed else self._motions[name].at(time).position

    def _ring(self, layer: Layer, centre: Array, radius: float, colour: Colour) -> None:
        corners = centre + radius * np.stack([np.cos(self._round), np.sin(self._round), 0.0 * self._round], axis=1)
        for begin, end in pairwise(corners):
            layer.join(LINE, 3.0, begin, end, colour)
