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
from auvsim.navigation.estimate import PLANAR_STATES
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


def estimate_errors(log: VehicleLog) -> EstimateErrors:
    """Estimates against the truth interpolated to their times; the velocities through the water."""
    estimate, truth = log["estimate"], log["truth"]
    time, covariance = estimate["time"], estimate["covariance"]
    through_water = truth["nu"][:, [0, 1, 5]]
    through_water[:, :2] -= to_body(truth["quaternion"], truth["current"])[:, :2]
    position = estimate["position"] - interpolate(time, truth["time"], truth["position"])
    heading = interpolate(time, truth["time"], np.unwrap(truth["attitude"][:, 2]))
    nees = np.full(len(time), math.nan)
    horizontal = covariance[:, :2, :2]
    finite = np.isfinite(position[:, :2].sum(axis=1) + horizontal.sum(axis=(1, 2)))
    regular = finite & (np.linalg.det(np.where(finite[:, None, None], horizontal, 0.0)) > 0.0)
    nees[regular] = normalised_square(position[regular, :2], horizontal[regular])
    return EstimateErrors(
        time=time,
        phase=phase_at(log, time),
        initialised=estimate["initialised"],
        position=position,
        heading=np.array([wrap(error) for error in (estimate["heading"] - heading).tolist()]),
        velocity=estimate["velocity"] - interpolate(time, truth["time"], through_water),
        current=estimate["current"] - interpolate(time, truth["time"], truth["current"][:, :2]),
        sigma=_sigma(log),
        nees=nees,
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
        nees = errors.nees[part & np.isfinite(errors.nees)]
        qualities[name] = EstimateQuality(
            samples=int(part.sum()),
            position_rms=_rms(errors.position[part, :2]),
            heading_rms_deg=_rms(np.degrees(errors.heading[part, None])),
            velocity_rms=_rms(errors.velocity[part, :2]),
            current_rms=_rms(errors.current[part]),
            nees_per_dof=float(nees.mean() / 2.0) if len(nees) else None,
            coverage_95=float((nees <= limit).mean()) if len(nees) else None,
        )
    return qualities


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
