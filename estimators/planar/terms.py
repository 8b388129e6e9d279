"""Motion models of other structures than the planar one: accelerations as sums of terms, each stated once in CasADi.

A structure is a selection of the terms: Nomoto's, the planar model's own, Abkowitz' and MMG-like ones, wind. The
coefficients are accelerations by their term [SI], so that no mass need be known; u, v are velocities through the water.
Input (rudder [rad], positive to starboard; shaft speed, of two shafts their mean [rad/s]; apparent wind, the velocity
of the air past the vehicle, towards its bow and to starboard [m/s]; half of what the port shaft is faster than the
starboard one, and a side thruster's speed, positive where it pushes to starboard [rad/s]).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import ModuleType
from typing import NamedTuple

import casadi as ca
import numpy as np

from estimators.core.errors import NotFiniteError, ParameterError
from estimators.core.kernels import step_kernels
from estimators.core.types import Array, ProcessModel
from estimators.planar.model import MAX_SUBSTEP, Biases, Integrator, PlanarParameters

INPUTS = 6


class _Motion(NamedTuple):
    u: ca.SX
    v: ca.SX
    r: ca.SX
    d: ca.SX  # rudder
    n: ca.SX  # shaft speed
    a: ca.SX  # apparent wind towards the bow
    b: ca.SX  # and to starboard
    w: ca.SX  # half the difference of the shafts, port less starboard
    t: ca.SX  # side thruster

    @property
    def thrust(self) -> ca.SX:
        """Mean of n|n| of both shafts."""
        return (_signed_square(self.n + self.w) + _signed_square(self.n - self.w)) / 2

    @property
    def turning(self) -> ca.SX:
        """Half the difference of n|n| of both shafts."""
        return (_signed_square(self.n + self.w) - _signed_square(self.n - self.w)) / 2


def _signed_square(x: ca.SX) -> ca.SX:
    return x * ca.fabs(x)


class Term(NamedTuple):
    """One term of an acceleration."""

    axis: int  # 0 surge, 1 sway, 2 yaw
    name: str
    value: Callable[[_Motion], ca.SX]

    @property
    def label(self) -> str:
        """Name in files and tables, for example `yaw v|r|`."""
        return f"{AXES[self.axis]} {self.name}"


AXES = ("surge", "sway", "yaw")
_SURGE: dict[str, Callable[[_Motion], ca.SX]] = {
    "1": lambda m: ca.SX(1),
    "u": lambda m: m.u,
    "u|u|": lambda m: m.u * ca.fabs(m.u),
    "vr": lambda m: m.v * m.r,
    "rr": lambda m: m.r**2,
    "vv": lambda m: m.v**2,
    "uudd": lambda m: (m.u * m.d) ** 2,
    "nndd": lambda m: (m.n * m.d) ** 2,
    "n|n|": lambda m: m.thrust,
    "|n|u": lambda m: (ca.fabs(m.n + m.w) + ca.fabs(m.n - m.w)) / 2 * m.u,
    "wind": lambda m: m.a * ca.sqrt(m.a**2 + m.b**2 + 1e-12),
}
_LATERAL: dict[str, Callable[[_Motion], ca.SX]] = {
    "1": lambda m: ca.SX(1),
    "uu": lambda m: m.u**2,
    "n|n|": lambda m: m.thrust,
    "v": lambda m: m.v,
    "r": lambda m: m.r,
    "uv": lambda m: m.u * m.v,
    "ur": lambda m: m.u * m.r,
    "v|v|": lambda m: m.v * ca.fabs(m.v),
    "r|r|": lambda m: m.r * ca.fabs(m.r),
    "v|r|": lambda m: m.v * ca.fabs(m.r),
    "|v|r": lambda m: ca.fabs(m.v) * m.r,
    "vvv": lambda m: m.v**3,
    "vvr": lambda m: m.v**2 * m.r,
    "vrr": lambda m: m.v * m.r**2,
    "rrr": lambda m: m.r**3,
    "d": lambda m: m.d,
    "uud": lambda m: m.u**2 * m.d,
    "n|n|d": lambda m: m.thrust * m.d,
    "nud": lambda m: m.n * m.u * m.d,
    "wind": lambda m: m.b * ca.sqrt(m.a**2 + m.b**2 + 1e-12),
    "twin n|n|": lambda m: m.turning,
    "twin |n|u": lambda m: (ca.fabs(m.n + m.w) - ca.fabs(m.n - m.w)) / 2 * m.u,
    "t|t|": lambda m: m.t * ca.fabs(m.t),
    "t|t|u": lambda m: m.t * ca.fabs(m.t) * m.u,
}
_YAW = {**_LATERAL, "wind ab": lambda m: m.a * m.b}
TERMS = tuple(
    Term(axis, name, value)
    for axis, terms in enumerate((_SURGE, _LATERAL, _YAW))
    for name, value in terms.items()
)  # fmt: skip
LABELS = tuple(term.label for term in TERMS)
# Largest surge, sway and yaw rate [m/s, rad/s] that the terms are known for; they stand behind the coefficients.
LIMITS = ("surge limit", "sway limit", "yaw rate limit")
PARAMETERS = (*LABELS, *LIMITS)
RETURN = 1.0  # time constant with which a velocity beyond its limit comes back [s]


@dataclass(frozen=True, kw_only=True, slots=True)
class Structure:
    """A selection of the terms."""

    name: str
    terms: tuple[str, ...]  # of LABELS, in their order

    @property
    def places(self) -> tuple[int, ...]:
        """Places of its terms among TERMS."""
        return tuple(LABELS.index(term) for term in self.terms)


def structure(name: str, surge: str, sway: str, yaw: str) -> Structure:
    """A structure by the names of its terms, separated by spaces, in each axis.

    Raises:
        ParameterError: There is no such term.
    """
    chosen = [f"{axis} {term}" for axis, names in zip(AXES, (surge, sway, yaw), strict=True) for term in names.split()]
    for label in chosen:
        if label not in LABELS:
            raise ParameterError(f"no term '{label}'; there are {', '.join(LABELS)}")
    return Structure(name=name, terms=tuple(label for label in LABELS if label in chosen))


_PROPELLED = "1 u|u| n|n| |n|u"
_LINEAR = "v r uv ur"
_QUADRATIC = "v|v| r|r|"
_STREAM = "uud n|n|d nud"
STRUCTURES = (  # from the simplest
    structure("Nomoto, first order", "1 u n|n|", "v r", "r d"),
    structure("Nomoto, second order", "1 u n|n| vr", "v r d", "v r d"),
    structure("planar", f"{_PROPELLED} vr rr uudd", f"uv ur {_QUADRATIC} uud", f"uv ur {_QUADRATIC} uud"),
    structure(
        "planar, linear", f"{_PROPELLED} u vr rr uudd", f"{_LINEAR} {_QUADRATIC} uud", f"{_LINEAR} {_QUADRATIC} uud"
    ),
    structure(
        "manoeuvring", f"{_PROPELLED} u vr rr vv uudd nndd",
        f"{_LINEAR} {_QUADRATIC} v|r| |v|r {_STREAM}", f"{_LINEAR} {_QUADRATIC} v|r| |v|r {_STREAM}",
    ),
    structure(
        "manoeuvring, cubic", f"{_PROPELLED} u vr rr vv uudd nndd",
        f"{_LINEAR} vvv vvr vrr rrr {_STREAM}", f"{_LINEAR} vvv vvr vrr rrr {_STREAM}",
    ),
)  # fmt: skip
PLANAR = tuple(dict.fromkeys((*STRUCTURES[2].terms, *STRUCTURES[3].terms)))  # what PlanarParameters can hold
ASYMMETRY = ("sway 1", "sway uu", "sway n|n|", "yaw 1", "yaw uu", "yaw n|n|")
WIND = ("surge wind", "sway wind", "yaw wind", "yaw wind ab")
TWIN = ("sway twin n|n|", "sway twin |n|u", "yaw twin n|n|", "yaw twin |n|u")  # of two shafts
THRUSTER = ("sway t|t|", "sway t|t|u", "yaw t|t|", "yaw t|t|u")  # at the side


def accelerations(nu: ca.SX, inputs: ca.SX, coefficients: ca.SX) -> ca.SX:
    """Accelerations (3,) of nu = [u, v, r] under inputs (6,) [m/s^2, rad/s^2].

    Beyond its limit a velocity counts as the limit, and comes back: sums of quadratic and cubic terms that were fitted
    to smaller velocities may drive the vehicle there, which no water does.

    Args:
        nu, inputs: Velocities through the water, and the inputs.
        coefficients: In the order of PARAMETERS; infinite limits are none.
    """
    known = [ca.fmax(ca.fmin(nu[k], coefficients[len(TERMS) + k]), -coefficients[len(TERMS) + k]) for k in range(3)]
    motion = _Motion(*known, *(inputs[k] for k in range(INPUTS)))
    sums = [(known[k] - nu[k]) / RETURN for k in range(3)]
    for place, term in enumerate(TERMS):
        sums[term.axis] += coefficients[place] * term.value(motion)
    return ca.vertcat(*sums)


@lru_cache
def step_function(integrator: Integrator = "midpoint", biases: Biases = ()) -> ca.Function:
    """One step (x, u, p, h) -> (x', F = dx'/dx) of the planar model's eight states, and of `biases` behind them."""
    x, u = ca.SX.sym("x", 8 + len(biases)), ca.SX.sym("u", INPUTS)
    p, h = ca.SX.sym("p", len(PARAMETERS)), ca.SX.sym("h")

    def slope(x: ca.SX) -> ca.SX:
        cosine, sine = ca.cos(x[2]), ca.sin(x[2])
        north, east = cosine * x[3] - sine * x[4] + x[6], sine * x[3] + cosine * x[4] + x[7]
        l = accelerations(x[3:6], u, p)
        if "surge" in biases:
            l[0] += x[8 + biases.index("surge")]
        return ca.vertcat(north, east, x[5], l, ca.SX(x.numel() - 6, 1))

    change = slope(x)
    if integrator == "midpoint":
        change = slope(x + h / 2 * change)
    following = x + h * change
    moving = ("surge",) if "surge" in biases else ()  # the others only stand there
    name = "_".join((f"planar_terms{x.numel()}", *moving, integrator))
    return ca.Function(name, [x, u, p, h], ca.cse([following, ca.jacobian(following, x)]))


@lru_cache
def kernels(integrator: Integrator = "midpoint", biases: Biases = ()) -> ModuleType:
    """The compiled functions of `kernels.step_kernels`; they compile at their first call."""
    return step_kernels(step_function(integrator, biases), wrapped=(2,))


class TermsProcess(ProcessModel):
    """A structure's motion as a ProcessModel.

    Its state is [north, east, heading, u, v, r, current north, current east], then the biases.

    Args:
        coefficients: By PARAMETERS; a term that is left out is zero, a limit none.
        noise: Power spectral densities (8,) of the process noise, then one of each bias.
        integrator: "midpoint" or "euler".
        max_substep: Longest substep [s].
        biases: Those in the state, as of `PlanarProcess`.

    Raises:
        ParameterError: An unknown term, a coefficient or density that cannot be.
    """

    angles = (2,)  # the heading

    def __init__(
        self,
        coefficients: Mapping[str, float],
        noise: Array,
        *,
        integrator: Integrator = "midpoint",
        max_substep: float = MAX_SUBSTEP,
        biases: Biases = (),
    ) -> None:
        self.noise = np.array(noise, dtype=float)
        if self.noise.shape != (8 + len(biases),) or not (self.noise >= 0.0).all():
            raise ParameterError(f"process noise {noise} must be {8 + len(biases)} power spectral densities >= 0")
        self._p = vector(coefficients)
        self._max_substep = max_substep
        self._kernels = kernels(integrator, biases)

    def propagate(self, mean: Array, covariance: Array, u: Sequence[float], dt: float) -> tuple[Array, Array, int]:
        """Mean and covariance after `dt` in one compiled call, and the substeps it took.

        Raises:
            NotFiniteError: The prediction is not finite.
        """
        substeps = self._substeps(dt)
        x, P, finite = self._kernels.predict(mean, covariance, _inputs(u), self._p, self.noise, dt, substeps)
        if not finite:
            raise NotFiniteError(f"prediction over {dt:g} s from {mean} with input {u} is not finite")
        return x, P, substeps

    def evaluate(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """State after `dt` [s] with the input held."""
        return self.propagate(x, np.zeros((x.size, x.size)), u, dt)[0]

    def jacobian(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """Derivative of `evaluate`: the product of the substeps' Jacobians."""
        substeps = self._substeps(dt)
        total, F = np.eye(x.size), np.zeros((x.size, x.size))
        x, following = np.array(x, dtype=float), np.empty(x.size)
        for _ in range(substeps):
            self._kernels.step(x, _inputs(u), self._p, dt / substeps, following, F)
            total, x, following = F @ total, following, x
        return total

    def covariance(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """Noise gathered over `dt`."""
        return self.propagate(x, np.zeros((x.size, x.size)), u, dt)[1]

    def move(self, points: Array, u: Sequence[float], dt: float) -> Array:
        """States (k, n) after `dt`, each from one of `points`; angles are not wrapped."""
        moved = np.array(points, dtype=float)
        self._kernels.move(moved, _inputs(u), self._p, dt, self._substeps(dt))
        return moved

    def _substeps(self, dt: float) -> int:
        return max(1, math.ceil(dt / self._max_substep - 1e-9))


@dataclass(frozen=True, kw_only=True, slots=True)
class TermsMotion:
    """A vehicle of any structure, as filters believe it (`model.Dynamics`)."""

    coefficients: Mapping[str, float]  # by PARAMETERS

    def process(
        self,
        noise: Array,
        *,
        integrator: Integrator = "midpoint",
        max_substep: float = MAX_SUBSTEP,
        biases: Biases = (),
    ) -> TermsProcess:
        """The vehicle as a ProcessModel; arguments as of `TermsProcess`."""
        return TermsProcess(
            self.coefficients, noise, integrator=integrator, max_substep=max_substep, biases=biases
        )  # fmt: skip

    def steady_surge(self, shaft_speed: float) -> float:
        """Surge [m/s] at which thrust and drag balance on a straight course; 0 if the thrust is astern.

        No more than the limit for which surge is known: there the model holds the vehicle.
        """
        c, n = self.coefficients, shaft_speed
        straight = PlanarParameters(
            m=1.0, I_z=1.0, X_prop=c.get("surge 1", 0.0), X_u=c.get("surge u", 0.0), X_uu=c.get("surge u|u|", 0.0),
            X_nn=c.get("surge n|n|", 0.0), X_nu=c.get("surge |n|u", 0.0),
        )  # fmt: skip
        limit = c.get("surge limit", math.inf)
        try:
            found = straight.steady_surge(n)
        except ParameterError:  # drag that grows with surge is none of this model's
            found = limit
        if not math.isfinite(found):
            raise ParameterError(f"thrust at {n:g} rad/s meets no drag, and surge has no limit")
        return min(found, limit)


def vector(coefficients: Mapping[str, float]) -> Array:
    """Values (parameters,) in the order of PARAMETERS; terms left out are zero, limits left out infinite.

    Raises:
        ParameterError: There is no such term, or a coefficient is not finite.
    """
    values = np.concatenate([np.zeros(len(TERMS)), np.full(len(LIMITS), np.inf)])
    for label, value in coefficients.items():
        if label not in PARAMETERS:
            raise ParameterError(f"no term '{label}'; there are {', '.join(PARAMETERS)}")
        values[PARAMETERS.index(label)] = value
    if not np.isfinite(values[: len(TERMS)]).all() or not (values[len(TERMS) :] > 0.0).all():
        raise ParameterError(f"coefficients must be finite: {coefficients}")
    return values


def _inputs(u: Sequence[float]) -> tuple[float, ...]:
    """All inputs; those that are not given are none: no wind, one shaft, no thruster."""
    return (*(float(value) for value in u), *(0.0 for _ in range(INPUTS - len(u))))


def planar_parameters(coefficients: dict[str, float], masses: PlanarParameters | None = None) -> PlanarParameters:
    """The planar model that accelerates as these coefficients do.

    Args:
        coefficients: Of terms in PLANAR.
        masses: Its masses and added masses are taken over; None: unit mass and moment of inertia.

    Raises:
        ParameterError: A term is none of the planar model's.
    """
    foreign = [label for label, value in coefficients.items() if value and label not in (*PLANAR, *LIMITS)]
    if foreign:
        raise ParameterError(f"the planar model has no term {', '.join(foreign)}")
    own = masses or PlanarParameters(m=1.0, I_z=1.0)

    def get(axis: str, term: str) -> float:
        return coefficients.get(f"{axis} {term}", 0.0)

    along = own.m - own.X_ud
    M = np.array([[own.m - own.Y_vd, own.m * own.x_g - own.Y_rd], [own.m * own.x_g - own.N_vd, own.I_z - own.N_rd]])

    def lateral(term: str) -> tuple[float, float]:
        force, moment = M @ np.array([get("sway", term), get("yaw", term)])
        return float(force), float(moment)

    (Y_v, N_v), (Y_r, N_r), (Y_uv, N_uv), (Y_ur, N_ur) = (lateral(term) for term in ("v", "r", "uv", "ur"))
    (Y_vv, N_vv), (Y_rr, N_rr), (Y_dd, N_dd) = (lateral(term) for term in ("v|v|", "r|r|", "uud"))
    return PlanarParameters(
        m=own.m, x_g=own.x_g, I_z=own.I_z, X_ud=own.X_ud, Y_vd=own.Y_vd, Y_rd=own.Y_rd, N_vd=own.N_vd, N_rd=own.N_rd,
        X_uu=along * get("surge", "u|u|"), X_u=along * get("surge", "u"), X_dd=along * get("surge", "uudd"),
        X_vr=along * get("surge", "vr") - own.m, X_rr=along * get("surge", "rr") - own.m * own.x_g,
        X_prop=along * get("surge", "1"), X_nn=along * get("surge", "n|n|"), X_nu=along * get("surge", "|n|u"),
        Y_v=Y_v, Y_r=Y_r, Y_uv=Y_uv, Y_ur=Y_ur + own.m, Y_vv=Y_vv, Y_rr=Y_rr, Y_dd=Y_dd,
        N_v=N_v, N_r=N_r, N_uv=N_uv, N_ur=N_ur + own.m * own.x_g, N_vv=N_vv, N_rr=N_rr, N_dd=N_dd,
    )  # fmt: skip
