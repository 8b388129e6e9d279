"""A course-unstable tanker whose equations are none of the package's, and the faulty log that it leaves.

The KVLCC2 at a length of 7 m by the MMG standard method (Yasukawa and Yoshimura, J. Mar. Sci. Technol. 20, 2015): hull
forces with cubic terms, propeller by its open-water curve, rudder in the propeller's stream with other flow
straightening to port than to starboard. Its yaw damping is halved, so that it is clearly unstable on its course. Wind
by constant coefficients, and a slow disturbance of each acceleration.
Only NumPy. Yaw rate and heading clockwise, sway to starboard; a positive rudder turns to starboard.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

LENGTH, DRAUGHT, VOLUME, X_G, DIAMETER, RUDDER_AREA = 7.0, 0.46, 3.27, 0.25, 0.216, 0.0539
RHO, RHO_AIR = 1000.0, 1.2
SPEED, SHAFT = 1.179, 2.0 * math.pi * 10.4  # of the approach [m/s, rad/s]
LATERAL, FRONTAL = 3.0, 1.0  # windage [m2]
FINE = 0.05  # step of the truth [s]


class Sea(NamedTuple):
    """What moves the tanker besides itself, and what its log does to the truth."""

    wind: tuple[float, float] = (0.0, 0.0)  # towards north, east [m/s]
    gust: float = 0.0  # standard deviation of the slow disturbance of wind [m/s]
    disturbance: float = 0.0  # of surge and sway acceleration, slow [m/s^2]; of yaw by a lever of half the length
    lag: float = 0.5  # of velocities behind positions and heading [s]
    filtered: float = 0.5  # time constant of the filter on what is logged as velocity [s]
    noise: float = 1.0  # factor on the sensors' noise


class Ship(NamedTuple):
    """Equations of a ship, and how it goes."""

    slope: Callable[[np.ndarray, float, float, np.ndarray, np.ndarray], np.ndarray]  # see the tanker's
    speed: float  # of the approach [m/s]
    shaft: float  # at that [rad/s]


class Run(NamedTuple):
    """One manoeuvre: what happened and what was logged."""

    kind: str
    times: np.ndarray  # (n,) [s]
    truth: np.ndarray  # (n, 6) north, east, heading, u, v, r
    log: dict[str, np.ndarray]  # columns with their headers


def slope(x: np.ndarray, rudder: float, shaft: float, wind: np.ndarray, push: np.ndarray) -> np.ndarray:
    """Time derivative (6,) of north, east, heading, u, v (at midship), r."""
    psi, u, v, r = x[2:]
    speed = max(math.hypot(u, v), 0.05)
    vp, rp = v / speed, r * LENGTH / speed
    q = 0.5 * RHO * LENGTH * DRAUGHT * speed**2
    XH = q * (-0.022 * (u / speed) * abs(u / speed) - 0.040 * vp**2 + 0.002 * vp * rp + 0.011 * rp**2 + 0.771 * vp**4)
    YH = -0.315 * vp + 0.083 * rp - 1.607 * vp**3 + 0.379 * vp**2 * rp - 0.391 * vp * rp**2 + 0.008 * rp**3
    NH = -0.137 * vp - 0.025 * rp - 0.030 * vp**3 - 0.294 * vp**2 * rp + 0.055 * vp * rp**2 - 0.013 * rp**3
    YH, NH = q * YH, q * LENGTH * NH
    n = max(shaft, 1e-3) / (2.0 * math.pi)
    drift = math.atan2(-v, max(u, 1e-3))
    beta_p = drift - (-0.48) * rp
    wake = 0.35 * math.exp(-4.0 * beta_p**2)
    J = u * (1.0 - wake) / (n * DIAMETER)
    KT = 0.2931 - 0.2753 * J - 0.1385 * J**2
    XP = (1.0 - 0.220) * RHO * n**2 * DIAMETER**4 * KT
    beta_r = drift - (-0.710) * rp
    v_r = speed * (0.640 if beta_r > 0.0 else 0.395) * beta_r
    slip = math.sqrt(max(1.0 + 8.0 * KT / (math.pi * max(J, 0.05) ** 2), 0.0))
    u_r = 1.09 * u * (1.0 - wake) * math.sqrt(0.626 * (1.0 + 0.50 * (slip - 1.0)) ** 2 + 1.0 - 0.626)
    attack = rudder - math.atan2(v_r, u_r)
    FN = 0.5 * RHO * RUDDER_AREA * (u_r**2 + v_r**2) * 2.747 * math.sin(attack)
    XR = -(1.0 - 0.387) * FN * math.sin(rudder)
    YR = -(1.0 + 0.312) * FN * math.cos(rudder)
    NR = -(-0.5 + 0.312 * -0.464) * LENGTH * FN * math.cos(rudder)
    cosine, sine = math.cos(psi), math.sin(psi)
    a_u, a_v = cosine * wind[0] + sine * wind[1] - u, -sine * wind[0] + cosine * wind[1] - v
    a = math.hypot(a_u, a_v)
    XW = 0.5 * RHO_AIR * FRONTAL * 0.7 * a * a_u
    YW = 0.5 * RHO_AIR * LATERAL * 0.9 * a * a_v
    NW = 0.5 * RHO_AIR * LATERAL * LENGTH * 0.12 * a_u * a_v
    X, Y, N = XH + XP + XR + XW, YH + YR + YW, NH + NR + NW
    m, unit = RHO * VOLUME, 0.5 * RHO * LENGTH**2 * DRAUGHT
    mx, my = 0.022 * unit, 0.223 * unit
    Iz = m * (0.25 * LENGTH) ** 2 + m * X_G**2 + 0.011 * unit * LENGTH**2
    du = (X + (m + my) * v * r + X_G * m * r**2) / (m + mx)
    M = np.array([[m + my, X_G * m], [X_G * m, Iz]])
    dv, dr = np.linalg.solve(M, [Y - (m + mx) * u * r, N - X_G * m * u * r])
    return np.array([cosine * u - sine * v, sine * u + cosine * v, r, du + push[0], dv + push[1], dr + push[2]])


def _slow(generator: np.random.Generator, count: int, step: float, deviation: float, constant: float) -> np.ndarray:
    """A first-order Gauss-Markov process (count,)."""
    keep = math.exp(-step / constant)
    kicks = deviation * math.sqrt(1.0 - keep**2) * generator.standard_normal(count)
    values = np.empty(count)
    x = deviation * generator.standard_normal()
    for k in range(count):
        values[k] = x
        x = keep * x + kicks[k]
    return values


CALM = Sea()
KINDS = ("zigzag10", "zigzag20", "steps", "turns", "multisine", "steps slow")


TANKER = Ship(slope, SPEED, SHAFT)


def _order(kind: str, t: float, state: dict, x: np.ndarray, tables: Mapping[str, np.ndarray]) -> tuple[float, float]:
    """Rudder [rad], and shaft by that of the approach."""
    shaft = float(tables["shaft"][int(t // 40.0) % len(tables["shaft"])])
    if kind.startswith("zigzag"):
        angle = math.radians(float(kind[6:]))
        side = state.setdefault("side", 1.0)
        if side * (x[2] - state.setdefault("psi", x[2])) > angle:
            state["side"] = side = -side
        return side * angle, shaft
    if kind == "turns":
        return math.radians(float(tables["turn"][int(t // 75.0) % len(tables["turn"])])), shaft
    if kind == "multisine":
        wave = np.sin(2.0 * math.pi * tables["f"] * t + tables["phase"]).sum() / math.sqrt(len(tables["f"]))
        return math.radians(12.0) * float(np.clip(wave, -2.5, 2.5)), shaft
    hold = 25.0 if kind == "steps slow" else 12.0
    return math.radians(float(tables["steps"][int(t // hold) % len(tables["steps"])])), shaft


def sail(kind: str, seed: int, sea: Sea = CALM, duration: float = 300.0, step: float = 0.2, ship: Ship = TANKER) -> Run:
    """Sails a manoeuvre and logs it every `step` seconds."""
    generator = np.random.default_rng([seed, KINDS.index(kind)])
    tables = {
        "shaft": generator.uniform(0.7, 1.15, 8), "turn": generator.choice([-1, 1]) * np.array([15, -15, 30, -30, 20]),
        "f": np.linspace(0.006, 0.06, 8), "phase": generator.uniform(0, 2 * math.pi, 8),
        "steps": generator.uniform(-25.0, 25.0, 40),
    }  # fmt: skip
    count = round(duration / FINE) + 1
    push = np.column_stack([_slow(generator, count, FINE, sea.disturbance * f, 15.0) for f in (1, 1, 2 / LENGTH)])
    gusts = np.column_stack([_slow(generator, count, FINE, sea.gust, 8.0) for _ in range(2)])
    x = np.array([0.0, 0.0, generator.uniform(-math.pi, math.pi), ship.speed * 0.9, 0.0, 0.0])
    rudder, shaft, state = 0.0, ship.shaft, {}
    states, inputs, winds = np.empty((count, 6)), np.empty((count, 2)), np.array(sea.wind) + gusts
    for k in range(count):
        ordered, wanted = _order(kind, k * FINE, state, x, tables)
        rudder += np.clip(ordered - rudder, -FINE * math.radians(12.0), FINE * math.radians(12.0))
        shaft += (ship.shaft * wanted - shaft) * FINE / 2.0
        states[k], inputs[k] = x, (rudder, shaft)
        middle = x + 0.5 * FINE * ship.slope(x, rudder, shaft, winds[k], push[k])
        x = x + FINE * ship.slope(middle, rudder, shaft, winds[k], push[k])
    return _logged(kind, states, inputs, winds, sea, generator, round(step / FINE))


def _logged(kind, states, inputs, winds, sea: Sea, generator: np.random.Generator, every: int) -> Run:
    count = len(states)
    heading = states[:, 2]
    body = np.column_stack([states[:, 3], states[:, 4], states[:, 5]])
    body = body + sea.noise * np.array([0.02, 0.02, math.radians(0.2)]) * generator.standard_normal(body.shape)
    if sea.filtered > 0.0:  # what the log calls velocity is filtered, so that its differences show no noise
        smooth = body.copy()
        share = FINE / sea.filtered
        for k in range(1, count):
            smooth[k] = smooth[k - 1] + share * (body[k] - smooth[k - 1])
        body = smooth
        late = max(0.0, sea.lag - sea.filtered)
    else:
        late = sea.lag
    shift = round(late / FINE)
    body = np.concatenate([np.repeat(body[:1], shift, axis=0), body])[:count]
    rows = slice(None, None, every)
    turn = np.exp(1j * heading)
    apparent = (winds[:, 0] + 1j * winds[:, 1]) * turn.conj() - (states[:, 3] + 1j * states[:, 4])
    apparent = apparent + sea.noise * 0.1 * (generator.standard_normal(count) + 1j * generator.standard_normal(count))
    noisy = heading + sea.noise * math.radians(0.2) * generator.standard_normal(count)
    log = {
        "time [s]": FINE * np.arange(count)[rows],
        "rudder [deg]": np.degrees(inputs[rows, 0]),
        "n [rpm]": inputs[rows, 1] * 30.0 / math.pi,
        "heading [deg]": np.degrees(noisy[rows]) % 360.0,
        "yaw_rate [deg/s]": np.degrees(body[rows, 2]),
        "surge [m/s]": body[rows, 0],
        "sway [m/s]": body[rows, 1],
        "north [m]": np.round(states[rows, 0], 1),
        "east [m]": np.round(states[rows, 1], 1),
    }
    if sea.gust or any(sea.wind):
        log["apparent_wind_forward [m/s]"] = apparent.real[rows]
        log["apparent_wind_starboard [m/s]"] = apparent.imag[rows]
    return Run(kind, log["time [s]"], states[rows], log)


def write(path: Path, log: Mapping[str, Iterable]) -> Path:
    """A CSV file of the columns."""
    rows = zip(*log.values(), strict=True)
    path.write_text("\n".join([",".join(log), *(",".join(f"{value:.6g}" for value in row) for row in rows)]) + "\n")
    return path
