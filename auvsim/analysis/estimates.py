"""Errors of estimates against the truth, and whether the filter's own covariance explains them."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvsim.base.frames import Array, wrap
from auvsim.data.log import StructureLog, VehicleLog
from auvsim.data.phases import interpolate, phase_at
from auvsim.missions.docking.dock_frame import to_body
from auvsim.navigation.estimate import DOCK_HEADING_BIAS, PLANAR_STATES
from estimators.core.consistency import chi_square, interval, normalised_square
from estimators.docking.usbl import UsblFix, UsblModel

NEES_INTERVAL = interval(2)  # 95 % of the NEES of a horizontal position
NOT_STARTED, DUPLICATE = "not_started", "duplicate"  # reasons for which readings are refused, see `core.history`
AT_REST = "docked"  # phase in which the vehicle no longer moves as any model of free motion says


@dataclass(frozen=True, kw_only=True, slots=True)
class EstimateErrors:
    """Estimate minus truth at each estimate, and what the filter claims."""

    time: Array  # (n,) [s]
    phase: NDArray[np.int64]  # (n,) index into the mission's phases, -1 before the first
    initialised: NDArray[np.bool_]  # (n,)
    position: Array  # (n, 3) north, east, down [m]
    heading: Array  # (n,) wrapped [rad]
    velocity: Array  # (n, 3) u, v through the water [m/s], r [rad/s]
    current: Array  # (n, 2) north, east [m/s]
    sigma: Array  # (n, 8) claimed standard deviations of PLANAR_STATES; 0 where not estimated
    nees: Array  # (n,) of the horizontal position, 2 degrees of freedom; NaN where the covariance is singular
    relative: Array  # (n, 2) error of the horizontal position as the dock sees it [m]; NaN where no dock does
    nees_relative: Array  # (n,) of that


@dataclass(frozen=True, kw_only=True, slots=True)
class EstimateQuality:
    """Estimate errors over some part of a trial; None where there is nothing to average."""

    samples: int
    position_rms: float | None  # horizontal [m]
    heading_rms_deg: float | None  # [deg]
    velocity_rms: float | None  # of u and v together [m/s]
    current_rms: float | None  # horizontal [m/s]
    nees_per_dof: float | None  # of the horizontal position; 1 is expected
    coverage_95: float | None  # share of truths inside the 95 % ellipse of the horizontal position
    # As the dock sees it: by its own axis, so that the error of its compass, which turns both, does not count.
    relative_rms: float | None = None  # [m]
    nees_relative: float | None = None  # a degree of freedom


def estimate_errors(log: VehicleLog) -> EstimateErrors:
    """Estimates against the truth interpolated to their times; the velocities through the water."""
    estimate, truth = log["estimate"], log["truth"]
    time, covariance = estimate["time"], estimate["covariance"]
    through_water = truth["nu"][:, [0, 1, 5]]
    through_water[:, :2] -= to_body(truth["quaternion"], truth["current"])[:, :2]
    true_position = interpolate(time, truth["time"], truth["position"])
    position = estimate["position"] - true_position
    heading = interpolate(time, truth["time"], np.unwrap(truth["attitude"][:, 2]))
    relative, relative_covariance = _seen_by_dock(log, true_position[:, :2])
    return EstimateErrors(
        time=time,
        phase=phase_at(log, time),
        initialised=estimate["initialised"],
        position=position,
        heading=np.array([wrap(error) for error in (estimate["heading"] - heading).tolist()]),
        velocity=estimate["velocity"] - interpolate(time, truth["time"], through_water),
        current=estimate["current"] - interpolate(time, truth["time"], truth["current"][:, :2]),
        sigma=_sigma(log),
        nees=_nees(position[:, :2], covariance[:, :2, :2]),
        relative=relative,
        nees_relative=_nees(relative, relative_covariance),
    )


def estimate_quality(errors: EstimateErrors, phases: tuple[str, ...]) -> dict[str, EstimateQuality]:
    """Root-mean-square errors and consistency, phase by phase and over all initialised estimates before docking.

    Once the latch holds it, the vehicle no longer moves as any model of free motion says; "all" leaves that out.

    Args:
        errors: of one vehicle.
        phases: of its mission, in the order of their values.
    """
    at_rest = phases.index(AT_REST) if AT_REST in phases else -2
    parts = {"all": errors.initialised & (errors.phase != at_rest)}
    parts |= {name: errors.initialised & (errors.phase == index) for index, name in enumerate(phases)}
    limit = chi_square(0.95, 2)
    qualities = {}
    for name, part in parts.items():
        if name != "all" and not part.any():
            continue
        nees, relative = (values[part & np.isfinite(values)] for values in (errors.nees, errors.nees_relative))
        qualities[name] = EstimateQuality(
            samples=int(part.sum()),
            position_rms=_rms(errors.position[part, :2]),
            heading_rms_deg=_rms(np.degrees(errors.heading[part, None])),
            velocity_rms=_rms(errors.velocity[part, :2]),
            current_rms=_rms(errors.current[part]),
            nees_per_dof=float(nees.mean() / 2.0) if len(nees) else None,
            coverage_95=float((nees <= limit).mean()) if len(nees) else None,
            relative_rms=_rms(errors.relative[part]),
            nees_relative=float(relative.mean() / 2.0) if len(relative) else None,
        )
    return qualities


def _nees(error: Array, covariance: Array) -> Array:
    """NEES (n,) of errors (n, 2) with their covariances (n, 2, 2); NaN where one is singular or not finite."""
    nees = np.full(len(error), math.nan)
    finite = np.isfinite(error.sum(axis=1) + covariance.sum(axis=(1, 2)))
    regular = finite & (np.linalg.det(np.where(finite[:, None, None], covariance, 0.0)) > 0.0)
    nees[regular] = normalised_square(error[regular], covariance[regular])
    return nees


def _seen_by_dock(log: VehicleLog, position: Array) -> tuple[Array, Array]:
    """Errors (n, 2) [m] of the horizontal position and covariances (n, 2, 2), in axes that the dock's compass turns.

    A dock that takes its heading for too large by b turns all that it measures about its mouth by b, and its own axis
    with it. So a vehicle that believes it is off by c sees itself at R(c - b) (p - mouth).

    Args:
        log: of the vehicle.
        position: (n, 2) the true one [m].
    """
    covariance = log["estimate"]["covariance"]
    if "usbl" not in log or not len(log["usbl"]["time"]):
        return np.full_like(position, math.nan), np.full((len(position), 2, 2), math.nan)
    dock, names = usbl_dock(log), log.table("estimate")["mean"].labels
    off = np.angle(np.exp(1j * (log["usbl"]["value"][:, 3] - dock.heading)).mean())
    from_mouth = log["estimate"]["position"][:, :2] - dock.position[:2]
    state = names.index(DOCK_HEADING_BIAS) if DOCK_HEADING_BIAS in names else None
    believed = np.zeros(len(position)) if state is None else log["estimate"]["mean"][:, state]
    cos, sin = np.cos(believed - off), np.sin(believed - off)
    turn = np.moveaxis(np.array([[cos, -sin], [sin, cos]]), -1, 0)  # (n, 2, 2)
    slope = np.zeros((len(position), 2, covariance.shape[1]))
    slope[:, :, :2] = turn
    seen = (turn @ from_mouth[:, :, None])[:, :, 0]
    if state is not None:
        slope[:, :, state] = np.stack([-seen[:, 1], seen[:, 0]], axis=-1)
    return seen - (position - dock.position[:2]), slope @ covariance @ slope.swapaxes(-1, -2)


def _sigma(log: VehicleLog) -> Array:
    """Claimed standard deviations (n, 8) of the planar states, by their names among those of the estimate."""
    variances = np.diagonal(log["estimate"]["covariance"], axis1=1, axis2=2)
    names = log.table("estimate")["mean"].labels
    sigma = np.zeros((len(variances), len(PLANAR_STATES)))
    for column, name in enumerate(PLANAR_STATES):
        if name in names:
            sigma[:, column] = np.sqrt(np.maximum(variances[:, names.index(name)], 0.0))
    return sigma


def refusals(log: VehicleLog) -> tuple[Array, tuple[str, ...]]:
    """When the estimator refused readings (k,) [s], and the reasons that occur; none where the log does not say.

    What came before it had started is not counted.
    """
    decided = log["measurements"]
    refused = ~decided["accepted"] & (decided["reason"] != NOT_STARTED)
    return decided["time"][refused], tuple(sorted({*decided["reason"][refused].tolist()}))


def fix_fates(log: VehicleLog) -> NDArray[Any]:
    """Why the estimator refused each USBL packet, as text (n,); empty where it did not, or the log does not say.

    The last decision counts: a late packet may undo an earlier one. A second copy is not the packet that it repeats.
    """
    if "usbl" not in log:
        return np.empty(0, dtype=object)
    decided = log["measurements"]
    of_fixes = (decided["sensor"] == "usbl") & (decided["reason"] != DUPLICATE)
    last = dict(zip(decided["sequence"][of_fixes].tolist(), decided["reason"][of_fixes].tolist(), strict=True))
    return np.array([last.get(number, "") for number in log["usbl"]["sequence"].tolist()], dtype=object)


def fixes(log: VehicleLog) -> Array:
    """Horizontal NED positions (n, 2) [m] of the transponder that the USBL packets say, lost ones included."""
    if "usbl" not in log or not len(log["usbl"]["time"]):
        return np.empty((0, 2))
    dock = usbl_dock(log)
    forward, starboard, down = (dock.number(f"transceiver_{a}", 0.0) for a in ("forward", "starboard", "down"))
    model, packets = UsblModel(transceiver=(forward, starboard, down)), log["usbl"]["value"]
    found = [UsblFix(stamp=0.0, received=0.0, position=p[:3], heading=p[3], pitch=p[4], roll=p[5]) for p in packets]
    places = np.array([model.world_fix(fix).value for fix in found], dtype=float).reshape(len(packets), 2)
    return places + dock.position[:2]


def usbl_dock(log: VehicleLog) -> StructureLog:
    """The structure whose USBL serves a vehicle.

    Raises:
        InputError: the log names none.
    """
    return log.log.structure(str(log.attributes.get("usbl_structure") or log.attributes.get("dock", "")))


def _rms(errors: Array) -> float | None:
    """Root of the mean squared length of error vectors (n, k); those that are not finite do not count."""
    squares = np.square(errors[np.isfinite(errors).all(axis=1)]).sum(axis=1)
    return float(np.sqrt(squares.mean())) if len(squares) else None
