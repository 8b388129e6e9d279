"""Interacting Kalman filters of any process and any sensors, whose measurements may be outliers, for a `History`."""

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from estimators.core import ekf, imm, loops, outliers
from estimators.core.consistency import chi_square
from estimators.core.ekf import Innovation
from estimators.core.errors import ParameterError
from estimators.core.filter import OUTLIER, Start, of_source, seen_anew, without
from estimators.core.history import Input, Node
from estimators.core.outliers import MixtureUpdate, Outliers
from estimators.core.recovery import PROBABLE, REMEMBERED, Readmission, Recovery, Rejected, opened
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

SHORTEST = 0.1  # time between measurements that counts at least, so that no mode ever dies out [s]
APART = 2.0  # time between two measurements from which a velocity may be told [s]
DOUBT = 0.1  # probability that a settled filter is right though three agree against it, as an echo and an outlier may
EVEN = 0.5  # the same where many were rejected that do not agree
MIN_ACCEPTED = 3  # measurements accepted before two that agree with each other no longer suffice to correct the filter

_new = tuple.__new__  # of a state, without the cost of its fields by name


class InteractingState(NamedTuple):
    """What a node keeps: each mode's belief and probability, and what is remembered of measurements."""

    means: Array  # (m, n) of the modes' beliefs
    covariances: Array  # (m, n, n) of them
    verdicts: Verdicts  # on this node's measurements, and revised ones
    weights: Array  # (m,) probabilities of the modes
    last_fix: float  # stamp of the last measurement that weighed the modes [s]
    accepted: int = 1  # such measurements taken so far
    outliers: int = 0  # those more probably wrong than not, so far
    rejected: tuple[Rejected, ...] = ()
    innovation: Innovation | None = None  # of the last of them, in the mode most probable then
    angles: tuple[int, ...] = (2,)  # states that are angles
    last_accepted: float = math.nan  # stamp of the last of them that was more probably right [s]
    wrong: float = 0.0  # sum of the probabilities of all of them that they were outliers
    seen: int = 0  # their number

    @property
    def belief(self) -> Gaussian:
        """The modes' beliefs merged."""
        mean, covariance = loops.merge(self.means, self.covariances, self.weights, imm.indices(self.angles))
        return Gaussian(mean=mean, covariance=covariance)

    @property
    def beliefs(self) -> list[Gaussian]:
        """Those of the modes."""
        return [Gaussian(mean=x, covariance=P) for x, P in zip(self.means, self.covariances, strict=True)]

    def with_beliefs(self, means: Array, covariances: Array, verdicts: Verdicts) -> "InteractingState":
        """The same but for means (m, n), covariances (m, n, n) and verdicts: cheaper than `_replace`."""
        return _new(InteractingState, (means, covariances, verdicts, *self[3:]))


class InteractingModelFilter:
    """Interacting extended Kalman filters that differ in their process (Blom and Bar-Shalom 1988).

    Measurements of the kinds in `mixtures` are weighed against being outliers in each mode, and weigh the modes. Modes
    change at constant rates, however often measurements come: right after one, by what the time since the one before
    it allows. Other kinds say nothing of the modes and are fused in each; those in `gates` only if the merged belief
    explains them, or if a source's rejected ones agree with each other, as in a `ModelFilter`.

    A filter that takes good measurements for outliers, because it is wrong itself, is set right by measurements that
    agree against it: by two if it has taken fewer than three, as after a wrong first one, else by three. Wrong ones may
    agree, too, so that in the latter case what it believed before stays in the covariance as the other hypothesis until
    the next measurement decides. Where many were rejected and none agree, both hypotheses are as likely.

    Args:
        processes: One of each mode; all have the same states.
        sensors: What each kind, or (kind, source), of measurement shows.
        start: See `filter.ModelFilter`.
        switching: (m, m) rates of changing from mode i (row) to mode j (column) [1/s]; the diagonal is not read.
        initial: Probabilities of the modes at first (m,).
        mixtures: Model of outliers, by kind.
        recovery: What to do about measurements of `mixtures` that are rejected again and again.
        gates: Probability with which a measurement that fits is accepted, by kind; none: no gate.
        readmission: What to do about measurements of `gates` that are.
        echo: Time for which wrong measurements may agree, as false echoes do [s]: none is let in before, and a
            velocity is told from two that lie `APART`.
        blended: The process that stands for all modes of given probabilities, for smoothing; None: the most probable's.

    Raises:
        ParameterError: Rates or probabilities do not fit the modes.
    """

    def __init__(
        self,
        processes: Sequence[ProcessModel],
        sensors: Models,
        start: Start,
        *,
        switching: Sequence[Sequence[float]],
        initial: Sequence[float],
        mixtures: Mapping[str, Outliers],
        recovery: Recovery,
        gates: Mapping[str, float] = MappingProxyType({}),
        readmission: Recovery = Readmission(),  # noqa: B008 - immutable
        echo: float = 0.0,
        blended: Callable[[Array], ProcessModel] | None = None,
    ) -> None:
        self._processes, self.sensors, self._start = tuple(processes), sensors, start
        self._initial = np.array(initial, dtype=float)
        self._generator = generator(np.array(switching, dtype=float), len(processes))
        shaped = self._initial.shape == (len(processes),) and (self._initial > 0.0).all()
        if not (shaped and abs(self._initial.sum() - 1.0) < 1e-9):
            raise ParameterError(f"initial {list(initial)} must be {len(processes)} probabilities above 0 of sum 1")
        self._mixtures, self._recovery, self._blended = dict(mixtures), recovery, blended
        self._gates, self._readmission = dict(gates), readmission
        self._echo = echo
        self._angles = self._processes[0].angles
        together = getattr(processes[0], "together", None)
        self._propagate = (together and together(processes[1:])) or self._propagated

    def start(self, nodes: Sequence[Node[InteractingState]], index: int) -> InteractingState | None:
        """State at the first node that suffices; its other measurements are fused."""
        first = self._start(nodes, index)
        if first is None:
            return None
        belief, used = first
        known = {id(m) for m in used}
        last = max((m.stamp for m in used if m.kind in self._mixtures), default=nodes[index].time)
        verdicts = tuple((m, "", math.nan) for m in used)
        means, covariances = imm.stacked((belief,) * len(self._processes))
        state = InteractingState(
            means, covariances, verdicts, self._initial, last, angles=self._angles, last_accepted=last
        )
        others = [m for m in nodes[index].measurements if id(m) not in known]
        return self.correct(state, nodes[index].time, others)

    def predict(self, state: InteractingState, u: Input, duration: float) -> InteractingState:
        """State after `duration` [s]."""
        means, covariances = self._propagate(state.means, state.covariances, u, duration)
        return state.with_beliefs(means, covariances, ())

    def correct(
        self, state: InteractingState, node_time: float, measurements: Sequence[Measurement]
    ) -> InteractingState:
        """State after a node's measurements."""
        for measurement in measurements:
            model = model_of(self.sensors, measurement)
            if model is None:
                verdicts = (*state.verdicts, (measurement, NO_MODEL, math.nan))
                state = state.with_beliefs(state.means, state.covariances, verdicts)
            elif measurement.kind in self._mixtures:
                state = self._weighed(state, measurement, model)
            elif measurement.kind in self._gates:
                state = self._gated(state, measurement, model, self._gates[measurement.kind])
            else:
                state = _taken(state, measurement, model)
        return state

    def process_after(self, state: InteractingState) -> ProcessModel:
        """For `smoothing`: the merged belief moves on by the process that stands for all modes."""
        if self._blended is not None:
            return self._blended(state.weights)
        return self._processes[int(state.weights.argmax())]

    def _propagated(self, means: Array, covariances: Array, u: Input, duration: float) -> tuple[Array, Array]:
        """Means (m, n) and covariances (m, n, n) of the modes after `duration` [s], one by one."""
        modes = zip(means, covariances, self._processes, strict=True)
        return imm.stacked(
            [ekf.predict(Gaussian(mean=x, covariance=P), process, u, duration) for x, P, process in modes]
        )

    def _gated(
        self, state: InteractingState, measurement: Measurement, model: MeasurementModel, gate: float
    ) -> InteractingState:
        before = state.belief
        innovation = ekf.correct(before, measurement, model, gate)[1]
        own = of_source(state.rejected, measurement)
        fits = innovation.accepted and innovation.nis <= chi_square(PROBABLE, innovation.residual.size)
        if innovation.accepted and (fits or not own):
            return _taken(state, measurement, model)._replace(rejected=without(state.rejected, own))
        H = model.jacobian(before.mean, measurement)
        now = Rejected(measurement, innovation.residual, H, innovation.nis, innovation)
        suspect, rest = (*own[1 - REMEMBERED :], now), without(state.rejected, own)
        if self._readmission.suffice(now, own, self._readmission.agreeing(now, own)):
            taken = _taken(state, measurement, model)
            anew = seen_anew(suspect, taken.belief.mean - before.mean)
            return taken._replace(rejected=(*rest, *anew))
        if innovation.accepted:
            return _taken(state, measurement, model)._replace(rejected=rest)
        verdicts = (*state.verdicts, (measurement, OUTLIER, innovation.nis))
        return state._replace(rejected=(*rest, *suspect), outliers=state.outliers + 1, verdicts=verdicts)

    def _weighed(self, state: InteractingState, fix: Measurement, model: MeasurementModel) -> InteractingState:
        mixture = self._mixtures[fix.kind].after(state.wrong, state.seen)
        modes = [outliers.correct(belief, fix, model, mixture) for belief in state.beliefs]
        weights = imm.update(state.weights, [mode.log_likelihood for mode in modes])
        innovation = modes[int(weights.argmax())].innovation
        own = of_source(state.rejected, fix)
        rejected = without(state.rejected, own)
        count = state.outliers
        p = float(sum(w * mode.probability for w, mode in zip(weights, modes, strict=True)))
        is_wrong, wrong, seen = p > 0.5, state.wrong + p, state.seen + 1
        # One that the filter would take, but only just, may as well confirm one that it did not take.
        if is_wrong or (own and innovation.nis > chi_square(PROBABLE, innovation.residual.size)):
            now = _rejected(state, fix, model, modes, innovation)
            agreeing = self._recovery.agreeing(now, own)
            settled = state.accepted >= MIN_ACCEPTED
            enough = self._recovery.suffice(now, own, agreeing, settled)
            lasts = bool(own) and fix.stamp - own[0].measurement.stamp >= self._echo
            if enough or (is_wrong and self._recovery.forces and len(own) >= REMEMBERED and lasts):
                before = state.belief
                if enough:
                    earlier = _apart(now, agreeing) if self._echo else agreeing[0]
                    corrected = self._recovery.recover(before, earlier, now, model)
                else:
                    corrected = ekf.correct(opened(before, now.H, now.residual), fix, model)[0]
                doubt = (DOUBT if settled else 0.0) if enough else EVEN
                both = imm.merge((corrected, before), np.array((1.0 - doubt, doubt)), self._angles)
                means, covariances = imm.stacked((both,) * len(modes))
                verdicts = (*state.verdicts, (fix, "", innovation.nis))
                if enough and self._recovery.fuses_both:
                    verdicts += tuple(found.taken for found in agreeing)
                    count -= len(agreeing)
                wrong = max(wrong - p - len(agreeing), 0.0)
                return InteractingState(
                    means, covariances, verdicts, self._initial, fix.stamp, 2, count, rejected, innovation,
                    self._angles, fix.stamp, wrong, seen,
                )  # fmt: skip
            if is_wrong:  # the first of them says when it began, the last ones what it is
                first = own[:1] if self._echo else own[1 - REMEMBERED : 2 - REMEMBERED]
                kept = (*first, *own[2 - REMEMBERED :]) if len(own) >= REMEMBERED else own
                rejected = (*rejected, *kept, now)
            count += is_wrong
        accepted = state.accepted + (not is_wrong)
        transition = loops.transition(self._generator, max(SHORTEST, fix.stamp - state.last_fix))
        following = weights @ transition
        unmixed = imm.stacked([mode.belief for mode in modes])
        means, covariances = loops.mix(*unmixed, weights, transition, following, imm.indices(self._angles))
        verdicts = (*state.verdicts, (fix, OUTLIER if is_wrong else "", innovation.nis))
        last_accepted = state.last_accepted if is_wrong else fix.stamp
        return InteractingState(
            means, covariances, verdicts, following, fix.stamp, accepted, count, rejected, innovation, self._angles,
            last_accepted, wrong, seen,
        )  # fmt: skip


def _taken(state: InteractingState, measurement: Measurement, model: MeasurementModel) -> InteractingState:
    """State after a measurement that says nothing of the modes."""
    means, covariances, nis = _fused(state, measurement, model)
    verdict = (measurement, "", nis[int(state.weights.argmax())])
    return state.with_beliefs(means, covariances, (*state.verdicts, verdict))


def _fused(
    state: InteractingState, measurement: Measurement, model: MeasurementModel
) -> tuple[Array, Array, Sequence[float]]:
    """Means (m, n), covariances (m, n, n) and NIS of the modes after a measurement that says nothing of them."""
    if model.is_angle and type(model).covariance is MeasurementModel.covariance:
        H = model.jacobian(state.means[0], measurement)  # the same everywhere
        found = loops.correct_angle_each(state.means, state.covariances, H, measurement.value, measurement.covariance)
        means, covariances, nis, status = found
        if status == loops.OK:
            return means, covariances, nis.tolist()
    fused = [ekf.fuse(belief, measurement, model) for belief in state.beliefs]  # or says what is wrong
    return *imm.stacked([belief for belief, _ in fused]), [nis for _, nis in fused]


def _apart(now: Rejected, agreeing: Sequence[Rejected]) -> Rejected:
    """The latest of those that agree that is long enough before that of now to tell a velocity; else the first."""
    return next((r for r in agreeing if now.measurement.stamp - r.measurement.stamp >= APART), agreeing[-1])


def _rejected(
    state: InteractingState,
    fix: Measurement,
    model: MeasurementModel,
    modes: Sequence[MixtureUpdate],
    innovation: Innovation,
) -> Rejected:
    """A measurement as seen by the modes together, before it was used."""
    residual = np.sum([w * m.innovation.residual for w, m in zip(state.weights, modes, strict=True)], axis=0)
    since = fix.stamp - state.last_accepted
    return Rejected(fix, residual, model.jacobian(state.belief.mean, fix), innovation.nis, innovation, since)


def generator(rates: Array, modes: int) -> Array:
    """Rates of a Markov chain (m, m) with the diagonal that makes its rows sum to zero.

    Raises:
        ParameterError: They are not rates between that many modes, or leave a mode that is never reached.
    """
    Q = rates.copy() if rates.shape == (modes, modes) else np.full((modes, modes), -1.0)
    np.fill_diagonal(Q, 0.0)
    # Every mode leads to every other, at once or by way of others.
    if (Q < 0.0).any() or not (np.linalg.matrix_power(np.eye(modes) + (Q > 0.0), modes) > 0.0).all():
        raise ParameterError(
            f"{modes} modes need a row and a column of switching rates each, none below 0, that lead from every mode "
            f"to every other; not {rates.tolist()}"
        )
    np.fill_diagonal(Q, -Q.sum(axis=1))
    return Q
