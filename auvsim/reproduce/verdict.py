"""One thing that a paper's study is to reach, and what it reached."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True, slots=True)
class Verdict:
    """One thing to reach, and what was reached."""

    row: str  # key of the study's row that it judges
    quantity: str
    measured: float
    low: float
    high: float
    deviation: float = math.nan  # standard deviation of what was measured, if known
    reason: str = ""  # why it is not met

    @property
    def met(self) -> bool:
        """Whether what was measured lies within the limits."""
        return self.low <= self.measured <= self.high

    @property
    def accept(self) -> str:
        """The limits as text."""
        if math.isinf(self.high):
            return f">= {self.low:g}"
        return f"{self.low:g} .. {self.high:g}" if self.low > 0.0 else f"<= {self.high:g}"
