"""Loads vehicles and structures as PyMJCF elements, with what the rest of the system needs to know of them."""

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from dm_control import mjcf

from auvsim.base.errors import InputError
from auvsim.base.frames import Array, flip
from auvsim.vehicles import fields, model_files
from auvsim.vehicles.actuation import FinsAndShaft, Thrusters


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """A vehicle's MJCF and what the rest of the system needs to know of it."""

    model: str  # name of the model; an instance in a scene has a name of its own
    root: Any  # PyMJCF RootElement, a fresh one each load
    source: str  # text of the MJCF file
    actuation: Any  # FinsAndShaft or Thrusters
    nose: float  # distance of the nose ahead of the body origin [m]
    length: float  # from the nose to the aftmost body, which is the propeller of a torpedo [m]


@dataclass(frozen=True, kw_only=True)
class Structure:
    """A funnel dock's MJCF and its dimensions."""

    model: str  # name of the model; an instance in a scene has a name of its own
    root: Any  # PyMJCF RootElement, a fresh one each load
    source: str  # text of the MJCF file
    mouth_radius: float  # [m]
    throat_radius: float  # [m]
    cone_length: float  # mouth to throat along the axis [m]
    throat_length: float  # end of the cone to the stop along the axis [m]
    latched: float  # where the latch holds the nose, along the axis from the mouth [m]
    aligned_within: float | None = None  # largest angle between vehicle and axis that counts as aligned [rad]
    panel_contact: tuple[float, float] | None = None  # stiffness [N/m] and damping [N s/m] of its panels

    @property
    def dimensions(self) -> dict[str, float]:
        """Its dimensions by name [m], and the angle within which it says that a vehicle is aligned [rad]."""
        names = ("mouth_radius", "throat_radius", "cone_length", "throat_length", "latched")
        found = {name: getattr(self, name) for name in names}
        return found | ({} if self.aligned_within is None else {"aligned_within": self.aligned_within})


ALIGNED = math.radians(5.0)  # of docks that do not say within which angle a vehicle is aligned [rad]


def _parse(path: Path, text: str) -> Any:
    try:
        root: Any = mjcf.from_xml_string(text, model_dir=str(path.parent))
    except Exception as error:  # PyMJCF raises whatever its parsers do
        raise InputError(f"model {path}: {' '.join(str(error).split())[:200]}") from None
    if root.compiler.angle != "radian":
        raise InputError(
            f'model {path}: give <compiler angle="radian"/> and every angle in radians; MuJoCo takes them for degrees '
            "without it"
        )
    return root


def _is_driven_by_thrusters(root: Any) -> bool:
    """Whether a vehicle has thrusters and no shaft."""
    return root.find("actuator", "shaft") is None and any(n.name.endswith("_thrust") for n in root.find_all("numeric"))


def _fins_and_shaft(root: Any, name: str) -> FinsAndShaft:
    if root.find("actuator", "shaft") is None:
        known = ", ".join(str(a.name) for a in root.find_all("actuator")) or "none"
        raise InputError(f"model {name} lacks the actuator 'shaft', that of its propeller; there are {known}")
    fins = tuple(a.name for a in root.find_all("actuator") if a.name != "shaft")
    matrix = fields.allocation(root, name, fins)
    limits = np.stack([fields.limits(root, name, channel) for channel in (*fins, "shaft")])
    lags = np.array([fields.lag(root, channel) for channel in (*fins, "shaft")])
    return FinsAndShaft(fins=fins, matrix=matrix, limits=limits, lags=lags)


def _thrusters(root: Any, name: str) -> Thrusters:
    """The thrusters of a vehicle, each a body of the hull; what each pushes is from its body's place and attitude."""
    channels = tuple(str(actuator.name) for actuator in root.find_all("actuator"))
    columns, thrust, dead, lags = [], [], [], []
    for channel in channels:
        body = root.find("body", channel)
        if body is None or body.parent.name != "hull" or body.joint:
            raise InputError(
                f"model {name}: thruster '{channel}' must be a body of the hull, of its actuator's name, fixed"
            )
        place = flip(np.zeros(3) if body.pos is None else np.array(body.pos, dtype=float))
        quaternion = np.array((1.0, 0.0, 0.0, 0.0) if body.quat is None else body.quat, dtype=float)
        if any(getattr(body, other) is not None for other in ("euler", "axisangle", "xyaxes", "zaxis")):
            raise InputError(f"model {name}: give the attitude of thruster '{channel}' as quat")
        direction = flip(_ahead(quaternion / np.linalg.norm(quaternion)))
        columns.append(np.concatenate([direction, np.cross(place, direction)]))
        common = root.find("numeric", f"{channel}_thrust") is None
        thrust.append(fields.numeric(root, name, "thruster_thrust" if common else f"{channel}_thrust"))
        band = root.find("numeric", f"{channel}_dead_band") or root.find("numeric", "thruster_dead_band")
        dead.append(0.0 if band is None else float(np.ravel(band.data)[0]))
        lag = fields.attribute(root.find("actuator", channel), "dynprm")
        lags.append(0.0 if lag is None else float(np.ravel(lag)[0]))
    return Thrusters(
        channels=channels,
        matrix=np.stack(columns, axis=-1),
        thrust=np.array(thrust),
        dead_band=np.array(dead),
        lags=np.array(lags),
    )


def _ahead(quaternion: Array) -> Array:
    """The x axis (3,) of a body with a quaternion (4,), in its parent's axes."""
    w, x, y, z = quaternion.tolist()
    return np.array((1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)), dtype=float)


def vehicle(name: str) -> Vehicle:
    """Loads a vehicle: `remus100`, or the path of an MJCF file that keeps the contract of models/README.md.

    Raises:
        InputError: there is no such model, or it breaks the contract; the text says where.
    """
    path, text = model_files.source("vehicle", name)
    root = _parse(path, text)
    hull = root.find("body", "hull")
    if hull is None:
        raise InputError(f"model {name} lacks the body 'hull'")
    nose = fields.site_x(root, name, "nose")
    aftmost = min((float(body.pos[0]) for body in hull.body if body.pos is not None), default=-nose)
    try:
        actuation = _thrusters(root, name) if _is_driven_by_thrusters(root) else _fins_and_shaft(root, name)
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith("model ") else f"model {name}: {text}") from None
    return Vehicle(model=root.model, root=root, source=text, actuation=actuation, nose=nose, length=nose - aftmost)


def actuation(name: str) -> FinsAndShaft | Thrusters:
    """What drives a vehicle, as `vehicle` reads it from its file; read once for each text of that.

    Raises:
        InputError: likewise.
    """
    return _actuation(name, *model_files.source("vehicle", name))


@lru_cache(maxsize=16)
def _actuation(name: str, path: Path, text: str) -> FinsAndShaft | Thrusters:
    return vehicle(name).actuation


def structure(name: str) -> Structure:
    """Loads a structure: `dock`, or the path of an MJCF file that keeps the contract of models/README.md.

    Raises:
        InputError: there is no such model, or it breaks the contract; the text says where.
    """
    path, text = model_files.source("structure", name)
    root = _parse(path, text)
    fields.site(root, name, "capture")
    if np.abs(fields.site(root, name, "mouth")).max() > 1e-6:
        raise InputError(f"model {name}: the site 'mouth' must be the origin, for a dock's place is that of its mouth")
    dimensions = ("mouth_radius", "throat_radius", "cone_length", "throat_length")
    lengths = {dimension: fields.length(root, name, dimension) for dimension in dimensions}
    latched, (mouth, throat, cone, rest) = fields.site_x(root, name, "latched"), lengths.values()
    if throat > mouth:
        raise InputError(f"model {name}: throat_radius {throat:g} m is more than mouth_radius {mouth:g} m")
    if not 0.0 < latched < cone + rest:
        raise InputError(
            f"model {name}: the site 'latched' is {latched:g} m behind the mouth; it must be between 0 and the stop at "
            f"{cone + rest:g} m"
        )
    aligned = root.find("numeric", "aligned_within")
    return Structure(
        model=root.model,
        root=root,
        source=text,
        latched=latched,
        aligned_within=None if aligned is None else fields.length(root, name, "aligned_within"),
        panel_contact=fields.panel_contact(root, name),
        **lengths,
    )
