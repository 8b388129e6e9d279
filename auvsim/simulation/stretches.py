"""Conditions that last for a while, each told once: when it begins after a time without it."""

QUIET = 5.0  # time without a condition after which it is over [s]


class Stretches:
    """Says when conditions begin; one that comes and goes within `QUIET`, as in waves, is one stretch."""

    def __init__(self) -> None:
        self._last: dict[tuple[str, ...], float] = {}

    def begins(self, time: float, *condition: str) -> bool:
        """Whether a stretch of a condition, which holds now, begins now.

        Args:
            time: now [s].
            condition: its names, such as of a vehicle and of what happens to it.
        """
        last = self._last.get(condition)
        self._last[condition] = time
        return last is None or time - last > QUIET
