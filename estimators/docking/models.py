"""Process and measurement models that the docking filters share, and the start from a first fix."""

import math
from collections.abc import Sequence
from typing import TypedDict

import numpy as np

from estimators.core.history import Node
from estimators.core.loops import wrap
from estimators.core.types import Array, Gaussian, Measurement, MeasurementModel, ProcessModel
from estimators.docking import range_start
from estimators.docking.aids import RANGE, Aids
from estimators.docking.noise import DockingNoise
from estimators.docking.sensors import COMPASS, USBL, HeadingModel, PositionModel
from estimators.planar.model import MAX_SUBSTEP, Dynamics, Integrator


class ModelOptions(TypedDict, total=False):
    """What filters on the planar model pass on to their `PlanarModels`, which explains it and has the defaults."""

    transponder: tuple[float, float]
    initial_surge: float | None
    aids: Aids
    integrator: Integrator
    max_substep: float


class PlanarModels:
    """Process and measurement models of a docking filter, made from its assumptions; and its start.

    Args:
        parameters: The vehicle: `PlanarParameters`, or `TermsMotion` of any structure.
        noise: Noise that the filter assumes, and the biases in its state.
        transponder: Place of the acoustic transponder on the hull, (x, y) forward and starboard of the origin [m].
        initial_surge: Surge at the first fix [m/s]; None: steady at the shaft speed then.
        aids: Sensors besides.
        integrator: "midpoint" or "euler".
        max_substep: Longest substep of the prediction [s].
    """

    def __init__(
        self,
        parameters: Dynamics,
        noise: DockingNoise,
        *,
        transponder: tuple[float, float] = (0.0, 0.0),
        initial_surge: float | None = None,
        aids: Aids = Aids(),  # noqa: B008 - immutable
        integrator: Integrator = "midpoint",
        max_substep: float = MAX_SUBSTEP,
    ) -> None:
        self.parameters, self.noise = parameters, noise
        self._initial_surge = initial_surge
        self._numerics = {"integrator": integrator, "max_substep": max_substep, "biases": noise.bias_names}
        self.process = self.process_with(noise)
        places = {name: 8 + k for k, name in enumerate(noise.bias_names)}
        n = 8 + len(places)
        self.aids = aids.models(noise.bias_names)
        self.heading = HeadingModel(n, places.get("compass"))
        self.position = PositionModel(
            transponder, n, dock_heading=places.get("dock_heading"), clock=places.get("clock")
        )

    def process_with(self, noise: DockingNoise) -> ProcessModel:
        """The vehicle with other densities of the process noise."""
        return self.parameters.process(noise.densities(), **self._numerics)

    @property
    def sensors(self) -> dict[str | tuple[str, str], MeasurementModel]:
        """The measurement models by kind."""
        return {COMPASS: self.heading, USBL: self.position, **self.aids}

    def start(self, nodes: Sequence[Node], index: int) -> tuple[Gaussian, list[Measurement]] | None:
        """`first`, and the measurements that are in it: the fix and the compass, not further fixes.

        Without a fix, where ranges are heard: the place that those up to the node explain.
        """
        found = self.first(nodes, index)
        if found is not None:
            belief, fix = found
            return belief, [m for m in nodes[index].measurements if m is fix or m.kind == COMPASS]
        now = [m for m in nodes[index].measurements if m.kind in (COMPASS, RANGE)]
        if not any(m.kind == RANGE for m in now):
            return None
        belief = self._by_ranges(nodes, index)
        return None if belief is None else (belief, now)

    def first(self, nodes: Sequence[Node], index: int) -> tuple[Gaussian, Measurement] | None:
        """Belief at the node of a first fix, and that fix; None without a fix there or any compass sample.

        Heading by the compass at that time, surge given or steady at the shaft speed then, the rest zero (sec. 7 of the
        paper).
        """
        fix = next((m for m in nodes[index].measurements if m.kind == USBL), None)
        heading = None if fix is None else _heading_at(nodes, index)
        if fix is None or heading is None:
            return None
        mean = self._mean(heading, nodes[index])
        mean[:2] = fix.value - self.position.evaluate(mean)
        # The fix is given, so that the position takes the errors of all other states in it.
        onto = np.eye(mean.size)
        onto[:2, 2:] = -self.position.jacobian(mean)[:, 2:]
        return self._belief(mean, fix.covariance, onto), fix

    def _by_ranges(self, nodes: Sequence[Node], index: int) -> Gaussian | None:
        """Belief by the ranges so far; None where they leave the place open."""
        heading = _heading_at(nodes, index)
        if heading is None:
            return None
        mean = self._mean(heading, nodes[index])
        velocity = mean[3] * np.array((math.cos(heading), math.sin(heading)))
        ranges = range_start.heard(nodes[: index + 1], velocity, RANGE)
        found = range_start.place(ranges, max(self.noise.initial_current, 1e-3))
        if found is None:
            return None
        mean[:2] = found.position
        # What a range shows too much has moved the place.
        onto, names = np.eye(mean.size), self.noise.bias_names
        for column, one in zip(found.gain.T, ranges, strict=True):
            for name, factor in ((f"range_{one.source}", 1.0), (f"range_scale_{one.source}", one.value)):
                if name in names:
                    onto[:2, 8 + names.index(name)] -= factor * column
        return self._belief(mean, found.covariance, onto)

    def _mean(self, heading: float, node: Node) -> Array:
        """The state at a start with its place still open."""
        surge = self._initial_surge
        if surge is None:
            surge = self.parameters.steady_surge(node.input[1])
        return np.array([0.0, 0.0, heading, surge, 0.0, 0.0, 0.0, 0.0, *(0.0 for _ in self.noise.bias_names)])

    def _belief(self, mean: Array, place: Array, onto: Array) -> Gaussian:
        """What is known of a state whose place has a covariance (2, 2), and takes on other errors by `onto` (n, n)."""
        noise, names = self.noise, self.noise.bias_names
        deviations = (noise.compass, noise.initial_surge, noise.initial_sway, noise.initial_yaw_rate)
        currents = (noise.initial_current, noise.initial_current)
        biases = [noise.biases[name].deviation for name in names]
        covariance = np.diag(np.square([0.0, 0.0, *deviations, *currents, *biases]))
        covariance[:2, :2] = place
        # A compass bias is an error of the initial heading.
        J = np.eye(mean.size)
        if "compass" in names:
            J[2, 8 + names.index("compass")] = -1.0
        J = onto @ J
        return Gaussian(mean=mean, covariance=J @ covariance @ J.T)


def _heading_at(nodes: Sequence[Node], index: int) -> float | None:
    """The compass at a node: its own sample, else interpolated between neighbours, else the nearest before or after."""
    before = next((k for k in range(index, -1, -1) if _compass(nodes[k]) is not None), None)
    after = next((k for k in range(index, len(nodes)) if _compass(nodes[k]) is not None), None)
    if before is None or after is None:
        known = before if before is not None else after
        return None if known is None else _compass(nodes[known])
    start, end = _compass(nodes[before]), _compass(nodes[after])
    assert start is not None
    assert end is not None
    duration = nodes[after].time - nodes[before].time
    share = (nodes[index].time - nodes[before].time) / duration if duration else 0.0
    return wrap(start + share * wrap(end - start))


def _compass(node: Node) -> float | None:
    return next((float(m.value[0]) for m in node.measurements if m.kind == COMPASS), None)
