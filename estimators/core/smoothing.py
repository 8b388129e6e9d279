"""Fixed-lag smoothing over the delay buffer: past states given all measurements (Rauch, Tung and Striebel 1965).

The buffer reaches back as far as it keeps nodes, and each of its poses is refined by all that came after.
"""

from collections.abc import Callable, Sequence
from typing import Any

from estimators.core import ekf
from estimators.core.bounds import inverse
from estimators.core.history import Node
from estimators.core.loops import wrap
from estimators.core.types import Gaussian, ProcessModel


def smooth(
    nodes: Sequence[Node[Any]], process_after: Callable[[Any], ProcessModel], angles: tuple[int, ...] | None = None
) -> list[Gaussian]:
    """The belief at each of the nodes since the filter's last start, given all measurements of all nodes.

    Args:
        nodes: Nodes of a `History` that is up to date; their states have a `belief`.
        process_after: The process model by which the filter went on from a state.
        angles: States that are angles, kept in (-pi, pi]; None: those of the process.
    """
    smoothed: list[Gaussian] = []
    following = 0.0  # time of the node after
    for node in reversed(nodes):
        if node.state is None:
            break
        belief = node.state.belief
        if smoothed:
            process, duration = process_after(node.state), following - node.time
            belief = _refined(
                belief, smoothed[-1], process, node.input, duration, process.angles if angles is None else angles
            )
        smoothed.append(belief)
        following = node.time
    return smoothed[::-1]


def _refined(
    belief: Gaussian,
    later: Gaussian,
    process: ProcessModel,
    u: Sequence[float],
    duration: float,
    angles: tuple[int, ...],
) -> Gaussian:
    """The belief before an interval, given the smoothed one after it."""
    predicted = ekf.predict(belief, process, u, duration)
    C = belief.covariance @ process.jacobian(belief.mean, u, duration).T @ inverse(predicted.covariance)
    change = later.mean - predicted.mean
    for index in angles:
        change[index] = wrap(change[index])
    mean = belief.mean + C @ change
    for index in angles:
        mean[index] = wrap(mean[index])
    P = belief.covariance + C @ (later.covariance - predicted.covariance) @ C.T
    return Gaussian(mean=mean, covariance=0.5 * (P + P.T))
