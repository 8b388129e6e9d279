"""A cargo ship by Abkowitz' polynomial, made for the tests: no ship of the package, no structure that is fitted.

The Mariner class at a length of 5 m by its third-order polynomial about the service speed (Chislett and Stroem-Tejsen,
HyA report Hy-6, 1965, with the coefficients of Fossen 1994). To it come thrust by a parabola of shaft speed and
advance, and a rudder whose force goes with the stream that the propeller leaves. Each seed is another ship: all
coefficients are drawn within 15 %.
Only NumPy. Yaw rate and heading clockwise, sway to starboard; a positive rudder turns to starboard.
"""

import math

import numpy as np
from tanker import Ship

LENGTH, RHO, RHO_AIR = 5.0, 1000.0, 1.2
SPEED, SHAFT = 1.36, 60.0  # service speed [m/s, rad/s]: Froude's, of 15 kn at 160.93 m
MASS, I_Z, X_G = 798e-5, 39.2e-5, -0.023
XUD, YVD, YRD, NVD, NRD = -42e-5, -748e-5, -9.354e-5, 4.646e-5, -43.8e-5
X = {"u": -184, "uu": -110, "uuu": -215, "vv": -899, "rr": 18, "dd": -95, "udd": -190, "rv": 798, "vd": -93,
    "uvd": -93,
}  # fmt: skip
Y = {
    "v": -1160, "r": -499, "vvv": -8078, "vvr": 15356, "vu": -1160, "ru": -499, "d": -278, "ddd": 90, "ud": -556,
    "uud": -278, "vdd": -4, "vvd": -1190,
}  # fmt: skip
N = {
    "v": -264, "r": -166, "vvv": 1636, "vvr": -5483, "vu": -264, "ru": -166, "d": 139, "ddd": -45, "ud": 278,
    "uud": 139, "vdd": 13, "vvd": 489,
}  # fmt: skip


def ship(seed: int, yaw_damping: float = 1.0) -> Ship:
    """Another ship for each seed; with a yaw damping of 0.6 it is unstable on its course."""
    generator = np.random.default_rng([seed, 77])
    x, y, n = ({key: 1e-5 * value * generator.uniform(0.85, 1.15) for key, value in axis.items()} for axis in (X, Y, N))
    n["r"] *= yaw_damping
    n["ru"] *= yaw_damping
    stream = generator.uniform(0.4, 0.7)  # share of the rudder's force by the propeller's stream, not by the speed
    M = np.array([[MASS - YVD, MASS * X_G - YRD], [MASS * X_G - NVD, I_Z - NRD]])
    drag = 340e-5  # of the hull at the service speed, which the thrust there meets

    def slope(state: np.ndarray, rudder: float, shaft: float, wind: np.ndarray, push: np.ndarray) -> np.ndarray:
        psi, u, v, r = state[2:]
        U = max(math.hypot(u, v), 0.05)
        du, vp, rp = (u - SPEED) / U, v / U, r * LENGTH / U
        turns = shaft / SHAFT
        d = rudder * ((1.0 - stream) + stream * (turns * SPEED / U) ** 2)
        XH = (
            x["uu"] * du**2 + x["uuu"] * du**3 + x["u"] * du + x["vv"] * vp**2 + x["rr"] * rp**2 + x["rv"] * rp * vp
            + x["dd"] * d**2 + x["udd"] * du * d**2 + (x["vd"] + x["uvd"] * du) * vp * d
        )  # fmt: skip
        XP = drag * ((1.9 * turns**2 - 0.9 * turns * u / SPEED) * (SPEED / U) ** 2 - 1.0)
        lateral = []
        for c in (y, n):
            lateral.append(
                c["v"] * vp + c["r"] * rp + c["vvv"] * vp**3 + c["vvr"] * vp**2 * rp + c["vu"] * vp * du
                + c["ru"] * rp * du + c["d"] * d + c["ddd"] * d**3 + (c["ud"] * du + c["uud"] * du**2) * d
                + c["vdd"] * vp * d**2 + c["vvd"] * vp**2 * d
            )  # fmt: skip
        cosine, sine = math.cos(psi), math.sin(psi)
        a, b = cosine * wind[0] + sine * wind[1] - u, -sine * wind[0] + cosine * wind[1] - v
        unit = 0.5 * RHO * LENGTH**2 * U**2
        if wind.any():
            air = 0.5 * RHO_AIR * math.hypot(a, b) / unit
            XH += air * 0.5 * 0.6 * a
            lateral[0] += air * 1.8 * 0.9 * b
            lateral[1] += 0.5 * RHO_AIR * 1.8 * 0.1 * a * b / unit
        ahead = (XH + XP) * U**2 / LENGTH / (MASS - XUD)
        sway, yaw = np.linalg.solve(M, lateral)
        return np.array(
            [cosine * u - sine * v, sine * u + cosine * v, r, ahead + push[0], sway * U**2 / LENGTH + push[1],
             yaw * U**2 / LENGTH**2 + push[2]]
        )  # fmt: skip

    return Ship(slope, SPEED, SHAFT)
