"""Whether a docking says the truth about why it gave up: its reasons against the truth in the log."""

import math
import re
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from auvsim.base import yaml_text
from auvsim.base.frames import Array
from auvsim.data.log import VehicleLog
from auvsim.missions.docking.decisions import DEPTH_LENGTH
from auvsim.missions.docking.dock_frame import in_dock_frame, nose_position, to_body
from auvsim.missions.docking.speeds import ground_speed_along

KINDS = ("aborted", "timeout", "go_around", "jammed")  # of events that give a reason
RIM = 0.1  # inside the mouth's radius, where the hull meets the rim [m]
RECENT = 10.0  # time for which a contact counts as present [s]
CLOCK_OFF = 1.0  # offset of a clock that is off [s]
CLOCK_ERROR = 3.0  # by which a stated offset may be wrong [s]
CREEPS = 0.3  # speed over ground with which an approach is not worth the name [m/s]


class Judgement(NamedTuple):
    """A reason that was given, and whether it was true."""

    time: float  # [s]
    kind: str
    text: str
    true: bool
    found: str  # what the truth was


def judge(log: VehicleLog) -> tuple[Judgement, ...]:
    """Judges all reasons in a log: of the end, and of attempts that were broken off."""
    events, found = log["event"], []
    for time, kind, text in zip(events["time"].tolist(), events["kind"], events["text"], strict=True):
        if kind in KINDS:
            true, truth = _verdict(_Moment(log, time), text)
            found.append(Judgement(time, str(kind), str(text), true, truth))
    return tuple(found)


class _Moment:
    """The truth at a time [s]."""

    def __init__(self, log: VehicleLog, time: float) -> None:
        self.log, self.time = log, time
        truth, self.dock = log["truth"], log.structure
        assert self.dock is not None
        self.nose = in_dock_frame(self.dock, nose_position(log))  # (n, 3)
        self.times = truth["time"]
        self.now = min(int(np.searchsorted(self.times, time)), len(self.times) - 1)
        self.along, self.cross, self.below = self.nose[self.now].tolist()
        self.current: tuple[float, float] = tuple(truth["current"][self.now, :2].tolist())
        self.radius, self.latched = self.dock.number("mouth_radius"), self.dock.number("latched", 1.0)
        text = str(log.log.attributes["scenario"])
        self.scenario = yaml_text.read(text, "scenario of the log").value or {}
        self.guidance = self.scenario["vehicles"][log.name]["mission"]

    @property
    def off(self) -> float:
        """Distance of the nose from the dock's axis [m]."""
        return math.hypot(self.cross, self.below)

    def touched(self) -> bool:
        """Whether there was contact a moment ago."""
        contact = self.log["contact"]["time"]
        return bool(np.any((contact > self.time - RECENT) & (contact <= self.time)))

    def fixes(self, since: float) -> tuple[int, int]:
        """Fixes accepted and refused between a time and now [s]."""
        heard = self.log["measurements"]
        ranges = {name for name, s in self._sensors().items() if isinstance(s, dict) and s.get("kind") == "range"}
        named = np.isin(heard["sensor"].astype(str), ["usbl", *ranges])
        kept = named & (heard["time"] > since) & (heard["time"] <= self.time)
        accepted = heard["accepted"][kept]
        return int(np.count_nonzero(accepted)), int(np.count_nonzero(~accepted))

    def _sensors(self) -> dict:
        return self.scenario["vehicles"][self.log.name]["sensors"]

    def through_water(self) -> Array:
        """Speed through the water (n,) [m/s]."""
        truth = self.log["truth"]
        return np.linalg.norm(truth["nu"][:, :3] - to_body(truth["quaternion"], truth["current"]), axis=1)


def _verdict(here: _Moment, text: str) -> tuple[bool, str]:
    reason = re.split(r"; attempt |, waits at the gate: ", text)[-1 if "waits at the gate" in text else 0]
    for pattern, check in CHECKS:
        if match := re.match(pattern, reason):
            return check(here, *match.groups())
    return reason.startswith("not docked within"), "no reason is given"


def _occupied(here: _Moment, other: str) -> tuple[bool, str]:
    assert here.dock is not None
    moment = here.log.log.vehicle(other)
    k = min(int(np.searchsorted(moment["truth"]["time"], here.time)), len(moment["truth"]["time"]) - 1)
    along, cross, below = in_dock_frame(here.dock, nose_position(moment)[k : k + 1])[0].tolist()
    inside = along > 0.0 and math.hypot(cross, below) < here.radius
    return inside, f"its nose was {along:.1f} m behind the mouth, {math.hypot(cross, below):.1f} m off the axis"


def _silent(here: _Moment, seconds: str, refused: str | None, clock: str | None) -> tuple[bool, str]:
    accepted, others = here.fixes(here.time - float(seconds) + 1.0)
    offset = here.scenario["network"]["acoustics"]["clock_offset"]
    counted = abs(others - int(refused or 0)) <= 2  # those that came within a second of the last one of use
    true = accepted == 0 and counted and (abs(offset) > CLOCK_OFF or not clock)
    return true, f"{accepted} accepted, {others} refused, the dock's clock {offset:+.1f} s"


def _clock(here: _Moment, offset: str) -> tuple[bool, str]:
    true = float(here.scenario["network"]["acoustics"]["clock_offset"])
    return abs(true) > CLOCK_OFF and abs(true - float(offset)) < CLOCK_ERROR, f"the dock's clock {true:+.1f} s"


def _too_strong(here: _Moment, current: str, fastest: str) -> tuple[bool, str]:
    assert here.dock is not None
    speed, most = math.hypot(*here.current), float(fastest)
    over_ground = ground_speed_along(here.dock.heading, most, here.current)
    named = abs(speed - float(current)) < 0.1 + 0.15 * speed and here.through_water().max() < most + 0.2
    return named and (
        over_ground < CREEPS or speed > 0.95 * most
    ), f"{speed:.2f} m/s, {over_ground:.2f} m/s over ground"


def _no_progress(here: _Moment, away: str, place: str) -> tuple[bool, str]:
    before = [here.guidance["gate_distance"], here.guidance["retry_distance"]] if place == "from the gate" else [0.0]
    found = [np.hypot(here.nose[:, 0] + distance, here.nose[:, 1]) for distance in before]
    distance = min(found, key=lambda d: abs(d[here.now] - float(away)))
    since = int(np.searchsorted(here.times, here.time - here.guidance["progress_timeout"]))
    nearer, speed = float(distance[since] - distance[since : here.now + 1].min()), math.hypot(*here.current)
    stronger = speed > here.through_water().max()
    named = abs(distance[here.now] - float(away)) < 25.0 + 0.15 * float(away)
    found = f"{distance[here.now]:.0f} m, {nearer:.0f} m nearer than before, current {speed:.2f} m/s"
    return named and nearer < 30.0 and not stronger, found


def _depth(here: _Moment, metres: str, side: str) -> tuple[bool, str]:
    claimed = float(metres) * (1.0 if side == "below" else -1.0)
    return abs(claimed - here.below) < 0.5 + 0.2 * abs(here.below), f"{here.below:+.1f} m below the axis"


def _uncertain(here: _Moment, metres: str) -> tuple[bool, str]:
    mission = here.log["mission"]
    k = min(int(np.searchsorted(mission["time"], here.time)), len(mission["time"]) - 1)
    error = abs(float(mission["cross_track"][k]) - here.cross)
    return error < 3.0 * float(metres), f"{error:.1f} m wrong"


def _would_miss(here: _Moment, metres: str) -> tuple[bool, str]:
    way = max(-here.along, 0.0)
    across, down = math.exp(-way / here.guidance["lookahead"]), math.exp(-way / DEPTH_LENGTH)
    miss = math.hypot(across * here.cross, down * here.below)
    return miss > here.radius - RIM, f"by {miss:.2f} m, {way:.1f} m before it"


def _missed(here: _Moment, metres: str) -> tuple[bool, str]:
    return here.off > here.radius - RIM, f"{here.off:.2f} m off the axis at {here.along:+.1f} m"


def _passed(here: _Moment) -> tuple[bool, str]:
    outside = here.along > 0.0 and here.off > here.radius - RIM
    return outside or here.along > here.latched, f"at {here.along:+.1f} m, {here.off:.2f} m off the axis"


def _captured_not(here: _Moment, where: str) -> tuple[bool, str]:
    inside, touched = -0.3 < here.along < here.latched + 0.5 and here.off < here.radius, here.touched()
    true = touched and inside if where == "jammed in the funnel" else not touched
    return true, f"at {here.along:+.1f} m, {here.off:.2f} m off the axis, {'' if touched else 'no '}contact"


def _jammed(here: _Moment, side: str, along: str, off: str) -> tuple[bool, str]:
    near = abs(here.along - float(along)) < 0.5 and abs(here.off - float(off)) < 0.5
    return near and here.touched(), f"at {here.along:+.1f} m, {here.off:.2f} m off the axis"


NUMBER = r"([\d.]+)"
Check = Callable[..., tuple[bool, str]]
CHECKS: tuple[tuple[str, Check], ...] = (
    (r"the dock's clock is off by ([-+][\d.]+) s: ", _clock),
    (r"the dock is occupied by '(.+)'", _occupied),
    (rf"no fix for {NUMBER} s(?:: (\d+) refused, [^:]*(: the dock's clock is off)?)?", _silent),
    (rf"current too strong for this vehicle: {NUMBER} m/s, it makes {NUMBER} m/s", _too_strong),
    (rf"no progress, {NUMBER} m (from the gate|before the entrance)", _no_progress),
    (rf"{NUMBER} m (above|below) the dock", _depth),
    (rf"(?:chance of \d+ %, )?(?:off-axis position|position across the axis) uncertain by {NUMBER} m", _uncertain),
    (rf"would miss the entrance by {NUMBER} m", _would_miss),
    (rf"entrance missed by {NUMBER} m", _missed),
    (r"entrance passed without capture", _passed),
    (r"not captured within [\d.]+ s of the last metres: (jammed in the funnel|hovering)", _captured_not),
    (r"(?:jammed )?(in|beside) the funnel: the nose at ([-+\d.]+) m, ([\d.]+) m off the axis", _jammed),
)  # fmt: skip
