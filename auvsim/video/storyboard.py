"""Which moments of a trial the video shows, how fast, and from where: time-lapse far off, slow at the dock."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from auvsim.base.frames import Array
from auvsim.missions.docking.guidance import Phase
from auvsim.video.playback import Playback

LAPSE = 25.0  # speed-up far from the dock
MISSED = 4.0  # speed-up near the dock where the vehicle does not dock
LAST_METRES = 2.0
DOCKING = 1.0
RAMP = 1.0  # change of the speed-up in a second of the trial [1/s]
NEAR = 13.0  # range at which the dock is looked at [m]
CLOSE = 6.0  # time before docking that is shown as it was [s]
LONGEST, SHORTEST = 45.0, 10.0  # of the video without its end [s]
HOLD = 2.5  # how long the end stands [s]
BANNER = 3.5  # how long an event is told [s]
LEAST_SHOT = 1.5  # shown shorter than this, a stretch away from the dock is no shot of its own [s]


@dataclass(frozen=True, kw_only=True, slots=True)
class Frame:
    """One picture of the video."""

    time: float  # of the trial [s]
    speed: float  # speed-up
    near: bool  # whether the dock is looked at
    banner: str  # what has just happened, or nothing


def storyboard(playback: Playback, fps: float, lapse: float | None = None) -> list[Frame]:
    """The pictures of the video.

    Args:
        playback: the trial.
        fps: pictures a second.
        lapse: speed-up far from the dock; by default such that the video lasts less than a minute.
    """
    times, near = playback.times, near_dock(playback)
    speeds = speed_ups(playback, near, LAPSE if lapse is None else lapse)
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
        frames.append(Frame(time=time, speed=float(speeds[at]), near=bool(near[at]), banner=banner))
    end = Frame(time=playback.end, speed=0.0, near=bool(near[-1]), banner=verdict(playback))
    return frames + [end] * round(HOLD * fps)


def near_dock(playback: Playback) -> np.ndarray:
    """Whether the dock is looked at, (n,) for the samples of the truth."""
    return playback.ranges < NEAR


def speed_ups(playback: Playback, near: np.ndarray, lapse: float) -> Array:
    """Speed-up (n,) at the samples of the truth: slow near the dock, slowest where it docks, without jumps."""
    times = playback.times
    speeds = np.where(near, min(MISSED, lapse), lapse).astype(float)
    docked = np.flatnonzero(playback.phases == Phase.DOCKED)
    if len(docked):
        since = times - times[docked[0]]
        begin = np.flatnonzero(~near[: docked[0]]).max(initial=-1) + 1  # of the last metres that led into the dock
        speeds[begin:] = np.minimum(speeds[begin:], LAST_METRES)
        speeds[(since > -CLOSE) & near] = DOCKING
    steps = RAMP * np.diff(times)
    for i in range(1, len(speeds)):
        speeds[i] = min(speeds[i], speeds[i - 1] + steps[i - 1])
    for i in range(len(speeds) - 2, -1, -1):
        speeds[i] = min(speeds[i], speeds[i + 1] + steps[i])
    return speeds


def verdict(playback: Playback) -> str:
    """How the trial ended, in a line."""
    log = playback.log
    kinds, texts, times = log["event"]["kind"], log["event"]["text"], log["event"]["time"]
    for kind, text, time in zip(kinds[::-1], texts[::-1], times[::-1], strict=True):
        if kind == "docked":
            return f"docked after {time:.0f} s, attempt {playback.at(float(time)).attempt}"
        if kind in ("aborted", "timeout", "diverged", "interrupted", "manoeuvre"):
            return f"{kind}: {text}"
    return f"not docked ({log.attributes['status']})"


def _events(playback: Playback, times: Array, shown: Array) -> list[tuple[float, str]]:
    """When in the video something happens, and what, in order."""
    start = playback.plan.vehicle.start
    told = [(0.0, f"start: {start.range:.0f} m from the dock, depth {start.depth:.0f} m")]
    event = playback.log["event"]
    for time, kind, text in zip(event["time"], event["kind"], event["text"], strict=True):
        if time <= playback.end and kind != "refused":  # a refused fix is seen by its mark
            told.append((float(np.interp(time, times, shown)), f"{kind.replace('_', ' ')}: {text}"))
    return told


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
