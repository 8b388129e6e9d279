"""What counts as success in a campaign, as its plan says it."""

from typing import Any

from pydantic import Field, model_validator

from auvsim.base.settings import Settings


class Criterion(Settings):
    """A boolean column of the table, or a bound of a number: `success: docked`, `{metric: position_rms, below: 1}`."""

    metric: str = Field(description="column of the table: a boolean one, or a number with a bound")
    below: float | None = Field(default=None, description="a success is below this, in the column's unit")
    above: float | None = Field(default=None, description="likewise above this")

    @model_validator(mode="before")
    @classmethod
    def _named(cls, values: Any) -> Any:
        return {"metric": values} if isinstance(values, str) else values

    @property
    def bounded(self) -> bool:
        """Whether it is a bound of a number."""
        return self.below is not None or self.above is not None

    def met(self, value: Any) -> bool:
        """Whether a value of the column is a success; none is not."""
        if value is None or not self.bounded:
            return bool(value)
        return (self.below is None or value < self.below) and (self.above is None or value > self.above)
