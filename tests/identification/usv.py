"""A small surface vehicle with two screws and no rudder, made for the tests: none of the package's equations.

A catamaran of 2 m and 55 kg: linear and quadratic drag, Munk's moment, thrust of each screw by a parabola of its speed
and advance, larger ahead than astern. Each seed is another vehicle: all coefficients are drawn within 15 %.
Only NumPy. Yaw rate and heading clockwise, sway to starboard; a faster port screw turns to starboard.
"""

import math

import numpy as np
from tanker import FINE, KINDS, Run, Sea, _logged, _order, _slow

SPEED, SHAFT = 1.3, 80.0  # of the approach [m/s, rad/s]
BOW, BOW_ARM, BOW_SHAFT = 2.5e-4, 0.8, 100.0  # thrust of a side thruster [N/(rad/s)^2], ahead [m], its speed [rad/s]
SHARE = 0.45  # of the shaft's mean by which 25 deg of a tanker's rudder part the two screws


def parameters(seed: int) -> dict[str, float]:
    """Masses, drag and thrust."""
    generator = np.random.default_rng([seed, 78])
    usual = {
        "m_u": 60.0, "m_v": 90.0, "I": 42.0, "X_u": 12.0, "X_uu": 17.0, "Y_v": 60.0, "Y_vv": 110.0, "Y_r": 4.0,
        "N_r": 30.0, "N_rr": 25.0, "N_v": 6.0, "N_vr": 15.0, "T": 6.2e-3, "T_u": 0.085, "arm": 0.39,
    }  # fmt: skip
    return {name: value * float(generator.uniform(0.85, 1.15)) for name, value in usual.items()}


def slope(p: dict[str, float], x: np.ndarray, port: float, starboard: float, push: np.ndarray) -> np.ndarray:
    """Time derivative (6,) of north, east, heading, u, v, r."""
    psi, u, v, r = x[2:]
    thrusts = [
        p["T"] * n * abs(n) * (1.0 if n > 0.0 else 0.7) - p["T_u"] * abs(n) * u for n in (port, starboard)
    ]  # fmt: skip
    X = sum(thrusts) - p["X_u"] * u - p["X_uu"] * u * abs(u) + p["m_v"] * v * r
    Y = -p["Y_v"] * v - p["Y_vv"] * v * abs(v) - p["Y_r"] * r - p["m_u"] * u * r
    N = p["arm"] * (thrusts[0] - thrusts[1]) - p["N_r"] * r - p["N_rr"] * r * abs(r) - p["N_v"] * v
    N += (p["m_u"] - p["m_v"]) * u * v - p["N_vr"] * abs(v) * r
    cosine, sine = math.cos(psi), math.sin(psi)
    return np.array(
        [cosine * u - sine * v, sine * u + cosine * v, r, X / p["m_u"] + push[0], Y / p["m_v"] + push[1],
         N / p["I"] + push[2]]
    )  # fmt: skip


def sail(kind: str, seed: int, sea: Sea, duration: float = 240.0, step: float = 0.2, *, bow: bool = False) -> Run:
    """Sails a tanker's manoeuvre with the screws' difference for the rudder; its log has two shafts and no rudder.

    With `bow` a side thruster pushes for some of every 12 s, to port or starboard, and is logged.
    """
    generator = np.random.default_rng([seed, KINDS.index(kind), 3])
    p = parameters(seed)
    tables = {
        "shaft": generator.uniform(0.7, 1.15, 8), "turn": generator.choice([-1, 1]) * np.array([15, -15, 30, -30, 20]),
        "f": np.linspace(0.01, 0.1, 8), "phase": generator.uniform(0, 2 * math.pi, 8),
        "steps": generator.uniform(-25.0, 25.0, 40),
    }  # fmt: skip
    count = round(duration / FINE) + 1
    push = np.column_stack([_slow(generator, count, FINE, sea.disturbance * f, 8.0) for f in (1, 1, 1)])
    x, state = np.array([0.0, 0.0, generator.uniform(-math.pi, math.pi), SPEED, 0.0, 0.0]), {}
    states, shafts = np.empty((count, 6)), np.empty((count, 2))
    screws = np.array([SHAFT, SHAFT])
    orders = bow * np.random.default_rng([seed, KINDS.index(kind), 4]).choice([-1.0, -0.6, 0.0, 0.0, 0.7, 1.0], 60)
    aside = BOW_SHAFT * np.repeat(orders, round(12.0 / FINE))[:count]  # [rad/s]
    push = push + np.outer(BOW * aside * np.abs(aside), [0.0, 1.0 / p["m_v"], BOW_ARM / p["I"]])
    for k in range(count):
        rudder, mean = _order(kind, k * FINE, state, x, tables)
        apart = SHARE * rudder / math.radians(25.0)
        wanted = SHAFT * mean * np.array([1.0 + apart, 1.0 - apart])
        screws = screws + (wanted - screws) * FINE / 0.3
        states[k], shafts[k] = x, screws
        middle = x + 0.5 * FINE * slope(p, x, *screws, push[k])
        x = x + FINE * slope(p, middle, *screws, push[k])
    run = _logged(kind, states, np.zeros((count, 2)), np.zeros((count, 2)), sea, generator, round(step / FINE))
    log = {name: values for name, values in run.log.items() if name not in ("rudder [deg]", "n [rpm]")}
    rows = slice(None, None, round(step / FINE))
    for name, column in zip(("port", "starboard"), shafts.T, strict=True):
        log[f"n_{name} [rpm]"] = column[rows] * 30.0 / math.pi
    if bow:
        log["bow_thruster [rpm]"] = aside[rows] * 30.0 / math.pi
    return run._replace(log=log)
