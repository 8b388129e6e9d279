"""What is drawn into the scene beside its bodies: tracks, fixes, the estimate, the water's motion, enlarged symbols."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from auvsim.base import yaml_text
from auvsim.base.frames import Array
from auvsim.physics import scenery
from auvsim.video.layer import ARROW, DOT, LINE, Colour, Layer, Mark
from auvsim.video.motion import Belief, Motion, VehicleMoment
from auvsim.video.playback import Dock, Moment, Playback
from auvsim.video.pulses import Pulses

TRUE: Colour = (1.0, 0.86, 0.15, 1.0)
ESTIMATE: Colour = (1.0, 0.25, 0.78, 1.0)
FIX: Colour = (0.95, 0.97, 1.0, 1.0)
REFUSED: Colour = (1.0, 0.15, 0.1, 1.0)
CURRENT: Colour = (0.45, 0.95, 1.0, 1.0)
DOCK: Colour = (1.0, 0.55, 0.2, 1.0)
MOTE: Colour = (0.75, 0.92, 0.92, 1.0)
BEACON: Colour = (0.72, 0.53, 0.04, 1.0)

FLEET: tuple[Colour, ...] = (  # of several vehicles, each with colours of its own
    TRUE, (0.35, 0.9, 0.2, 1.0), (0.62, 0.45, 1.0, 1.0), (0.95, 0.5, 0.5, 1.0), (0.3, 0.6, 1.0, 1.0)
)  # fmt: skip

SIGMAS = 2.0  # of the ellipse round the estimate
MOTES, MOTE_CUBE = 90, 11.0  # specks in the water round the vehicle, and the side of the cube they fill [m]
ARROW_TIME = 7.0  # [s]
GATE_DISTANCE = 200.0  # length of a dock's axis where the log does not say how far its gate is [m]
STILL_WATER = 0.01  # slower water has no arrows [m/s]


@dataclass(frozen=True, kw_only=True)
class Tracks:
    """Tracks as marks, thinned out, and the ends that still move."""

    colour: Colour  # of the true one
    true: Array  # (n, 3) corners
    true_times: Array
    estimated: Array
    estimated_times: Array
    marks: list[Mark]

    @classmethod
    def of(cls, motion: Motion, colour: Colour, spacing: float, dot: float) -> "Tracks":
        """The tracks with corners at least `spacing` apart, and the fixes as dots of half width `dot` [m]."""
        true = _thin(motion.positions, spacing)
        estimated = _thin(motion.belief_positions, spacing)
        corners = motion.positions[true], motion.times[true]
        beliefs = motion.belief_positions[estimated], motion.belief_times[estimated]
        marks = [*_polyline(*corners, 3.0, colour), *_polyline(*beliefs, 2.0, ESTIMATE)]
        fixes = motion.received_fixes()
        for time, place, reason in zip(fixes.times, fixes.places, fixes.reasons, strict=True):
            marks.append(Mark(float(time), DOT, dot, place, place, REFUSED if reason else FIX))
        true, estimated = corners, beliefs
        return cls(
            colour=colour,
            true=true[0],
            true_times=true[1],
            estimated=estimated[0],
            estimated_times=estimated[1],
            marks=marks,
        )

    def tips(self, layer: Layer, time: float, now: VehicleMoment) -> None:
        """Draws both tracks from their last corner to where they are now."""
        _tip(layer, self.true, self.true_times, time, now.position, 3.0, self.colour)
        if now.belief is not None:
            _tip(layer, self.estimated, self.estimated_times, time, now.belief.position, 2.0, ESTIMATE)


def colour_of(playback: Playback, vehicle: str) -> Colour:
    """The colour of a vehicle's true track and name."""
    return FLEET[list(playback.motions).index(vehicle) % len(FLEET)]


def _all_tracks(playback: Playback, spacing: float, dot: float) -> dict[str, Tracks]:
    """The tracks of all vehicles, by name."""
    return {
        name: Tracks.of(motion, colour_of(playback, name), spacing, dot) for name, motion in playback.motions.items()
    }


def _thin(points: Array, spacing: float) -> list[int]:
    """Indices of points that are at least `spacing` apart, the first among them."""
    kept: list[int] = []
    for index, point in enumerate(points):
        if not kept or float(np.linalg.norm(point - points[kept[-1]])) >= spacing:
            kept.append(index)
    return kept


def _polyline(points: Array, times: Array, width: float, colour: Colour) -> list[Mark]:
    return [Mark(float(times[i + 1]), LINE, width, points[i], points[i + 1], colour) for i in range(len(points) - 1)]


def _tip(layer: Layer, points: Array, times: Array, time: float, end: Array, width: float, colour: Colour) -> None:
    last = int(np.searchsorted(times, time, side="right")) - 1
    if last >= 0:
        layer.join(LINE, width, points[last], end, colour)


class NearMarks:
    """The marks of views of some metres: tracks, ghost of the estimate, specks and arrows that move with the water."""

    def __init__(self, playback: Playback) -> None:
        self._tracks = _all_tracks(playback, 1.0, 0.03)
        marks = [mark for tracks in self._tracks.values() for mark in tracks.marks]
        marks += [mark for dock in playback.docks.values() for mark in _axis(dock, 1.0, 40.0)]
        self.layer = Layer(playback, marks, overview=False)
        self._motes = np.random.default_rng(0).uniform(0.0, MOTE_CUBE, (MOTES, 3))
        self._lengths = {name: 2.0 * motion.log.number("nose") for name, motion in playback.motions.items()}

    def update(self, moment: Moment, vehicle: str, speed: float) -> None:
        """Draws the moment round a vehicle; in time-lapse specks would only flicker."""
        layer, centre = self.layer, moment.vehicles[vehicle]
        layer.begin(moment.time, centre.position)
        for name, now in moment.vehicles.items():
            if float(np.linalg.norm(now.position - centre.position)) > scenery.MURK[1]:
                continue  # the water hides it
            self._tracks[name].tips(layer, moment.time, now)
            if now.belief is not None:
                _ellipse(layer, now.belief, 0.01)
                matrix = _turned(-now.belief.heading)
                size = (0.5 * self._lengths[name], 0.07, 0.07)
                layer.ball(size, now.belief.position, matrix, (*ESTIMATE[:3], 0.35))
        if float(np.linalg.norm(centre.current)) > STILL_WATER:
            self._arrows(centre)
        if speed <= 5.0:
            self._specks(centre)

    def _arrows(self, now: VehicleMoment) -> None:
        """Arrows round the vehicle that show where the water flows, each as far as it flows in ARROW_TIME."""
        flow = ARROW_TIME * now.current
        side = np.array([-flow[1], flow[0], 0.0]) / max(float(np.linalg.norm(flow[:2])), 1e-9)
        for across in (-2.2, 2.2):
            for along in (-1.0, 1.0):
                start = now.position + across * side + along * 2.4 * _unit(flow) - 0.5 * flow + [0.0, 0.0, -0.25]
                self.layer.join(ARROW, 0.022, start, start + flow, CURRENT)

    def _specks(self, now: VehicleMoment) -> None:
        corner = now.position - 0.5 * MOTE_CUBE
        places = corner + np.mod(self._motes + now.drift - corner, MOTE_CUBE)
        trail = 0.05 * now.current + [0.0, 0.0, 0.012]  # at least so long that it covers a pixel
        for place in places:
            self.layer.join(LINE, 2.0, place, place + trail, MOTE)


class FarMarks:
    """The marks of the overview, in which vehicles and docks would be smaller than a pixel: symbols stand for them."""

    def __init__(self, playback: Playback, distance: float) -> None:
        self.unit = unit = 0.01 * distance
        self._tracks = _all_tracks(playback, 1.0 * unit, 0.22 * unit)
        self.above = np.array([0.0, 0.0, 3.4 * unit])  # from a symbol to its name
        marks = [mark for tracks in self._tracks.values() for mark in tracks.marks]
        for dock in playback.docks.values():
            marks += _funnel(dock, unit) + _axis(dock, 1.6 * unit, _gate_distance(playback, dock))
        self.layer = Layer(playback, marks, overview=True)
        self._floor = playback.model.geom("sea_floor").pos[2]
        self._stations = _stations(playback, unit)
        self._pulses = Pulses(playback)
        self._beacons = [*playback.beacons.values()]

    def update(self, moment: Moment) -> None:
        """Draws the moment."""
        layer, unit = self.layer, self.unit
        layer.begin(moment.time, moment.followed.position)
        for name, now in moment.vehicles.items():
            tracks = self._tracks[name]
            tracks.tips(layer, moment.time, now)
            forward = 3.5 * unit * _turned(-now.heading)[:, 0]
            foot = np.array([*now.position[:2], self._floor])
            layer.join(LINE, 1.0, now.position, foot, (1.0, 1.0, 1.0, 0.5))
            if now.belief is not None:
                _ellipse(layer, now.belief, 0.02 * unit)
                layer.ball((0.5 * unit,) * 3, now.belief.position, np.eye(3), ESTIMATE)
            layer.join(ARROW, 0.6 * unit, now.position - forward, now.position + forward, tracks.colour)
        for place in self._beacons:
            layer.ball((0.9 * unit,) * 3, place, np.eye(3), BEACON)
        self._pulses.draw(layer, moment.time)
        self._flow(moment.followed.current)

    def _flow(self, current: Array) -> None:
        """Arrows of the current (3,) [m/s] at every station."""
        speed = float(np.linalg.norm(current))
        if speed <= STILL_WATER:
            return
        length = min(30.0 * speed, 11.0) * self.unit  # no longer than to the next arrow
        half, width = 0.5 * length * current / speed, min(0.14 * self.unit, 0.08 * length)
        for station in self._stations:
            self.layer.join(ARROW, width, station - half, station + half, (*CURRENT[:3], 0.75))


def _stations(playback: Playback, unit: float) -> list[Array]:
    """Where the overview shows the current: a grid over tracks and docks, at the depth of the first of either."""
    mouths = [dock.mouth for dock in playback.docks.values()]
    places = np.concatenate([*(motion.positions for motion in playback.motions.values()), np.reshape(mouths, (-1, 3))])
    low, high = places[:, :2].min(axis=0) - 6.0 * unit, places[:, :2].max(axis=0) + 6.0 * unit
    counts = np.maximum(np.round((high - low) / (14.0 * unit)), 1).astype(int)
    grid = [np.linspace(low[i], high[i], counts[i] + 1) for i in range(2)]
    depth = (mouths or [places[0]])[0][2]
    return [np.array([x, y, depth]) for x in grid[0] for y in grid[1]][:200]


def _gate_distance(playback: Playback, dock: Dock) -> float:
    """How long a dock's axis is drawn [m]: to the gate of the first mission to it."""
    for motion in playback.motions.values():
        if motion.log.attributes.get("dock") == dock.name and "mission_settings" in motion.log.attributes:
            settings = yaml_text.read(str(motion.log.attributes["mission_settings"]), "log").value
            distance = settings.get("gate_distance") if isinstance(settings, Mapping) else None
            return float(distance) if isinstance(distance, int | float) else GATE_DISTANCE
    return GATE_DISTANCE


def _ellipse(layer: Layer, belief: Belief, thickness: float) -> None:
    """The ellipse of the horizontal position that the covariance claims, as a thin disc."""
    values, vectors = np.linalg.eigh(belief.covariance)
    if values[0] <= 0.0:
        return
    north, east = vectors[:, 1]
    size = SIGMAS * np.sqrt(values[::-1])
    layer.ball((*size, thickness), belief.position, _turned(math.atan2(-east, north)), (*ESTIMATE[:3], 0.22))


def _axis(dock: Dock, dash: float, length: float) -> list[Mark]:
    """The dock's axis, dashed, on the side from which vehicles come."""
    outward = -dock.axis
    starts = np.arange(dash, length, 2.0 * dash)
    line = [(dock.mouth + s * outward, dock.mouth + (s + dash) * outward) for s in starts]
    return [Mark(-math.inf, LINE, 1.0, a, b, (*DOCK[:3], 0.8)) for a, b in line]


def _funnel(dock: Dock, unit: float) -> list[Mark]:
    """The dock enlarged: two rings and the ribs between them."""
    axis = dock.axis
    side, up = np.array([-axis[1], axis[0], 0.0]), np.array([0.0, 0.0, 1.0])
    angles = np.linspace(0.0, 2.0 * math.pi, 13)
    round_about = np.outer(np.cos(angles), side) + np.outer(np.sin(angles), up)
    mouth = dock.mouth + 2.4 * unit * round_about
    throat = dock.mouth + 3.0 * unit * axis + 0.6 * unit * round_about
    pairs = [*pairwise(mouth), *pairwise(throat)]
    pairs += list(zip(mouth[:-1], throat[:-1], strict=True))
    pairs.append((dock.mouth + 3.0 * unit * axis, dock.mouth + 5.0 * unit * axis))
    return [Mark(-math.inf, LINE, 2.0, a, b, DOCK) for a, b in pairs]


def _turned(angle: float) -> Array:
    """Rotation matrix (3, 3) about MuJoCo's z axis."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def _unit(vector: Array) -> Array:
    return vector / max(float(np.linalg.norm(vector)), 1e-9)
