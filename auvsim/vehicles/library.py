"""Finds models/ (in a checkout or in the installed package) and loads vehicles and structures as PyMJCF elements."""

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from dm_control import mjcf

import auvsim
from auvsim.base.errors import InputError, unknown_name
from auvsim.base.frames import Array, flip
from auvsim.base.settings import OTHERWISE
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
PACKAGE = Path(auvsim.__file__).parent
_MODEL = re.compile(r"<mujoco\b[^>]*?\bmodel\s*=\s*[\"']([^\"']+)")
INSTANCE = re.compile(r"[A-Za-z_][A-Za-z0-9_-]{0,63}")  # what a vehicle or structure may be called
_GIVEN: ContextVar[Mapping[tuple[str, str], str] | None] = ContextVar("given", default=None)  # see `given`
_MARKS = {"vehicle": '<body name="hull"', "structure": '<site name="capture"'}  # what every MJCF of a kind has


def models_folder() -> Path:
    """The folder of the models: inside the installed package, else beside it in a checkout."""
    for folder in (PACKAGE / "models", PACKAGE.parent / "models"):
        if folder.is_dir():
            return folder
    raise InputError(f"no models folder inside or beside {PACKAGE}; reinstall auvsim")


def _read(path: Path) -> str:
    """Text of a file, which is read again when it has changed."""
    try:
        state = path.stat()
        return _text(path, state.st_mtime_ns, state.st_size)
    except FileNotFoundError:
        raise InputError(f"model {path}: there is no such file; give a shipped model's name or an MJCF file") from None
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"model {path}: it cannot be read: {reason}") from None


@lru_cache(maxsize=64)
def _text(path: Path, modified: int, size: int) -> str:
    return path.read_text(encoding="utf-8")


def find(kind: str, name: str) -> Path:
    """The MJCF file of a shipped model by name, or the user's own by the path of its `.xml`.

    Args:
        kind: `vehicle` or `structure`.
        name: of the model, or a path.

    Raises:
        InputError: no model has that name; the text lists those there are.
    """
    if name.endswith(".xml"):
        return Path(name).expanduser()
    folder = models_folder()
    path = folder / name / f"{name}.xml"
    if not INSTANCE.fullmatch(name) or not path.is_file():
        raise unknown_name(kind, name, shipped(kind))
    return path


def shipped(kind: str) -> list[str]:
    """Names of the models that auvsim ships; `kind` as of `find`."""
    found = models_folder().glob("*/*.xml")
    return [path.stem for path in found if path.stem == path.parent.name and _MARKS[kind] in _read(path)]


@contextmanager
def given(texts: Mapping[tuple[str, str], str]) -> Iterator[None]:
    """Takes models from texts, such as a log holds, and not from their files.

    Args:
        texts: MJCF by kind (`vehicle` or `structure`) and name; other models are read from their files.
    """
    before = _GIVEN.set({**(_GIVEN.get() or {}), **texts})
    try:
        yield
    finally:
        _GIVEN.reset(before)


def source(kind: str, name: str) -> tuple[Path, str]:
    """The MJCF file of a model and its text now, or the text that is `given`; arguments and errors as of `find`."""
    held = _GIVEN.get() or {}
    if (kind, name) in held:
        return Path(name), held[kind, name]
    path = find(kind, name)
    return path, _read(path)


def model_name(kind: str, name: str) -> str:
    """Name of a model as its MJCF says it, without loading it; arguments and errors as of `find`.

    Raises:
        InputError: it cannot name a vehicle or structure, too.
    """
    path, text = source(kind, name)
    match = _MODEL.search(text)
    found = match.group(1) if match else "unnamed"
    if not INSTANCE.fullmatch(found):
        shown = found if len(found) <= 40 else f"{found[:37]}..."
        raise InputError(f"model {path}: model=\"{shown}\": give a name of 1 to 64 letters, digits, '_' and '-'")
    return found


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


def _numeric(root: Any, where: str, name: str) -> Any:
    element = root.find("numeric", name)
    if element is None:
        raise InputError(f"model {where} lacks the numeric '{name}'")
    data = np.atleast_1d(np.array([] if element.data is None else element.data, dtype=float))
    if not data.size or not np.isfinite(data).all():
        raise InputError(f"model {where}: the numeric '{name}' is {data.tolist()}; its data must be finite numbers")
    if np.abs(data).max() > OTHERWISE:
        raise InputError(f"model {where}: the numeric '{name}' has {np.abs(data).max():g}, more than {OTHERWISE:g}")
    return data


def _allocation(root: Any, where: str, fins: tuple[str, ...]) -> Array:
    """Fin angle per unit of rudder and of elevator (m, 2)."""
    columns = []
    for name in ("allocation_rudder", "allocation_elevator"):
        column = _numeric(root, where, name)
        if column.size != len(fins):
            known = ", ".join(fins) or "none"
            raise InputError(
                f"model {where}: '{name}' has {column.size} numbers; it wants {len(fins)}, one for each fin ({known})"
            )
        columns.append(column)
    return np.stack(columns, axis=-1)


def _length(root: Any, where: str, name: str) -> float:
    """A numeric that is a length [m]."""
    data = _numeric(root, where, name)
    if data.size != 1 or data[0] <= 0.0:
        raise InputError(f"model {where}: '{name}' is {data.tolist()}; it must be one number above 0 [m]")
    return float(data[0])


def _panel_contact(root: Any, where: str) -> tuple[float, float] | None:
    """Stiffness [N/m] and damping [N s/m] of a dock's panels, if it says so."""
    if root.find("numeric", "panel_contact") is None:
        return None
    data = _numeric(root, where, "panel_contact")
    if data.size != 2 or data[0] <= 0.0 or data[1] < 0.0:
        raise InputError(
            f"model {where}: 'panel_contact' is {data.tolist()}; it must be a stiffness above 0 [N/m] and a damping of "
            "0 or more [N s/m]"
        )
    return float(data[0]), float(data[1])


def _site(root: Any, where: str, name: str) -> Array:
    """Place (3,) of a site in its body [m]."""
    site = root.find("site", name)
    if site is None:
        raise InputError(f"model {where} lacks the site '{name}'")
    place = np.zeros(3) if site.pos is None else np.array(site.pos, dtype=float)
    if not np.isfinite(place).all():
        raise InputError(f"model {where}: the site '{name}' is at {place.tolist()}; give finite numbers")
    return place


def _site_x(root: Any, where: str, name: str) -> float:
    return float(_site(root, where, name)[0])


def _attribute(element: Any, name: str) -> Any:
    """An attribute of an MJCF element: its own, else that of its default classes from the inside out, else None."""
    value, group = getattr(element, name), element.dclass or element.root.default
    while value is None and group is not None and group.tag == "default":
        value, group = getattr(getattr(group, element.tag), name, None), group.parent
    return value


def _limits(root: Any, where: str, name: str) -> Array:
    """Smallest and largest command (2,) of an actuator."""
    actuator = root.find("actuator", name)
    if actuator is None:
        raise InputError(f"model {where} lacks the actuator '{name}'")
    limits = _attribute(actuator, "ctrlrange")
    if limits is None:
        raise InputError(f"model {where}: actuator '{name}' needs a ctrlrange")
    return np.array(limits, dtype=float)


def _lag(root: Any, name: str) -> float:
    """Time constant [s] of a servo: damping / kp of a position servo, armature / kv of a velocity servo."""
    actuator = root.find("actuator", name)
    terms = {"position": ("damping", "kp"), "velocity": ("armature", "kv")}.get(actuator.tag)
    if terms is None:
        return 0.0
    inertia, gain = _attribute(actuator.joint, terms[0]), _attribute(actuator, terms[1])
    return float(np.atleast_1d(inertia)[0] / gain) if inertia is not None and gain else 0.0


def _is_driven_by_thrusters(root: Any) -> bool:
    """Whether a vehicle has thrusters and no shaft."""
    return root.find("actuator", "shaft") is None and any(n.name.endswith("_thrust") for n in root.find_all("numeric"))


def _fins_and_shaft(root: Any, name: str) -> FinsAndShaft:
    if root.find("actuator", "shaft") is None:
        known = ", ".join(str(a.name) for a in root.find_all("actuator")) or "none"
        raise InputError(f"model {name} lacks the actuator 'shaft', that of its propeller; there are {known}")
    fins = tuple(a.name for a in root.find_all("actuator") if a.name != "shaft")
    matrix = _allocation(root, name, fins)
    limits = np.stack([_limits(root, name, channel) for channel in (*fins, "shaft")])
    lags = np.array([_lag(root, channel) for channel in (*fins, "shaft")])
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
        thrust.append(_numeric(root, name, "thruster_thrust" if common else f"{channel}_thrust"))
        band = root.find("numeric", f"{channel}_dead_band") or root.find("numeric", "thruster_dead_band")
        dead.append(0.0 if band is None else float(np.ravel(band.data)[0]))
        lag = _attribute(root.find("actuator", channel), "dynprm")
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
    path, text = source("vehicle", name)
    root = _parse(path, text)
    hull = root.find("body", "hull")
    if hull is None:
        raise InputError(f"model {name} lacks the body 'hull'")
    nose = _site_x(root, name, "nose")
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
    return _actuation(name, *source("vehicle", name))


@lru_cache(maxsize=16)
def _actuation(name: str, path: Path, text: str) -> FinsAndShaft | Thrusters:
    return vehicle(name).actuation


def structure(name: str) -> Structure:
    """Loads a structure: `dock`, or the path of an MJCF file that keeps the contract of models/README.md.

    Raises:
        InputError: there is no such model, or it breaks the contract; the text says where.
    """
    path, text = source("structure", name)
    root = _parse(path, text)
    _site(root, name, "capture")
    if np.abs(_site(root, name, "mouth")).max() > 1e-6:
        raise InputError(f"model {name}: the site 'mouth' must be the origin, for a dock's place is that of its mouth")
    dimensions = ("mouth_radius", "throat_radius", "cone_length", "throat_length")
    lengths = {dimension: _length(root, name, dimension) for dimension in dimensions}
    latched, (mouth, throat, cone, rest) = _site_x(root, name, "latched"), lengths.values()
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
        aligned_within=None if aligned is None else _length(root, name, "aligned_within"),
        panel_contact=_panel_contact(root, name),
        **lengths,
    )
