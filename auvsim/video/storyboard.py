"""Which moments of a run the video shows, how fast, and from where: time-lapse far off, slow at the dock."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvsim.analysis.estimates import AT_REST
from auvsim.base.frames import Array
from auvsim.video.motion import Motion
from auvsim.video.playback import Playback

LAPSE = 25.0  # speed-up far from the dock
MISSED = 4.0  # speed-up near the dock where the vehicle does not dock
LAST_METRES = 2.0
DOCKING = 1.0
RAMP = 1.0  # change of the speed-up in a second of the run [1/s]
NEAR = 13.0  # range at which the dock is looked at [m]
AFTER = 5.5  # time for which a vehicle is still looked at after the end of its mission [s]
CLOSE = 6.0  # time before docking that is shown as it was [s]
LONGEST, SHORTEST = 45.0, 10.0  # of the video without its end [s]
HOLD = 2.5  # how long the end stands [s]
BANNER = 3.5  # how long an event is told [s]
LEAST_SHOT = 1.5  # shown shorter than this, a stretch away from the dock is no shot of its own [s]


@dataclass(frozen=True, kw_only=True, slots=True)
class Frame:
    """One picture of the video."""

    time: float  # of the run [s]
    speed: float  # speed-up
    near: bool  # whether the dock is looked at
    banner: str  # what has just happened, or nothing
    focus: str | None = None  # the vehicle to look at; the first by default


def storyboard(playback: Playback, fps: float, lapse: float | None = None) -> list[Frame]:
    """The pictures of the video.

    Args:
        playback: the run.
        fps: pictures a second.
        lapse: speed-up far from the dock; by default such that the video lasts less than a minute.
    """
    times, speeds, near, focus = _together(playback, LAPSE if lapse is None else lapse)
    shown = _elapsed(times, speeds)
    if lapse is None:
        factor = max(shown[-1] / LONGEST, 1.0) if shown[-1] > SHORTEST else shown[-1] / SHORTEST
        speeds = np.maximum(speeds * factor, 1.0)
        shown = _elapsed(times, speeds)
    near = _without_short_cuts(near, shown)
    counted = np.arange(0.0, shown[-1], 1.0 / fps)
    instants = [*np.interp(counted, shown, times).tolist(), playback.end]
    events = _events(playback, times, shown)
    frames = []
    for index, time in enumerate(instants):
        at = min(int(np.searchsorted(times, time)), len(times) - 1)
        banner = next((text for start, text in reversed(events) if start <= index / fps < start + BANNER), "")
        looked = Frame(time=time, speed=float(speeds[at]), near=bool(near[at]), banner=banner, focus=focus[at])
        frames.append(looked)
    end = Frame(time=playback.end, speed=0.0, near=bool(near[-1]), banner=verdict(playback), focus=focus[-1])
    return frames + [end] * round(HOLD * fps)


def near_dock(motion: Motion) -> NDArray[np.bool_]:
    """Whether a vehicle is looked at near its dock, (n,) for the samples of its truth: until it has stayed a while."""
    return (motion.ranges < NEAR) & (motion.times <= motion.over_at() + AFTER)


def looked_at(playback: Playback, time: float) -> str | None:
    """The vehicle that is looked at near its dock at a time, the nearest one; None where none is."""
    moment = playback.at(time)
    near = {
        name: now.range
        for name, now in moment.vehicles.items()
        if now.range < NEAR and time <= playback.motions[name].over_at() + AFTER
    }
    return min(near, key=lambda name: near[name]) if near else None


def speed_ups(motion: Motion, near: NDArray[np.bool_], lapse: float) -> Array:
    """Speed-up (n,) at the samples of the truth that suits one vehicle: slow near the dock, slowest where it docks."""
    times = motion.times
    speeds = np.where(near, min(MISSED, lapse), lapse).astype(float)
    docked = np.flatnonzero(motion.phases == motion.phase_names.index(AT_REST)) if AT_REST in motion.phase_names else []
    if len(docked):
        since = times - times[docked[0]]
        begin = np.flatnonzero(~near[: docked[0]]).max(initial=-1) + 1  # of the last metres that led into the dock
        last = slice(begin, None)
        speeds[last] = np.where(near[last], np.minimum(speeds[last], LAST_METRES), speeds[last])
        speeds[(since > -CLOSE) & near] = DOCKING
    return speeds


def ramped(times: Array, speeds: Array) -> Array:
    """Speed-ups (n,) without jumps: nowhere above those given, changing by at most RAMP a second of the run."""
    speeds, steps = speeds.copy(), RAMP * np.diff(times)
    for i in range(1, len(speeds)):
        speeds[i] = min(speeds[i], speeds[i - 1] + steps[i - 1])
    for i in range(len(speeds) - 2, -1, -1):
        speeds[i] = min(speeds[i], speeds[i + 1] + steps[i])
    return speeds


def _together(playback: Playback, lapse: float) -> tuple[Array, Array, NDArray[np.bool_], NDArray[Any]]:
    """Times (n,) of the run, speed-ups that suit all vehicles, whether a dock is looked at, and which vehicle."""
    times = playback.longest.times
    speeds, ranges = np.full(len(times), lapse), np.full(len(times), np.inf)
    focus = np.full(len(times), playback.first.name, dtype=object)
    for name, motion in playback.motions.items():
        near = near_dock(motion)
        at = np.clip(np.searchsorted(motion.times, times), 0, len(motion.times) - 1)  # samples of this vehicle
        moving = times <= motion.end + AFTER  # what a diverged one was near to does not matter later
        speeds = np.where(moving, np.minimum(speeds, speed_ups(motion, near, lapse)[at]), speeds)
        nearest = near[at] & moving & (motion.ranges[at] < ranges)
        ranges[nearest], focus[nearest] = motion.ranges[at][nearest], name
    looked = np.isfinite(ranges)
    latest = np.maximum.accumulate(np.where(looked, np.arange(len(times)), 0))  # between two looks, as in the last
    return times, ramped(times, speeds), looked, focus[latest]


def verdict(playback: Playback) -> str:
    """How the run ended, in a line; of several vehicles, how each did."""
    if playback.lone:
        end, count = _end_of(playback.first, "after"), playback.first.at(playback.end).count
        return f"{end}, {count}" if end.startswith("docked") else end
    ends = {name: _end_of(motion, "at") for name, motion in playback.motions.items()}
    return ", ".join(f"{name} {text}" for name, text in ends.items())


def _end_of(motion: Motion, preposition: str) -> str:
    log = motion.log
    kinds, texts, times = log["event"]["kind"], log["event"]["text"], log["event"]["time"]
    for kind, text, time in zip(kinds[::-1], texts[::-1], times[::-1], strict=True):
        if kind == "docked":
            return f"docked {preposition} {time:.0f} s"
        if kind == "done":
            return f"finished {preposition} {time:.0f} s"
        if kind in ("aborted", "timeout", "diverged", "interrupted", "manoeuvre"):
            return f"{kind}: {text}"
    wanted = "docked" if AT_REST in motion.phase_names else "finished"
    return f"not {wanted} ({log.log.attributes['status']})"


def _events(playback: Playback, times: Array, shown: Array) -> list[tuple[float, str]]:
    """When in the video something happens, and what, in order."""
    told = [(0.0, _start(playback))]
    event = playback.log.groups["event"]
    for time, vehicle, kind, text in zip(*(event[k] for k in ("time", "vehicle", "kind", "text")), strict=True):
        if time <= playback.end and kind not in ("refused", "lost"):  # a fix or packet is seen by its mark
            who = "" if playback.lone or not vehicle else f"{vehicle} "
            told.append((float(np.interp(time, times, shown)), f"{who}{kind.replace('_', ' ')}: {text}"))
    return told


def _start(playback: Playback) -> str:
    """What the video begins with."""
    if not playback.lone:
        return f"start: {len(playback.motions)} vehicles"
    motion = playback.first
    dock, depth = playback.dock_of(motion.name), -motion.positions[0, 2]
    if dock is None:
        return f"start: depth {depth:.0f} m"
    return f"start: {np.hypot(*(motion.positions[0] - dock.mouth)[:2]):.0f} m from the dock, depth {depth:.0f} m"


def _elapsed(times: Array, speeds: Array) -> Array:
    """Time in the video (n,) [s] of the samples."""
    steps = np.diff(times) / (0.5 * (speeds[1:] + speeds[:-1]))
    return np.concatenate([[0.0], np.cumsum(steps)])


def _without_short_cuts(near: np.ndarray, shown: Array) -> np.ndarray:
    """`near` with the stretches between that are too short to be a shot filled in."""
    filled = near.copy()
    edges = np.flatnonzero(np.diff(near.astype(int)))
    for leave, come in pairwise(edges):
        if near[leave] and shown[come] - shown[leave] < LEAST_SHOT:
            filled[leave : come + 1] = True
    return filled
