"""A recording through an estimator."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from auvsim.acoustics.message import Delivery
from auvsim.base.errors import InputError, unknown_name
from auvsim.base.plugins import is_own
from auvsim.navigation import registry
from auvsim.navigation.estimate import PLANAR_STATES, Estimate
from auvsim.navigation.message_gate import MessageGate
from auvsim.navigation.navigator import Buffered, Navigator
from auvsim.navigation.settings import EstimatorSettings
from auvsim.replay.recording import Recording
from auvsim.simulation.short import estimator_keys
from estimators.core.errors import EstimatorError, ParameterError
from estimators.core.innovations import Innovated, innovations
from estimators.core.types import Gaussian, Outcome

LAG = 15.0  # age from which a node of a delay buffer counts as settled [s]
STRIDE = 10.0  # time between two looks at settled nodes [s]; together less than a buffer keeps


@dataclass(frozen=True, kw_only=True, slots=True)
class Replayed:
    """What an estimator made of a recording."""

    recording: Recording
    estimator: str  # its name, with what was done to it
    states: dict[str, str]  # units by name
    estimates: list[Estimate]
    innovations: list[Innovated] = field(default_factory=list)  # by sensor and stamp; none where it does not say


def settings_for(recording: Recording, kind: str | None) -> Any:
    """Settings of an estimator of a kind: the recording's own, as far as the kind knows them.

    Raises:
        InputError: There is no such estimator.
    """
    own = recording.own
    if kind is None or kind == own.kind:
        return own
    if not is_own(kind) and kind not in registry.ALL:
        raise unknown_name("estimator", kind, [*registry.ALL, "package.module:factory of your own"])
    known = estimator_keys(kind) - {"kind", "settings"}
    values = {key: value for key, value in own.model_dump().items() if key in known}
    try:
        return TypeAdapter(EstimatorSettings).validate_python({"kind": kind, **values})
    except ValidationError as error:
        raise InputError(f"estimator '{kind}': {' '.join(str(error).split())[:200]}") from None


def replay(recording: Recording, kind: str | None = None, *, smooth: bool = False) -> list[Replayed]:
    """What an estimator makes of a recording; smoothed, too, if asked for.

    Args:
        recording: What it is given.
        kind: Of a shipped one, or package.module:factory; None: the recording's own.
        smooth: Also refine each pose by what came in the 15 to 25 s after it.

    Raises:
        InputError: There is no such estimator, it cannot be used on this recording, or not smoothed.
    """
    settings = settings_for(recording, kind)
    navigator = registry.build(recording.setup(settings))
    if smooth and not isinstance(navigator, Buffered):
        raise InputError(f"estimator '{settings.kind}' keeps no delay buffer; only one that does can be smoothed")
    settled = _Settled(navigator, smooth)
    estimates, gate, message_gate = [], recording.gate, recording.message_gate
    for tick in recording.ticks():
        try:
            readings, gated = gate.passed(tick.readings)
            messages, refused = _judged(message_gate, tick.messages)
            estimate = navigator.update(tick.time, readings, messages, tick.commands)
            gated += refused
            estimates.append(replace(estimate, outcomes=(*gated, *estimate.outcomes)) if gated else estimate)
            settled.look(tick.time)
        except EstimatorError as error:
            raise InputError(f"estimator '{settings.kind}' of {recording.name} at {tick.time:g} s: {error}") from None
    if estimates:
        settled.look(estimates[-1].time, last=True)
    states = dict(navigator.states)
    found = Replayed(
        recording=recording, estimator=settings.kind, states=states, estimates=estimates,
        innovations=settled.innovations,
    )  # fmt: skip
    if not smooth:
        return [found]
    refined = [_refined(e, settled.beliefs.get(e.time), [*states]) for e in estimates]
    return [found, replace(found, estimator=f"{settings.kind}, smoothed", estimates=refined, innovations=[])]


def _judged(gate: MessageGate, deliveries: Sequence[Delivery]) -> tuple[list[Delivery], list[Outcome]]:
    """Messages that may be heard, and the fates of others; a dock's packets are judged as readings."""
    good, refused = gate.passed([d for d in deliveries if d.message.kind != "usbl"])
    return [d for d in deliveries if d.message.kind == "usbl"] + good, refused


class _Settled:
    """Collects innovations and refined poses from a delay buffer, once nothing late changes them any more."""

    def __init__(self, navigator: Navigator, smooth: bool) -> None:
        self._navigator, self._smooth = navigator, smooth
        self._done, self._next = -np.inf, -np.inf
        self.innovations: list[Innovated] = []
        self.beliefs: dict[float, Gaussian] = {}

    def look(self, time: float, last: bool = False) -> None:
        navigator = self._navigator
        if not isinstance(navigator, Buffered) or (time < self._next and not last):
            return
        end = time if last else time - LAG
        nodes = [node for node in navigator.nodes if node.time <= end]
        start = max(0, sum(node.time <= self._done for node in nodes) - 1)
        try:
            self.innovations += innovations(nodes[start:], navigator.filter)
        except ParameterError:  # it does not know its own process
            if self._smooth:
                raise
        if self._smooth:
            self.beliefs |= {t: b for t, b in navigator.smoothed() if self._done < t <= end}
        self._done, self._next = end, time + STRIDE


def _refined(estimate: Estimate, belief: Gaussian | None, names: list[str]) -> Estimate:
    """An estimate with the smoothed states in place of its own, where there are any; it decides on no measurement."""
    if belief is None:
        return replace(estimate, outcomes=())
    at = {name: float(belief.mean[k]) for k, name in enumerate(names)}
    before = dict(zip(PLANAR_STATES, (*estimate.position[:2], estimate.heading, *estimate.velocity, *estimate.current),
                      strict=True))  # fmt: skip
    north, east, heading, *rest = (at.get(name, value) for name, value in before.items())
    return replace(
        estimate, position=np.array((north, east, estimate.position[2])), heading=heading,
        velocity=np.array(rest[:3]), current=np.array(rest[3:]), covariance=belief.covariance, mean=belief.mean,
        outcomes=(),
    )  # fmt: skip
