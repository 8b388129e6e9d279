"""Cells of speed and direction of the current, and which one a trial belongs to."""

import math
from dataclasses import dataclass

from auvsim.campaign.report.content import Content, Row

# Columns, of a scenario in the short form or in full.
SPEED = ("current.speed", "water.current.speed")
DIRECTION = ("current.direction_deg", "water.current.direction_deg")
DOCK = "dock.heading_deg"
SECTORS, FINE_SECTORS = 8, 16  # of direction; fine ones from so many trials of a variant on:
FINE = 1000
PER_CELL = 8  # trials that a cell should hold on average
RINGS = (2, 6)  # of speed, at least and at most


@dataclass(frozen=True, kw_only=True, slots=True)
class Frame:
    """What directions are counted from, clockwise."""

    title: str
    choice: str  # in the menu
    names: tuple[str, str, str, str]  # of the directions 0, 90, 180 and 270 degrees
    reference: str | None  # column of the direction 0 [deg]; None: north

    def direction(self, row: Row) -> float | None:
        """Where the water of a trial flows to [deg]."""
        direction, zero = _value(row, DIRECTION), 0.0 if self.reference is None else row.get(self.reference)
        return None if direction is None or zero is None else (direction - zero) % 360.0


FRAMES = {
    "compass": Frame(title="North is up", choice="by compass", names=("N", "E", "S", "W"), reference=None),
    "dock": Frame(
        title="The way into the dock is up",
        choice="by the dock's axis",
        names=("inward", "to starboard", "outward", "to port"),
        reference=DOCK,
    ),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Cells:
    """Rings of speed and sectors of direction, the first sector round the direction 0."""

    edges: tuple[float, ...]  # (rings + 1,) [m/s]
    sectors: int

    def place(self, row: Row, frame: str) -> str:
        """The cell of a trial as `ring,sector`; empty if it has no speed or direction."""
        speed, direction = _value(row, SPEED), FRAMES[frame].direction(row)
        if speed is None or direction is None:
            return ""
        ring = sum(speed >= edge for edge in self.edges[1:-1])
        return f"{ring},{round(direction * self.sectors / 360.0) % self.sectors}"

    def label(self, ring: int, sector: int, frame: str) -> str:
        """A cell in words: speeds and directions."""
        width = 360.0 / self.sectors
        start, end = ((sector - 0.5) * width) % 360.0, ((sector + 0.5) * width) % 360.0
        quarter, rest = divmod(4 * sector, self.sectors)
        name = f" ({FRAMES[frame].names[quarter]})" if rest == 0 else ""
        zero = "" if FRAMES[frame].reference is None else " from the dock's axis"
        return f"current {self.edges[ring]:g} to {self.edges[ring + 1]:g} m/s, {start:g}° to {end:g}°{zero}{name}"


def frames(content: Content) -> list[str]:
    """Frames in which some trial has a direction; that of the dock only where a vehicle docks."""
    possible = {
        name: frame for name, frame in FRAMES.items() if not frame.reference or "docking" in content.layout.kinds
    }
    return [name for name, frame in possible.items() if any(frame.direction(row) is not None for row in content.rows)]


def choose(content: Content) -> Cells | None:
    """Cells as fine as the trials of one variant allow; None where speed and direction are not drawn."""
    pairs = [(_value(row, SPEED), _value(row, DIRECTION)) for row in content.rows]
    known = [(speed, direction) for speed, direction in pairs if speed is not None and direction is not None]
    if len(set(known)) < 2:
        return None
    each = len(known) / len(content.variants)
    sectors = FINE_SECTORS if each >= FINE else SECTORS
    rings = min(max(round(each / sectors / PER_CELL), RINGS[0]), RINGS[1])
    speeds = [speed for speed, _ in known]
    return Cells(edges=_edges(min(speeds), max(speeds), rings), sectors=sectors)


def _value(row: Row, columns: tuple[str, ...]) -> float | None:
    """The value of the first of some columns that has one."""
    return next((row[name] for name in columns if row.get(name) is not None), None)


def _edges(low: float, high: float, rings: int) -> tuple[float, ...]:
    """Evenly spaced speeds, from 0 unless all are high; of about as many rings as wanted those with round edges."""
    low = 0.0 if low < 0.35 * high else math.floor(20.0 * low) / 20.0
    width = max(math.ceil(20.0 * high - 1e-9) / 20.0 - low, 0.05)
    round_edges = [n for n in (rings, rings + 1, rings - 1) if math.isclose(200.0 * width / n % 1.0, 0.0, abs_tol=1e-9)]
    count = next(iter(round_edges), rings)
    return tuple(round(low + width * edge / count, 3) for edge in range(count + 1))
