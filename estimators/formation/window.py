"""Maximum a posteriori over a sliding window: all states of the last steps are linearised anew at each measurement."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimators.core import batch, ekf
from estimators.core.errors import NotFiniteError, ParameterError
from estimators.core.history import Input, Node
from estimators.core.types import Gaussian, Measurement, Models, ProcessModel, Verdicts, model_of


class Past(NamedTuple):
    """A step of the window."""

    time: float  # [s]
    input: Input  # from then on
    measurements: tuple[Measurement, ...]
    mean: tuple[float, ...]  # most probable state so far


class WindowState(NamedTuple):
    """What a node keeps."""

    belief: Gaussian
    prior: Gaussian  # at the first step of the window, with its measurements
    steps: tuple[Past, ...]
    outliers: int = 0
    verdicts: Verdicts = ()


class WindowFilter:
    """A `Filter` whose correction is the most probable trajectory of the last steps, by Gauss-Newton.

    What leaves the window is kept as the prior of its first step, linearised where the window left it last.

    Args:
        process: How the state moves; its noise must reach all states.
        sensors: What each kind of measurement shows; others are ignored.
        start: Belief at the first node.
        steps: How many are kept.

    Raises:
        ParameterError: There are fewer than two steps.
    """

    def __init__(self, process: ProcessModel, sensors: Models, start: Gaussian, *, steps: int = 10) -> None:
        if steps < 2:
            raise ParameterError(f"a window of {steps} steps is too short; 2 or more")
        self.process, self.sensors = process, sensors
        self._start, self._steps = start, steps

    def start(self, nodes: Sequence[Node[WindowState]], index: int) -> WindowState:
        """The known belief, with the node's measurements."""
        node = nodes[index]
        belief = self._fused(self._start, node.measurements, self._start.mean)
        first = Past(node.time, (), (), tuple(belief.mean))
        return WindowState(belief, belief, (first,), verdicts=self._verdicts(node.measurements))

    def predict(self, state: WindowState, u: Input, duration: float) -> WindowState:
        """One step more, predicted."""
        belief = ekf.predict(state.belief, self.process, u, duration)
        last = state.steps[-1]
        following = Past(last.time + duration, (), (), tuple(belief.mean))
        return state._replace(belief=belief, steps=(*state.steps[:-1], last._replace(input=u), following), verdicts=())

    def correct(self, state: WindowState, node_time: float, measurements: Sequence[Measurement]) -> WindowState:
        """The window with a node's measurements, and shorter by what is too old."""
        if not any(model_of(self.sensors, m) for m in measurements):
            return state._replace(verdicts=self._verdicts(measurements))
        steps = (*state.steps[:-1], state.steps[-1]._replace(measurements=tuple(measurements)))
        try:
            nodes = [_node(step) for step in steps]
            guess = np.array([step.mean for step in steps])
            found = batch.solve(nodes, state.prior, self.process, self.sensors, guess)
            means, covariance = found.means, found.covariance(-1)
        except NotFiniteError:  # it does not converge: as an extended filter goes on
            belief = self._fused(state.belief, measurements, state.belief.mean)
            means, covariance = np.array([*(step.mean for step in steps[:-1]), belief.mean]), belief.covariance
        steps = tuple(step._replace(mean=tuple(mean)) for step, mean in zip(steps, means, strict=True))
        belief, prior = Gaussian(mean=means[-1], covariance=covariance), state.prior
        while len(steps) > self._steps:
            prior, steps = self._shortened(prior, steps), steps[1:]
        return WindowState(belief, prior, steps, verdicts=self._verdicts(measurements))

    def process_after(self, state: WindowState) -> ProcessModel:
        """For `smoothing`."""
        return self.process

    def _shortened(self, prior: Gaussian, steps: tuple[Past, ...]) -> Gaussian:
        """The prior of the second step, linearised at what the window makes of the first two."""
        first, second = steps[:2]
        duration, x = second.time - first.time, np.array(first.mean)
        F = self.process.jacobian(x, first.input, duration)
        mean = self.process.evaluate(x, first.input, duration) + F @ (prior.mean - x)
        P = F @ prior.covariance @ F.T + self.process.covariance(x, first.input, duration)
        return self._fused(Gaussian(mean=mean, covariance=P), second.measurements, np.array(second.mean))

    def _fused(self, belief: Gaussian, measurements: Sequence[Measurement], at: np.ndarray) -> Gaussian:
        for measurement in measurements:
            if (model := model_of(self.sensors, measurement)) is not None:
                expected, H = model.shown(at, measurement)
                residual = model.residual(measurement.value, expected) - H @ (belief.mean - at)
                belief, _ = ekf.correct_linear(belief, H, residual, model.covariance(at, measurement))
        return belief

    def _verdicts(self, measurements: Sequence[Measurement]) -> Verdicts:
        return tuple((m, "" if model_of(self.sensors, m) else "no_model", float("nan")) for m in measurements)


def _node(step: Past) -> Node:
    return Node(step.time, step.input, list(step.measurements), True)
