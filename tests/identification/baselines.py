"""What anybody would do with a ship's log in thirty lines: least squares of differences, and SciPy's output error.

Only NumPy and SciPy, on the columns as they are logged; nothing of the package.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares
from tanker import Run

HORIZON, LEAD, EVERY = 60.0, 5.0, 10.0  # of a prediction, before the first, from one to the next [s]


def signals(run: Run) -> np.ndarray:
    """North, east, heading, u, v, r, rudder, shaft, wind forward and starboard (10, n), as logged [SI]."""
    log = run.log
    still = np.zeros(len(log["time [s]"]))
    return np.array(
        [
            log["north [m]"], log["east [m]"], np.unwrap(np.radians(log["heading [deg]"])), log["surge [m/s]"],
            log["sway [m/s]"], np.radians(log["yaw_rate [deg/s]"]), np.radians(log["rudder [deg]"]),
            log["n [rpm]"] * np.pi / 30.0, log.get("apparent_wind_forward [m/s]", still),
            log.get("apparent_wind_starboard [m/s]", still),
        ]
    )  # fmt: skip


def planar(u, v, r, d, n, a, b) -> tuple[list[np.ndarray], ...]:
    """Terms of surge, and of sway and yaw: rudder force by u^2, quadratic damping, lift."""
    surge = [np.ones_like(u), u * abs(u), n * abs(n), abs(n) * u, v * r, r**2, (u * d) ** 2]
    lateral = [u * v, u * r, v * abs(v), r * abs(r), u**2 * d]
    return surge, lateral, lateral


def abkowitz(u, v, r, d, n, a, b) -> tuple[list[np.ndarray], ...]:
    """These, with linear and mixed terms and the rudder in the propeller's stream."""
    surge, lateral, _ = planar(u, v, r, d, n, a, b)
    lateral = [*lateral, v, r, v * abs(r), abs(v) * r, n * abs(n) * d, n * u * d]
    return [*surge, u, v**2], lateral, lateral


def ordinary(runs: Sequence[Run], terms=planar) -> list[np.ndarray]:
    """Coefficients of each axis by ordinary least squares of differences of the logged velocities."""
    rows, changes = [], []
    for run in runs:
        s = signals(run)
        step = run.times[1] - run.times[0]
        middle = 0.5 * (s[3:6, 1:] + s[3:6, :-1])
        rows.append([np.array(axis) for axis in terms(*middle, *s[6:, :-1])])
        changes.append(np.diff(s[3:6], axis=1) / step)
    found = []
    for axis in range(3):
        A = np.concatenate([row[axis] for row in rows], axis=1).T
        y = np.concatenate([change[axis] for change in changes])
        size = np.linalg.norm(A, axis=0)
        found.append(np.linalg.lstsq(A / size, y, rcond=1e-10)[0] / size)
    return found


def predict(runs: Sequence[Run], coefficients: Sequence[np.ndarray], terms, every: float = EVERY):
    """States (time, 6, starts) from the logged state at each start, and what was logged there; truth at the end."""
    firsts, logged, truth = [], [], []
    for run in runs:
        s = signals(run)
        step = run.times[1] - run.times[0]
        width = round(HORIZON / step)
        for begin in range(round(LEAD / step), s.shape[1] - width, round(every / step)):
            logged.append(s[:, begin : begin + width + 1])
            firsts.append(s[:6, begin])
            truth.append((run.truth[begin, :2], run.truth[begin + width, :2], run.truth[begin : begin + width, 3:5]))
    data = np.stack(logged, axis=-1)  # (10, time, starts)
    x = np.array(firsts).T
    step = runs[0].times[1] - runs[0].times[0]
    states = [x]
    for k in range(data.shape[1] - 1):
        middle = x + 0.5 * step * _slope(x, data[6:, k], coefficients, terms)
        x = np.clip(x + step * _slope(middle, data[6:, k], coefficients, terms), -1e4, 1e4)
        states.append(x)
    return np.array(states), data, truth, step


def _slope(x, inputs, coefficients, terms):
    u, v, r = np.clip(x[3:], -5.0, 5.0)
    axes = terms(u, v, r, *inputs)
    l = [sum(c * t for c, t in zip(own, axis, strict=True)) for own, axis in zip(coefficients, axes, strict=True)]
    cosine, sine = np.cos(x[2]), np.sin(x[2])
    return np.array([cosine * u - sine * v, sine * u + cosine * v, r, *l])


def output_error(runs: Sequence[Run], terms=planar, evaluations: int = 15) -> list[np.ndarray]:
    """Coefficients by SciPy's least squares of free runs of 60 s against the log, from those of `ordinary`."""
    start = ordinary(runs, terms)
    sizes = np.cumsum([len(own) for own in start])[:-1]
    scale = np.concatenate([np.maximum(np.abs(own), 1e-6) for own in start])
    weights = 1.0 / np.array([1.0, 1.0, 0.05, 0.05, 0.05, 0.01])

    def residuals(z: np.ndarray) -> np.ndarray:
        states, data, _, _ = predict(runs, np.split(z * scale, sizes), terms, every=HORIZON)
        off = data[:6].swapaxes(0, 1) - states
        return (weights[:, None] * off)[::5].ravel()

    found = least_squares(residuals, np.concatenate(start) / scale, loss="soft_l1", max_nfev=evaluations)
    return np.split(found.x * scale, sizes)


def error(runs: Sequence[Run], coefficients: Sequence[np.ndarray], terms=planar) -> float:
    """Position error after the horizon by the distance run, rms."""
    states, _, truth, step = predict(runs, coefficients, terms)
    shares = []
    for k, (begin, end, speed) in enumerate(truth):
        moved = states[-1, :2, k] - states[0, :2, k]
        shares.append(np.hypot(*(end - begin - moved)) / (step * np.hypot(*speed.T).sum()))
    return float(np.sqrt(np.mean(np.minimum(shares, 10.0) ** 2)))
