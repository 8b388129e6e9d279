"""A Kalman filter of any process and any sensors, for a `History`."""

from collections.abc import Callable, Mapping, Sequence
from typing import Literal, NamedTuple

from estimators.core import ekf, ukf
from estimators.core.consistency import chi_square
from estimators.core.ekf import Innovation
from estimators.core.errors import ParameterError
from estimators.core.history import Input, Node
from estimators.core.outliers import Outliers
from estimators.core.outliers import correct as correct_mixture
from estimators.core.recovery import PROBABLE, REMEMBERED, Readmission, Recovery, Rejected
from estimators.core.types import (
    NO_MODEL,
    Array,
    Gaussian,
    Measurement,
    MeasurementModel,
    Models,
    ProcessModel,
    Verdicts,
    model_of,
)

Transform = Literal["extended", "unscented", "iterated", "second_order"]
TRANSFORMS = {
    "extended": ekf.correct,
    "unscented": ukf.correct,
    "iterated": ekf.correct_iterated,
    "second_order": ekf.correct_second_order,
}
OUTLIER = "outlier"

# (nodes, index) -> the belief at a node and which of its measurements are in it; None if they do not suffice
Start = Callable[[Sequence[Node], int], tuple[Gaussian, Sequence[Measurement]] | None]


class FilterState(NamedTuple):
    """What a node keeps."""

    belief: Gaussian
    outliers: int = 0  # measurements rejected so far
    rejected: tuple[Rejected, ...] = ()  # of each source since one was last accepted
    innovation: Innovation | None = None  # of the last measurement of a kind that has a gate, or is not linear
    verdicts: Verdicts = ()  # on this node's measurements, and on earlier ones where they were revised


class ModelFilter:
    """A Kalman filter with gates that cannot lock it out.

    A measurement whose normalised innovation squared exceeds the chi-square quantile of its kind's gate is rejected and
    remembered. If the filter itself is wrong, the measurements of that source that follow disagree with it but agree
    with each other; then `recovery` sets it right by them. A lone outlier moves nothing. The gate widens while
    measurements are missing: one that comes after a rejected one and is inside the gate, but outside its inner 95 %, is
    compared too.

    Args:
        process: How the state moves.
        sensors: What each kind, or (kind, source), of measurement shows; others are refused as "no_model".
        start: A belief known from the first node on; or a function that makes it of measurements.
        gates: Probability with which a measurement that fits is accepted: of every kind, or by kind; None: no gate.
        mixtures: Kinds that are weighed against being outliers instead of gated.
        recovery: What to do about a source that is rejected again and again; None: nothing.
        recoveries: The same of some kinds.
        transform: "extended", "unscented", "iterated" where a measurement says more of a state than its belief, or
            "second_order" where a value is curved over it, as ranges across a line of beacons.
    """

    def __init__(
        self,
        process: ProcessModel,
        sensors: Models,
        start: Gaussian | Start,
        *,
        gates: float | Mapping[str, float | None] | None = None,
        mixtures: Mapping[str, Outliers] | None = None,
        recovery: Recovery | None = Readmission(),  # noqa: B008 - immutable
        recoveries: Mapping[str, Recovery] | None = None,
        transform: Transform = "extended",
    ) -> None:
        if transform not in TRANSFORMS:
            raise ParameterError(f"no transform '{transform}'; there are {', '.join(TRANSFORMS)}")
        kinds = {key if isinstance(key, str) else key[0] for key in sensors}
        self.process, self.sensors, self.recovery = process, sensors, recovery
        self._start, self._recoveries = start, dict(recoveries or {})
        self._gates = (
            dict(gates) if isinstance(gates, Mapping) else {} if gates is None else dict.fromkeys(kinds, gates)
        )
        self._mixtures = dict(mixtures or {})
        for kind in (*self._gates, *self._mixtures):
            if kind not in kinds:
                raise ParameterError(f"no model of the gated kind '{kind}'; there are {', '.join(sorted(kinds))}")
        self._predict = ukf.predict if transform == "unscented" else ekf.predict
        self._correct = TRANSFORMS[transform]

    def start(self, nodes: Sequence[Node[FilterState]], index: int) -> FilterState | None:
        """State at the first node that suffices; its other measurements are fused."""
        first = (self._start, ()) if isinstance(self._start, Gaussian) else self._start(nodes, index)
        if first is None:
            return None
        belief, used = first
        known = {id(m) for m in used}
        others = [m for m in nodes[index].measurements if id(m) not in known]
        state = FilterState(belief, verdicts=tuple((m, "", float("nan")) for m in used))
        return self.correct(state, nodes[index].time, others)

    def predict(self, state: FilterState, u: Input, duration: float) -> FilterState:
        """State after `duration` [s]."""
        belief = self._predict(state.belief, self.process, u, duration)
        return FilterState(belief, state.outliers, state.rejected, state.innovation)

    def correct(self, state: FilterState, node_time: float, measurements: Sequence[Measurement]) -> FilterState:
        """State after a node's measurements."""
        for measurement in measurements:
            model = model_of(self.sensors, measurement)
            if model is None:
                state = state._replace(verdicts=(*state.verdicts, (measurement, NO_MODEL, float("nan"))))
            elif measurement.kind in self._mixtures:
                state = self._weighed(state, measurement, model, self._mixtures[measurement.kind])
            elif measurement.kind in self._gates or not model.is_linear:
                state = self._gated(state, measurement, model, self._gates.get(measurement.kind))
            else:
                belief, nis = ekf.fuse(state.belief, measurement, model)
                verdicts = (*state.verdicts, (measurement, "", nis))
                state = FilterState(belief, state.outliers, state.rejected, state.innovation, verdicts)
        return state

    def process_after(self, state: FilterState) -> ProcessModel:
        """For `smoothing`."""
        return self.process

    def _gated(
        self, state: FilterState, measurement: Measurement, model: MeasurementModel, gate: float | None
    ) -> FilterState:
        belief, innovation = self._correct(state.belief, measurement, model, gate)
        nis, verdicts = innovation.nis, state.verdicts
        accepted = (*verdicts, (measurement, "", nis))
        own = of_source(state.rejected, measurement)
        if innovation.accepted and (not own or nis <= chi_square(PROBABLE, innovation.residual.size)):
            return FilterState(belief, state.outliers, without(state.rejected, own), innovation, accepted)
        H = model.jacobian(state.belief.mean, measurement)
        now = Rejected(measurement, innovation.residual, H, nis, innovation)
        rest = without(state.rejected, own)
        recovery = self._recoveries.get(measurement.kind, self.recovery)
        if recovery is not None:
            found = recovery.agreeing(now, own)
            if recovery.suffice(now, own, found):
                return _recovered(recovery, state, found[0], now, model, rest, accepted, 1)
        if innovation.accepted:
            return FilterState(belief, state.outliers, rest, innovation, accepted)
        if recovery is not None and recovery.forces and len(own) >= REMEMBERED:
            return _recovered(recovery, state, own[-1], now, model, rest, accepted, 0)
        verdicts = (*verdicts, (measurement, OUTLIER, nis))
        rejected = (*rest, *own[1 - REMEMBERED :], now) if len(own) >= REMEMBERED else (*state.rejected, now)
        return FilterState(state.belief, state.outliers + 1, rejected, innovation, verdicts)

    def _weighed(
        self, state: FilterState, measurement: Measurement, model: MeasurementModel, mixture: Outliers
    ) -> FilterState:
        update = correct_mixture(state.belief, measurement, model, mixture)
        wrong = update.probability > 0.5
        verdict = (measurement, OUTLIER if wrong else "", update.innovation.nis)
        outliers, verdicts = state.outliers + wrong, (*state.verdicts, verdict)
        return FilterState(update.belief, outliers, state.rejected, update.innovation, verdicts)


def _recovered(
    recovery: Recovery,
    state: FilterState,
    earlier: Rejected,
    now: Rejected,
    model: MeasurementModel,
    rest: tuple[Rejected, ...],
    accepted: Verdicts,
    confirmed: int,
) -> FilterState:
    belief = recovery.recover(state.belief, earlier, now, model)
    if recovery.fuses_both:
        return FilterState(belief, state.outliers - confirmed, rest, now.innovation, (*accepted, earlier.taken))
    suspect = (*of_source(state.rejected, now.measurement)[2 - REMEMBERED :], now)
    anew = seen_anew(suspect, belief.mean - state.belief.mean)
    return FilterState(belief, state.outliers, (*rest, *anew), now.innovation, accepted)


def seen_anew(suspect: Sequence[Rejected], moved: Array) -> list[Rejected]:
    """What is remembered of a source, from a belief that has followed it by a step (n,)."""
    return [r._replace(residual=r.residual - r.H @ moved) for r in suspect]


def of_source(rejected: tuple[Rejected, ...], m: Measurement) -> tuple[Rejected, ...]:
    """The rejected measurements of the kind and source of another."""
    return tuple(r for r in rejected if (r.measurement.kind, r.measurement.source) == (m.kind, m.source))


def without(rejected: tuple[Rejected, ...], own: tuple[Rejected, ...]) -> tuple[Rejected, ...]:
    """The rejected measurements of other sources."""
    return tuple(r for r in rejected if not any(r is mine for mine in own)) if own else rejected


def at_first(belief: Gaussian, *kinds: str) -> Start:
    """A start from a broad belief at the first node with a measurement of one of the kinds, or any if none is named."""

    def start(nodes: Sequence[Node], index: int) -> tuple[Gaussian, Sequence[Measurement]] | None:
        suffices = any(not kinds or m.kind in kinds for m in nodes[index].measurements)
        return (belief, ()) if suffices else None

    return start
