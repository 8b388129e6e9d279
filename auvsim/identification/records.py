"""Records of manoeuvres: what drove the vehicle and what was measured, on a uniform grid of time."""

from dataclasses import dataclass

from auvsim.physics.planar_sets import Source
from estimators.core.types import Array

MEASURED = ("north", "east", "heading", "surge", "sway", "yaw_rate", "ground_surge", "ground_sway")


@dataclass(frozen=True, kw_only=True, slots=True)
class Record:
    """One uninterrupted span of a manoeuvre on a uniform grid of time: what drove the vehicle and what was measured."""

    name: str  # file and span, for messages
    times: Array  # (n,) [s], evenly spaced
    # (n, 2) effective rudder [rad] (positive to starboard), shaft speed [rad/s], held from times[k] to times[k + 1]
    inputs: Array
    # (n, 8) in the order of MEASURED, NaN where nothing was measured; positions [m], heading [rad] (not wrapped),
    # velocities through the water (surge, sway) [m/s], yaw rate [rad/s], velocity over ground in the body's axes [m/s]
    measured: Array
    deviations: Array  # (8,) assumed standard deviation of each [same units]
    current: Array | None = None  # (2,) north, east [m/s] where it is known; None: a nuisance parameter of the record
    kind: str = ""  # of the manoeuvre, where it is known
    wind: Array | None = None  # (n, 2) apparent wind, air past the vehicle towards its bow and to starboard [m/s]
    # (n, 2) half of what the port shaft is faster than the starboard one, a side thruster's speed [rad/s]
    thrusters: Array | None = None

    @property
    def step(self) -> float:
        """Time between two samples [s]."""
        return float(self.times[-1] - self.times[0]) / (len(self.times) - 1)

    @property
    def duration(self) -> float:
        """From the first sample to the last [s]."""
        return float(self.times[-1] - self.times[0])


@dataclass(frozen=True, kw_only=True, slots=True)
class Readings:
    """All that was read from files."""

    records: tuple[Record, ...]
    sources: tuple[Source, ...]  # the files, with the hash of their bytes
    notes: tuple[str, ...]  # what was dropped, split, moved or taken as understood
