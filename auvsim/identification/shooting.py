"""Multiple shooting with IPOPT: whole records, continuous over their nodes, under constraints; a cross-check.

Nothing of the compiled loops is used here: motion, measurements and derivatives are CasADi's own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from auvsim.base.errors import InputError
from auvsim.identification.constraints import limits
from auvsim.identification.fit import (
    DEFAULT_FREE,
    MASSES,
    Fit,
    Nuisances,
    check,
    free_indices,
    residual_summary,
    with_values,
)
from auvsim.identification.records import Record
from auvsim.identification.segment_problem import active_nuisances
from auvsim.identification.states import smoothed, substeps
from estimators.core.types import Array
from estimators.planar.model import PARAMETER_NAMES, PlanarParameters, accelerations

_SMALLEST = 1e-3  # of an inertia that is kept positive [kg, kg m^2]


@dataclass(frozen=True, kw_only=True, slots=True)
class ShootingOptions:
    """How records are cut, and what is held."""

    length: float = 10.0  # between two nodes [s]
    nuisances: Nuisances = field(default_factory=Nuisances)
    signs: bool = False  # as in SegmentOptions
    max_iterations: int = 100


class _Node(NamedTuple):
    """The samples between two nodes, and the node's state."""

    record: int
    first: int
    count: int
    state: ca.MX


def fit_shooting(
    records: Sequence[Record],
    start: PlanarParameters,
    free: Sequence[str] = DEFAULT_FREE,
    options: ShootingOptions | None = None,
) -> Fit:
    """Fits whole records, without noise of the process, by least squares; inertia stays positive.

    The covariance is that of the parameters under the constraints that hold the nodes together.

    Raises:
        InputError: Records, names or options that cannot be used, or IPOPT stopped without a point.
    """
    options = options or ShootingOptions()
    check(records, start)
    if not options.length > 0.0:
        raise InputError(f"nodes every {options.length} s; the length must be positive")
    problem = _Problem(records, start, free, options)
    unknowns, stats = problem.solve(options.max_iterations)
    return problem.report(unknowns, stats)


class _Problem:
    """The nonlinear program: unknowns are scaled parameters, then nuisances, then the states of the nodes."""

    def __init__(
        self, records: Sequence[Record], start: PlanarParameters, free: Sequence[str], options: ShootingOptions
    ) -> None:
        self.records, self.start, self.free = tuple(records), start, tuple(free)
        self.indices = free_indices(free)
        deviations = options.nuisances.vector()
        ways = [smoothed(record, start, deviations) for record in records]
        self.active = np.array([active_nuisances(record, deviations) for record in records])
        before = start.vector()[self.indices]
        self.scale = np.where(before != 0.0, np.abs(before), 1.0)
        k, own = len(self.free), int(self.active.sum())
        theta, xi = ca.MX.sym("theta", k), ca.MX.sym("xi", own)
        p = ca.MX(ca.DM(start.vector()))
        p[self.indices.tolist()] = theta * self.scale
        nuisances = self._nuisances(xi)
        self._nodes, guesses = _nodes(records, ways, options.length)
        residuals, gaps = [xi / deviations[np.nonzero(self.active)[1]]], []
        for a, node in enumerate(self._nodes):
            e, end = _span(records[node.record], node, p, nuisances[node.record])
            residuals.append(e)
            if a + 1 < len(self._nodes) and self._nodes[a + 1].record == node.record:
                gaps.append(self._nodes[a + 1].state - end)
        self.continuity = 6 * len(gaps)
        positive = _inertia(p) if set(free) & set(MASSES) else ca.MX(0, 1)
        self.w = ca.vertcat(theta, xi, *(node.state for node in self._nodes))
        self.residual = ca.Function("residual", [self.w], [ca.vertcat(*residuals)])
        self.constraint = ca.Function("constraint", [self.w], [ca.vertcat(*gaps, positive)])
        self.first = np.concatenate([before / self.scale, np.zeros(own), *guesses])
        low, high = limits(free, options.signs)
        self._low = np.full(len(self.first), -np.inf)
        self._high = np.full(len(self.first), np.inf)
        self._low[:k], self._high[:k] = low / self.scale, high / self.scale

    def solve(self, max_iterations: int) -> tuple[Array, dict]:
        """The best unknowns and IPOPT's own words."""
        e, g = self.residual(self.w), self.constraint(self.w)
        J = ca.jacobian(e, self.w)
        factor, multipliers = ca.MX.sym("factor"), ca.MX.sym("lam", g.numel())
        hessian = ca.Function("hessian", [self.w, ca.MX(0, 1), factor, multipliers], [factor * ca.triu(J.T @ J)])
        solver = ca.nlpsol(
            "shooting", "ipopt", {"x": self.w, "f": 0.5 * ca.sumsqr(e), "g": g},
            {
                "hess_lag": hessian, "print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes",
                "ipopt.max_iter": max_iterations, "ipopt.tol": 1e-6, "ipopt.linear_solver": "mumps",
            },
        )  # fmt: skip
        upper = np.zeros(g.numel())
        upper[self.continuity :] = np.inf
        lower = np.zeros(g.numel())
        lower[self.continuity :] = _SMALLEST
        solution = solver(x0=self.first, lbx=self._low, ubx=self._high, lbg=lower, ubg=upper)
        stats = solver.stats()
        unknowns = np.array(solution["x"]).ravel()
        if not np.isfinite(unknowns).all():
            raise InputError(f"IPOPT stopped without a point: {stats['return_status']}")
        return unknowns, stats

    def report(self, unknowns: Array, stats: dict) -> Fit:
        """The fit of solved unknowns."""
        k = len(self.free)
        own = int(self.active.sum())
        covariance = self._covariance(unknowns)
        e = np.array(self.residual(unknowns)).ravel()
        frozen = self._cost_of_start(unknowns)
        nuisances = np.zeros((len(self.records), 6))
        for r, record in enumerate(self.records):
            if record.current is not None:
                nuisances[r, :2] = record.current
        nuisances[self.active] = unknowns[k : k + own]
        deviations = np.zeros_like(nuisances)
        deviations[self.active] = np.sqrt(np.diag(covariance)[k:])
        residuals = self._by_channel(e[own:])
        rms, white = residual_summary(residuals)
        return Fit(
            method="shooting",
            start=self.start,
            parameters=with_values(self.start, self.free, unknowns[:k] * self.scale),
            free=self.free,
            covariance=covariance[:k, :k] * np.outer(self.scale, self.scale),
            nuisances=nuisances,
            nuisance_deviations=deviations,
            residual_rms=rms,
            whiteness=white,
            cost=0.5 * float(e @ e),
            start_cost=frozen,
            samples=len(e) - own,
            iterations=int(stats["iter_count"]),
            converged=bool(stats["success"]),
            message=str(stats["return_status"]).replace("_", " ").lower(),
        )

    def _covariance(self, unknowns: Array) -> Array:
        """Of scaled parameters and nuisances: the corner of the inverse of the constrained normal equations."""
        J = _sparse(ca.Function("J", [self.w], [ca.jacobian(self.residual(self.w), self.w)])(unknowns))
        gaps = self.constraint(self.w)[: self.continuity]
        A = _sparse(ca.Function("A", [self.w], [ca.jacobian(gaps, self.w)])(unknowns))
        head = len(self.free) + int(self.active.sum())
        ridge = sp.diags_array(np.full(J.shape[1], 1e-12))
        system = sp.block_array([[J.T @ J + ridge, A.T], [A, None]], format="csc")
        right = np.zeros((J.shape[1] + self.continuity, head))
        right[:head] = np.eye(head)
        return splu(system).solve(right)[:head]

    def _cost_of_start(self, unknowns: Array) -> float:
        """With the start's parameters and all else at its best, to second order about the solution."""
        k = len(self.free)
        aside = self.first[:k] - unknowns[:k]
        information = np.linalg.pinv(self._covariance(unknowns)[:k, :k])
        e = np.array(self.residual(unknowns)).ravel()
        return 0.5 * float(e @ e + aside @ information @ aside)

    def _nuisances(self, xi: ca.MX) -> list[ca.MX]:
        """All six of each record."""
        found, at = [], 0
        for record, active in zip(self.records, self.active, strict=True):
            values = ca.MX(6, 1)
            for j in range(6):
                if active[j]:
                    values[j] = xi[at]
                    at += 1
                elif j < 2 and record.current is not None:
                    values[j] = float(record.current[j])
            found.append(values)
        return found

    def _by_channel(self, e: Array) -> list[Array]:
        """Residuals (n, 8) of each record, from those of its nodes one after another."""
        found, at = [np.full(record.measured.shape, np.nan) for record in self.records], 0
        for node in self._nodes:
            there = np.isfinite(self.records[node.record].measured[node.first : node.first + node.count])
            block = np.full(there.shape, np.nan)
            block[there] = e[at : at + there.sum()]
            found[node.record][node.first : node.first + node.count] = block
            at += int(there.sum())
        return found


def _nodes(records: Sequence[Record], ways: Sequence[Array], length: float) -> tuple[list[_Node], list[Array]]:
    nodes, guesses = [], []
    for r, (record, way) in enumerate(zip(records, ways, strict=True)):
        size = max(2, min(len(record.times), round(length / record.step)))
        firsts = list(range(0, len(record.times) - 1, size))
        for first, end in zip(firsts, [*firsts[1:], len(record.times)], strict=True):
            nodes.append(_Node(r, first, end - first, ca.MX.sym(f"x_{r}_{first}", 6)))
            guesses.append(way[first, :6])
    return nodes, guesses


def _span(record: Record, node: _Node, p: ca.MX, nuisances: ca.MX) -> tuple[ca.MX, ca.MX]:
    """Weighted residuals of what was measured between two nodes, and the state at the next."""
    here = slice(node.first, node.first + node.count)
    step = _step(record.step, substeps(record.step)).mapaccum(node.count)
    inputs = ca.DM(record.inputs[here].T)
    after = step(node.state, inputs, ca.repmat(p, 1, node.count), ca.repmat(nuisances[:2], 1, node.count))
    states = ca.horzcat(node.state, after[:, :-1])
    shown = _shown().map(node.count)(states, ca.repmat(nuisances, 1, node.count))
    measured = record.measured[here].T
    there = np.flatnonzero(np.isfinite(measured).ravel(order="F")).tolist()
    weights = np.repeat(1.0 / record.deviations[:, None], node.count, axis=1).ravel(order="F")[there]
    return (ca.DM(measured.ravel(order="F")[there]) - ca.vec(shown)[there]) * weights, after[:, -1]


def _step(h: float, parts: int) -> ca.Function:
    """Runge and Kutta's step of the state over `h` [s]."""
    x, u, p, current = ca.SX.sym("x", 6), ca.SX.sym("u", 2), ca.SX.sym("p", len(PARAMETER_NAMES)), ca.SX.sym("c", 2)

    def slope(x: ca.SX) -> ca.SX:
        cosine, sine = ca.cos(x[2]), ca.sin(x[2])
        north, east = cosine * x[3] - sine * x[4] + current[0], sine * x[3] + cosine * x[4] + current[1]
        return ca.vertcat(north, east, x[5], accelerations(x[3:6], u[0], u[1], p))

    following, d = x, h / parts
    for _ in range(parts):
        a = slope(following)
        b = slope(following + d / 2 * a)
        c = slope(following + d / 2 * b)
        following += d / 6 * (a + 2 * b + 2 * c + slope(following + d * c))
    return ca.Function("step", [x, u, p, current], [following])


def _shown() -> ca.Function:
    """What the channels show of a state, with a record's constant errors."""
    x, own = ca.SX.sym("x", 6), ca.SX.sym("own", 6)
    cn, ce, gyro, compass, misalignment, scale = ca.vertsplit(own)
    cosine, sine = ca.cos(x[2]), ca.sin(x[2])

    def log(u: ca.SX, v: ca.SX) -> ca.SX:
        a, b = ca.cos(misalignment), ca.sin(misalignment)
        return (1 + scale) * ca.vertcat(a * u + b * v, a * v - b * u)

    through, over = log(x[3], x[4]), log(x[3] + cosine * cn + sine * ce, x[4] - sine * cn + cosine * ce)
    return ca.Function("shown", [x, own], [ca.vertcat(x[0], x[1], x[2] + compass, through, x[5] + gyro, over)])


def _inertia(p: ca.MX) -> ca.MX:
    """Principal minors of the inertia's symmetric part; positive if it is."""
    m, x_g, I_z, X_ud, Y_vd, Y_rd, N_vd, N_rd = (p[PARAMETER_NAMES.index(name)] for name in MASSES)
    across, along = m - Y_vd, I_z - N_rd
    return ca.vertcat(m - X_ud, across, across * along - (m * x_g - 0.5 * (Y_rd + N_vd)) ** 2)


def _sparse(matrix: ca.DM) -> Any:
    return sp.csc_array(matrix.sparse())
