"""What a run tells of packets and of the limits of the water, each once when it begins."""

from collections.abc import Collection
from typing import Any

from auvsim.acoustics.channel import DELIVERED
from auvsim.acoustics.message import Fate
from auvsim.physics.truth import Truth
from auvsim.simulation.stretches import Stretches


class Reports:
    """Rows and events of a run that are no agent's own.

    Args:
        log: to which they go; `data.recorder.Recorder` is one.
        vehicles: names of those that have events; docks and beacons have none.
    """

    def __init__(self, log: Any, vehicles: Collection[str]) -> None:
        self._log, self._vehicles = log, vehicles
        self._stretches = Stretches()
        self._fates: dict[tuple[str, str], str] = {}  # the last one, by sender and receiver

    def packet(self, fate: Fate) -> None:
        """Logs what became of a packet."""
        m = fate.message
        row = (m.sent, fate.received, m.source, fate.destination, m.kind, m.bits, fate.fate)
        self._log.append("network/messages", row)

    def loss(self, fate: Fate, time: float) -> None:
        """Logs where a receiver begins to lose the packets of a sender for a reason."""
        link = (fate.message.source, fate.destination)
        before, self._fates[link] = self._fates.get(link), fate.fate
        if fate.fate not in (DELIVERED, before) and fate.destination in self._vehicles:
            self._log.event(time, fate.destination, "lost", f"packet of {link[0]}: {fate.fate}")

    def mute(self, time: float, vehicle: str) -> None:
        """Logs that a vehicle without a modem begins to want to send."""
        if self._stretches.begins(time, vehicle, "mute"):
            self._log.event(time, vehicle, "mute", "the mission wants to send, but the vehicle has no modem")

    def limits(self, world: Any, truths: dict[str, Truth], since: float) -> None:
        """Logs vehicles that come out of the water or touch the sea floor.

        Args:
            world: as it is now.
            truths: of the vehicles.
            since: time of the last call [s].
        """
        for name, truth in truths.items():
            if world.surfaced(name):
                self._limit(name, truth, "surfaced", "part of the hull is out of the water")
            if world.grounded(name, since):
                self._limit(name, truth, "grounded", "touches the sea floor")

    def _limit(self, name: str, truth: Truth, kind: str, what: str) -> None:
        if self._stretches.begins(truth.time, name, kind):
            self._log.event(truth.time, name, kind, f"{what}, depth {float(truth.position[2]):.2f} m")
