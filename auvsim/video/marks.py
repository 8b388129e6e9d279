"""What is drawn into the scene beside its bodies: tracks, fixes, the estimate, the water's motion, enlarged symbols."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from auvsim.base.frames import Array
from auvsim.video.layer import ARROW, DOT, LINE, Colour, Layer, Mark
from auvsim.video.playback import Belief, Moment, Playback

TRUE: Colour = (1.0, 0.86, 0.15, 1.0)
ESTIMATE: Colour = (1.0, 0.25, 0.78, 1.0)
FIX: Colour = (0.95, 0.97, 1.0, 1.0)
REFUSED: Colour = (1.0, 0.15, 0.1, 1.0)
CURRENT: Colour = (0.45, 0.95, 1.0, 1.0)
DOCK: Colour = (1.0, 0.55, 0.2, 1.0)
MOTE: Colour = (0.75, 0.92, 0.92, 1.0)

SIGMAS = 2.0  # of the ellipse round the estimate
MOTES, MOTE_CUBE = 90, 11.0  # specks in the water round the vehicle, and the side of the cube they fill [m]
ARROW_TIME = 7.0  # [s]
STILL_WATER = 0.01  # slower water has no arrows [m/s]


@dataclass(frozen=True, kw_only=True)
class Tracks:
    """Tracks as marks, thinned out, and the ends that still move."""

    true: Array  # (n, 3) corners
    true_times: Array
    estimated: Array
    estimated_times: Array
    marks: list[Mark]

    @classmethod
    def of(cls, playback: Playback, spacing: float, dot: float) -> "Tracks":
        """The tracks with corners at least `spacing` apart, and the fixes as dots of half width `dot` [m]."""
        true = _thin(playback.positions, spacing)
        estimated = _thin(playback.belief_positions, spacing)
        corners = playback.positions[true], playback.times[true]
        beliefs = playback.belief_positions[estimated], playback.belief_times[estimated]
        marks = [*_polyline(*corners, 3.0, TRUE), *_polyline(*beliefs, 2.0, ESTIMATE)]
        for time, place, taken in zip(*playback.received_fixes(), strict=True):
            marks.append(Mark(float(time), DOT, dot, place, place, FIX if taken else REFUSED))
        return cls(
            true=corners[0], true_times=corners[1], estimated=beliefs[0], estimated_times=beliefs[1], marks=marks
        )

    def tips(self, layer: Layer, moment: Moment) -> None:
        """Draws both tracks from their last corner to where they are now."""
        _tip(layer, self.true, self.true_times, moment.time, moment.position, 3.0, TRUE)
        if moment.belief is not None:
            _tip(layer, self.estimated, self.estimated_times, moment.time, moment.belief.position, 2.0, ESTIMATE)


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
        self._tracks = Tracks.of(playback, 1.0, 0.03)
        marks = self._tracks.marks + _axis(playback, 1.0, 40.0)
        self.layer = Layer(playback, marks, overview=False)
        self._motes = np.random.default_rng(0).uniform(0.0, MOTE_CUBE, (MOTES, 3))
        self._length = 2.0 * playback.nose

    def update(self, moment: Moment, speed: float) -> None:
        """Draws the moment; in time-lapse specks would only flicker."""
        layer = self.layer
        layer.begin(moment)
        self._tracks.tips(layer, moment)
        if moment.belief is not None:
            _ellipse(layer, moment.belief, 0.01)
            matrix = _turned(-moment.belief.heading)
            layer.ball((0.5 * self._length, 0.07, 0.07), moment.belief.position, matrix, (*ESTIMATE[:3], 0.35))
        if float(np.linalg.norm(moment.current)) > STILL_WATER:
            self._arrows(moment)
        if speed <= 5.0:
            self._specks(moment)

    def _arrows(self, moment: Moment) -> None:
        """Arrows round the vehicle that show where the water flows, each as far as it flows in ARROW_TIME."""
        flow = ARROW_TIME * moment.current
        side = np.array([-flow[1], flow[0], 0.0]) / max(float(np.linalg.norm(flow[:2])), 1e-9)
        for across in (-2.2, 2.2):
            for along in (-1.0, 1.0):
                start = moment.position + across * side + along * 2.4 * _unit(flow) - 0.5 * flow + [0.0, 0.0, -0.25]
                self.layer.join(ARROW, 0.022, start, start + flow, CURRENT)

    def _specks(self, moment: Moment) -> None:
        corner = moment.position - 0.5 * MOTE_CUBE
        places = corner + np.mod(self._motes + moment.drift - corner, MOTE_CUBE)
        trail = 0.05 * moment.current + [0.0, 0.0, 0.012]  # at least so long that it covers a pixel
        for place in places:
            self.layer.join(LINE, 2.0, place, place + trail, MOTE)


class FarMarks:
    """The marks of the overview, in which vehicle and dock would be smaller than a pixel: symbols stand for them."""

    def __init__(self, playback: Playback, distance: float) -> None:
        self.unit = unit = 0.01 * distance
        self._tracks = Tracks.of(playback, 1.0 * unit, 0.22 * unit)
        self.above = np.array([0.0, 0.0, 3.4 * unit])  # from a symbol to its name
        marks = (
            self._tracks.marks
            + _funnel(playback, unit)
            + _axis(playback, 1.6 * unit, playback.plan.guidance.gate_distance)
        )
        self.layer = Layer(playback, marks, overview=True)
        self._floor = playback.model.geom("sea_floor").pos[2]
        low, high = playback.positions[:, :2].min(axis=0), playback.positions[:, :2].max(axis=0)
        low, high = np.minimum(low, 0.0) - 6.0 * unit, np.maximum(high, 0.0) + 6.0 * unit
        counts = np.maximum(np.round((high - low) / (14.0 * unit)), 1).astype(int)
        grid = [np.linspace(low[i], high[i], counts[i] + 1) for i in range(2)]
        self._stations = [np.array([x, y, playback.mouth[2]]) for x in grid[0] for y in grid[1]][:200]

    def update(self, moment: Moment, speed: float) -> None:
        """Draws the moment."""
        layer, unit = self.layer, self.unit
        layer.begin(moment)
        self._tracks.tips(layer, moment)
        forward = _turned(-moment.heading)[:, 0]
        foot = np.array([*moment.position[:2], self._floor])
        layer.join(LINE, 1.0, moment.position, foot, (1.0, 1.0, 1.0, 0.5))
        if moment.belief is not None:
            _ellipse(layer, moment.belief, 0.02 * unit)
            layer.ball((0.5 * unit,) * 3, moment.belief.position, np.eye(3), ESTIMATE)
        layer.join(
            ARROW, 0.6 * unit, moment.position - 3.5 * unit * forward, moment.position + 3.5 * unit * forward, TRUE
        )
        if float(np.linalg.norm(moment.current)) > STILL_WATER:
            speed = float(np.linalg.norm(moment.current))
            length = min(30.0 * speed, 11.0) * unit  # no longer than to the next arrow
            flow = length * moment.current / speed
            for station in self._stations:
                layer.join(
                    ARROW,
                    min(0.14 * unit, 0.08 * length),
                    station - 0.5 * flow,
                    station + 0.5 * flow,
                    (*CURRENT[:3], 0.75),
                )


def _ellipse(layer: Layer, belief: Belief, thickness: float) -> None:
    """The ellipse of the horizontal position that the covariance claims, as a thin disc."""
    values, vectors = np.linalg.eigh(belief.covariance)
    if values[0] <= 0.0:
        return
    north, east = vectors[:, 1]
    size = SIGMAS * np.sqrt(values[::-1])
    layer.ball((*size, thickness), belief.position, _turned(math.atan2(-east, north)), (*ESTIMATE[:3], 0.22))


def _axis(playback: Playback, dash: float, length: float) -> list[Mark]:
    """The dock's axis, dashed, on the side from which vehicles come."""
    outward = -playback.axis
    starts = np.arange(dash, length, 2.0 * dash)
    line = [(playback.mouth + s * outward, playback.mouth + (s + dash) * outward) for s in starts]
    return [Mark(-math.inf, LINE, 1.0, a, b, (*DOCK[:3], 0.8)) for a, b in line]


def _funnel(playback: Playback, unit: float) -> list[Mark]:
    """The dock enlarged: two rings and the ribs between them."""
    axis = playback.axis
    side, up = np.array([-axis[1], axis[0], 0.0]), np.array([0.0, 0.0, 1.0])
    angles = np.linspace(0.0, 2.0 * math.pi, 13)
    round_about = np.outer(np.cos(angles), side) + np.outer(np.sin(angles), up)
    mouth = playback.mouth + 2.4 * unit * round_about
    throat = playback.mouth + 3.0 * unit * axis + 0.6 * unit * round_about
    pairs = [*pairwise(mouth), *pairwise(throat)]
    pairs += list(zip(mouth[:-1], throat[:-1], strict=True))
    pairs.append((playback.mouth + 3.0 * unit * axis, playback.mouth + 5.0 * unit * axis))
    return [Mark(-math.inf, LINE, 2.0, a, b, DOCK) for a, b in pairs]


def _turned(angle: float) -> Array:
    """Rotation matrix (3, 3) about MuJoCo's z axis."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def _unit(vector: Array) -> Array:
    return vector / max(float(np.linalg.norm(vector)), 1e-9)
