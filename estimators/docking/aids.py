"""What a vehicle may have besides compass and USBL: gyro, DVL, ranges, a dock's light; each with constant errors."""

from collections.abc import Mapping
from dataclasses import dataclass

from estimators.core.models import sensors
from estimators.core.models.motion import Motion
from estimators.core.states import StateSpace
from estimators.core.types import MeasurementModel
from estimators.planar.model import Biases

GYRO, BOTTOM, WATER, RANGE, LIGHT = "gyro", "dvl_bottom", "dvl_water", "range", "light"  # kinds of measurement
MOUTH = (0.0, 0.0, 0.0)  # in the filters' axes
STATES = {
    "north": "m", "east": "m", "heading": "rad", "surge": "m/s", "sway": "m/s", "yaw_rate": "rad/s",
    "current_north": "m/s", "current_east": "m/s",
}  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class Aids:
    """Sensors besides those that a docking filter always has."""

    gyro: bool = False
    dvl: bool = False  # both tracks
    # Places of the transponders of ranging sensors on the hull, (x, y) forward and starboard [m], by source. A
    # measurement's parameters say where its beacon is from the dock: north, east, and down from the transponder [m].
    ranges: Mapping[str, tuple[float, float]] | None = None
    # Places of cameras that see the light in the dock's mouth, likewise. They measure its bearing from the bow.
    lights: Mapping[str, tuple[float, float]] | None = None

    def models(self, biases: Biases) -> dict[str | tuple[str, str], MeasurementModel]:
        """Measurement models of the planar state with these biases; those of a sensor's own name are its error."""
        # Its rates are the planar process's: sensors without a lag do not ask for them.
        motion = Motion("planar", StateSpace(STATES | dict.fromkeys(biases, "1"), ("heading",)), (), lambda x, u: {})

        def own(*names: str) -> list[str | None]:
            return [name if name in biases else None for name in names]

        found: dict[str | tuple[str, str], MeasurementModel] = {}
        if self.gyro:
            found[GYRO] = sensors.gyro(motion, bias=own("gyro"))
        if self.dvl:
            found |= {
                kind: sensors.dvl(motion, track=track, bias=own("dvl_surge", "dvl_sway"))
                for kind, track in ((BOTTOM, "bottom"), (WATER, "water"))
            }
        for source, point in (self.ranges or {}).items():
            (scale,) = own(f"range_scale_{source}")
            bias = own(f"range_{source}")
            found[RANGE, source] = sensors.range_to(motion, point=point, bias=bias, scale=scale)
        for source, point in (self.lights or {}).items():
            found[LIGHT, source] = sensors.bearing_to(motion, MOUTH, point=point, bias=own(f"light_{source}"))
        return found
