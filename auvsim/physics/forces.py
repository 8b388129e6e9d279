"""Forces of hull, fin, propeller and thruster as compiled functions of the velocity relative to the water.

All vectors here are in the element's own MuJoCo axes (x forward, y port, z up); `hydrodynamics` converts the SNAME
coefficients once. A coefficient record `c` starts at `o`; its layout is `HULL`, `FIN`, `PROPELLER` and `THRUSTER`
below, so that the same code serves a NumPy array and a row of `mjModel.body_user`.
"""

import math

from numba import njit

STRIPS = 16  # the most cross-flow strips a hull may have

# Offsets of the coefficient records behind the common head [kind, water slot, water density].
KIND, SLOT, DENSITY, HEAD = 0, 1, 2, 3
HULL_KIND, FIN_KIND, PROPELLER_KIND, THRUSTER_KIND = 1, 2, 3, 4

HULL = {"added_mass": (HEAD, 36), "linear_damping": (HEAD + 36, 36), "quadratic_damping": (HEAD + 72, 36)}
HULL |= {"displaced_volume": (HEAD + 108, 1), "body_lift": (HEAD + 109, 1), "body_lift_x": (HEAD + 110, 1)}
HULL |= {
    "cross_flow_drag": (HEAD + 111, 1),
    "strip_x": (HEAD + 112, STRIPS),
    "strip_area": (HEAD + 112 + STRIPS, STRIPS),
    "body_induced_drag": (HEAD + 112 + 2 * STRIPS, 1),
}
# Of the strips, for the surface; worked out by `hydrodynamics`, not given. Their centre is the origin. Deeper than
# `reach` a hull is all under water.
DERIVED = {"strip_volume": (HEAD + 113 + 2 * STRIPS, STRIPS), "strip_radius": (HEAD + 113 + 3 * STRIPS, STRIPS)}
DERIVED |= {"strip_half_length": (HEAD + 113 + 4 * STRIPS, STRIPS), "reach": (HEAD + 113 + 5 * STRIPS, 1)}
FIN = {"area": (HEAD, 1), "lift_slope": (HEAD + 1, 1), "stall_angle": (HEAD + 2, 1), "drag": (HEAD + 3, 1)}
FIN |= {"induced_drag": (HEAD + 4, 1), "normal_drag": (HEAD + 5, 1), "astern_lift": (HEAD + 6, 1)}
PROPELLER = {"diameter": (HEAD, 1), "thrust_coefficients": (HEAD + 1, 2), "torque_coefficients": (HEAD + 3, 2)}
PROPELLER |= {"wake_fraction": (HEAD + 5, 1), "thrust_deduction": (HEAD + 6, 1), "swirl_recovery": (HEAD + 7, 1)}
PROPELLER |= {"astern_loss": (HEAD + 8, 1), "locked_drag": (HEAD + 9, 1)}
PROPELLER |= {"torque_limit": (HEAD + 10, 1), "power_limit": (HEAD + 11, 1)}
THRUSTER = {"thrust": (HEAD, 2), "size": (HEAD + 2, 1), "dead_band": (HEAD + 3, 1), "free_speed": (HEAD + 4, 2)}
THRUSTER |= {"cross_flow_loss": (HEAD + 6, 1), "reaction": (HEAD + 7, 1)}
CHANNEL = HEAD + 8  # of a thruster's record: its command in `mjData.act`, or -1 - its command in `mjData.ctrl`
BRAKE = HEAD + 12  # of a propeller's record: what holds its shaft at its limits [N m s], worked out by `hydrodynamics`
RECORD = HEAD + 114 + 5 * STRIPS  # numbers a body needs: its `nuser_body`

_MASS, _LIFT, _LIFT_X = HULL["added_mass"][0], HULL["body_lift"][0], HULL["body_lift_x"][0]
_CROSS_FLOW, _STRIP_X, _STRIP_AREA = HULL["cross_flow_drag"][0], HULL["strip_x"][0], HULL["strip_area"][0]
_LINEAR, _QUADRATIC = HULL["linear_damping"][0], HULL["quadratic_damping"][0]
_AREA, _SLOPE, _STALL = FIN["area"][0], FIN["lift_slope"][0], FIN["stall_angle"][0]
_DRAG, _INDUCED = FIN["drag"][0], FIN["induced_drag"][0]
_NORMAL, _ASTERN = FIN["normal_drag"][0], FIN["astern_lift"][0]
_DIAMETER, _THRUST = PROPELLER["diameter"][0], PROPELLER["thrust_coefficients"][0]
_TORQUE, _WAKE = PROPELLER["torque_coefficients"][0], PROPELLER["wake_fraction"][0]
_DEDUCTION, _ASTERN_LOSS = PROPELLER["thrust_deduction"][0], PROPELLER["astern_loss"][0]
_LOCKED, _LIMIT, _POWER = PROPELLER["locked_drag"][0], PROPELLER["torque_limit"][0], PROPELLER["power_limit"][0]
_FULL, _DEAD, _FREE = THRUSTER["thrust"][0], THRUSTER["dead_band"][0], THRUSTER["free_speed"][0]
_CROSS_LOSS = THRUSTER["cross_flow_loss"][0]
_BODY_INDUCED = HULL["body_induced_drag"][0]

_inline = njit(cache=True, inline="never", error_model="numpy", fastmath=False)


@_inline
def added_momentum(c, o, i, v0, v1, v2, w0, w1, w2):
    """Row i of `M_A nu`, [kg m/s] or [kg m2/s]."""
    a = o + _MASS + 6 * i
    return c[a] * v0 + c[a + 1] * v1 + c[a + 2] * v2 + c[a + 3] * w0 + c[a + 4] * w1 + c[a + 5] * w2


@_inline
def _damped(c, o, i, v0, v1, v2, w0, w1, w2):
    """Row i of `D nu`; with the products |nu_j| nu_j in place of nu_j, of the quadratic damping."""
    a = o + 6 * i
    return c[a] * v0 + c[a + 1] * v1 + c[a + 2] * v2 + c[a + 3] * w0 + c[a + 4] * w1 + c[a + 5] * w2


@_inline
def hull_force(c, o, v0, v1, v2, w0, w1, w2, g1, g2):
    """Velocity-dependent force and moment of a hull about its origin, without the inertial `-M_A dnu/dt`.

    Coriolis of the added mass (Fossen 2021, eq. 6.44, Kirchhoff), linear and quadratic damping, cross-flow drag by
    strips (Faltinsen 1990, sec. 6; both transverse velocities share one resultant), and body lift of a slender hull
    with a separating tail, which changes ends when the flow does.

    Args:
        c: coefficients, with the record at `o`.
        v0, v1, v2: velocity of the origin relative to the water [m/s].
        w0, w1, w2: angular velocity [rad/s].
        g1, g2: change of the water's y and z velocity per metre along x [1/s].

    Returns:
        Force (3) [N] and moment (3) [N m] as six numbers.
    """
    p0 = added_momentum(c, o, 0, v0, v1, v2, w0, w1, w2)
    p1 = added_momentum(c, o, 1, v0, v1, v2, w0, w1, w2)
    p2 = added_momentum(c, o, 2, v0, v1, v2, w0, w1, w2)
    h0 = added_momentum(c, o, 3, v0, v1, v2, w0, w1, w2)
    h1 = added_momentum(c, o, 4, v0, v1, v2, w0, w1, w2)
    h2 = added_momentum(c, o, 5, v0, v1, v2, w0, w1, w2)
    # -C_A nu = -[omega x p; omega x h + v x p]: the cross product v x p is the Munk moment.
    f0 = p1 * w2 - p2 * w1
    f1 = p2 * w0 - p0 * w2
    f2 = p0 * w1 - p1 * w0
    m0 = h1 * w2 - h2 * w1 + p1 * v2 - p2 * v1
    m1 = h2 * w0 - h0 * w2 + p2 * v0 - p0 * v2
    m2 = h0 * w1 - h1 * w0 + p0 * v1 - p1 * v0

    a, b = o + _LINEAR, o + _QUADRATIC
    q0, q1, q2 = abs(v0) * v0, abs(v1) * v1, abs(v2) * v2
    s0, s1, s2 = abs(w0) * w0, abs(w1) * w1, abs(w2) * w2
    f0 -= _damped(c, a, 0, v0, v1, v2, w0, w1, w2) + _damped(c, b, 0, q0, q1, q2, s0, s1, s2)
    f1 -= _damped(c, a, 1, v0, v1, v2, w0, w1, w2) + _damped(c, b, 1, q0, q1, q2, s0, s1, s2)
    f2 -= _damped(c, a, 2, v0, v1, v2, w0, w1, w2) + _damped(c, b, 2, q0, q1, q2, s0, s1, s2)
    m0 -= _damped(c, a, 3, v0, v1, v2, w0, w1, w2) + _damped(c, b, 3, q0, q1, q2, s0, s1, s2)
    m1 -= _damped(c, a, 4, v0, v1, v2, w0, w1, w2) + _damped(c, b, 4, q0, q1, q2, s0, s1, s2)
    m2 -= _damped(c, a, 5, v0, v1, v2, w0, w1, w2) + _damped(c, b, 5, q0, q1, q2, s0, s1, s2)

    k = 0.5 * c[o + DENSITY] * c[o + _CROSS_FLOW]
    if k > 0.0:
        r1, r2 = w2 - g1, -w1 - g2  # transverse velocity per metre along x
        for i in range(STRIPS):
            area = c[o + _STRIP_AREA + i]
            if area == 0.0:
                break
            x = c[o + _STRIP_X + i]
            y, z = v1 + x * r1, v2 + x * r2
            d = k * area * math.sqrt(y * y + z * z)
            f1 -= d * y
            f2 -= d * z
            m1 += x * d * z
            m2 -= x * d * y

    lift = c[o + _LIFT]
    y, z = -lift * abs(v0) * v1, -lift * abs(v0) * v2
    if c[o + _BODY_INDUCED] > 0.0:
        # Prandtl's D = L^2 / (rho U^2 / 2 pi e b^2), against the motion.
        speed2 = v0 * v0 + v1 * v1 + v2 * v2
        if speed2 > 1e-12:
            d = c[o + _BODY_INDUCED] * (y * y + z * z) / (0.5 * c[o + DENSITY] * speed2 * math.sqrt(speed2))
            f0, f1, f2 = f0 - d * v0, f1 - d * v1, f2 - d * v2
    x = math.copysign(c[o + _LIFT_X], v0 * c[o + _LIFT_X])
    return f0, f1 + y, f2 + z, m0, m1 - x * z, m2 + x * y


@_inline
def fin_force(c, o, v0, v1):
    """Lift and drag of a fin in the plane across its span, at its hinge axis.

    Attached flow: `C_L = slope sin(alpha) cos(alpha)`, parasitic and induced drag; separated flow: a flat plate's
    normal force; blended smoothly over +-5 degrees round the stall angle (Beard & McLain 2012, eq. 4.9). The same
    holds for flow from astern, with a reduced slope (the sharp edge leads).

    Args:
        c: coefficients, with the record at `o`.
        v0, v1: the fin's velocity relative to the water along its chord (forward) and its normal [m/s].

    Returns:
        Force along chord and normal [N].
    """
    speed2 = v0 * v0 + v1 * v1
    if speed2 < 1e-12:
        return 0.0, 0.0
    speed = math.sqrt(speed2)
    ca, sa = v0 / speed, v1 / speed
    slope = c[o + _SLOPE] if v0 >= 0.0 else c[o + _SLOPE] * c[o + _ASTERN]
    cl = slope * sa * abs(ca)
    attached_drag = c[o + _DRAG] + c[o + _INDUCED] * cl * cl
    margin = (math.asin(min(1.0, abs(sa))) - c[o + _STALL]) / 0.0873
    separated = 0.0 if margin <= -1.0 else 1.0 if margin >= 1.0 else 0.25 * (margin + 1.0) ** 2 * (2.0 - margin)
    plate = c[o + _NORMAL] * sa
    cl = (1.0 - separated) * cl + separated * plate * abs(ca)
    cd = (1.0 - separated) * attached_drag + separated * (c[o + _DRAG] + plate * sa)
    q = 0.5 * c[o + DENSITY] * c[o + _AREA] * speed2
    # Lift is across the flow and opposes the normal velocity, drag is against the motion.
    lift0 = cl * sa if v0 >= 0.0 else -cl * sa
    return q * (lift0 - cd * ca), q * (-cl * abs(ca) - cd * sa)


@_inline
def propeller_force(c, o, v0, n):
    """Thrust on the vehicle and torque on the shaft of an open propeller.

    `K_T` and `K_Q` are linear in the advance number J = (1 - w) v0 / (n D) (Fossen 2021, eq. 9.8); where the water
    meets the propeller from the other side (J < 0) they keep their bollard value. Turning astern, both lose the share
    `astern_loss`. A shaft that turns slower than that of no thrust, J_0 = -K_T0 / (dK_T/dJ), or stands, drags:
    `locked_drag` on the disc's area, times (1 - J_0 / |J|)^2.

    Args:
        c: coefficients, with the record at `o`.
        v0: speed of the propeller ahead relative to the water [m/s].
        n: revolutions per second, positive ahead [1/s].

    Returns:
        Thrust ahead, after thrust deduction [N], and torque that the water puts on the shaft [N m].
    """
    d = c[o + _DIAMETER]
    advance = (1.0 - c[o + _WAKE]) * v0 / d if v0 * n > 0.0 else 0.0
    scale = c[o + DENSITY] * d * d * d * d * abs(n)
    if n < 0.0:
        scale *= 1.0 - c[o + _ASTERN_LOSS]
    thrust = scale * (c[o + _THRUST] * n + c[o + _THRUST + 1] * advance)
    torque = scale * d * (c[o + _TORQUE] * n + c[o + _TORQUE + 1] * advance)
    thrust *= 1.0 - c[o + _DEDUCTION]
    if c[o + _LOCKED] > 0.0:
        inflow = (1.0 - c[o + _WAKE]) * v0
        driven = abs(c[o + _THRUST] * n * d) - abs(c[o + _THRUST + 1] * inflow)  # over that of no thrust
        if driven < 0.0:
            part = driven / (c[o + _THRUST + 1] * inflow)
            thrust -= 0.125 * math.pi * d * d * c[o + DENSITY] * c[o + _LOCKED] * part * part * abs(inflow) * inflow
    return thrust, -torque


@_inline
def shaft_brake(c, o, v0, n):
    """Torque [N m] that holds a shaft at the rate at which the water's torque reaches the motor's limit.

    A velocity servo drives the shaft through a made-up inertia that gives its lag; what the motor lacks is taken off
    here, the faster the shaft is beyond its limit. The limit is the smaller of `torque_limit` and `power_limit` over
    the present rate.

    Args:
        c: coefficients, with the record at `o`.
        v0: speed of the propeller ahead relative to the water [m/s].
        n: revolutions per second [1/s].
    """
    limit = c[o + _LIMIT] if c[o + _LIMIT] > 0.0 else math.inf
    if c[o + _POWER] > 0.0 and n != 0.0:
        limit = min(limit, c[o + _POWER] / (2.0 * math.pi * abs(n)))
    if math.isinf(limit):
        return 0.0
    d = c[o + _DIAMETER]
    scale = c[o + DENSITY] * d * d * d * d * d * (1.0 - c[o + _ASTERN_LOSS] if n < 0.0 else 1.0)
    slope = c[o + _TORQUE + 1] * (1.0 - c[o + _WAKE]) * abs(v0) / d if v0 * n > 0.0 else 0.0
    # K_Q0 n^2 + slope n = limit / scale
    most = (math.sqrt(slope * slope + 4.0 * c[o + _TORQUE] * limit / scale) - slope) / (2.0 * c[o + _TORQUE])
    return -c[o + BRAKE] * 2.0 * math.pi * math.copysign(max(abs(n) - most, 0.0), n)


@_inline
def thruster_force(c, o, v0, across, command):
    """Thrust of a thruster along its axis [N].

    Beyond the dead band the rate of the screw follows the command, and the thrust its square. Inflow along the thrust
    takes the share (v / v_0) / rate, v_0 being the speed of no thrust at full rate (Fossen 2021, eq. 9.9: bilinear in
    rate and inflow); inflow against it takes nothing. Flow across a tunnel takes the share 1 - exp(-c v^2) (Palmer,
    Hearn & Stevenson 2008, Modelling tunnel thrusters for autonomous underwater vehicles).

    Args:
        c: coefficients, with the record at `o`.
        v0: speed of the thruster along its axis relative to the water [m/s].
        across: square of its speed across the axis [m2/s2].
        command: -1 to 1; beyond, it is limited.
    """
    dead = c[o + _DEAD]
    size = min(abs(command), 1.0)
    if size <= dead:
        return 0.0
    rate = (size - dead) / (1.0 - dead)
    way = 0 if command > 0.0 else 1
    inflow = v0 if command > 0.0 else -v0
    free = c[o + _FREE + way]
    pull = rate * rate - (rate * inflow / free if free > 0.0 and inflow > 0.0 else 0.0)
    thrust = c[o + _FULL + way] * pull * math.exp(-c[o + _CROSS_LOSS] * across)
    return thrust if command > 0.0 else -thrust
