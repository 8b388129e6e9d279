"""The filter of paper 2 as published: two squared ranges and the displacement between them.

Its states are north, east [m] and the current [m/s]; the paper's x is north here, its y east. What is wrong with it is
kept: each range is used twice, ranges have no noise of their own, the covariance of the state is counted again in Q
and R, and in reading A the derivative by the state before meets the covariance of the state after.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from estimators.core.errors import NotFiniteError, ParameterError
from estimators.core.history import Input, Node
from estimators.core.models.odometry import Displacement, OdometryNoise
from estimators.core.types import NO_MODEL, Array, Gaussian, Measurement, Verdicts
from estimators.motion_radius.ranges import KIND, flattened

UNKNOWN = Gaussian(mean=np.array([10.0, -100.0, 0.0, 0.0]), covariance=np.diag([1e8, 1e8, 1e7, 1e7]))
Q = np.diag([10.0, 10.0, 2.0, 2.0, 0.05, 0.05]) ** 2  # of x, y, dx, dy, Ux, Uy, each cycle
R = np.diag([10.0] * 6 + [2.0, 2.0, 0.05, 0.05]) ** 2  # slave, leader then, leader now (x, y each), dx, dy, Ux, Uy
SIMULTANEOUS = "simultaneous"  # why a second range at one time is refused: nothing lies between the two
STEEP = "too_steep"  # why a range is refused that no range in the plan view explains
SILENT = OdometryNoise()


class Packet(NamedTuple):
    """A range in the plan view, and where the leader was."""

    distance: float  # [m]
    leader: Array  # (2,) [m]


class PaperState(NamedTuple):
    """What a node keeps: the belief at the last range, and the displacement since."""

    corrected: Gaussian
    since: Displacement = Displacement()
    last: Packet | None = None
    verdicts: Verdicts = ()

    @property
    def belief(self) -> Gaussian:
        """The prediction from the last range to now."""
        return predicted(self.corrected, self.since)


class PaperFilter:
    """The filter of eqs 1 to 18, for a `History`; inputs are forward and starboard speed [m/s] and heading [rad].

    Over lost packets it adds up the displacement, and pairs the next range with the last that came.

    Args:
        start: Belief at the first node.
        reading: "A" takes the measurement's derivative by the state before and uses it as if it were by the state
            after, as printed; "C" takes it by the state after.
        terms: Samples of displacement that eq. 1 adds up in a cycle of 8, for the print's limits k .. N + k: 8 or 9.
    """

    def __init__(
        self, start: Gaussian = UNKNOWN, *, reading: Literal["A", "C"] = "A", terms: Literal[8, 9] = 8
    ) -> None:
        if reading not in ("A", "C"):
            raise ParameterError(f"no reading '{reading}' of the paper; there are A, C")
        self._start, self._reading, self._stretch = start, reading, terms / 8.0

    def start(self, nodes: Sequence[Node[PaperState]], index: int) -> PaperState:
        """State at the first node; a range there waits for the next."""
        return self.correct(PaperState(self._start), nodes[index].time, nodes[index].measurements)

    def predict(self, state: PaperState, u: Input, duration: float) -> PaperState:
        """State after `duration` [s]: the motion radius vector grows (eq. 1)."""
        forward, starboard, heading = u
        stretch = self._stretch
        since = state.since.extended(forward * stretch, starboard * stretch, heading, duration, SILENT)
        return PaperState(state.corrected, since, state.last)

    def correct(self, state: PaperState, node_time: float, measurements: Sequence[Measurement]) -> PaperState:
        """State after a node's measurements."""
        for m in measurements:
            if m.kind != KIND:
                state = state._replace(verdicts=(*state.verdicts, (m, NO_MODEL, np.nan)))
                continue
            north, east, depth, own, _ = m.parameters
            flat = flattened(float(m.value[0]), depth - own, 0.0)
            if flat is None:
                state = state._replace(verdicts=(*state.verdicts, (m, STEEP, np.nan)))
                continue
            packet = Packet(flat[0], np.array([north, east]))
            belief, nis = state.corrected, np.nan
            if state.last is not None and state.since.duration > 0.0:
                belief, nis = corrected(state.corrected, state.since, state.last, packet, self._reading)
            elif state.last is not None:
                state = state._replace(verdicts=(*state.verdicts, (m, SIMULTANEOUS, np.nan)))
                continue
            state = PaperState(belief, Displacement(), packet, (*state.verdicts, (m, "", nis)))
        return state


def predicted(belief: Gaussian, since: Displacement) -> Gaussian:
    """Eqs 2, 9, 10 and 13, 14."""
    x, h = belief.mean, since.duration
    if h <= 0.0:
        return belief
    mean = x + np.array([since.north + h * x[2], since.east + h * x[3], 0.0, 0.0])
    F, W = transition(h)
    P = F @ belief.covariance @ F.T + W @ Q @ W.T
    return Gaussian(mean=mean, covariance=0.5 * (P + P.T))


def transition(h: float) -> tuple[Array, Array]:
    """F (4, 4) and W (4, 6), eqs 9 and 10."""
    F = np.eye(4)
    F[0, 2] = F[1, 3] = h
    W = np.hstack((F[:, :2], F))
    return F, W


def derivatives(a: Array, b: Array, h: float) -> tuple[Array, Array]:
    """H (2, 4) by the state before and V (2, 10), eqs 11 and 12, of the vectors leader to slave before and after."""
    none = np.zeros(2)
    H = 2.0 * np.vstack((np.hstack((a, none)), np.hstack((b, h * b))))
    V = 2.0 * np.vstack((np.hstack((a, -a, np.zeros(6))), np.hstack((b, none, -b, b, h * b))))
    return H, V


def corrected(
    belief: Gaussian, since: Displacement, before: Packet, now: Packet, reading: str
) -> tuple[Gaussian, float]:
    """Eqs 15 to 18, and the NIS.

    Raises:
        NotFiniteError: The correction is not finite.
    """
    x, h = belief.mean, since.duration
    a = x[:2] - before.leader
    b = x[:2] + (since.north, since.east) + h * x[2:] - now.leader
    H, V = derivatives(a, b, h)
    if reading == "C":
        H = 2.0 * np.vstack((np.hstack((a, -h * a)), np.hstack((b, np.zeros(2)))))
    prior = predicted(belief, since)
    residual = np.array([before.distance**2 - a @ a, now.distance**2 - b @ b])
    noise = V @ R @ V.T
    S = H @ prior.covariance @ H.T + noise
    K = np.linalg.solve(S, H @ prior.covariance).T
    A = np.eye(4) - K @ H
    P = A @ prior.covariance @ A.T + K @ noise @ K.T  # Joseph's form: P1 and P differ by ten orders of magnitude
    mean = prior.mean + K @ residual
    if not (np.isfinite(mean).all() and np.isfinite(P).all()):
        raise NotFiniteError(f"correction of {x} by the ranges {before.distance} and {now.distance} m is not finite")
    return Gaussian(mean=mean, covariance=0.5 * (P + P.T)), float(residual @ np.linalg.solve(S, residual))
