"""Bad frames of an imaging sonar: spoiled, missing or late, by chance."""

from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from auvsim.base.settings import Settings

Fault = Literal["empty", "not_finite", "saturated", "wrong_size", "missing", "late"]
FAULTS: tuple[Fault, ...] = ("empty", "not_finite", "saturated", "wrong_size", "missing", "late")


class FaultSettings(Settings):
    """Share of the frames that go wrong in each way; none by default."""

    empty: float = Field(default=0.0, ge=0.0, le=1.0, description="share of frames that are 0 all over [-]")
    not_finite: float = Field(default=0.0, ge=0.0, le=1.0, description="share with beams that are no numbers [-]")
    saturated: float = Field(
        default=0.0, ge=0.0, le=1.0, description="share with half of the samples at the receiver's limit [-]"
    )
    wrong_size: float = Field(default=0.0, ge=0.0, le=1.0, description="share with half of the beams missing [-]")
    missing: float = Field(default=0.0, ge=0.0, le=1.0, description="share that never arrives [-]")
    late: float = Field(default=0.0, ge=0.0, le=1.0, description="share that arrives late [-]")
    delay: float = Field(default=3.0, gt=0.0, le=3600.0, description="by which those are late [s]")

    @model_validator(mode="after")
    def _shares_of_one(self) -> "FaultSettings":
        if self.total > 1.0 + 1e-9:
            raise ValueError(f"the shares of {', '.join(FAULTS)} sum up to {self.total:g}, at most 1")
        return self

    @property
    def total(self) -> float:
        """Share of all frames that go wrong."""
        return sum(getattr(self, name) for name in FAULTS)

    def of(self, chance: float) -> Fault | None:
        """What goes wrong with a frame, by a draw from U[0, 1)."""
        for name in FAULTS:
            chance -= getattr(self, name)
            if chance < 0.0:
                return name
        return None


def spoiled(frame: np.ndarray, fault: Fault | None) -> np.ndarray:
    """A frame (beams, bins) as it arrives after a fault; those of time leave it as it is."""
    if fault == "empty":
        return np.zeros_like(frame)
    if fault == "not_finite":
        broken = frame.copy()
        broken[::3] = np.nan
        return broken
    if fault == "saturated":
        return np.minimum(frame, np.median(frame))
    return frame[::2] if fault == "wrong_size" else frame
