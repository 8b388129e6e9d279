"""What a log's heading and velocities are, by its own positions: counted from where, in which axes, of which sign."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import InputError
from auvsim.identification.signals import Signal, Signals

WINDOW = 10.0  # over which displacements are compared [s]
LEAST = 8  # windows
TURNED = 0.9  # mean of unit vectors of the heading above which axes cannot be told
BETTER = 0.5  # share of the residuals of the body's axes that another meaning must leave
SLIPS = 0.02  # of a displacement that noise alone may be
DRIFT = 5.0  # standard deviations of a drift that is one
Complex = NDArray[np.complex128]
PAIRS = (("ground_surge", "ground_sway"), ("surge", "sway"))


class _Meaning(NamedTuple):
    velocity: Complex  # north + i east [m/s]
    said: str


def check(one: Signals) -> list[str]:
    """Refuses velocities that heading and positions show to be something else; notes on what they are.

    Raises:
        InputError: They are in the earth's axes, of another sign, or the heading is counted otherwise; with what would
            be right.
    """
    given = one.signals
    if not {"north", "east", "heading"} <= given.keys():
        return []
    notes = []
    if not {"surge", "ground_surge"} & given.keys():
        _heading_by_course(one)
    for forward, starboard in PAIRS:
        if forward not in given:
            continue
        found = _displacements(given, forward, starboard)
        if found is None:
            continue
        moved, meanings = found
        residuals = [_residual(moved, meaning.velocity)[0] for meaning in meanings]
        best = int(np.argmin(residuals))
        floor = SLIPS * float(np.sqrt(np.mean(np.abs(moved) ** 2)))
        if best and residuals[best] < BETTER * residuals[0] and residuals[0] > floor:
            raise InputError(f"{one.name}: {forward.replace('_', ' ')} and {starboard.replace('_', ' ')}: "
                             f"{meanings[best].said}")  # fmt: skip
        notes += _over_ground(one.name, forward, moved, meanings[0].velocity)
    return notes


def _heading_by_course(one: Signals) -> None:
    """Refuses a heading that is not that of the course which the positions make good, but of it counted otherwise.

    Raises:
        InputError: It is; with the column map that would mend it.
    """
    north, east, heading = (one.signals[name] for name in ("north", "east", "heading"))
    start, stop = max(north.times[0], heading.times[0]), min(north.times[-1], heading.times[-1])
    edges = np.arange(start, stop, WINDOW)
    if len(edges) <= LEAST:
        return
    moved = np.diff(np.interp(edges, north.times, north.values) + 1j * np.interp(edges, east.times, east.values))
    psi = np.interp(0.5 * (edges[1:] + edges[:-1]), heading.times, heading.values)
    fast = np.abs(moved) > 0.3 * np.median(np.abs(moved))
    course, turn = moved[fast] / np.abs(moved[fast]), np.exp(1j * psi[fast])
    if len(course) <= LEAST or abs(turn.mean()) > TURNED:
        return
    meanings = {
        "": turn,
        "from east, against the clock: `heading: {column: ..., sign: -1, offset: 90}`": 1j * turn.conj(),
        "from east: `heading: {column: ..., offset: 90}`": 1j * turn,
        "against the clock: `heading: {column: ..., sign: -1}`": turn.conj(),
        "from the stern: `heading: {column: ..., offset: 180}`": -turn,
    }
    # A current turns the course, and drift adds to it: what agrees best by far is meant.
    agrees = {said: float(np.mean((course * by.conj()).real)) for said, by in meanings.items()}
    best = max(agrees, key=lambda said: agrees[said])
    if best and agrees[best] > 0.8 and agrees[""] < 0.4:
        raise InputError(
            f"{one.name}: positions contradict the heading, which counts {best} in --columns mends it (offset in the "
            "column's unit; and a rudder counted likewise needs `sign: -1`)"
        )


def _displacements(given: Mapping[str, Signal], forward: str, starboard: str) -> tuple[Complex, list[_Meaning]] | None:
    """Displacements by positions, and by the velocities under each meaning (n,); None where axes cannot be told."""
    ahead, heading, north, east = given[forward], given["heading"], given["north"], given["east"]
    start = max(signal.times[0] for signal in (ahead, heading, north, east))
    stop = min(signal.times[-1] for signal in (ahead, heading, north, east))
    edges = np.arange(start, stop, WINDOW)
    if len(edges) <= LEAST:
        return None
    times = ahead.times
    psi = np.interp(times, heading.times, heading.values)
    if abs(np.exp(1j * psi).mean()) > TURNED:
        return None
    u = ahead.values
    v = np.interp(times, given[starboard].times, given[starboard].values) if starboard in given else np.zeros(len(u))
    turn = np.exp(1j * psi)

    def moved(velocity: Complex) -> Complex:
        way = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(times) * (velocity[1:] + velocity[:-1]))])
        return np.diff(np.interp(edges, times, way.real) + 1j * np.interp(edges, times, way.imag))

    body = u + 1j * v
    away = "name them `velocity_north [m/s]`, `velocity_east [m/s]`"
    meanings = [
        (turn * body, ""),
        (body, f"these are velocities north and east, not the vehicle's; {away}"),
        (v + 1j * u, f"these are velocities east and north, not the vehicle's; {away}, the right way round"),
        (-turn * body, "the vehicle goes backwards by them; turn the surge round with `sign: -1` in --columns"),
        (turn * body.conj(), "sway is to port; it must be to starboard: turn it round with `sign: -1` in --columns"),
        (turn.conj() * body, "the heading counts against the clock; turn it round with `sign: -1` in --columns"),
        (
            1j * turn.conj() * body,
            "the heading counts from east, against the clock; `heading: {column: ..., sign: -1, offset: 90}` in "
            "--columns mends it (offset in the column's unit)",
        ),
    ]
    places = np.interp(edges, north.times, north.values) + 1j * np.interp(edges, east.times, east.values)
    return np.diff(places), [_Meaning(moved(velocity), said) for velocity, said in meanings]


def _residual(moved: Complex, by: Complex) -> tuple[float, float, complex, float]:
    """Rms of what scale and drift leave of displacements (n,); the scale, the drift and its standard deviation."""
    A = np.zeros((2 * len(moved), 3))
    A[: len(by), 0], A[len(by) :, 0] = by.real, by.imag
    A[: len(by), 1] = A[len(by) :, 2] = 1.0
    b = np.concatenate([moved.real, moved.imag])
    solution, *_ = np.linalg.lstsq(A, b, rcond=None)
    off = b - A @ solution
    rms = float(np.sqrt(np.mean(off**2)))
    # A velocity of the wrong sign must not pass for one by a scale below zero.
    if solution[0] < 0.0:
        return float(np.sqrt(np.mean(np.abs(moved) ** 2))), *solution[:1].tolist(), 0j, np.inf
    deviation = rms * float(np.sqrt(np.linalg.pinv(A.T @ A)[1, 1])) + 1e-9
    return rms, float(solution[0]), complex(solution[1], solution[2]), deviation


def _over_ground(name: str, forward: str, moved: Complex, by: Complex) -> list[str]:
    """Whether velocities differ from those of the positions by a steady drift."""
    rms, _, drift, deviation = _residual(moved, by)
    speed = abs(drift) / WINDOW
    drifts = abs(drift) > DRIFT * deviation and speed > 0.03 and rms < abs(drift)
    if drifts and forward == "ground_surge":
        return [
            f"{name}: the ground velocities drift by {speed:.2f} m/s against the positions: are they through the water?"
        ]
    return []
