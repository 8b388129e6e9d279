"""The native passive-force callback that puts hydrodynamics into MuJoCo.

After velocities are known MuJoCo calls `mjcb_passive`. For every body with a coefficient record in `mjModel.body_user`
(see `forces`; filled by `hydrodynamics`) the callback adds its forces to `qfrc_passive` and, for hulls, `J' M_A J` to
the joint-space inertia `mjData.M`, which it then factorises again. All that follows in the step (contact, implicit
integrators, each Runge-Kutta stage) uses the sum, so added mass is exact in free motion and in contact.

With v_r the hull's velocity relative to the water, omega its angular velocity, G the gradient of the water's velocity
and a_c = Dv_c/Dt, `-M_A d(nu_r)/dt` is `-M_A J qacc` (in M) plus
`M_A [a_c + G v_r + omega x v_r - (d(J)/dt qvel); 0]`: the hull enters other water as it moves. A gradient also takes
`G' p` from the force, p being the linear part of the impulse `M_A nu_r` (Galper & Miloh 1995, J. Fluid Mech. 295), and
the water's own pressure adds `rho V a_c` at the centre of buoyancy. Force and moment are then those of the kinetic
energy `nu_r' M_A nu_r / 2`, exact in irrotational strain but for moments of the order of M_A G^2. In rotational shear
they are an approximation, which has the lift coefficient of a sphere, 1/2 (Auton, Hunt & Prud'homme 1988).

The water is a local expansion in `mjData.userdata`, one slot per vehicle (see `water_slot`). Where it has a surface,
buoyancy is that of the strips under water; the other forces of a hull, and its added mass, fade with the share of its
volume that is under water, those of fins, propellers and thrusters with the share of their area. What a breaking
surface adds (slamming, ventilation, waves made) is left out.
"""

import ctypes
import math
import os
from pathlib import Path
from typing import Any

import llvmlite.binding
import mujoco
from numba import cfunc, njit, types
from numba.core.caching import FunctionCache

from auvsim.physics import mujoco_structs
from auvsim.physics.forces import (
    CHANNEL,
    DENSITY,
    FIN,
    FIN_KIND,
    HULL,
    HULL_KIND,
    PROPELLER,
    PROPELLER_KIND,
    SLOT,
    THRUSTER,
    THRUSTER_KIND,
    added_momentum,
    fin_force,
    hull_force,
    propeller_force,
    shaft_brake,
    thruster_force,
)
from auvsim.physics.pointers import integers, load_pointer, numbers, scratch
from auvsim.physics.submergence import share_under, volume_out
from auvsim.physics.water_slot import WATER

__all__ = ["WATER", "install", "is_warm"]

_MASS, _VOLUME = HULL["added_mass"][0], HULL["displaced_volume"][0]
_SWIRL, _DIAMETER = PROPELLER["swirl_recovery"][0], PROPELLER["diameter"][0]
_AREA = FIN["area"][0]
_SIZE, _REACTION = THRUSTER["size"][0], THRUSTER["reaction"][0]
_scratch = scratch(42)  # a hull's Jacobian (6, 6) and a row of its product


@njit(cache=True, error_model="numpy")
def _water_at(water, slot, time, x0, x1, x2):
    """Velocity of the water (3) at a place and time from the local expansion in `water[slot:]`."""
    dt = time - water[slot]
    d0, d1, d2 = x0 - water[slot + 1], x1 - water[slot + 2], x2 - water[slot + 3]
    g = slot + 10
    v0 = water[slot + 4] + water[slot + 7] * dt + water[g] * d0 + water[g + 1] * d1 + water[g + 2] * d2
    v1 = water[slot + 5] + water[slot + 8] * dt + water[g + 3] * d0 + water[g + 4] * d1 + water[g + 5] * d2
    v2 = water[slot + 6] + water[slot + 9] * dt + water[g + 6] * d0 + water[g + 7] * d1 + water[g + 8] * d2
    return v0, v1, v2


@njit(cache=True, error_model="numpy")
def _apply(qfrc, cdof, parent, dof, f0, f1, f2, m0, m1, m2):
    """Adds a world force and moment about the tree's centre of mass to all joints that move the body."""
    while dof >= 0:
        a = 6 * dof
        qfrc[dof] += cdof[a] * m0 + cdof[a + 1] * m1 + cdof[a + 2] * m2
        qfrc[dof] += cdof[a + 3] * f0 + cdof[a + 4] * f1 + cdof[a + 5] * f2
        dof = parent[dof]


@njit(cache=True, error_model="numpy")
def _hull(c, o, body, water, time, gravity, xpos, xmat, cvel, com, cdof, parent, dof0, qfrc, M, rows, J):
    """A hull's forces into `qfrc` and its added mass into `M`; `com` is its tree's centre of mass (3)."""
    R = 9 * body
    r00, r01, r02, r10, r11, r12 = xmat[R], xmat[R + 1], xmat[R + 2], xmat[R + 3], xmat[R + 4], xmat[R + 5]
    r20, r21, r22 = xmat[R + 6], xmat[R + 7], xmat[R + 8]
    x0, x1, x2 = xpos[3 * body], xpos[3 * body + 1], xpos[3 * body + 2]
    a0, a1, a2 = x0 - com[0], x1 - com[1], x2 - com[2]
    o0, o1, o2 = cvel[6 * body], cvel[6 * body + 1], cvel[6 * body + 2]
    s0 = cvel[6 * body + 3] + o1 * a2 - o2 * a1
    s1 = cvel[6 * body + 4] + o2 * a0 - o0 * a2
    s2 = cvel[6 * body + 5] + o0 * a1 - o1 * a0
    slot = int(c[o + SLOT])
    c0, c1, c2 = _water_at(water, slot, time, x0, x1, x2)
    g = slot + 10
    # Material acceleration of the water, Dv/Dt = dv/dt + (v . grad) v.
    b0 = water[slot + 7] + water[g] * c0 + water[g + 1] * c1 + water[g + 2] * c2
    b1 = water[slot + 8] + water[g + 3] * c0 + water[g + 4] * c1 + water[g + 5] * c2
    b2 = water[slot + 9] + water[g + 6] * c0 + water[g + 7] * c1 + water[g + 8] * c2
    # Change of the water's velocity per metre along the hull.
    e0 = water[g] * r00 + water[g + 1] * r10 + water[g + 2] * r20
    e1 = water[g + 3] * r00 + water[g + 4] * r10 + water[g + 5] * r20
    e2 = water[g + 6] * r00 + water[g + 7] * r10 + water[g + 8] * r20

    u0, u1, u2 = s0 - c0, s1 - c1, s2 - c2
    v0 = r00 * u0 + r10 * u1 + r20 * u2
    v1 = r01 * u0 + r11 * u1 + r21 * u2
    v2 = r02 * u0 + r12 * u1 + r22 * u2
    w0 = r00 * o0 + r10 * o1 + r20 * o2
    w1 = r01 * o0 + r11 * o1 + r21 * o2
    w2 = r02 * o0 + r12 * o1 + r22 * o2
    f0, f1, f2, m0, m1, m2 = hull_force(
        c, o, v0, v1, v2, w0, w1, w2, r01 * e0 + r11 * e1 + r21 * e2, r02 * e0 + r12 * e1 + r22 * e2
    )

    # The acceleration that M does not carry: omega x (omega x p), p from the free joint's origin to the hull's, in
    # world axes.
    j0 = dof0 + 3
    p0, p1, p2 = 0.0, 0.0, 0.0  # omega x p = velocity of the hull's origin less that of the joint's
    for k in range(3):
        d = 6 * (j0 + k)
        q = cdof[d] * o0 + cdof[d + 1] * o1 + cdof[d + 2] * o2  # angular rate about this joint axis
        p0 += q * (cdof[d + 3] + cdof[d + 1] * a2 - cdof[d + 2] * a1)
        p1 += q * (cdof[d + 4] + cdof[d + 2] * a0 - cdof[d] * a2)
        p2 += q * (cdof[d + 5] + cdof[d] * a1 - cdof[d + 1] * a0)
    # Change of the water's velocity along the hull's path, dv/dt + (x_dot . grad) v = Dv/Dt + (v_r . grad) v.
    h0 = b0 + (water[g] * u0 + water[g + 1] * u1 + water[g + 2] * u2)
    h1 = b1 + (water[g + 3] * u0 + water[g + 4] * u1 + water[g + 5] * u2)
    h2 = b2 + (water[g + 6] * u0 + water[g + 7] * u1 + water[g + 8] * u2)
    k0 = h0 + o1 * u2 - o2 * u1 - (o1 * p2 - o2 * p1)
    k1 = h1 + o2 * u0 - o0 * u2 - (o2 * p0 - o0 * p2)
    k2 = h2 + o0 * u1 - o1 * u0 - (o0 * p1 - o1 * p0)
    n0 = r00 * k0 + r10 * k1 + r20 * k2
    n1 = r01 * k0 + r11 * k1 + r21 * k2
    n2 = r02 * k0 + r12 * k1 + r22 * k2
    f0 += added_momentum(c, o, 0, n0, n1, n2, 0.0, 0.0, 0.0)
    f1 += added_momentum(c, o, 1, n0, n1, n2, 0.0, 0.0, 0.0)
    f2 += added_momentum(c, o, 2, n0, n1, n2, 0.0, 0.0, 0.0)
    m0 += added_momentum(c, o, 3, n0, n1, n2, 0.0, 0.0, 0.0)
    m1 += added_momentum(c, o, 4, n0, n1, n2, 0.0, 0.0, 0.0)
    m2 += added_momentum(c, o, 5, n0, n1, n2, 0.0, 0.0, 0.0)

    # The impulse in strained water, of which G' p is taken from the force.
    i0 = added_momentum(c, o, 0, v0, v1, v2, w0, w1, w2)
    i1 = added_momentum(c, o, 1, v0, v1, v2, w0, w1, w2)
    i2 = added_momentum(c, o, 2, v0, v1, v2, w0, w1, w2)
    P0 = r00 * i0 + r01 * i1 + r02 * i2
    P1 = r10 * i0 + r11 * i1 + r12 * i2
    P2 = r20 * i0 + r21 * i1 + r22 * i2

    # To world axes, as far as the hull is under water.
    out, out_moment = volume_out(c, o, water, slot, time, x0, x1, x2, r00, r10, r20)
    share = 1.0 - out / c[o + _VOLUME] if out > 0.0 else 1.0
    F0 = share * (r00 * f0 + r01 * f1 + r02 * f2 - (water[g] * P0 + water[g + 3] * P1 + water[g + 6] * P2))
    F1 = share * (r10 * f0 + r11 * f1 + r12 * f2 - (water[g + 1] * P0 + water[g + 4] * P1 + water[g + 7] * P2))
    F2 = share * (r20 * f0 + r21 * f1 + r22 * f2 - (water[g + 2] * P0 + water[g + 5] * P1 + water[g + 8] * P2))
    # Buoyancy and the water's own pressure gradient act at the hull's origin, less at the strips that are out.
    n0, n1, n2 = b0 - gravity[0], b1 - gravity[1], b2 - gravity[2]
    mass, arm = c[o + DENSITY] * (c[o + _VOLUME] - out), c[o + DENSITY] * out_moment
    F0, F1, F2 = F0 + mass * n0, F1 + mass * n1, F2 + mass * n2
    T0 = share * (r00 * m0 + r01 * m1 + r02 * m2) + a1 * F2 - a2 * F1 - arm * (r10 * n2 - r20 * n1)
    T1 = share * (r10 * m0 + r11 * m1 + r12 * m2) + a2 * F0 - a0 * F2 - arm * (r20 * n0 - r00 * n2)
    T2 = share * (r20 * m0 + r21 * m1 + r22 * m2) + a0 * F1 - a1 * F0 - arm * (r00 * n1 - r10 * n0)
    _apply(qfrc, cdof, parent, dof0 + 5, F0, F1, F2, T0, T1, T2)

    # J: column i is the hull's velocity, in its axes, for unit speed of joint axis i.
    for i in range(6):
        d = 6 * (dof0 + i)
        l0 = cdof[d + 3] + cdof[d + 1] * a2 - cdof[d + 2] * a1
        l1 = cdof[d + 4] + cdof[d + 2] * a0 - cdof[d] * a2
        l2 = cdof[d + 5] + cdof[d] * a1 - cdof[d + 1] * a0
        J[i] = r00 * l0 + r10 * l1 + r20 * l2
        J[6 + i] = r01 * l0 + r11 * l1 + r21 * l2
        J[12 + i] = r02 * l0 + r12 * l1 + r22 * l2
        J[18 + i] = r00 * cdof[d] + r10 * cdof[d + 1] + r20 * cdof[d + 2]
        J[24 + i] = r01 * cdof[d] + r11 * cdof[d + 1] + r21 * cdof[d + 2]
        J[30 + i] = r02 * cdof[d] + r12 * cdof[d + 1] + r22 * cdof[d + 2]
    for i in range(6):
        for k in range(6):  # row i of J' M_A
            total = 0.0
            for n in range(6):
                total += J[6 * n + i] * c[o + _MASS + 6 * n + k]
            J[36 + k] = total
        row = rows[dof0 + i]
        for j in range(i + 1):
            total = 0.0
            for n in range(6):
                total += J[36 + n] * J[6 * n + j]
            M[row + j] += share * total


@njit(cache=True, error_model="numpy")
def _part(kind, c, o, body, water, time, xpos, xmat, cvel, drive, com, cdof, parent, dof, qfrc):
    """Forces of a fin, propeller or thruster, from the local velocity at its origin.

    `drive` is a shaft's rate [rad/s], or a thruster's command.
    """
    R = 9 * body
    x0, x1, x2 = xpos[3 * body], xpos[3 * body + 1], xpos[3 * body + 2]
    a0, a1, a2 = x0 - com[0], x1 - com[1], x2 - com[2]
    o0, o1, o2 = cvel[6 * body], cvel[6 * body + 1], cvel[6 * body + 2]
    slot = int(c[o + SLOT])
    c0, c1, c2 = _water_at(water, slot, time, x0, x1, x2)
    u0 = cvel[6 * body + 3] + o1 * a2 - o2 * a1 - c0
    u1 = cvel[6 * body + 4] + o2 * a0 - o0 * a2 - c1
    u2 = cvel[6 * body + 5] + o0 * a1 - o1 * a0 - c2
    ahead = xmat[R] * u0 + xmat[R + 3] * u1 + xmat[R + 6] * u2
    if kind == FIN_KIND:
        across = xmat[R + 1] * u0 + xmat[R + 4] * u1 + xmat[R + 7] * u2
        chord, normal = fin_force(c, o, ahead, across)
        share = share_under(water, slot, time, x0, x1, x2, 0.5 * math.sqrt(c[o + _AREA]))
        chord, normal = share * chord, share * normal
        F0 = xmat[R] * chord + xmat[R + 1] * normal
        F1 = xmat[R + 3] * chord + xmat[R + 4] * normal
        F2 = xmat[R + 6] * chord + xmat[R + 7] * normal
        _apply(qfrc, cdof, parent, dof, F0, F1, F2, a1 * F2 - a2 * F1, a2 * F0 - a0 * F2, a0 * F1 - a1 * F0)
        return
    if kind == THRUSTER_KIND:
        across2 = max(u0 * u0 + u1 * u1 + u2 * u2 - ahead * ahead, 0.0)
        thrust = thruster_force(c, o, ahead, across2, drive)
        thrust *= share_under(water, slot, time, x0, x1, x2, 0.5 * c[o + _SIZE])
        F0, F1, F2 = xmat[R] * thrust, xmat[R + 3] * thrust, xmat[R + 6] * thrust
        torque = -c[o + _REACTION] * thrust
        T0, T1, T2 = a1 * F2 - a2 * F1, a2 * F0 - a0 * F2, a0 * F1 - a1 * F0
        T0, T1, T2 = T0 + xmat[R] * torque, T1 + xmat[R + 3] * torque, T2 + xmat[R + 6] * torque
        _apply(qfrc, cdof, parent, dof, F0, F1, F2, T0, T1, T2)
        return
    n = drive / (2.0 * math.pi)
    thrust, torque = propeller_force(c, o, ahead, n)
    share = share_under(water, slot, time, x0, x1, x2, 0.5 * c[o + _DIAMETER])
    thrust, torque = share * thrust, share * torque
    F0, F1, F2 = xmat[R] * thrust, xmat[R + 3] * thrust, xmat[R + 6] * thrust
    T0, T1, T2 = a1 * F2 - a2 * F1, a2 * F0 - a0 * F2, a0 * F1 - a1 * F0
    qfrc[dof] += torque + shaft_brake(c, o, ahead, n)
    # The hull feels the torque less what the tail recovers from the swirl.
    torque *= 1.0 - c[o + _SWIRL]
    T0, T1, T2 = T0 + xmat[R] * torque, T1 + xmat[R + 3] * torque, T2 + xmat[R + 6] * torque
    _apply(qfrc, cdof, parent, parent[dof], F0, F1, F2, T0, T1, T2)


@njit(cache=True, error_model="numpy")
def _adds_along_all(c, o):
    """Whether a hull's added mass shows in the first element of M, which without it is the mass of its tree."""
    return min(c[o + _MASS], c[o + _MASS + 7], c[o + _MASS + 14]) > 1e-6 * c[o + DENSITY] * c[o + _VOLUME]


_make_M = types.ExternalFunction("mj_makeM", types.void(types.intp, types.intp))
_factor_M = types.ExternalFunction("mj_factorM", types.void(types.intp, types.intp))
_project = types.ExternalFunction("mj_projectConstraint", types.void(types.intp, types.intp))


def _build(model_at: dict[str, int], data_at: dict[str, int], gravity_at: int) -> Any:
    """Compiles the callback; the offsets are closure constants, so that a change of them is a new cache entry."""
    m_nbody, m_nuser, m_user = model_at["nbody"], model_at["nuser_body"], model_at["body_user"]
    m_weld, m_dofadr, m_dofnum = model_at["body_weldid"], model_at["body_dofadr"], model_at["body_dofnum"]
    m_root, m_parent, m_rows = model_at["body_rootid"], model_at["dof_parentid"], model_at["M_rowadr"]
    d_time, d_userdata, d_xpos, d_xmat = data_at["time"], data_at["userdata"], data_at["xpos"], data_at["xmat"]
    d_cvel, d_com, d_cdof = data_at["cvel"], data_at["subtree_com"], data_at["cdof"]
    d_qfrc, d_M, d_qvel = data_at["qfrc_passive"], data_at["M"], data_at["qvel"]
    d_act, d_ctrl, d_crb = data_at["act"], data_at["ctrl"], data_at["crb"]

    @cfunc(types.void(types.intp, types.intp), cache=True, error_model="numpy")
    def passive(m, d):
        nuser = load_pointer(m + m_nuser)
        if nuser == 0:
            return
        nbody = load_pointer(m + m_nbody)
        c = numbers(load_pointer(m + m_user))
        weld, dofadr = integers(load_pointer(m + m_weld)), integers(load_pointer(m + m_dofadr))
        dofnum, root = integers(load_pointer(m + m_dofnum)), integers(load_pointer(m + m_root))
        parent, rows = integers(load_pointer(m + m_parent)), integers(load_pointer(m + m_rows))
        time = numbers(d + d_time)[0]
        water, xpos = numbers(load_pointer(d + d_userdata)), numbers(load_pointer(d + d_xpos))
        xmat, cvel = numbers(load_pointer(d + d_xmat)), numbers(load_pointer(d + d_cvel))
        coms, cdof = load_pointer(d + d_com), numbers(load_pointer(d + d_cdof))
        qfrc, M = numbers(load_pointer(d + d_qfrc)), numbers(load_pointer(d + d_M))
        qvel = numbers(load_pointer(d + d_qvel))
        crb = numbers(load_pointer(d + d_crb))
        act, control = numbers(load_pointer(d + d_act)), numbers(load_pointer(d + d_ctrl))
        J = _scratch()
        touched = False
        for body in range(1, nbody):
            o = nuser * body
            kind = int(c[o])
            if kind == 0:
                continue
            base = weld[body]
            com = numbers(coms + 24 * root[body])
            if kind == HULL_KIND:
                at = dofadr[base]
                if not touched:
                    # Rebuilt, if need be, so that entering twice (mj_forwardSkip, mjd_transitionFD) adds nothing twice.
                    if not (_adds_along_all(c, o) and M[rows[at]] == crb[10 * base + 9]):
                        _make_M(m, d)
                    touched = True
                gravity = numbers(m + gravity_at)
                _hull(c, o, body, water, time, gravity, xpos, xmat, cvel, com, cdof, parent, at, qfrc, M, rows, J)
            elif kind in (FIN_KIND, PROPELLER_KIND):
                dof = dofadr[base] + dofnum[base] - 1
                _part(kind, c, o, body, water, time, xpos, xmat, cvel, qvel[dof], com, cdof, parent, dof, qfrc)
            elif kind == THRUSTER_KIND:
                dof = dofadr[base] + dofnum[base] - 1
                at = int(c[o + CHANNEL])
                command = act[at] if at >= 0 else control[-1 - at]
                _part(kind, c, o, body, water, time, xpos, xmat, cvel, command, com, cdof, parent, dof, qfrc)
        if touched:
            _factor_M(m, d)
            _project(m, d)

    return passive


_callback: Any = None


def _library() -> ctypes.CDLL:
    """MuJoCo's shared library, already loaded by the `mujoco` package."""
    folder = Path(str(mujoco.__file__)).parent
    for pattern in ("libmujoco.so.*", "libmujoco*.dylib", "mujoco.dll"):
        for path in folder.glob(pattern):
            return ctypes.CDLL(os.fspath(path))
    raise OSError(f"no MuJoCo library in {folder}")


INSIDE = ("forces.py", "pointers.py", "submergence.py", "water_slot.py")  # whose code is in the callback's


def _cached_code() -> list[Path]:
    """The index files of numba's cache for this module that are up to date; the others are deleted.

    Numba watches the file of the function that it keeps, but this module's code has that of others inside.
    """
    try:
        folder = Path(FunctionCache(_build).cache_path)
    except RuntimeError:  # numba finds no folder that it may write to
        return []
    written = max(Path(__file__).with_name(name).stat().st_mtime for name in INSIDE)
    current = []
    for index in folder.glob("fluid.*.nbi"):
        if index.stat().st_mtime < written:
            index.unlink(missing_ok=True)
        else:
            current.append(index)
    return current


def is_warm() -> bool:
    """Whether `install` needs no compilation: it ran before, in this process or, through numba's cache, in another."""
    return _callback is not None or any(index.name.startswith("fluid._build") for index in _cached_code())


def install() -> None:
    """Compiles (6 s once, then from the cache) and installs the callback for all models of this process.

    A model without coefficient records is untouched by it.

    Raises:
        AuvsimError: MuJoCo's memory layout is not what its introspection says.
    """
    global _callback
    if _callback is None:
        _cached_code()
        mujoco_structs.verify()
        library = _library()
        for name in ("mj_makeM", "mj_factorM", "mj_projectConstraint"):
            address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
            llvmlite.binding.add_symbol(name, address)
        gravity_at = mujoco_structs.offsets("mjModel")["opt"] + mujoco_structs.offsets("mjOption")["gravity"]
        _callback = _build(mujoco_structs.offsets("mjModel"), mujoco_structs.offsets("mjData"), gravity_at)
    mujoco.set_mjcb_passive(_callback.ctypes)
