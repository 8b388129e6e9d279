"""What physics says of the planar parameters: inertia is positive, damping takes energy; and steps that keep to it."""

from collections.abc import Sequence

import numpy as np

from estimators.core.types import Array
from estimators.planar.model import PlanarParameters

# Drag, cross-flow and lift along and about the vehicle's own axes lose energy; a propeller ahead pushes ahead, less so
# with speed. Couplings (Y_rr, N_vv, Y_ur, N_uv) and the rudder's place may have either sign.
SIGNS = {
    "X_uu": -1, "X_u": -1, "X_dd": -1, "X_nn": 1, "X_nu": -1,
    "Y_vv": -1, "Y_v": -1, "Y_uv": -1,
    "N_rr": -1, "N_r": -1, "N_ur": -1,
}  # fmt: skip


def limits(free: Sequence[str], signs: bool) -> tuple[Array, Array]:
    """Lowest and highest values (k,) of the free parameters; infinite without `signs`."""
    side = np.array([SIGNS.get(name, 0) if signs else 0 for name in free])
    return np.where(side > 0, 0.0, -np.inf), np.where(side < 0, 0.0, np.inf)


def prior_information(start: Array, free: Sequence[str], prior: float | None, prior_on: Sequence[str] | None) -> Array:
    """Information (k,) of a weak prior on free parameters about their start; zero where there is none.

    Args:
        start: Of the free parameters (k,).
        free: Their names.
        prior: Relative deviation from the start; None: there is no prior.
        prior_on: Parameters with a prior; None: all.
    """
    reach = np.abs(start) * (prior or 0.0)
    held = (reach > 0.0) & np.array([prior_on is None or name in prior_on for name in free])
    return np.where(held, 1.0 / np.where(held, reach, 1.0) ** 2, 0.0)


def inertia(p: PlanarParameters) -> Array:
    """The matrix (3, 3) that multiplies the accelerations of surge, sway and yaw."""
    return np.array(
        [
            [p.m - p.X_ud, 0.0, 0.0],
            [0.0, p.m - p.Y_vd, p.m * p.x_g - p.Y_rd],
            [0.0, p.m * p.x_g - p.N_vd, p.I_z - p.N_rd],
        ]
    )


def has_inertia(p: PlanarParameters) -> bool:
    """Whether the inertia is positive: every acceleration of the vehicle costs energy."""
    M = inertia(p)
    return bool(np.linalg.eigvalsh(0.5 * (M + M.T))[0] > 0.0)


def bounded_step(H: Array, g: Array, damping: float, low: Array, high: Array) -> Array:
    """The damped step of equations scaled to a unit diagonal, its parts kept between limits (k,) where there are.

    What would cross its limit stops there, and the rest is solved again.
    """
    diagonal = np.diag(H).copy()
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    part = H / np.outer(scale, scale) + damping * np.eye(len(g))
    low, high = (np.concatenate([side, np.full(len(g) - len(side), e)]) for side, e in ((low, -np.inf), (high, np.inf)))
    step, loose = np.zeros(len(g)), diagonal > 0.0
    while loose.any():
        rest = g / scale - part @ np.where(loose, 0.0, step * scale)
        step[loose] = np.linalg.lstsq(part[np.ix_(loose, loose)], rest[loose], rcond=1e-14)[0] / scale[loose]
        crossing = loose & ((step < low) | (step > high))
        if not crossing.any():
            break
        step[crossing] = np.clip(step, low, high)[crossing]
        loose &= ~crossing
    return step
