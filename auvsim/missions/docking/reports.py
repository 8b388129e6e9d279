"""What a dock says of itself in its packets: means of its heading and depth, and when it was last heard."""

import math
from collections.abc import Sequence

from auvsim.base.reading import Reading


class DockReports:
    """Means over all packets so far.

    Args:
        charted: heading [rad] and depth [m] of the mouth where the dock reports nothing; None where it does.
    """

    def __init__(self, charted: tuple[float, float] | None) -> None:
        self._cos, self._sin, self._depth, self.count = 0.0, 0.0, 0.0, 0
        self.last = 0.0  # when the dock was last heard [s]
        if charted is not None:
            self._add(*charted)

    def observe(self, readings: Sequence[Reading]) -> None:
        """Takes the dock's packets among `readings`."""
        for reading in readings:
            if reading.sensor == "usbl" and all(map(math.isfinite, reading.value.tolist())):
                self._add(float(reading.value[3]), float(reading.value[6]))
                self.last = max(self.last, reading.received)

    @property
    def axis(self) -> float:
        """Course of the dock's axis [rad]."""
        return math.atan2(self._sin, self._cos)

    @property
    def depth(self) -> float:
        """Depth of the mouth [m]."""
        return self._depth / max(self.count, 1)

    def _add(self, heading: float, depth: float) -> None:
        self._cos, self._sin = self._cos + math.cos(heading), self._sin + math.sin(heading)
        self._depth, self.count = self._depth + depth, self.count + 1
