"""The planar (surge, sway, yaw) rudder-driven vehicle, defined once in CasADi for filters and identification.

State [north, east, psi, u, v, r], or with the current's [c_n, c_e] appended, and after these the biases a filter may
estimate besides (BIASES, in that order); u, v are velocities through the water.
Input (rudder [rad], positive to starboard; shaft speed [rad/s]). SNAME notation; Qiu and Li (2019), coefficients of
Prestero (2001).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, fields
from functools import lru_cache
from types import ModuleType, SimpleNamespace
from typing import Literal, Protocol

import casadi as ca
import numpy as np

from estimators.core import loops
from estimators.core.compiling import is_ready
from estimators.core.errors import NotFiniteError, ParameterError
from estimators.core.kernels import step_kernels
from estimators.core.types import Array, ProcessModel

Integrator = Literal["euler", "midpoint"]

# surge: acceleration that the model lacks, by an error of thrust or drag [m/s^2]; compass: bias of the vehicle's
# compass [rad]; dock_heading: bias of the dock's compass [rad]; clock: time from a fix's stamp to its true time [s].
BIASES = ("surge", "compass", "dock_heading", "clock")
Biases = tuple[str, ...]  # a selection, in the order of BIASES; then errors of other sensors, which only stand there

# Velocities beyond these come from outliers, not from the vehicle's motion; the quadratic damping there would make
# explicit steps of up to MAX_SUBSTEP unstable, so the accelerations are those at the limit.
SURGE_LIMIT, SWAY_LIMIT, YAW_RATE_LIMIT = 4.0, 2.0, 0.5  # [m/s, m/s, rad/s]
MAX_SUBSTEP = 0.17  # [s]


@dataclass(frozen=True, kw_only=True, slots=True)
class PlanarParameters:
    """Coefficients of the planar model, SI units, about the body's origin; rudder positive to starboard.

    Y_ur, N_uv and N_ur contain the added-mass (Munk) terms, as the literature prints them.
    """

    m: float  # mass [kg]
    x_g: float = 0.0  # centre of gravity ahead of the origin [m]
    I_z: float  # yaw moment of inertia [kg m^2]
    X_ud: float = 0.0
    Y_vd: float = 0.0
    Y_rd: float = 0.0
    N_vd: float = 0.0
    N_rd: float = 0.0
    X_uu: float = 0.0
    X_vr: float = 0.0
    X_rr: float = 0.0
    X_dd: float = 0.0
    X_prop: float = 0.0  # constant thrust [N]
    Y_vv: float = 0.0
    Y_rr: float = 0.0
    Y_uv: float = 0.0
    Y_ur: float = 0.0
    Y_dd: float = 0.0
    Y_v: float = 0.0
    Y_r: float = 0.0
    N_vv: float = 0.0
    N_rr: float = 0.0
    N_uv: float = 0.0
    N_ur: float = 0.0
    N_dd: float = 0.0
    N_v: float = 0.0
    N_r: float = 0.0
    X_u: float = 0.0
    X_nn: float = 0.0  # thrust by shaft speed, X_nn n|n| [N s^2/rad^2]
    X_nu: float = 0.0  # its loss with surge, X_nu |n| u [N s^2/(rad m)]

    def vector(self) -> Array:
        """The coefficients (30,), in the order of PARAMETER_NAMES."""
        return np.array(astuple(self), dtype=float)

    def process(
        self,
        noise: Array,
        *,
        integrator: Integrator = "midpoint",
        max_substep: float = MAX_SUBSTEP,
        biases: Biases = (),
    ) -> "PlanarProcess":
        """The vehicle as a ProcessModel; arguments as of `PlanarProcess`."""
        return PlanarProcess(self, noise, integrator=integrator, max_substep=max_substep, biases=biases)

    def steady_surge(self, shaft_speed: float) -> float:
        """Surge [m/s] at which thrust and drag balance on a straight course; 0 if the thrust is astern.

        Raises:
            ParameterError: The parameters have thrust but no drag.
        """
        n = shaft_speed
        a, b, c = self.X_uu, self.X_u + self.X_nu * abs(n), self.X_prop + self.X_nn * n * abs(n)
        if c <= 0.0:
            return 0.0
        if a < 0.0:
            return (-b - math.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)
        if a == 0.0 and b < 0.0:
            return -c / b
        raise ParameterError(f"thrust {c:g} N meets no drag: X_uu {a:g} or X_u {self.X_u:g} must be below 0")


class Dynamics(Protocol):
    """A vehicle in the plane as filters believe it, whatever its structure; also `terms.TermsMotion` keeps to it."""

    def process(
        self, noise: Array, *, integrator: Integrator = ..., max_substep: float = ..., biases: Biases = ...
    ) -> ProcessModel:
        """The vehicle as a ProcessModel; arguments as of `PlanarProcess`."""
        ...

    def steady_surge(self, shaft_speed: float) -> float:
        """Surge [m/s] at which thrust and drag balance on a straight course."""
        ...


PARAMETER_NAMES = tuple(field.name for field in fields(PlanarParameters))

# REMUS-100 of Prestero (2001), App. C, with Y_vv of strip theory, the fixed tail-fin lift of 20 kg/m at -0.638 m that
# makes it stable on a straight line, and the rudder's signs turned (there a positive rudder turns to port).
PRESTERO = PlanarParameters(
    m=30.48,
    I_z=3.45,
    X_ud=-0.93,
    Y_vd=-35.5,
    Y_rd=1.93,
    N_vd=1.93,
    N_rd=-4.88,
    X_uu=-1.62,
    X_vr=35.5,
    X_rr=-1.93,
    X_dd=-4.82,
    X_prop=1.037,
    Y_vv=-131.0,
    Y_rr=0.632,
    Y_uv=-48.6,
    Y_ur=17.98,
    Y_dd=-9.64,
    N_vv=-3.18,
    N_rr=-94.0,
    N_uv=-11.24,
    N_ur=-10.14,
    N_dd=6.15,
)


def accelerations(nu: ca.SX, rudder: ca.SX, shaft_speed: ca.SX, parameters: ca.SX) -> ca.SX:
    """Accelerations l (3,) of nu = [u, v, r] through the water [m/s^2, rad/s^2]; `parameters` as PARAMETER_NAMES."""
    p = SimpleNamespace(**dict(zip(PARAMETER_NAMES, ca.vertsplit(parameters), strict=True)))
    u, v, r = (
        ca.fmax(ca.fmin(nu[k], limit), -limit) for k, limit in enumerate((SURGE_LIMIT, SWAY_LIMIT, YAW_RATE_LIMIT))
    )
    n, d = shaft_speed, rudder
    thrust = p.X_prop + p.X_nn * n * ca.fabs(n) + p.X_nu * ca.fabs(n) * u
    X = p.X_uu * u * ca.fabs(u) + p.X_u * u + (p.X_vr + p.m) * v * r + (p.X_rr + p.m * p.x_g) * r**2
    X += p.X_dd * u**2 * d**2 + thrust
    Y = p.Y_vv * v * ca.fabs(v) + p.Y_rr * r * ca.fabs(r) + p.Y_uv * u * v + (p.Y_ur - p.m) * u * r
    Y += p.Y_dd * u**2 * d + p.Y_v * v + p.Y_r * r
    N = p.N_vv * v * ca.fabs(v) + p.N_rr * r * ca.fabs(r) + p.N_uv * u * v + (p.N_ur - p.m * p.x_g) * u * r
    N += p.N_dd * u**2 * d + p.N_v * v + p.N_r * r
    m_v, m_r = p.m - p.Y_vd, p.I_z - p.N_rd
    y_r, n_v = p.m * p.x_g - p.Y_rd, p.m * p.x_g - p.N_vd
    determinant = m_v * m_r - y_r * n_v
    return ca.vertcat(X / (p.m - p.X_ud), (m_r * Y - y_r * N) / determinant, (m_v * N - n_v * Y) / determinant)


def derivative(x: ca.SX, u: ca.SX, parameters: ca.SX, biases: Biases = ()) -> ca.SX:
    """dx/dt of the state, (6,) or (8,) with the current, then the `biases`; eq. 1 and 12 of the paper."""
    psi, surge, sway, r = x[2], x[3], x[4], x[5]
    current = x[6:8] if x.numel() >= 8 else ca.SX(2, 1)
    north = ca.cos(psi) * surge - ca.sin(psi) * sway + current[0]
    east = ca.sin(psi) * surge + ca.cos(psi) * sway + current[1]
    l = accelerations(x[3:6], u[0], u[1], parameters)
    if "surge" in biases:
        l[0] += x[8 + biases.index("surge")]
    return ca.vertcat(north, east, r, l, ca.SX(x.numel() - 6, 1))


@lru_cache
def step_function(*, current: bool = True, integrator: Integrator = "midpoint", biases: Biases = ()) -> ca.Function:
    """One step (x, u, p, h) -> (x', F = dx'/dx) of six states, of eight (with `current`), or of more with `biases`."""
    if integrator not in ("euler", "midpoint"):
        raise ParameterError(f"no integrator '{integrator}'; there are euler, midpoint")
    first = tuple(name for name in BIASES if name in biases)
    if biases[: len(first)] != first or (biases and not current):
        raise ParameterError(f"biases {biases} must be some of {BIASES}, in that order, then others, behind a current")
    x, u = ca.SX.sym("x", 8 + len(biases) if current else 6), ca.SX.sym("u", 2)
    p, h = ca.SX.sym("p", len(PARAMETER_NAMES)), ca.SX.sym("h")
    slope = derivative(x, u, p, biases)
    if integrator == "midpoint":
        slope = derivative(x + h / 2 * slope, u, p, biases)
    following = x + h * slope
    expressions = ca.cse([following, ca.jacobian(following, x)])
    moving = ("surge",) if "surge" in biases else ()  # the others only stand there: any of them compiles to the same
    return ca.Function("_".join((f"planar{x.numel()}", *moving, integrator)), [x, u, p, h], expressions)


@lru_cache
def planar_kernels(*, current: bool = True, integrator: Integrator = "midpoint", biases: Biases = ()) -> ModuleType:
    """The compiled functions of `kernels.step_kernels`; they compile at their first call, see `warm`."""
    function = step_function(current=current, integrator=integrator, biases=biases)
    return step_kernels(function, wrapped=(2,))


def is_warm(*, current: bool = True, integrator: Integrator = "midpoint", biases: Biases = ()) -> bool:
    """Whether a filter on this model starts at once; if not, its first use compiles for some seconds."""
    kernels = planar_kernels(current=current, integrator=integrator, biases=biases)
    compiled = (kernels.predict, kernels.predict_each, loops.correct, loops.correct_angle, loops.correct_angle_each)
    return all(map(is_ready, compiled))


def warm(*, current: bool = True, integrator: Integrator = "midpoint", biases: Biases = ()) -> None:
    """Compiles what a filter on this model needs, or loads it from the cache on disk."""
    n = 8 + len(biases) if current else 6
    process = PlanarProcess(PRESTERO, np.zeros(n), integrator=integrator, biases=biases)
    kernels = planar_kernels(current=current, integrator=integrator, biases=biases)
    mean, covariance, _ = process.propagate(np.zeros(n), np.eye(n), (0.0, 0.0), 0.1)
    loops.correct(mean, covariance, np.eye(1, n), np.zeros(1), np.eye(1), math.inf)
    loops.correct_angle(mean, covariance, np.eye(1, n), np.zeros(1), np.eye(1))
    each = kernels.predict_each(mean[None], covariance[None], (0.0, 0.0), process._p, process.noise[None], 0.1, 1)
    loops.correct_angle_each(*each[:2], np.eye(1, n), np.zeros(1), np.eye(1))
    loops.wrap(0.0)


class PlanarProcess(ProcessModel):
    """The planar vehicle as a ProcessModel, in substeps short enough for an explicit integrator.

    Args:
        parameters: The vehicle.
        noise: Power spectral densities of the process noise: (8,) with the current in the state, (6,) without it;
            [m^2/s, m^2/s, rad^2/s, m^2/s^3, m^2/s^3, rad^2/s^3, m^2/s^3, m^2/s^3], then one of each bias.
        integrator: "midpoint" or the paper's "euler".
        max_substep: Longest substep [s].
        biases: Those in the state, of BIASES.
    """

    angles = (2,)  # the heading

    def __init__(
        self,
        parameters: PlanarParameters,
        noise: Array,
        *,
        integrator: Integrator = "midpoint",
        max_substep: float = MAX_SUBSTEP,
        biases: Biases = (),
    ) -> None:
        self.parameters = parameters
        self.noise = np.array(noise, dtype=float)
        sizes = (8 + len(biases),) if biases else (6, 8)
        if self.noise.ndim != 1 or self.noise.size not in sizes or not (self.noise >= 0.0).all():
            wanted = " or ".join(map(str, sizes))
            raise ParameterError(f"process noise {noise} must be {wanted} power spectral densities >= 0")
        self._p = parameters.vector()
        if not np.isfinite(self._p).all():
            raise ParameterError(f"planar parameters must be finite: {parameters}")
        self._max_substep = max_substep
        kernels = planar_kernels(current=self.noise.size >= 8, integrator=integrator, biases=biases)
        self._predict, self._step, self._move, self._walk = kernels.predict, kernels.step, kernels.move, kernels.walk
        self._predict_each = kernels.predict_each

    def evaluate(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """State after `dt` [s] with the input (rudder [rad], shaft speed [rad/s]) held."""
        return self.propagate(x, np.zeros((x.size, x.size)), u, dt)[0]

    def jacobian(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """Derivative of `evaluate`: the product of the substeps' Jacobians."""
        substeps = self._substeps(dt)
        total, F = np.eye(x.size), np.zeros((x.size, x.size))
        x, following = np.array(x, dtype=float), np.empty(x.size)
        for _ in range(substeps):
            self._step(x, (float(u[0]), float(u[1])), self._p, dt / substeps, following, F)
            total, x, following = F @ total, following, x
        return total

    def covariance(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """Noise gathered over `dt`, h/2 (F diag(q) F' + diag(q)) a substep: nearly the same however it is split."""
        return self.propagate(x, np.zeros((x.size, x.size)), u, dt)[1]

    def propagate(self, mean: Array, covariance: Array, u: Sequence[float], dt: float) -> tuple[Array, Array, int]:
        """Mean and covariance after `dt` in one compiled call, and the substeps it took.

        Raises:
            NotFiniteError: The prediction is not finite.
        """
        substeps = self._substeps(dt)
        x, P, finite = self._predict(mean, covariance, u, self._p, self.noise, dt, substeps)
        if not finite:
            raise NotFiniteError(f"prediction over {dt:g} s from {mean} with input {u} is not finite")
        return x, P, substeps

    def together(self, others: Sequence[ProcessModel]) -> Callable[..., tuple[Array, Array]] | None:
        """One compiled call for `propagate` of this process and of others that differ in nothing but noise, else None.

        It takes means (m, n), covariances (m, n, n), input and duration [s]; gives means and covariances.
        """
        own = (self._predict_each, self._max_substep, self.parameters)
        densities = [self.noise]
        for other in others:
            if not isinstance(other, PlanarProcess):
                return None
            if (other._predict_each, other._max_substep, other.parameters) != own:
                return None
            densities.append(other.noise)
        noise = np.array(densities)

        def propagate(means: Array, covariances: Array, u: Sequence[float], dt: float) -> tuple[Array, Array]:
            X, P, finite = self._predict_each(means, covariances, u, self._p, noise, dt, self._substeps(dt))
            if not finite:
                raise NotFiniteError(f"prediction over {dt:g} s from one of {means} with input {u} is not finite")
            return X, P

        return propagate

    def move(self, points: Array, u: Sequence[float], dt: float) -> Array:
        """States (k, n) after `dt` with the input held, each from one of `points` (k, n); angles are not wrapped."""
        moved = np.array(points, dtype=float)
        self._move(moved, (float(u[0]), float(u[1])), self._p, dt, self._substeps(dt))
        return moved

    def walk(self, start: Array, inputs: Array, step: float, increments: Array) -> Array:
        """A sampled trajectory (k + 1, n) in steps of `step` [s]; angles are not wrapped.

        Args:
            start: First state (n,).
            inputs: Input during each step (k, 2).
            step: Its length [s], without substeps.
            increments: Noise added after each step (k, n).
        """
        return self._walk(np.array(start, dtype=float), np.array(inputs, dtype=float), self._p, step, increments)

    def _substeps(self, dt: float) -> int:
        return max(1, math.ceil(dt / self._max_substep - 1e-9))
