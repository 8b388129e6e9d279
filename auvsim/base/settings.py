"""The base of every module's settings: frozen, strict, documented field by field."""

from pydantic import BaseModel, ConfigDict


class Settings(BaseModel):
    """Scenario data owned by one module.

    A field's `description` (with its unit) becomes the comment beside it in the printed default scenario.
    Unknown keys, NaN and infinities are refused. Angles are degrees in keys that end in `_deg`, shaft speeds
    revolutions per minute in keys that end in `_rpm`, everything else SI.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
